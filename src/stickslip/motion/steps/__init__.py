"""One step of a motion, compiled: the data of functions, the step size, series, roots."""
