"""Formulas as trees: read from text, differentiated, enclosed, lowered to tapes and to NumPy."""
