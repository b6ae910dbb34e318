"""What the page shows: the figures of each panel, empty; the page fills them with what it is told."""
