"""Compiled settling and measuring."""
