"""When a motion has settled, on what, and what a period of that amounts to."""
