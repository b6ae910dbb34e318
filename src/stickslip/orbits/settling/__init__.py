"""Convergence of motions to attractors, and measures of these."""
