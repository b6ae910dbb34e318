"""The record of a motion: its knots, and what follows from them."""
