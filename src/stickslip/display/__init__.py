"""A system's equations as a person would write them."""
