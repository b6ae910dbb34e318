"""Curves and branches of any kind of solution."""
