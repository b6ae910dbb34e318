"""What single entries of a declaration hold, whatever the system is: units, samples, and what is
asked of formulas."""
