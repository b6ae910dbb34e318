"""Rotating anisotropic friction: the intersection of an ellipse with all its rotations is a disc.

The stable set K(s) is an ellipse with the semi-axes 2 and 1/2 that makes half a turn in one period.
Friction cannot balance a force outside the disc of radius 1/2 at every phase, so Ψ_av(V) = |V|/2: a
motion in the direction V takes place at the phase at which the short axis points along V.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), (2.3) and (2.4).
"""

from pathlib import Path

import numpy as np

import stickslip as ss

model = ss.load_evolution(Path(__file__).parent / "evolution" / "rotating-ellipse.toml")
average = model.potential.average()

angles = np.linspace(0.0, np.pi, 37)
motions = [average.optimal_motion([np.cos(a), np.sin(a)]) for a in angles]
costs = np.array([motion.cost for motion in motions])
error = float(np.max(np.abs(costs - 0.5)))
gap = max(motion.gap for motion in motions)

# The short axis points along V at the phase s with 2πs = 2 angle(V) + π.
waits = float(
    max(
        np.abs((m.phases - a / np.pi) % 1.0 - 0.5).max()
        for m, a in zip(motions, angles, strict=True)
    )
)


def plot_phases(axes):
    """The phase that does the moving, over the direction of the motion."""

    # s = angle/π + 1/2 modulo 1, cut where it jumps.
    line = [0, 90, np.nan, 90, 180], [0.5, 1.0, np.nan, 0.0, 0.5]
    axes.plot(*line, color=ss.style.STICK_LINE, lw=1.0, label="short axis along $V$")
    for angle, motion in zip(angles, motions, strict=True):
        axes.plot(
            np.full(len(motion.phases), np.degrees(angle)),
            motion.phases,
            "o",
            color=ss.style.BLUE,
            ms=5,
            clip_on=False,
        )
    axes.plot([], [], "o", color=ss.style.BLUE, ms=5, label="optimal motion")
    axes.set_xlim(0, 180)
    axes.set_xticks([0, 45, 90, 135, 180])
    axes.set_ylim(0, 1)
    axes.set_xlabel("direction of the motion $V$  [deg]")
    axes.set_ylabel("phase $s$ that moves  [periods]")
    ss.style.legend_above(axes)


if __name__ == "__main__":
    path = Path("out/rotating-ellipse/stable-sets.png")
    path.parent.mkdir(parents=True, exist_ok=True)
    with ss.style.paper_style():
        figure = ss.style.new_figure(9.2, 4.8)
        left, right = figure.subplots(1, 2)
        ss.figures.stable_sets(left, model.potential, unit="dimensionless")
        plot_phases(right)
        figure.savefig(path, dpi=200)
    print(f"largest difference of Ψ_av(V) from |V|/2: {error:.1e}; largest duality gap: {gap:.1e}")
    print(path)
