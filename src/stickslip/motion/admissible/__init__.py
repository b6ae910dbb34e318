"""Admissible forces and impulses: their existence and computation."""
