"""Long flights in closed form, audited as a whole."""
