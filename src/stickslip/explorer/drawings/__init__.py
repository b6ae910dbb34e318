"""Animations of systems, as data: parts, and their positions at the times of a motion."""
