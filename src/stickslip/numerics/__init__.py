"""Numbers that computations share: levels with names and reasons, and ratios of what may vanish."""
