"""From a system with numbers to its motion, and what is asked of it."""
