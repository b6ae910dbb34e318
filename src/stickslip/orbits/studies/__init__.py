"""Studies: gaits, hysteresis operators."""
