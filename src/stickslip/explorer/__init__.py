"""The explorer: a page in the browser for looking at a system and playing with it."""
