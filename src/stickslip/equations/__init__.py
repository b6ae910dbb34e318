"""From a declaration to the equations of motion, and from these to machine code."""
