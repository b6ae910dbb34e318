"""Which mode a motion takes, compiled: guards, the Taylor series of a mode, and pivoting."""
