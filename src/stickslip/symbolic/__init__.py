"""Formulas as trees: parsed, differentiated, bounded, lowered to tapes and to NumPy."""
