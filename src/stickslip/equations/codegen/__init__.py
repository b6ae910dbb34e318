"""Equations of one mode as source text, written out and compiled."""
