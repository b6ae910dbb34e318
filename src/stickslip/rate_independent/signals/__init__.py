"""Signals: what a user gives as a function of time or phase, read once, asked in one way."""
