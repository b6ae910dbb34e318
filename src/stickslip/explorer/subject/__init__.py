"""The systems, motions and other results that pages look at, and how finely."""
