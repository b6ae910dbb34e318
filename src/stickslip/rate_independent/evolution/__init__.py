"""Evolutions in Rⁿ: declaration, time stepping, results."""
