"""What the functions of a system compute, as data."""
