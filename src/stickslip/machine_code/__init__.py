"""Compiled functions: what Python calls is machine code that was made before; numba makes it where
it was not."""
