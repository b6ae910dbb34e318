"""The equations of a system in mathematical notation."""
