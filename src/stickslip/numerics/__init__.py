"""Common numbers of computations: named levels with their reasons, and ratios with vanishing
denominators."""
