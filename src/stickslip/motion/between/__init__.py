"""The motion between its knots, compiled: values and pictures."""
