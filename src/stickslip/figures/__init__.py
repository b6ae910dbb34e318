"""Pictures of results. Every function returns a matplotlib Figure; no window is ever opened."""
