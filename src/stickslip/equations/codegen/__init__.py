"""The statements of the functions of a system, as data."""
