"""Motions of a system with given parameters: computation, results, and certificates."""
