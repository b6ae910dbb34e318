"""Compiled code: marks and returns of motions, extrapolation to cycles, and measures of one
period."""
