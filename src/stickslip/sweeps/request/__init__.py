"""Requests of maps: axes, records, measures, carried states."""
