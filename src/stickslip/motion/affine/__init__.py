"""Modes that are affine in the state, compiled: closed forms in place of steps."""
