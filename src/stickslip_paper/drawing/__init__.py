"""Common parts of the figures of [M]."""
