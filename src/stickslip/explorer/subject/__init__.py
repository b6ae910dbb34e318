"""The systems, motions and other results shown by pages, and their resolution."""
