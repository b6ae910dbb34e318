"""Cycles: found, measured, certified."""
