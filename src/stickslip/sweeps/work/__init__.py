"""The execution of a map, chunk by chunk."""
