"""The systems and motions that pages look at, and how finely."""
