"""First variations of motions, and values of expressions in numbers, in compiled loops."""
