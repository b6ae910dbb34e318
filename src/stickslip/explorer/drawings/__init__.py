"""Moving pictures of systems, as data: parts, and where they are at the times of a motion."""
