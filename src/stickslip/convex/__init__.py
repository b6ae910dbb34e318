"""Formulas that are convex and homogeneous of degree 1: support functions of convex sets, with
proofs of these properties."""
