"""Rapidly oscillating friction: the play operator of [M] section 2.2, with figure 2.1.

The load is ℓ(t) = 5t − t², the threshold ρ(t/ε) = 1 + cos(2πt/ε)/2. The motion z_ε consists of
short bursts around the phases where ρ is smallest, and follows the play with the constant threshold
min ρ = 1/2 at a distance of the order ε.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017).
"""

from pathlib import Path

import numpy as np

import stickslip as ss

LOAD = "5*t - t**2"
THRESHOLD = "1 + cos(2*pi*s)/2"
SMALLEST = 0.5

resolved = ss.play(LOAD, THRESHOLD, (0, 5), initial=0.0, epsilon=0.1)
averaged = ss.play(LOAD, SMALLEST, (0, 5), initial=0.0)

times = np.linspace(0, 5, 10_001)
distance = float(np.max(np.abs(resolved.position(times) - averaged.position(times))))

if __name__ == "__main__":
    path = Path("out/play-moving-threshold/figure-2-1.png")
    path.parent.mkdir(parents=True, exist_ok=True)
    ss.figures.plot_limit(resolved, averaged).savefig(path)
    print(f"largest distance of z_ε from z_0: {distance:.4f} = {distance / 0.1:.2f} ε")
    print(f"dissipated: {resolved.dissipated:.6f}, in the limit {averaged.dissipated:.6f}")
    print(path)
