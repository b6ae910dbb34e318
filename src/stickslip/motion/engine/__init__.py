"""The event loop, compiled: modes, guards and their roots, steps and flights."""
