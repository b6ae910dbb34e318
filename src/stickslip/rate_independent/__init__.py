"""Rate-independent evolution in Rⁿ: dissipation, steps, averaging."""
