"""The audit of a motion, compiled: whether it obeys its law at its knots and between them."""
