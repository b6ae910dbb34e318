"""Colours that colour-blind readers can distinguish, for plots and for the page."""

# Okabe & Ito's palette: distinct under all common forms of colour blindness, and in print.
BLUE = "#0072B2"
VERMILION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
SKY = "#56B4E9"
ORANGE = "#E69F00"
LINES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
STICK_SHADE = "#E4E4E4"
STICK_LINE = "#222222"
THRESHOLD = "#B8860B"
BAND = "#F3DFA8"
UNSTABLE = (0, (4, 2))
EQUILIBRIUM = "#6E6E6E"
SLIP = {-1: ORANGE, 1: BLUE}
