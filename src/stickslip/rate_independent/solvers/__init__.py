"""Solvers of one minimising-movement step."""
