"""Evolutions in Rⁿ: what they are, how they step, what comes of them."""
