"""Equilibria: states of rest and of steady sliding, isolated or in sets, of any declared system.

In a mode the motion is smooth, so an equilibrium is a zero of that mode's field in which the guards
of the mode hold. A contact with a moving surface must slip, all others must stick; only contacts
that move in a translation of the whole system are tried in all modes. In each region of the kinks,
a mode with an affine field is solved directly. For all other modes, sets are covered by boxes, and
isolated equilibria are searched by Newton's method from many starts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import islice, product

import numpy as np

from stickslip.arguments import validated
from stickslip.certificates import Residual, worst
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Field, Guard, Mode, Region, named_modes
from stickslip.equations.mode_fields import mode_field
from stickslip.errors import DeclarationError, StickslipError, suggestion
from stickslip.model.declaration import check_initial
from stickslip.model.system import System
from stickslip.motion.problem import checked_values
from stickslip.orbits.equilibria import search
from stickslip.orbits.equilibria.box_bounds import is_within, touch
from stickslip.orbits.equilibria.candidates import autonomous, possible_modes, surface_speed
from stickslip.orbits.equilibria.certificate import ON_BOUNDARY, certify_equilibrium, certify_set
from stickslip.orbits.equilibria.covering import CoveredSet, cover, valued
from stickslip.orbits.equilibria.equilibrium import (
    Equilibria,
    Equilibrium,
    EquilibriumSet,
    describe_guard,
    modes_text,
)
from stickslip.orbits.equilibria.reduction import Irreducible
from stickslip.orbits.equilibria.stick_sets import Conditions, all_stick, at_rest, dimension
from stickslip.orbits.fields.steady import Array, Steady, invariant_directions
from stickslip.stopping.scopes import watching
from stickslip.symbolic import expressions as ex

_MOST = 4096  # largest number of modes times regions that are all tried
_STARTS = 63
_KNOWN = 1e-9  # error of the ends of sets, relative to their size
_POLISH = 4  # number of Newton steps that move a point inside a set onto its equations
# smallest unit of a component (absolute): zero states are not compared with rounding errors
_LEAST_UNIT = 1e-6
_SAME_POINT = 1e-7  # distance, in these units, of points found on two sides of a boundary


@validated
def equilibria(
    system: System,
    *,
    parameters: Mapping[str, float] | None = None,
    box: Mapping[str, tuple[float, float]] | None = None,
) -> Equilibria:
    """Find all equilibria: isolated ones, and sets of equilibria in stick.

    Sets are proved to be connected and complete; otherwise the result reports what is undecided,
    and is not certified. Isolated equilibria are searched from many starts.

    Parameters
    ----------
    system : System
    parameters : mapping of str to float, optional
        Values that replace the defaults.
    box : mapping of str to (float, float), optional
        Ranges of states in which isolated equilibria are searched, and which sets must intersect;
        by default around the declared initial state.

    Returns
    -------
    Equilibria
        May be empty; its ``message`` then reports what was tried and the closest candidate.

    Raises
    ------
    DeclarationError
        If an argument is wrong, or the system depends on time.
    """
    values = checked_values(system, parameters)
    with watching():  # an interrupt inside ends the entire search
        return _Search(system, autonomous(system), values, box or {}).run()


def is_equilibrium(found: Equilibria, point: Mapping[str, float]) -> bool:
    """Return whether a point is an isolated equilibrium that was found, or in a set.

    Parameters
    ----------
    point : mapping of str to float
        See :meth:`Equilibria.contains`.

    Raises
    ------
    DeclarationError
        If the point is not a state.
    """
    looked = _Search(found.system, autonomous(found.system), found.parameters, {})
    return looked.contains(found, point)


_Piece = tuple[Mapping[str, tuple[float, float]], Conditions]  # with its extent


class _Search:
    def __init__(
        self,
        system: System,
        equations: MotionEquations,
        values: dict[str, float],
        box: Mapping[str, tuple[float, float]],
    ) -> None:
        self.system = system
        self.eq = equations
        self.values = values
        self.state = system.declaration.state
        self.contacts = equations.labels
        self.origin = np.array([float(system.plain.initial.get(name, 0.0)) for name in self.state])
        self.box = self._checked_box(box)
        self.invariant = invariant_directions(equations, values, self.origin)
        self.starts = np.column_stack([self.origin, self._sample()])
        self.isolated: list[Equilibrium] = []
        self.sets: list[EquilibriumSet] = []
        self.nearest = (-math.inf, "")
        self.looked: set[tuple[Mode, Region]] = set()
        self.waiting: list[tuple[Mode, Region]] = []
        self.covered: dict[tuple[Mode, Region | None], bool] = {}  # and whether that found all
        self.undecided: list[str] = []
        self.polyhedral: dict[Mode, bool] = {}
        self.pieces: list[tuple[EquilibriumSet, list[_Piece]]] = []  # pieces of sets, by region

    def _checked_box(
        self, box: Mapping[str, tuple[float, float]]
    ) -> dict[str, tuple[float, float]]:
        checked = {}
        for name, ends in box.items():
            if name not in self.state:
                raise DeclarationError(f"box.{name}", "unknown state", suggestion(name, self.state))
            low, high = (float(v) for v in ends)
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise DeclarationError(
                    f"box.{name}", f"({low:g}, {high:g}) is not a range", "Give (low, high)"
                )
            checked[name] = (low, high)
        return checked

    def _sample(self) -> Array:
        points = search.wide_sample(_STARTS, self.origin)
        for i, name in enumerate(self.state):
            if name in self.box:
                low, high = (np.array([v]) for v in self.box[name])
                # Components of one even sample of the whole box, so that they are not correlated.
                unit = search.fill_box(
                    _STARTS, np.zeros(len(self.state)), np.ones(len(self.state))
                )[i]
                points[i] = low + (high - low) * unit
        return points

    # -- where to look -----------------------------------------------------------------------------

    def run(self) -> Equilibria:
        choices = possible_modes(self.eq, self.values, self._named(self.origin), self.invariant)
        modes = (
            tuple(mode for _, mode in sorted(pair for part in parts for pair in part.items()))
            for parts in product(*choices)
        )
        regions = self._regions()
        candidates = ((mode, region) for mode in modes for region in regions)
        self._look_everywhere(islice(candidates, _MOST))
        count = math.prod(map(len, choices)) * 2 ** sum(s is None for s in self._fixed_regions())
        tried = (
            f"tried {len(self.looked)} of {count} combinations of modes and regions with "
            f"{self.starts.shape[1]} starts each"
        )
        if not self.isolated and not self.sets:
            tried += self._look_at_the_end_of_a_motion()
        if self.pieces and len(self.looked) < count:
            self.undecided.append(
                f"{count - len(self.looked)} combinations of modes and regions were not tried"
            )
        order = {True: 0, None: 1, False: 2}
        self.isolated.sort(key=lambda e: order[e.stable])
        return Equilibria(
            self.system,
            dict(self.values),
            tuple(self.isolated),
            tuple(self.sets),
            tried,
            self.nearest[1],
            tuple(dict.fromkeys(self.undecided)),
        )

    def contains(self, found: Equilibria, point: Mapping[str, float]) -> bool:
        """Return whether a point is an isolated equilibrium, or in a set."""
        rates = {f"d_{x}" for x in self.eq.declaration.inertial}
        for name in point:
            check_initial(self.system.declaration, name, point[name])
        for name in self.state:
            if name not in point and name not in rates:
                raise DeclarationError(
                    f"point.{name}", "the value is missing", "Give values of all coordinates"
                )
        for one in found:
            y = np.array([point.get(x, one.state[x]) for x in self.state])
            if self._is_at(one, y) if isinstance(one, Equilibrium) else self._is_in(one, y):
                return True
        return False

    def _is_at(self, one: Equilibrium, y: Array) -> bool:
        """Return whether a state is that of an isolated equilibrium, up to translation."""
        there = np.array(list(one.state.values()))
        units = np.maximum(np.maximum(np.abs(y), np.abs(there)), _LEAST_UNIT)
        apart, along = (y - there) / units, self.invariant / units[:, None]
        return float(np.max(np.abs(apart - along @ (np.linalg.pinv(along) @ apart)))) <= _KNOWN

    def _is_in(self, one: EquilibriumSet, y: Array) -> bool:
        """Return whether a state satisfies the conditions of a set, and so those of all sets of its
        modes."""
        for region in one.regions:
            if self._rests(one.mode):
                conditions = all_stick(self.eq, one.mode, region, self.values)
            elif (field := self._field(one.mode, region)) is not None:
                steady = Steady(field, self.values, self.invariant, self.origin)
                conditions = self._conditions(steady)
            else:
                continue
            whole = conditions.completed(y)
            if whole is not None:
                equations, guards = certify_set(conditions, whole).residuals
                if equations.value <= _KNOWN and guards.value >= -_KNOWN:
                    return True
        return False

    def _look_everywhere(self, candidates: Iterable[tuple[Mode, Region]]) -> None:
        """Search all candidates, and the regions of zeros that are outside of the searched
        region."""
        self.waiting = list(candidates)
        while self.waiting and len(self.looked) < _MOST:
            candidate = self.waiting.pop(0)
            if candidate not in self.looked:
                self.looked.add(candidate)
                self._look(*candidate)

    def _fixed_regions(self) -> list[int | None]:
        """Regions of the kinks that the parameters decide; None for the others."""
        names = set(self.eq.declaration.parameters)
        return [
            int(ex.evaluate(g, self.values) >= 0.0) if g.symbols <= names else None
            for g in self.eq.kinks
        ]

    def _regions(self) -> list[Region]:
        """Regions of the kinks: all, or those of the starts if there are too many."""
        fixed = self._fixed_regions()
        if 2 ** fixed.count(None) <= _MOST:
            return list(product(*((s,) if s is not None else (1, 0) for s in fixed)))
        return list(dict.fromkeys(self._region(y) for y in self.starts.T))

    def _region(self, y: Array) -> Region:
        """Region of a state in which coordinates without mass are at rest."""
        rates = {f"d_{x}": 0.0 for x in self.eq.declaration.coordinates}
        at = {**rates, **self.values, **self._named(y), "t": 0.0}
        at |= {name: ex.evaluate(speed, at) for name, speed in self.eq.speeds.items()}
        return tuple(int(ex.evaluate(g, at) >= 0.0) for g in self.eq.kinks)

    def _look_at_the_end_of_a_motion(self) -> str:
        """Follow the motion from the declared initial state: it may settle where no start was
        near."""
        from stickslip.motion.simulate import simulate

        try:
            motion = simulate(self.system, parameters=self.values)
        except StickslipError:
            return ""  # no motion starts from the declared initial state
        y = np.array(list(motion.final.values()))
        self.starts = y[:, None]
        modes = {mode for mode, _ in self.looked}
        self.looked -= {(mode, self._region(y)) for mode in modes}
        self._look_everywhere((mode, self._region(y)) for mode in modes)
        return (
            f", and the end of the motion from the initial state at t = {motion.knots.time[-1]:g}"
        )

    # -- one mode and region -----------------------------------------------------------------------

    def _look(self, mode: Mode, region: Region) -> None:
        field = self._field(mode, region)
        if self._rests(mode):
            self._look_for_rest(mode, region)
        elif field is not None:
            self._look_for_steady_motion(field)

    def _rests(self, mode: Mode) -> bool:
        """Return whether contacts stick in a mode, and none slides."""
        sticks = False
        for i, (c, m) in enumerate(zip(self.eq.contacts, mode, strict=True)):
            if c.opens or self.eq.is_loose(i, mode):
                continue
            turns = bool(c.speed.symbols & frozenset(self.state))
            if m != 0 or not (turns or surface_speed(c, self.values) == 0.0):
                return False
            sticks = True
        return sticks

    def _look_for_rest(self, mode: Mode, region: Region) -> None:
        if mode not in self.polyhedral:
            whole = all_stick(self.eq, mode, None, self.values)
            self.polyhedral[mode] = whole.affine_by_regions(self.eq.kinks)
            if not self.polyhedral[mode]:
                self._cover(whole, mode)
        if self.covered.get((mode, None)):
            return
        conditions = all_stick(self.eq, mode, region, self.values)
        forces = len(conditions.unknowns) - len(self.state)
        starts = self.starts[:, :1] if conditions.affine else self.starts[:, :8]
        for y in starts.T:
            centre = conditions.centre(np.append(y, np.zeros(forces)))
            if centre is not None:
                self._note_set(conditions, centre, mode, region)

    def _look_for_steady_motion(self, field: Field) -> None:
        steady = Steady(field, self.values, self.invariant, self.origin)
        residual = steady.residual()
        conditions = self._conditions(steady)
        if not conditions.affine_by_regions(()) and self._cover(
            conditions, field.mode, field.region
        ):
            return
        starts = self.starts[:, :1] if residual.affine else self.starts
        for y, rank in search.zeros(residual, starts, self.origin):
            if rank < len(y):
                centre = conditions.centre(y)
                if centre is not None and np.all(self._beyond(steady, centre) >= 0.0):
                    self._note_set(conditions, centre, field.mode, field.region)
            else:
                self._note_isolated(steady, y)

    def _cover(self, conditions: Conditions, mode: Mode, region: Region | None = None) -> bool:
        """Add all sets of a mode, in one region or in all; return whether these are proved to be
        all.

        In a region without free states, equilibria are isolated.
        """
        if (mode, region) not in self.covered:
            self.covered[mode, region] = self._covered(conditions, mode, region)
        return self.covered[mode, region]

    def _covered(self, conditions: Conditions, mode: Mode, region: Region | None) -> bool:
        try:
            parts = cover(conditions, self.invariant, self.origin, self.box)
        except Irreducible as reason:
            return reason.empty
        if region is not None and parts.isolated:
            return False
        if parts.undecided:
            self.undecided.append(parts.undecided)
        for part in parts.found:
            self._note_part(conditions, part, mode, region)
        return bool(parts.found) or not parts.undecided

    def _conditions(self, steady: Steady) -> Conditions:
        field = steady.field
        equal = [*steady.field.rates, *steady.field.constraints]
        if self.invariant.shape[1]:
            across = np.linalg.svd(self.invariant.T)[2][self.invariant.shape[1] :]
            rows = [
                [(f, float(w)) for f, w in zip(field.rates, row, strict=True) if w != 0.0]
                for row in across
            ]
            equal = [*(ex.add(*row) for row in rows), *field.constraints]
        guards = tuple(g.value for g in field.guards)
        return Conditions(field.state, tuple(equal), guards, self.values, field.state)

    # -- what was found ----------------------------------------------------------------------------

    def _note_isolated(self, steady: Steady, y: Array) -> None:
        y = steady.settled(y)
        field = steady.field
        point = steady.point(y)
        if any(
            not low <= y[self.state.index(name)] <= high for name, (low, high) in self.box.items()
        ):
            return
        beyond = self._beyond(steady, y)
        if np.any(beyond < 0.0):
            worst = int(np.argmin(beyond))
            self._note_failure(field, y, float(beyond[worst]), field.guards[worst])
            at = {**self.values, **self._named(y), "t": 0.0}
            region = tuple(int(ex.evaluate(g, at) >= 0.0) for g in field.kinks)
            self.waiting.append((field.mode, region))
            return
        margins = steady.sizes(point[:, None]).margins[0]
        guards = [g for g, m in zip(field.guards, margins, strict=True) if abs(m) <= ON_BOUNDARY]
        nearest = (
            describe_guard(self.eq, field.guards[int(np.argmin(margins))], field.mode)
            if len(margins)
            else ""
        )
        certificate, error = certify_equilibrium(steady, point, nearest)
        found = Equilibrium(
            self._named(y),
            dict(self.values),
            self.contacts,
            field.mode,
            field.region,
            tuple(complex(z) for z in steady.eigenvalues(point)),
            self._drift(steady.drift(point)),
            tuple(describe_guard(self.eq, g, field.mode) for g in guards),
            certificate,
            error,
            self._normal_forces(field, y),
            self.eq.turned(field.region),
        )
        units = np.maximum(np.maximum(np.abs(self.origin), np.abs(y)), _LEAST_UNIT)
        for other in self.isolated:
            apart = (np.array(list(other.state.values())) - y) / units
            # The same point may be found on both sides of a boundary.
            if np.max(np.abs(apart)) < _SAME_POINT and (
                other.boundary or (other.mode, other.region) == (field.mode, field.region)
            ):
                return
        self.isolated.append(found)

    def _beyond(self, steady: Steady, y: Array) -> Array:
        """Margins of the guards, relative to their terms: the speed of a slip must be positive,
        other guards may be zero.

        A slip of speed zero is at the boundary of a stick set, and is reported as part of it.
        """
        guards = steady.field.guards
        kinks = len(steady.field.kinks)
        least = [ON_BOUNDARY if g.switch >= kinks and g.to == 0 else -ON_BOUNDARY for g in guards]
        return steady.sizes(steady.point(y)[:, None]).margins[0] - np.array(least)

    def _note_failure(self, field: Field, y: Array, margin: float, guard: Guard) -> None:
        if margin > self.nearest[0]:
            state = ", ".join(f"{name} = {value:.6g}" for name, value in self._named(y).items())
            modes = modes_text(named_modes(self.contacts, field.mode, self.eq.turned(field.region)))
            broken = describe_guard(self.eq, guard, field.mode)
            self.nearest = (
                margin,
                f"nearest: {modes} at {state}, beyond the boundary ({broken})",
            )

    def _note_part(
        self, conditions: Conditions, part: CoveredSet, mode: Mode, region: Region | None
    ) -> None:
        """Add a covered set, with kinks or within one region."""
        kinks = [at_rest(self.eq, g) for g in self.eq.kinks]
        over = valued(kinks, self.state, self.values, part.inside).T >= 0.0
        regions = tuple(dict.fromkeys(tuple(map(int, row)) for row in over))
        if region is None:
            conditions = all_stick(self.eq, mode, regions[0], self.values)
        centre = conditions.completed(part.state)
        if centre is None:
            self.undecided.append(
                f"no forces were found in equilibrium at {self._named(part.state)}"
            )
            return
        if part.undecided and not part.error <= _KNOWN:
            self._note_set(conditions, centre, mode, regions[0])
            return
        residuals = (
            Residual("extent", part.error, _KNOWN, note="of its size"),
            Residual("undecided boxes next to it", float(part.undecided), 0.0),
        )
        within = regions if region is None else (region,)
        new = self._set(conditions, centre, mode, within, part.dimension, part.extent, residuals)
        new = replace(new, repeats=part.repeats)
        if region is None:
            self.sets.append(new)
        else:
            self._join(new, conditions)

    def _field(self, mode: Mode, region: Region) -> Field | None:
        try:
            return mode_field(self.eq, mode, region)
        except ZeroDivisionError:
            return None

    def _note_set(self, conditions: Conditions, centre: Array, mode: Mode, region: Region) -> None:
        """Add a polyhedron, or the part of another set that can be followed from an interior
        point."""
        n = len(self.state)
        exact = conditions.affine
        for _ in range(0 if exact else _POLISH):
            value, slopes = conditions.equations(centre)
            centre = centre - np.linalg.lstsq(slopes, value, rcond=None)[0]
        if not exact:
            if any(
                s.mode == mode and is_within(s.extent, self._named(centre[:n]))
                for s in self.sets
                if not s.exact
            ):
                return
            modes = modes_text(named_modes(self.contacts, mode, self.eq.turned(region)))
            self.undecided.append(f"sets with {modes} were continued from interior points only")
        extent = {name: conditions.extent(centre, i) for i, name in enumerate(self.state)}
        size = dimension(conditions, n, centre)
        followed = () if exact else (Residual("parts not examined", 1.0, 0.0),)
        self._join(
            self._set(conditions, centre, mode, (region,), size, extent, followed), conditions
        )

    def _set(
        self,
        conditions: Conditions,
        centre: Array,
        mode: Mode,
        regions: tuple[Region, ...],
        size: int,
        extent: dict[str, tuple[float, float]],
        residuals: tuple[Residual, ...],
    ) -> EquilibriumSet:
        field = self._field(mode, regions[0])
        y = centre[: len(self.state)]
        drift = {}
        eigenvalues = None
        if field is not None:
            steady = Steady(field, self.values, self.invariant, self.origin)
            point = steady.point(y)
            drift = self._drift(steady.drift(point))
            every = sorted(steady.eigenvalues(point), key=abs)
            along = size - self.invariant.shape[1]
            eigenvalues = tuple(
                complex(z) for z in sorted(every[along:], key=lambda z: (-z.real, -z.imag))
            )
        measured = certify_set(conditions, centre)
        return EquilibriumSet(
            self._named(y),
            dict(self.values),
            self.contacts,
            mode,
            regions,
            size,
            extent,
            all(r.ok for r in residuals),
            eigenvalues,
            drift,
            replace(measured, residuals=(*measured.residuals, *residuals)),
            self._normal_forces(field, y),
            turned=self.eq.turned(regions[0]),
        )

    def _join(self, new: EquilibriumSet, conditions: Conditions) -> None:
        """Add a set of a region, joined with the sets of the same mode in other regions that it
        intersects.

        A linear program decides whether polyhedra intersect; for other sets, extents decide only on
        a line.
        """
        extent = new.extent
        joined: list[_Piece] = [(extent, conditions)]
        for other, pieces in list(self.pieces):
            near = [p for e, p in pieces if other.mode == new.mode and touch(extent, e)]
            told = conditions.affine and all(p.affine for p in near)
            if not near or (told and not any(conditions.meets(p) for p in near)):
                continue
            self.pieces.remove((other, pieces))
            self.sets.remove(other)
            joined += pieces
            hull = {
                name: (min(a[0], b[0]), max(a[1], b[1]))
                for (name, a), b in zip(other.extent.items(), new.extent.values(), strict=True)
            }
            larger = other if other.dimension >= new.dimension else new
            sure = told or larger.dimension <= 1
            certificate = worst([other.certificate, new.certificate])
            if not sure:
                guess = Residual("parts joined by their extents", 1.0, 0.0)
                certificate = replace(certificate, residuals=(*certificate.residuals, guess))
            new = replace(
                larger,
                regions=tuple(dict.fromkeys([*other.regions, *new.regions])),
                extent=hull,
                exact=other.exact and new.exact and sure,
                certificate=certificate,
            )
        self.sets.append(new)
        self.pieces.append((new, joined))

    def _normal_forces(self, field: Field | None, y: Array) -> dict[str, float]:
        """Normal forces of the closed contacts in a mode, as far as the state determines them."""
        at = {**self.values, **self._named(y), "t": 0.0}
        if field is None:
            return {}
        pairs = zip(field.contacts, field.mode, strict=True)
        closed = [c for c, m in pairs if c.gap is not None and m == 0]
        return {c.name: ex.evaluate(c.force, at) for c in closed}

    def _named(self, y: Array) -> dict[str, float]:
        return dict(zip(self.state, map(float, y), strict=True))

    def _drift(self, rates: Array) -> dict[str, float]:
        return {name: v for name, v in self._named(rates).items() if v != 0.0}
