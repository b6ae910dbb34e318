"""Compiled functions for one step of a motion: their arrays, the step size, series, roots."""
