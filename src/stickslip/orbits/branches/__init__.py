"""Branches of equilibria and cycles over parameters, with their special points."""
