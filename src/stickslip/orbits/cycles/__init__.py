"""Cycles: search, measures, certificates."""
