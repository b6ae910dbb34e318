"""Convex sets that depend on a phase: their interface at one phase, at many, and between."""
