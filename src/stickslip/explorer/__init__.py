"""The explorer: an interactive page in the browser for a system."""
