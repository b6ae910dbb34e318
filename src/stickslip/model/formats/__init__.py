"""Formats of text files (TOML with the keys of classes, and columns of numbers), and what may be
written: types of values, and names of measures."""
