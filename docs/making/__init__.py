"""Pages that are read off the library: each module here makes some, as texts by their places."""
