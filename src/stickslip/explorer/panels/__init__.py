"""The empty figures of each panel, which the page fills with data."""
