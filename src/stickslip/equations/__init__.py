"""The derivation of the equations of motion from a declaration, and their machine code."""
