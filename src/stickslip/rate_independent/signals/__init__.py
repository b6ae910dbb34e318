"""Signals: functions of time or phase from the user, with a common interface."""
