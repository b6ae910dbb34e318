"""From measured data to a law: fits, profiles, comparisons, and what their uncertainty does."""
