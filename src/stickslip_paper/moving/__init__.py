"""Animations, and the drawings with moving parts they are made of."""
