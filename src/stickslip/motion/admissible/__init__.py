"""Forces and impulses that a law allows: whether there are any, and which."""
