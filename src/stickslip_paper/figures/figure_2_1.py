"""Figure 2.1 of [M]: friction that oscillates fast, and its limit."""

from matplotlib.figure import Figure

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry


def draw() -> Figure:
    """z_ε for ε = 0.1 inside its stable region, and the limit z_0 inside the region that is stable
    at every phase."""
    load, threshold = "5*t - t**2", "1 + cos(2*pi*s)/2"
    smallest = ss.WeightedL1([threshold]).average().support([1.0])  # in (2.3): Ψ_av(V) = min ρ |V|
    resolved = ss.play(load, threshold, (0, 5), initial=0.0, epsilon=0.1)
    averaged = ss.play(load, smallest, (0, 5), initial=0.0)
    return ss.figures.plot_limit(resolved, averaged)


ENTRY = FigureEntry(
    "2.1",
    "Oscillating friction and its limit",
    "The energetic solution of (2.1) for the energy z²/2 − ℓ(t)z with ℓ(t) = 5t − t² and "
    "Ψ(s, ż) = ρ(s)|ż|, z(0) = 0. Left: z_ε for ε = 0.1 in the stable region "
    "[ℓ − ρ(t/ε), ℓ + ρ(t/ε)]; it rests most of the time and moves in short bursts while ρ is near "
    "its minimum. Right: the limit z_0 for ε → 0; the region, ℓ ± ρ_min, is the intersection of "
    "all stable regions. [M] leaves ρ open; here ρ(s) = 1 + cos(2πs)/2, so ρ_min = 1/2.",
    draw,
)
