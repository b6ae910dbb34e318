"""Levels."""

TINIEST = 1e-300
