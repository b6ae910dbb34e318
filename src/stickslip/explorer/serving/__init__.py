"""The server of the explorer: its doors, its workers, and what it does for each page."""
