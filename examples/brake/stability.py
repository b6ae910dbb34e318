"""A brake with a measured friction coefficient: its stability and its limit cycles.

Steady sliding is stable if μ(v) decreases no faster than damping allows, N μ′(V) + c > 0. The
script computes a map of the long-term motions from rest and the cycle at the declared parameters,
and replaces the table by a law fitted to its points.
"""

from pathlib import Path

import numpy as np

import stickslip as ss

HERE = Path(__file__).parent
brake = ss.load(HERE / "brake.toml")
cycle = ss.find_cycle(brake)
speeds, forces = np.linspace(0.1, 1.5, 8), np.linspace(5.0, 40.0, 5)
swept = ss.sweep(brake, {"V": speeds, "N": forces}, ["amplitude:x", "stick_fraction"])
amplitude = swept["amplitude:x"].values

slopes = np.array([brake.evaluate(f"d_mu({v})") for v in speeds])
steady = forces * slopes[:, None] + brake.values["c"] > 0.0

points = brake.tables["mu"]
found = ss.fit_law((points.points[1:], points.values[1:]), ss.laws.stribeck, starts=8)

if __name__ == "__main__":
    print(f"cycle of period {cycle.period:.6f} s, certified: {cycle.certificate.ok}")
    print("\n".join(found.unknowns_in_words()))
    swept.plot().savefig("brake-map.png")
