"""Hysteresis loops of a Prandtl–Ishlinskii operator: a weighted sum of plays with different
thresholds under one load.

40 plays with thresholds r between 0 and 2 share one load ℓ(t), and the output is the mean of their
positions, as in Iwan's model of a joint that slips gradually. Inner loops close and lie inside the
outer one (return-point memory), a turning point is erased when the load passes it, and only the
sequence of turning points matters, not the speed.

P. Krejčí, *Hysteresis, Convexity and Dissipation in Hyperbolic Equations*, Gakkōtosho (1996).
"""

from pathlib import Path

import numpy as np

import stickslip as ss

RADII = np.linspace(0.05, 2.0, 40)
WEIGHTS = np.full(40, 1 / 40)

# One large swing, and while the load increases again two small ones, each of which closes a loop
# and has no further effect.
TURNS = np.array([0.0, 3.0, -3.0, 1.0, -1.5, 2.0, 0.5, 3.0])
load = np.interp(np.linspace(0, 7, 2801), np.arange(8), TURNS)

output = ss.prandtl_ishlinskii(load, RADII, WEIGHTS)
# A single play is the sum of one.
positions = {
    f"$r = {r:g}$": ss.prandtl_ishlinskii(load, [r], [1.0]) for r in RADII[[9, 19, 39]].tolist()
}

# The first increase in closed form: Σ w_i max(ℓ − r_i, 0).
first_way = np.maximum(load[:400, None] - RADII, 0.0) @ WEIGHTS
error = float(np.max(np.abs(output[:400] - first_way)))

if __name__ == "__main__":
    path = Path("out/prandtl-ishlinskii/loops.png")
    path.parent.mkdir(parents=True, exist_ok=True)
    ss.figures.plot_loops(load, positions, output).savefig(path)
    print(f"largest difference from the first way up in closed form: {error:.1e}")
    print(path)
