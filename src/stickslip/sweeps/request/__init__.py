"""What a map is asked for: axes and measures."""
