"""Convex sets that depend on a phase: what can be asked of them, at one phase, at many, and
between."""
