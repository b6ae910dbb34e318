"""The statements of [M], section by section, with their checks."""
