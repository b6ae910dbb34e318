"""Formulas that are convex and homogeneous of degree 1: support functions of convex sets, and what
is proved of them."""
