"""How far the rows of a tape stray while the state follows a polynomial, compiled: what a step can
hide."""
