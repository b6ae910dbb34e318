"""Who does the work of a map, chunk by chunk."""
