"""Identification from measured data: fits, profiles, comparisons, and the effect of their
uncertainty."""
