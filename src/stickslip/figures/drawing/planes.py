"""Parts of plots of contacts in a plane: paths, coloured by stick and slip, and friction forces in
their admissible set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from stickslip.arrays import Array
from stickslip.figures.drawing.sampling import SampledMotion
from stickslip.figures.drawing.style import (
    BAND,
    BLUE,
    STICK_LINE,
    THRESHOLD,
    axis_label,
    legend_above,
    symbol,
)
from stickslip.figures.drawing.thinning import Curve
from stickslip.kept import cached_property
from stickslip.model.entries.units import unit_label
from stickslip.model.quantities import contact_key, quantity
from stickslip.numerics.levels import ROUNDED_SUM
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.convex.formula import ConvexFormula
    from stickslip.model.declaration import DryContact
    from stickslip.motion.trajectory import Trajectory

_SAME = 1e-3  # relative change of a threshold up to which it is drawn as one line
_ROUND = 181  # points of an ellipse
_FINE = 1441  # … and of a curve from a formula
_SPHERE = 4001  # number of directions of a face


@dataclass(frozen=True)
class InPlane:
    """A planar contact of one motion: the quantities for its figures.

    Attributes
    ----------
    name : str
        As declared.
    """

    trajectory: Trajectory
    name: str

    @cached_property
    def key(self) -> str:
        """Its name in variables."""
        return contact_key(self.name)

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """Names of its components in variables: two, or three of a face."""
        return tuple(map(contact_key, self.trajectory.system.planes[self.name]))

    @cached_property
    def _declared(self) -> tuple[DryContact, ...]:
        contacts = {c.name: c for c in self.trajectory.system.declaration.contacts}
        return tuple(contacts[part] for part in self.trajectory.system.planes[self.name])

    @property
    def turns(self) -> bool:
        """Whether the contact is a face, with a planar force and a moment."""
        return len(self.parts) == 3

    @cached_property
    def axes(self) -> tuple[float, ...]:
        """Half-axes of its set of forces, relative to the threshold."""
        return tuple(ex.evaluate(c.axis, self.trajectory.parameters) for c in self._declared)

    @cached_property
    def is_disc(self) -> bool:
        """Whether friction is the same in all directions."""
        return self.axes == (1.0, 1.0) and self.formula is None

    @cached_property
    def directions(self) -> tuple[dict[str, float], dict[str, float]] | None:
        """Weights of the coordinates in both components of the path; None if they vary, or there
        are none."""
        given = self.trajectory.parameters
        if self._declared[0].prescribed:
            return None
        if any(w.symbols - given.keys() for c in self._declared for w in c.direction.values()):
            return None
        first, second = (
            {x: ex.evaluate(w, given) for x, w in c.direction.items()} for c in self._declared[:2]
        )
        return first, second

    @property
    def traced(self) -> list[str]:
        """Quantities of the motion that its figures need in addition to the state."""
        return [f"{kind}_{part}" for part in self.parts for kind in ("friction", "threshold")]

    def force(self, values: Mapping[str, Array]) -> tuple[Array, Array]:
        """Both components of the friction force; for a face its size in the plane, and the
        moment."""
        first, second, *third = (values[f"friction_{part}"] for part in self.parts)
        return (np.hypot(first, second), third[0]) if third else (first, second)

    def bounds(self, values: Mapping[str, Array]) -> tuple[Array, Array]:
        """Half-axes of the set of forces, in units of a force; for a formula the threshold, which
        scales the outline."""
        bounds = [values[f"threshold_{part}"] for part in self.parts]
        if self.formula is not None:
            axes = np.eye(len(self.parts))
            along = [self.formula.numbers([*e, *self._others])[0] for e in axes]
            largest = int(np.argmax(along))
            s = bounds[largest] / along[largest]
            return s, s
        return bounds[0], bounds[1]

    @property
    def formula(self) -> ConvexFormula | None:
        """Its dissipation, if that is a formula."""
        return self._declared[0].dissipation

    @property
    def _others(self) -> list[float]:
        """Values of the parameters in the formula."""
        assert self.formula is not None
        return [self.trajectory.parameters[name] for name in self.formula.ranges]

    @cached_property
    def outline(self) -> Array:
        """The boundary of the set of forces, relative to :meth:`bounds`, shape (points, 2)."""
        if self.formula is None:
            angle = np.linspace(0.0, 2.0 * np.pi, _ROUND)
            return np.column_stack([np.cos(angle), np.sin(angle)])
        if self.turns:
            from scipy.spatial import ConvexHull

            surface = self._surface
            border = np.column_stack([np.hypot(surface[:, 0], surface[:, 1]), surface[:, 2]])
            both = np.concatenate([border, border * [-1.0, 1.0]])
            hull = both[ConvexHull(both).vertices]
            right = hull[hull[:, 0] >= 0.0]
            return right[np.argsort(np.arctan2(right[:, 1], right[:, 0]))]
        angle = np.linspace(0.0, 2.0 * np.pi, _FINE)
        way = zip(np.cos(angle), np.sin(angle), strict=True)
        # The force against a slip in each direction.
        return np.array([[-x for x in self.formula.numbers([*w, *self._others])[1:3]] for w in way])

    @cached_property
    def _ways(self) -> Array:
        """Directions distributed over an ellipsoid, shape (points, 3), by the golden angle, for
        velocities with equal dissipation along the axes."""
        assert self.formula is not None
        along = [self.formula.numbers([*e, *self._others])[0] for e in np.eye(3)]
        k = np.arange(_SPHERE) + 0.5
        height = 1.0 - 2.0 * k / _SPHERE
        turn = np.pi * (1.0 + 5.0**0.5) * k
        across = np.sqrt(1.0 - height**2)
        return np.column_stack([across * np.cos(turn), across * np.sin(turn), height]) / along

    @cached_property
    def _surface(self) -> Array:
        """The forces of a face against slips in these directions, relative to :meth:`bounds`."""
        assert self.formula is not None
        from stickslip.symbolic.evaluator import evaluator

        gradient = evaluator([*self.formula.gradient], [*self.formula.names, *self.formula.ranges])
        others = [np.full(len(self._ways), x) for x in self._others]
        return -gradient([*self._ways.T, *others]).T

    def _share(self, values: Mapping[str, Array]) -> Array:
        """The force of a face as a fraction of its limit surface."""
        forces = np.column_stack([values[f"friction_{part}"] for part in self.parts])
        outward = -self._ways
        most = np.einsum("ij,ij->i", self._surface, outward)
        found = [np.max(outward @ force / most) for force in forces]
        return np.array(found) / self.bounds(values)[0]

    def size(self, values: Mapping[str, Array]) -> tuple[Array, Array]:
        """abs(A⁻¹λ), and the threshold that bounds it; for a formula abs(λ), and the largest force
        in that direction; for a face the fraction of its limit surface, and 1."""
        if self.turns:
            share = self._share(values)
            return share, np.ones_like(share)
        if self.formula is not None:
            x, y = self.force(values)
            angles = np.arctan2(self.outline[:, 1], self.outline[:, 0])
            order = np.argsort(angles)
            radii = np.hypot(*self.outline[order].T)
            most = np.interp(np.arctan2(y, x), angles[order], radii, period=2.0 * np.pi)
            return np.hypot(x, y), self.bounds(values)[0] * most
        scaled = (part / a for part, a in zip(self.force(values), self.axes, strict=True))
        return np.hypot(*scaled), self.bounds(values)[0] / self.axes[0]

    def place(self, values: Mapping[str, Array]) -> tuple[Array, Array]:
        """Both components of the path of the contact. Rounding errors of their terms are removed,
        since they are all that varies in stick."""
        assert self.directions is not None
        places = [
            np.sum([w * values[x] for x, w in weights.items()], axis=0)
            for weights in self.directions
        ]
        first, second = (np.where(np.abs(p) > self._rounding, p, 0.0) for p in places)
        return first, second

    @cached_property
    def _rounding(self) -> float:
        """Rounding errors of the components of the path."""
        assert self.directions is not None
        motion = self.trajectory
        state = dict(zip(motion.system.declaration.state, motion.knots.state.T, strict=True))
        return ROUNDED_SUM * max(
            sum(abs(w) * float(np.max(np.abs(state[x]))) for x, w in weights.items() if x in state)
            for weights in self.directions
        )

    def place_labels(self) -> tuple[str, str]:
        """Labels of the axes of the path."""
        assert self.directions is not None
        first, second = (self._label(weights) for weights in self.directions)
        return first, second

    def _label(self, weights: Mapping[str, float]) -> str:
        unit = quantity(self.trajectory.system, next(iter(weights))).get("units", "")
        said = ""
        for x, w in weights.items():
            sign = " − " if w < 0 else " + " if said else ""
            number = "" if abs(w) == 1.0 else f"{abs(w):g} "
            said += f"{sign if said or w < 0 else ''}{number}{symbol(x)}"
        label = unit_label(unit)
        return said.strip() + (f"  [{label}]" if label else "")

    def force_labels(self) -> tuple[str, str]:
        """Labels of the axes of the force."""
        units = [
            quantity(self.trajectory.system, f"friction_{part}").get("units", "")
            for part in self.parts
        ]
        if self.turns:
            label = unit_label(units[0])
            across = r"$\sqrt{\lambda_1^2 + \lambda_2^2}$" + (f"  [{label}]" if label else "")
            return across, axis_label(["lam_3"], units[2])
        return axis_label(["lam_1"], units[0]), axis_label(["lam_2"], units[1])


class PlaneCurves:
    """Paths and forces of contacts in planes, collected incrementally.

    Parameters
    ----------
    sampled : SampledMotion
        Sampled times of the motion.
    whole : bool
        Whether to plot all samples.

    Attributes
    ----------
    path, force : dict of str to Curve
        By contact.
    ends : dict of str to array, shape (2, 2)
        Start and end of each path.
    reach : dict of str to array, shape (2, 2)
        Smallest and largest semi-axes of the set of forces.
    """

    def __init__(self, planes: Sequence[InPlane], sampled: SampledMotion, whole: bool) -> None:
        self.planes = list(planes)
        self.path = {
            p.key: Curve(whole, *p.place(sampled.at_knots)) for p in planes if p.directions
        }
        self.ends = {
            p.key: np.transpose(p.place(sampled.at_knots))[[0, -1]] for p in planes if p.directions
        }
        self.force = {p.key: Curve(whole, *_box(p, sampled)) for p in planes}
        self.reach = {p.key: np.array([[np.inf, np.inf], [0.0, 0.0]]) for p in planes}

    def absorb(self, steps: Array, values: Mapping[str, Array], modes: Mapping[str, Array]) -> None:
        """Add samples.

        Parameters
        ----------
        steps : array of int
            The step that each belongs to.
        modes : mapping of str to array
            Of the contacts on the steps.
        """
        joined = np.diff(steps) <= 1
        for plane in self.planes:
            sticks = modes[plane.key][steps] == 0
            if plane.key in self.path:
                rests = np.any([modes[key][steps] == 0 for key in self.along(plane)], axis=0)
                self.path[plane.key].absorb(*plane.place(values), rests, joined)
            self.force[plane.key].absorb(*_broken(*plane.force(values), sticks, joined))
            bounds = np.array(plane.bounds(values))
            reach = self.reach[plane.key]
            reach[0] = np.minimum(reach[0], np.min(bounds, axis=1))
            reach[1] = np.maximum(reach[1], np.max(bounds, axis=1))

    def along(self, plane: InPlane) -> list[str]:
        """Contacts with the same path, such as two belts below one parcel."""
        return [other.key for other in self.planes if other.directions == plane.directions]

    def paths(self) -> list[InPlane]:
        """Contacts with distinct paths."""
        found: list[InPlane] = []
        for plane in self.planes:
            if plane.key in self.path and all(p.directions != plane.directions for p in found):
                found.append(plane)
        return found

    def draw_path(self, axes: Axes, plane: InPlane) -> None:
        """A path, coloured by stick and slip, from its start to its end."""
        curve = self.path[plane.key]
        x, y, sticking = curve.points()
        axes.plot(x, np.where(sticking, np.nan, y), color=BLUE, lw=1.5, label="slip")
        axes.plot(
            x, np.where(sticking, y, np.nan), color=STICK_LINE, lw=2.4, label="stick", zorder=3
        )
        axes.plot(*curve.spots(), ".", color=STICK_LINE, ms=5, zorder=3)
        start, end = self.ends[plane.key]
        axes.plot(*start, "o", ms=6.5, mfc="white", mec=STICK_LINE, zorder=4, label="start", ls="")
        axes.plot(*end, "s", ms=5.5, mfc=STICK_LINE, mec="white", zorder=4, label="end", ls="")
        _square(axes, *plane.place_labels())
        legend_above(axes)

    def draw_force(self, axes: Axes, plane: InPlane) -> None:
        """A friction force in the set of forces, which may change."""
        curve = self.force[plane.key]
        least, largest = self.reach[plane.key]
        axes.fill(*(plane.outline * largest).T, fc=BAND, ec="none", alpha=0.5, zorder=0)
        changes = np.any(largest - least > _SAME * largest)
        for half in (least, largest) if changes else (largest,):
            axes.plot(*(plane.outline * half).T, color=THRESHOLD, lw=1.0, zorder=1)
        x, y, sticking = curve.points()
        axes.plot(x, np.where(sticking, np.nan, y), color=BLUE, lw=1.5, zorder=2)
        axes.plot(x, np.where(sticking, y, np.nan), color=STICK_LINE, lw=1.8, zorder=3)
        axes.plot(*curve.spots(), ".", color=STICK_LINE, ms=5, zorder=3)
        said = "thresholds" if changes else "threshold"
        marks = [
            Line2D([], [], color=BLUE, label="in slip"),
            Line2D([], [], color=STICK_LINE, lw=1.8, label="in stick"),
            Patch(fc=BAND, ec=THRESHOLD, lw=0.8, label=said),
        ]
        _square(axes, *plane.force_labels(), alike=not plane.turns)
        if len(self.planes) > 1:
            # The corners of a disc are free.
            axes.text(0.02, 0.98, plane.name, transform=axes.transAxes, va="top")
        if plane is self.planes[0]:
            legend_above(axes, marks)


def _broken(x: Array, y: Array, rests: Array, joined: Array) -> tuple[Array, Array, Array, Array]:
    """A curve with gaps between rest and motion, where forces jump."""
    at = np.flatnonzero(rests[1:] != rests[:-1]) + 1
    joined = joined.copy()
    joined[at - 1] = False
    return (
        np.insert(x, at, np.nan),
        np.insert(y, at, np.nan),
        np.insert(rests, at, False),
        np.insert(joined, at - 1, False),
    )


def _box(plane: InPlane, sampled: SampledMotion) -> tuple[Array, Array]:
    """Corners of a rectangle of about the size of the forces."""
    motion = plane.trajectory
    some = np.unique(np.linspace(0, sampled.steps - 1, 200).astype(int))
    names = [f"threshold_{part}" for part in plane.parts]
    bounds = motion.trace(names, sampled.time[some], some + sampled.first)
    first, *_, last = (float(np.max(bounds[name])) for name in names)
    return np.array([0.0 if plane.turns else -first, first]), np.array([-last, last])


def _square(axes: Axes, across: str, up: str, alike: bool = True) -> None:
    """Set equal scales for quantities of the same kind, and the labels of the axes."""
    if alike:
        axes.set_aspect("equal", adjustable="datalim")
    axes.set_box_aspect(0.9)
    axes.set_anchor("N")
    axes.margins(0.08)
    axes.yaxis.set_major_locator(MaxNLocator(5))
    axes.set_xlabel(across)
    axes.set_ylabel(up)
