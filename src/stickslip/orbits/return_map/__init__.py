"""The return map: where a motion comes back to, how it closes, its multipliers."""
