"""Parameter maps: many motions, what each settles on, stored."""
