"""The choice of the mode, compiled: guards, the Taylor series of a mode, and pivoting."""
