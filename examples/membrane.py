"""A membrane on a bed with travelling friction: a wave of thresholds compared with its average.

A membrane over the unit disc is clamped at its edge and rests on springs. Dry friction with the
threshold ρ(s, x) = 1 + 0.9 cos 2π(s − x₁), a wave that crosses the membrane once in every period ε,
resists a growing uniform load. Each point slips when the trough passes, so the resolved motion is a
slip front that moves with the wave, and every passage leaves less slip for the next. In the average
the threshold of every point is 0.1.

All quantities are dimensionless: lengths relative to the radius, forces to the mean threshold.
Linear finite elements on a triangulated disc; loads, thresholds and springs are lumped at the
nodes.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array
from skfem import Basis, ElementTriP1, MeshTri
from skfem.models.poisson import laplace, unit_load

import stickslip as ss

MEAN = 1.0
SWING = 0.9
SPRINGS = 30.0
LARGEST_LOAD = 2.0
PER_PERIOD = 10  # steps
TOLERANCE = 0.05
KKT = 1e-6


def threshold(s, x):
    """A wave that runs to the right."""
    return MEAN + SWING * np.cos(2 * np.pi * (s - x))


@dataclass(frozen=True, eq=False)
class Membrane:
    """A triangulated disc, and the evolution on its inner nodes."""

    mesh: Any
    inner: np.ndarray
    area: np.ndarray
    problem: ss.Evolution

    @property
    def periods(self):
        """Number of periods in the span."""
        return round(1.0 / self.problem.epsilon)

    def resolved(self):
        """The evolution with all phases resolved."""
        return ss.evolve(
            self.problem, steps=PER_PERIOD * self.periods, tolerance=TOLERANCE, kkt=KKT
        )

    def averaged(self):
        """Its limit; under proportional loading, long steps are exact at their ends."""
        return ss.evolve(self.problem.averaged(), steps=self.periods, tolerance=TOLERANCE, kkt=KKT)

    def distance(self, resolved, averaged):
        """Largest |z_ε − z_0| at the ends of the periods, of the largest |z_0|, in L²."""
        apart = resolved.z[::PER_PERIOD] - averaged.z
        norms = [np.sqrt(np.square(z) @ self.area) for z in (apart, averaged.z)]
        return float(norms[0].max() / norms[1].max())

    def profile(self, z):
        """Coordinates x₁ on the diameter x₂ = 0, increasing, and the values there."""
        (line,) = np.nonzero(np.abs(self.mesh.p[1]) < 1e-12)
        line = line[np.argsort(self.mesh.p[0, line])]
        return self.mesh.p[0, line], self.on_mesh(z)[line]

    def on_mesh(self, z):
        """Values at all nodes, 0 at the edge."""
        full = np.zeros(self.mesh.p.shape[1])
        full[self.inner] = z
        return full


def membrane(refinements, periods):
    """The problem on a disc whose triangles are quartered repeatedly (8 times: 1.3e5 unknowns)."""
    mesh = MeshTri.init_circle(refinements)
    basis = Basis(mesh, ElementTriP1())
    inner = mesh.interior_nodes()
    area = unit_load.assemble(basis)[inner]
    x = mesh.p[0, inner]
    problem = ss.Evolution(
        A=csr_array(laplace.assemble(basis)[inner][:, inner] + diags_array(SPRINGS * area)),
        load=lambda t: LARGEST_LOAD * t * area,
        dissipation=ss.WeightedL1(lambda s: area * threshold(s, x)),
        initial=np.zeros(len(inner)),
        epsilon=1.0 / periods,
        span=(0.0, 1.0),
    )
    return Membrane(mesh, inner, area, problem)


def distance(refinements, periods):
    """The distance between the resolved and the averaged motion."""
    disc = membrane(refinements, periods)
    resolved, averaged = disc.resolved(), disc.averaged()
    assert resolved.certificate.ok and averaged.certificate.ok, resolved.certificate.verdict
    return disc.distance(resolved, averaged)


def draw(disc, resolved, averaged, coarse, fast):
    """The wave and where it moves the membrane; the membrane; its profiles at the ends of the
    periods.

    A motion with a shorter period on a coarse mesh joins the last profile.
    """

    with ss.style.paper_style():
        figure = ss.style.new_figure(11.0, 4.2)
        ((maps, lines),) = figure.subfigures(1, 2, squeeze=False, width_ratios=[1.7, 1.0])
        draw_maps(maps, disc, resolved)
        draw_profiles(lines.subplots(), disc, resolved, averaged, coarse, fast)
        return figure


def draw_maps(figure, disc, resolved):
    """Thresholds with the slipping part hatched, and the deflection, in the middle of the last
    period."""
    from matplotlib.tri import Triangulation

    wave, plane = figure.subplots(1, 2)
    k = PER_PERIOD * (disc.periods - 1) + PER_PERIOD // 2
    t, z = resolved.times[k], resolved.z[k]
    slips = disc.on_mesh(z > resolved.z[k - 1])
    x, y = disc.mesh.p
    triangles = Triangulation(x, y, disc.mesh.t.T)
    rho = threshold(t / disc.problem.epsilon, disc.mesh.p[0])
    shown = (
        (
            wave,
            rho,
            "cividis",
            f"threshold $\\rho$ [dimensionless]\nat $t = {t:.2f}$; hatched: slips",
        ),
        (
            plane,
            disc.on_mesh(z),
            "viridis",
            f"deflection $z_\\varepsilon$ [dimensionless]\nat $t = {t:.2f}$",
        ),
    )
    for axes, values, colours, label in shown:
        image = axes.tripcolor(triangles, values, shading="gouraud", cmap=colours, rasterized=True)
        figure.colorbar(image, ax=axes, location="bottom", shrink=0.8, label=label)
        axes.set_aspect("equal")
        axes.set_axis_off()
    wave.tricontourf(triangles, slips, levels=[0.5, 2.0], colors="none", hatches=["////"])
    wave.tricontour(triangles, slips, levels=[0.5], colors="white", linewidths=1.2)


def draw_profiles(axes, disc, resolved, averaged, coarse, fast):
    """Deflection along a diameter."""

    x, _ = disc.profile(averaged.z[0])
    for period in range(1, disc.periods + 1):
        limit = disc.profile(averaged.z[period])[1]
        line = disc.profile(resolved.z[PER_PERIOD * period])[1]
        first = period == 1
        axes.plot(
            x,
            line,
            color=ss.style.BLUE,
            label=rf"$\varepsilon = 1/{disc.periods}$" if first else None,
        )
        axes.plot(
            x,
            limit,
            color=ss.style.STICK_LINE,
            lw=1.1,
            label=r"$\varepsilon \to 0$" if first else None,
        )
    axes.plot(
        *coarse.profile(fast.final),
        color=ss.style.ORANGE,
        label=rf"$\varepsilon = 1/{coarse.periods}$",
    )
    times = ", ".join(f"{period}/{disc.periods}" for period in range(1, disc.periods))
    axes.text(0.0, 0.066, f"from below: $t = {times}, 1$", ha="center", fontsize=10)
    axes.set_xlim(-1, 1)
    axes.set_xticks([-1, -0.5, 0, 0.5, 1])
    axes.set_ylim(0.0, 0.07)
    axes.set_xlabel("place $x_1$  [radii]")
    axes.set_ylabel("deflection  [dimensionless]")
    ss.style.legend_above(axes)


distances = {periods: distance(4, periods) for periods in (3, 12, 48)}

if __name__ == "__main__":
    path = Path("out/membrane/wave.png")
    path.parent.mkdir(parents=True, exist_ok=True)
    disc, coarse = membrane(8, periods=3), membrane(4, periods=48)
    resolved, averaged = disc.resolved(), disc.averaged()
    draw(disc, resolved, averaged, coarse, coarse.resolved()).savefig(path, dpi=200)
    print(
        f"{disc.problem.n} unknowns, {resolved.steps} steps: {resolved.wall_time:.0f} s; "
        f"{resolved.certificate.verdict}"
    )
    print(
        f"averaged, {averaged.steps} steps: {averaged.wall_time:.0f} s; "
        f"{averaged.certificate.verdict}"
    )
    print(f"distance from the averaged motion: {disc.distance(resolved, averaged):.1%}")
    print(
        "on 481 unknowns:",
        ", ".join(f"{d:.1%} with {periods} periods" for periods, d in distances.items()),
    )
    print(path)
