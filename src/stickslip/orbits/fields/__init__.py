"""The smooth fields of a system, mode by mode: their Jacobians, symmetries, first variations."""
