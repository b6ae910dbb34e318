"""The return map: returns of a motion, closing conditions, multipliers."""
