"""Single entries of a declaration, independent of the system: units, samples, and conditions on
formulas."""
