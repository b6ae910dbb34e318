"""Compiled: marks and returns, polishing, and one period measured."""
