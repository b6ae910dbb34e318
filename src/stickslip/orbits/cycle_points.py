"""What happens on a branch of cycles: where the sequence of modes changes, and the table of the points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.orbits.chart import Chart
from stickslip.orbits.continuation import UNDEFINED, Crossing, Lost, Path, Point
from stickslip.orbits.touching import Sequence, change_of, nearest_change, sequence
from stickslip.quantities import contact_key

if TYPE_CHECKING:
    import xarray

    from stickslip.orbits.cycles import Cycle

Array = np.ndarray

NEAR = 1e-4  # a located multiplier or slope is this close to its critical value, else it jumps there
FLAT = 1e-9  # values of a test function that are rounding
MOST_CHANGES = 8  # located within one step
TOUCHES = 1e-11  # a margin this small is zero
TOGETHER = 1e-6  # changes that are nearer to each other are one
FINE = 1e-11  # corrector's tolerance where a change is located
STABLE = {"flag_values": np.array([-1, 0, 1], np.int8), "flag_meanings": "neutral unstable stable"}


@dataclass(frozen=True)
class Change:
    """A change of the sequence: where, its name, and what happens in words."""

    x: Array
    kind: str
    note: str


def locate_changes(chart: Chart, a: Point, b: Point) -> list[Change]:
    """The changes of the sequence between two points, in the order of travel."""
    low, here = 0.0, sequence(chart.orbit(a.x).motion)
    high, there = b.length - a.length, sequence(chart.orbit(b.x).motion)
    contacts = [c.name for c in chart.shooting.pieces.equations.contacts]
    passed: list[tuple[Array, Sequence, Sequence]] = []
    while here != there and len(passed) < MOST_CHANGES:
        x, low, beyond = _Finder(chart, a, b, here).first_change(low, high)
        if passed and np.linalg.norm((x - passed[-1][0]) / chart.scale(x)) < TOGETHER:
            # Events that belong together by a symmetry of the cycle.
            x, here, _ = passed.pop()
        passed.append((x, here, beyond))
        here = beyond
    return [Change(x, *change_of(contacts, before, after)) for x, before, after in passed]


class _Finder:
    """Positive where a cycle has a given sequence, negative where not, and small where that changes."""

    def __init__(self, chart: Chart, a: Point, b: Point, here: Sequence) -> None:
        self.chart, self.a, self.b, self.here = chart, a, b, here
        self.seen: dict[float, tuple[Array, Sequence, float]] = {}

    def __call__(self, distance: float) -> float:
        if distance not in self.seen:
            whole = self.b.length - self.a.length
            ends = {0.0: self.a.x, whole: self.b.x}
            x = ends[distance] if distance in ends else self.chart.along(self.a, distance, FINE)
            motion = self.chart.orbit(x).motion
            order = sequence(motion)
            margin = nearest_change(motion, self.chart.shooting.pieces)
            margin = margin if margin > TOUCHES else 0.0
            self.seen[distance] = x, order, margin if order == self.here else -margin
        return self.seen[distance][2]

    def first_change(self, low: float, high: float) -> tuple[Array, float, Sequence]:
        """Unknowns at the change, a distance just beyond it, and the sequence there."""
        from scipy.optimize import brentq

        self(low)
        self(high)
        try:
            brentq(self, low, high, xtol=1e-13, maxiter=60)
        except (Lost, RuntimeError, ValueError, *UNDEFINED):
            pass  # what was found so far encloses the change
        beyond = min(s for s, (_, order, _) in self.seen.items() if order != self.here)
        x = min(self.seen.values(), key=lambda entry: abs(entry[2]))[0]
        return x, beyond, self.seen[beyond][1]


def is_flat(path: Path, crossing: Crossing) -> bool:
    """Whether a test function is zero on both sides, too, but for rounding: without damping that is so all along."""
    beside = path.points[max(crossing.index - 1, 0) : crossing.index + 2]
    return max(abs(point.tests[crossing.name]) for point in beside) < FLAT


def confirmed(name: str, slope: float, multipliers: Array, changes: list[Change]) -> tuple[str, str] | None:
    """Kind and note of a located zero of a test function; None if the function only jumps there."""
    if name == "fold":
        if abs(slope) <= NEAR:
            return "fold", ""
        return ("fold", "not smooth: the sequence changes there") if changes else None
    if name == "period doubling" and np.min(np.abs(multipliers + 1.0), initial=1.0) <= NEAR:
        return name, ""
    if name == "branch point" and np.min(np.abs(multipliers - 1.0), initial=1.0) <= NEAR:
        return name, ""
    on_circle = [z for z in multipliers if z.imag > NEAR and abs(abs(z) - 1.0) <= NEAR]
    if name == "torus" and on_circle:
        angle = float(np.angle(on_circle[0]))
        return name, f"rotation number {angle / (2.0 * np.pi):.9g}"
    return None


def dataset(parameter: str, values: list[float], cycles: list[Cycle]) -> xarray.Dataset:
    """Parameter, period, extremes, multipliers, stability, stick and slip, drift and certificate of every point."""
    import xarray as xr

    system = cycles[0].system
    multipliers: Any = np.array([c.multipliers for c in cycles])

    def column(quantity: str) -> tuple[str, Array]:
        return "point", np.array([getattr(c, quantity) for c in cycles], dtype=float)

    data: dict = {parameter: ("point", np.array(values)), "period": column("period"), "time": column("time")}
    for name in system.declaration.state:
        data[name] = "point", np.array([c.state[name] for c in cycles])
        data[f"min_{name}"] = "point", np.array([c.extrema[name][0] for c in cycles])
        data[f"max_{name}"] = "point", np.array([c.extrema[name][1] for c in cycles])
    data |= {
        "stable": ("point", np.array([-1 if c.neutral else int(c.stable) for c in cycles], np.int8), STABLE),
        "multiplier_real": (("point", "multiplier"), multipliers.real),
        "multiplier_imag": (("point", "multiplier"), multipliers.imag),
        "differentiable": ("point", np.array([c.differentiable for c in cycles], np.int8)),
        "sticks": ("point", np.array([c.sticks for c in cycles], np.int8)),
        "phases": ("point", np.array([len(c.phases) for c in cycles])),
        **{name: column(name) for name in ("stick_time", "slip_time", "dissipated", "supplied", "drift", "speed")},
        "residual": column("residual"),
        "certified": ("point", np.array([c.trajectory.certificate.ok for c in cycles], np.int8)),
    }
    for name in cycles[0].contacts:
        data[f"stick_time_{contact_key(name)}"] = "point", np.array([c.contacts[name].stick_time for c in cycles])
    return xr.Dataset(data, attrs={"title": system.title or system.name, "kind": "cycles"})
