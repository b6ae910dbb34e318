"""The server of the explorer: access control, workers, and sessions of pages."""
