"""Formats of text files: TOML with the keys of classes, and columns of numbers."""
