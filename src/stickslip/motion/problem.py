"""A system with numbers: what a computation of its motion starts from."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.generate import INVERSES, ORDERS
from stickslip.equations.codegen.program import pack
from stickslip.errors import DeclarationError
from stickslip.model.declaration import check_initial
from stickslip.model.system import System
from stickslip.motion.engine.forms import MOST_SWITCHES, make_closed_forms, make_flight
from stickslip.motion.steps.arrays import (
    DIMENSION,
    PART,
    Constants,
    Flow,
    Machine,
    Rows,
    Space,
    make_space,
)
from stickslip.stopping.scopes import flagged
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.enclosures import bounds

if TYPE_CHECKING:
    from stickslip.equations.native.systems import CompiledSystem
    from stickslip.motion.engine.forms import ClosedForms, Flight


MOTION_SLOTS = 64  # modes with a closed form that one set of parameters may have


class _Bench(threading.local):
    """Work space of a thread, for one motion after the other."""

    space: Space | None = None
    flight: Flight | None = None

    def __reduce__(self) -> tuple[type[_Bench], tuple[()]]:
        # What is on it is nobody else's.
        return _Bench, ()


@dataclass(frozen=True)
class Problem:
    """A system with numbers: everything the compiled loop takes.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
    order : int
        Order of the Taylor series.
    tolerance, atol : float
        Local tolerance of a step relative to the size of the state plus `atol`.
    exact : bool
        Use closed forms for affine modes; False: Taylor steps everywhere (the two check each
        other).
    boxes : dict of str to (float, float), optional
        Least and largest value of each parameter, where many sets of parameters share the problem.
    origin : float
        Time at which the clock of the compiled loops starts from 0.
    """

    system: System
    parameters: dict[str, float]
    order: int
    tolerance: float
    atol: float
    exact: bool = True
    boxes: Mapping[str, tuple[float, float]] | None = None
    origin: float = 0.0

    def at(self, parameter: str, value: float) -> Problem:
        """The same problem with another value of a parameter, within the box of this parameter if
        there is one.

        It shares all that does not depend on the value: curves ask for thousands of such problems.
        """
        other = replace(self, parameters={**self.parameters, parameter: value})
        shared = ["compiled", "machine", "_places"]
        if self.boxes is not None:
            low, high = self.boxes[parameter]
            if low <= value <= high:
                shared += ["rows", "_bench"] if self.exact else ["rows", "_bench", "closed_forms"]
            else:
                other = replace(other, boxes={**self.boxes, parameter: (value, value)})
        vars(other).update({name: getattr(self, name) for name in shared})
        return other

    @cached_property
    def compiled(self) -> CompiledSystem:
        """Machine code and layout of the system."""
        from stickslip.equations.native.systems import compile_system

        return compile_system(self.system)

    @cached_property
    def machine(self) -> Machine:
        """What compiled functions call: series, residual, and powers."""
        compiled = self.compiled
        return Machine(compiled.jets, compiled.residual, compiled.powers, compiled.landings)

    def flow(self, constants: Constants | None = None, retracing: bool = False) -> Flow:
        """What compiled functions take, with the work space of this thread: good for one call.

        Parameters
        ----------
        constants : Constants, optional
            Those of many sets of parameters (a leading axis); by default those of the problem.
        retracing : bool
            Whether a known motion is followed again, between its knots.
        """
        tol, atol = self.retrace if retracing else (self.tolerance, self.atol)
        k = self.constants if constants is None else constants
        bench = self._bench
        space = bench.space = flagged(bench.space or self.space())
        # What was followed before had other parameters, and another unit of time.
        space.known[-1] = 1
        space.W[self.rows.sizes[DIMENSION], 1] = 1.0
        return Flow(self.rows, k, space, self.order, tol, atol)

    @property
    def shared_flight(self) -> Flight:
        """What closed forms are followed with in this thread: good for one call."""
        bench = self._bench
        bench.flight = bench.flight or self.flight()
        return bench.flight

    @cached_property
    def _bench(self) -> _Bench:
        return _Bench()

    @cached_property
    def constants(self) -> Constants:
        """Constants, mass matrix, viscous matrix, contact directions and drive frequencies for
        these parameters."""
        table = np.array([[self.parameters[name] for name in self.system.parameters]], dtype=float)
        return Constants(*(part[0] for part in self.constants_of(table)))

    def constants_of(self, table: Array) -> Constants:
        """The same for a table of parameters, shape (groups, parameters): arrays with a leading
        axis."""
        from stickslip.motion.engine.tables import run_setups

        layout = self.compiled.layout
        groups = len(table)
        constants = Constants(
            *(np.zeros((groups, *layout.shape(name))) for name in Constants._fields)
        )
        run_setups(
            self.compiled.setup, np.column_stack([table, np.full(groups, self.origin)]), constants
        )
        return constants

    @property
    def retrace(self) -> tuple[float, float]:
        """Tolerances for following a motion again between its knots: finer than those that found
        it."""
        return max(1e-2 * self.tolerance, 1e-16), 1e-3 * self.atol

    @cached_property
    def closed_forms(self) -> ClosedForms:
        """Storage of the closed forms of affine modes, filled while the motion is computed."""
        return self.empty_forms(1, MOTION_SLOTS)

    def empty_forms(self, groups: int, slots: int) -> ClosedForms:
        """Storage for the closed forms of groups of motions; without slots if the system is too
        large for them."""
        layout = self.compiled.layout
        n = layout.sizes["n"]
        contacts = len(layout.u)
        kinks = len(layout.kinks)
        small = contacts + kinks <= MOST_SWITCHES and n <= 24 and layout.frequencies <= 6
        alone = not (layout.gaps or layout.planes)  # closed forms know neither
        slots = slots if small and self.exact and alone else 0
        doubtful = len(self.rows.doubtful)
        return make_closed_forms(groups, slots, n, contacts, kinks, doubtful, layout.frequencies)

    def space(self) -> Space:
        """New work space for the Taylor steps."""
        layout = self.compiled.layout
        return flagged(make_space(self.rows, layout.rows, layout.magnitudes, self.order))

    def flight(self) -> Flight:
        """New work space for the closed forms."""
        layout = self.compiled.layout
        return make_flight(self.rows, layout.frequencies, layout.timed)

    @cached_property
    def rows(self) -> Rows:
        """Where the compiled functions find things."""
        return self._places._replace(doubtful=self._doubtful())

    @cached_property
    def _places(self) -> Rows:
        """The same, without the rows that may become negative for these parameters."""
        layout = self.compiled.layout
        sizes = np.array(
            [layout.sizes[k] for k in ("n", "nq", "nz", "nr", "na", "mq", "mz", "mr", "kinks")]
        )
        tables = (layout.u, layout.force, layout.plus, layout.minus, layout.kinks)
        u, force, plus, minus, kinks = (np.array(table, dtype=np.int64) for table in tables)
        noise = self._places_of_sizes()
        equations = self.compiled.equations
        pulled = {i for plane in equations.planes if plane.pull for i in plane.parts}
        dropping = {i for i, *_ in layout.kinetic} - pulled
        state = frozenset(layout.state)
        watched = np.array(list(noise), dtype=np.int64)
        return Rows(
            sizes,
            u,
            force,
            plus,
            minus,
            kinks,
            watched,
            np.array(list(noise.values()), dtype=np.int64),
            np.zeros((0, 3), np.int64),
            np.array(
                [not guard.symbols & state for guard in self.compiled.equations.kinks],
                dtype=np.int64,
            ),
            self._vanishing(),
            np.array([c in dropping for c in range(len(u))], dtype=np.int64),
            pack(layout),
            *self._coupling(),
            *self._openings(),
            *self._jumps(),
            *self._planes(),
        )

    def _planes(self) -> tuple[Array, Array]:
        """Contacts in a plane, and the one that each contact is a component of."""
        layout = self.compiled.layout
        table = np.array(layout.planes, dtype=np.int64).reshape(-1, 10)
        plane = np.full(len(layout.u), -1, np.int64)
        for p, (first, second, *_) in enumerate(layout.planes):
            plane[[first, second]] = p
        return table, plane

    def _coupling(self) -> tuple[Array, Array, Array, Array]:
        """The components of the linear problems, what they have as members, where each contact
        is, and which of their directions change on the way."""
        layout = self.compiled.layout
        parts = list[tuple[int, ...]]()
        members = list[int]()
        homes = np.full((len(layout.u), 2), -1, np.int64)
        for matrix, name in enumerate(INVERSES):
            seat = 0
            for part in layout.coupled[name]:
                n, m = len(part.coordinates), len(part.contacts)
                for j, c in enumerate(part.contacts):
                    homes[c] = len(parts), seat + n + j
                parts.append((matrix, seat, n, m, len(members), int(part.moving)))
                members += [*part.coordinates, *part.contacts]
                seat += n + m
        homes[homes[:, PART] < 0, PART] = len(parts)
        table = np.array(parts, dtype=np.int64).reshape(-1, 6)
        turning = np.full((len(layout.u), layout.shape("J")[1]), -1, np.int64)
        for place, row in layout.turning.items():
            turning[place] = row
        return table, np.array(members, dtype=np.int64), homes, turning

    def _openings(self) -> tuple[Array, Array, Array, Array]:
        """Rows of the gaps and of the restitution of contacts, whose friction each is, and the rows
        of its coefficients; −1: of none."""
        layout = self.compiled.layout
        found = tuple(np.full(len(layout.u), -1, np.int64) for _ in range(3))
        tables = (layout.gaps, layout.restitution, layout.parents)
        for array, table in zip(found, tables, strict=True):
            for c, value in table.items():
                array[c] = value
        friction = np.full((len(layout.u), 4), -1, np.int64)
        for c, rows in layout.friction.items():
            friction[c] = rows
        return (*found, friction)  # type: ignore[return-value]

    def _jumps(self) -> tuple[Array, Array]:
        """Jumps of the state, and which parts of it have new values."""
        table = list[tuple[int, ...]]()
        landings = list[int]()
        for kink, direction, places in self.compiled.layout.jumps:
            table.append((kink, direction, len(landings), len(places)))
            landings += places
        return np.array(table, dtype=np.int64).reshape(-1, 4), np.array(landings, dtype=np.int64)

    def _places_of_sizes(self) -> dict[int, int]:
        """Rows that bound the step, with the places of the sizes of their terms: the state, then
        guards."""
        layout = self.compiled.layout
        n = layout.sizes["n"]
        contacts = len(layout.u)
        kinks = len(layout.kinks)
        noise = dict(enumerate(layout.rate_sizes))
        others = {row: -1 for row in (*layout.plus, *layout.minus)}
        others |= {row: 2 * contacts + c for c, row in enumerate(layout.force)}
        others |= {row: c for c, row in enumerate(layout.u)}
        others |= {row: 3 * contacts + j for j, row in enumerate(layout.kinks[:kinks])}
        others |= {row: 3 * contacts + kinks + c for c, row in layout.gaps.items()}
        for c, _, _, admissible, place, *_, slips, _ in layout.planes:
            others |= {slips: c, admissible: place}
        return noise | {row: others[row] for row in sorted(others) if row >= n}

    def _vanishing(self) -> Array:
        """The part of the state that is zero where a kink is, −1 where it is more than that."""
        equations = self.compiled.equations
        state = {name: i for i, name in enumerate(self.compiled.layout.state)}
        felt = state.keys() | {"t"}
        found = []
        for guard in equations.kinks:
            (name, *others) = sorted(guard.symbols & felt) or [""]
            alone = (
                not others
                and name in state
                and ex.substitute(guard, {name: ex.ZERO}, undefined=True) is ex.ZERO
            )
            found.append(
                state[name] if alone and not ex.derivative(guard, name).symbols & {name} else -1
            )
        return np.array(found, dtype=np.int64)

    def _doubtful(self) -> Array:
        """Rows of thresholds that are not nonnegative for every state, and of kinetic laws that may
        be inadmissible."""
        boxes = dict(self.boxes or {name: (v, v) for name, v in self.parameters.items()})
        layout = self.compiled.layout
        contacts = self.compiled.equations.contacts
        boxes |= {f"lambda:{i}": (0.0, math.inf) for i, c in enumerate(contacts) if c.opens}
        sides = [(row, c.plus) for row, c in zip(layout.plus, contacts, strict=True)]
        sides += [(row, c.minus) for row, c in zip(layout.minus, contacts, strict=True)]
        found = {(row, -1, 0) for row, s in sides if bounds(s, boxes)[0] < 0.0}
        planes = {plane.parts[0]: plane for plane in self.compiled.equations.planes}
        for i, side, force, margin in layout.kinetic:
            c = contacts[i]
            static, sliding = (c.plus, c.kinetic_plus) if side > 0 else (c.minus, c.kinetic_minus)
            if i in planes:
                static, sliding = planes[i].static, planes[i].kinetic
            at_rest = ex.substitute(sliding, {f"speed:{i}": ex.ZERO}, undefined=True)
            boxes[f"speed:{i}"] = (0.0, math.inf)
            found |= {(force, i, side)} if bounds(sliding, boxes)[0] < 0.0 else set()
            found |= {(margin, i, side)} if bounds(static - at_rest, boxes)[0] < 0.0 else set()
        return np.array(sorted(found), dtype=np.int64).reshape(-1, 3)

    def initial_state(self, initial: Mapping[str, float]) -> Array:
        """State vector of initial values (declared defaults where none is given)."""
        declaration = self.system.declaration
        for name, value in initial.items():
            check_initial(declaration, name, value)
        given = {**self.system.plain.initial, **initial}
        return np.array([float(given.get(name, 0.0)) for name in declaration.state])


def pose(
    system: System,
    parameters: Mapping[str, float] | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    exact: bool = True,
    origin: float = 0.0,
) -> Problem:
    """Check parameters and tolerances, and bind them to a system.

    Parameters
    ----------
    system : System
    parameters : mapping of str to float, optional
        Values that replace the defaults.
    rtol : float
        Relative accuracy of the motion, between 1e-13 and 1e-3.
    atol : float
        What does not matter, between 1e-30 and 1.
    exact : bool
        See :class:`Problem`.
    origin : float
        Time that clocks count from.

    Raises
    ------
    DeclarationError
        If a parameter is unknown or not admissible, or a tolerance is not in range.
    """
    if not isinstance(system, System):
        raise DeclarationError(
            "system",
            f"expected a System, got {type(system).__name__}",
            "Use ss.load or ss.catalogue",
        )
    values = {**system.values, **{k: v for k, v in (parameters or {}).items()}}
    system.declaration.check_parameters(values)
    for name, value, low, high in (("rtol", rtol, 1e-13, 1e-3), ("atol", atol, 1e-30, 1.0)):
        if not (isinstance(value, (int, float)) and low <= value <= high):
            raise DeclarationError(
                name, f"{value!r} is out of range", f"Choose {name} between {low:g} and {high:g}"
            )
    # Global quality: local steps are kept three digits finer than asked for; with Taylor series
    # that is nearly free.
    tolerance = max(1e-3 * rtol, 1e-16)
    order = min((n for n in ORDERS if n >= -0.95 * math.log(tolerance)), default=ORDERS[-1])
    numbers = {name: float(value) for name, value in values.items()}
    return Problem(system, numbers, order, tolerance, max(atol / rtol, 1e-6), exact, origin=origin)
