"""Parameter maps: measures of the attractors of many motions."""
