"""Derivatives of motions and cycles with respect to parameters and initial values."""
