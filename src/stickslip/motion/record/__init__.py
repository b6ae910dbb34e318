"""The record of a motion: its knots, and quantities derived from them."""
