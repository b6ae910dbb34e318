"""Reference computations, which share no code with the library."""
