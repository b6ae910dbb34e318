"""One step of a motion, compiled: what functions hand each other, what a step can hide, how long it
may be."""
