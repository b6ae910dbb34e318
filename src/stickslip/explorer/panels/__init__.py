"""The figures of each panel, empty; the page fills them with what it is told."""
