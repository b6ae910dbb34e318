"""Formats of text files (TOML with the keys of classes, and columns of numbers), and their
admissible contents: types of values, and names of measures."""
