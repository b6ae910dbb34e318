"""A path in the plane whose components move at different phases: example 2.1 of [M].

Ψ(s, v) = (2 − cos 2πs)|v₁| + (2 + cos 2πs)|v₂|. The first component has its smallest threshold at s
= 0, the second at s = 1/2. Under an oscillation of period ε the path is a staircase: the components
move alternately. As ε → 0 each component has its minimum threshold, Ψ_av(v) = |v₁| + |v₂|, and the
staircase converges to a curve.

[M] A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017).
"""

from pathlib import Path

import numpy as np

import stickslip as ss

model = ss.load_evolution(Path(__file__).parent / "evolution" / "two-phases.toml")
average = model.potential.average()

resolved = ss.evolve(model.problem, steps=2000)
averaged = ss.evolve(model.problem.averaged(), steps=500)

# The phases at which each component has moved, weighted by its displacement.
phases = (resolved.times[1:] / model.problem.epsilon) % 1.0
moved = np.abs(np.diff(resolved.z, axis=0))
near_0 = np.minimum(phases, 1.0 - phases) < 0.25
first_near_0 = float(moved[near_0, 0].sum() / moved[:, 0].sum())
second_near_half = float(moved[~near_0, 1].sum() / moved[:, 1].sum())

if __name__ == "__main__":
    folder = Path("out/two-phases")
    folder.mkdir(parents=True, exist_ok=True)
    ss.figures.plot_path(resolved.z, averaged.z, model.problem.epsilon).savefig(
        folder / "path.png", dpi=200
    )
    ss.figures.plot_average(model.potential, average, unit="dimensionless").savefig(
        folder / "stable-sets.png", dpi=200
    )
    print(f"Ψ_av(3, -4) = {average.support([3, -4]):.12g}, that is |v₁| + |v₂|")
    print(f"the first component moves near s = 0 for {first_near_0:.1%} of its way,")
    print(f"the second near s = 1/2 for {second_near_half:.1%} of its way")
    print(f"{resolved.certificate.verdict}; averaged {averaged.certificate.verdict}")
    print(f"{folder}/path.png, {folder}/stable-sets.png")
