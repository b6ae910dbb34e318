"""States of rest and of steady sliding."""
