"""Bounds, on complex discs, of the rows of a tape along a polynomial of the state, compiled:
features that a step may miss."""
