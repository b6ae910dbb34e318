"""The play operator with moving thresholds."""
