"""A system with parameter values and tolerances, the input of the computation of a motion."""

from __future__ import annotations

import math
import struct
import threading
import weakref
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.layout import ORDERS
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property, made_once
from stickslip.model.declaration import check_initial
from stickslip.model.system import System
from stickslip.motion.affine.forms import (
    MOST_SWITCHES,
    bytes_of_form,
    make_closed_forms,
    make_flight,
)
from stickslip.motion.affine.kept_modes import FEWEST_KEPT
from stickslip.motion.affine.kept_slopes import scaling_constants
from stickslip.motion.rows import guards_of, layout_rows
from stickslip.motion.steps.arrays import (
    DIMENSION,
    FORMULA,
    MASSIVE,
    Constants,
    Flow,
    Machine,
    Rows,
    Space,
    make_space,
)
from stickslip.numerics.levels import LEAST_RTOL
from stickslip.stopping.scopes import flagged
from stickslip.structures.coordinates import start_of
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.enclosures import bounds

if TYPE_CHECKING:
    from stickslip.equations.native.systems import CompiledSystem
    from stickslip.motion.affine.forms import ClosedForms, Flight

_FINEST = 1e-16  # tolerance of local errors: less than half of ε, below which steps only shrink
# smallest `atol` in any units: squares of values compared with it do not underflow
_LEAST_ATOL = 1e-30
_LEAST_UNIT = 1e-6  # smallest size relative to which errors of a state are measured, if atol ≪ rtol

MOTION_SLOTS = 64  # largest number of modes with a closed form for one set of parameters


class _WorkSpaces(threading.local):
    """Work space of a thread, for one motion after the other."""

    space: Space | None = None
    flight: Flight | None = None

    def __reduce__(self) -> tuple[type[_WorkSpaces], tuple[()]]:
        # A copy starts with an empty work space: the contents are temporary.
        return _WorkSpaces, ()


# largest number of work spaces of a system, each for one order and one number of guards
_MOST_BENCHES = 4
_MOST_ADMISSIBLE = 64  # largest number of admissible parameter sets of a system that are stored
_MOST_CONSTANTS = 4  # largest number of sets of matrices of a system
_MOST_ROWS = 64  # largest number of sets of rows of a system; required rows depend on parameters
_CURVE_SLOTS = 8  # the same along a curve, where no two problems share them; most need fewer
_FEW_SWITCHES = 2  # number of contacts and kinks up to which these are enough for large systems
# closed forms of the latest problems of a system are kept, about so many bytes, but for so many
# problems at least
_FORMS_BYTES, _FEWEST_FORMS = 2**27, 3
# largest number of states of a motion in closed form; the cost per mode is cubic in it
_MOST_STATES = 400
_MOST_STATES_OF_MANY = 24  # the same if many motions have closed forms of their own
# the same with friction in a plane, where only a rest has a closed form and has to repay its cost
_FEW_BESIDE_PLANES = 12


@dataclass(frozen=True)
class Problem:
    """A system with numbers: everything the compiled loop takes.

    Attributes
    ----------
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
        shared = ["compiled", "machine"]
        if self.boxes is not None:
            low, high = self.boxes[parameter]
            if low <= value <= high:
                shared += (
                    ["rows", "_work_spaces"]
                    if self.exact
                    else ["rows", "_work_spaces", "closed_forms"]
                )
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
        """Functions called by compiled code: series, residual, and powers."""
        compiled = self.compiled
        return Machine(compiled.jets, compiled.residual, compiled.powers, compiled.landings)

    def flow(self, constants: Constants | None = None, retracing: bool = False) -> Flow:
        """Arguments of compiled functions, with the work space of this thread: valid for one call.

        Parameters
        ----------
        constants : Constants, optional
            Those of many sets of parameters (a leading axis); by default those of the problem.
        retracing : bool
            Whether a known motion is followed again, between its knots.
        """
        tol, atol = self.retrace if retracing else (self.tolerance, self.atol)
        k = self.constants if constants is None else constants
        bench = self._work_spaces
        space = bench.space = flagged(bench.space or self.space())
        # The previous motion in this work space had other parameters and another unit of time.
        space.known[-1] = 1
        space.W[self.rows.sizes[DIMENSION], 1] = 1.0
        return Flow(self.rows, k, space, self.order, tol, atol, self.compiled.supports)

    @property
    def shared_flight(self) -> Flight:
        """Work space for closed forms in this thread: valid for one call."""
        bench = self._work_spaces
        bench.flight = bench.flight or self.flight()
        return bench.flight

    @cached_property
    def _work_spaces(self) -> _WorkSpaces:
        # Usually the motions of a system are computed sequentially.
        sizes = self.order, len(self.rows.required)
        return made_once(self.compiled, "bench", _WorkSpaces, sizes, _MOST_BENCHES)

    @cached_property
    def constants(self) -> Constants:
        """Constants, mass matrix, viscous matrix, contact directions and drive frequencies for
        these parameters."""
        table = np.array([[self.parameters[name] for name in self.system.parameters]], dtype=float)

        def make() -> Constants:
            return Constants(*(part[0] for part in self.constants_of(table)))

        key = table.tobytes(), self.origin
        return made_once(self.compiled, "constants", make, key, _MOST_CONSTANTS)

    def constants_of(self, table: Array) -> Constants:
        """The same for a table of parameters, shape (groups, parameters): arrays with a leading
        axis."""
        from stickslip.motion.engine.tables import run_setups

        layout = self.compiled.layout
        groups = len(table)
        shapes = made_once(
            self.compiled, "shapes", lambda: [layout.shape(name) for name in Constants._fields]
        )
        constants = Constants(*(np.zeros((groups, *shape)) for shape in shapes))
        run_setups(
            self.compiled.setup, np.column_stack([table, np.full(groups, self.origin)]), constants
        )
        return constants

    @property
    def retrace(self) -> tuple[float, float]:
        """Tolerances for following a motion again between its knots: finer than those that found
        it."""
        return max(1e-2 * self.tolerance, _FINEST), 1e-3 * self.atol

    @cached_property
    def closed_forms(self) -> ClosedForms:
        """Storage of the closed forms of affine modes, filled while the motion is computed, and
        again when they are needed later."""
        # Curves keep the motions of hundreds of problems, each with closed forms of its own.
        layout = self.compiled.layout
        n, contacts, waves = layout.sizes["n"], len(layout.u), layout.frequencies
        guards = layout.sizes["kinks"] + 2 * contacts
        most = _FORMS_BYTES // bytes_of_form(n, guards, contacts, waves)
        few = n < FEWEST_KEPT or contacts + layout.sizes["kinks"] <= _FEW_SWITCHES
        slots = _CURVE_SLOTS if self.boxes is not None and few else MOTION_SLOTS
        found = self.empty_forms(1, slots)
        held = made_once(self.compiled, "problems with closed forms", deque[Any])
        held.append(weakref.ref(self))
        while len(held) > max(most // _CURVE_SLOTS, _FEWEST_FORMS):
            old = held.popleft()()
            if old is not None:
                vars(old).pop("closed_forms", None)
        return found

    def empty_forms(self, groups: int, slots: int) -> ClosedForms:
        """Storage for the closed forms of groups of motions; without slots if the system is too
        large for them."""
        layout = self.compiled.layout
        n = layout.sizes["n"]
        contacts = len(layout.u)
        kinks = len(layout.kinks)
        # Modes of large structures are far apart, and need it; but not in all lanes of a map.
        most = _MOST_STATES if groups == 1 else _MOST_STATES_OF_MANY
        small = contacts + kinks <= MOST_SWITCHES and n <= most and layout.frequencies <= 6
        # Closed forms exclude these, and in a plane they cover only a rest under inertial forces
        # without faces.
        alone = not (layout.gaps or layout.prescribed or layout.together)
        alone = alone and all(p[MASSIVE] == 1 and p[FORMULA] < 0 for p in layout.planes)
        small = small and (n > _FEW_BESIDE_PLANES or not layout.planes)
        slots = slots if small and self.exact and alone else 0
        required, planes = len(self.rows.required), len(layout.planes)
        waves = layout.frequencies
        return make_closed_forms(groups, slots, n, contacts, kinks, required, waves, planes)

    @property
    def has_quadratic_powers(self) -> bool:
        """Whether dissipated and supplied power are quadratic where rates and forces are affine."""
        from stickslip.equations.powers import are_powers_quadratic

        equations = self.compiled.equations
        return made_once(equations, "powers", lambda: are_powers_quadratic(equations))

    def space(self) -> Space:
        """New work space for the Taylor steps."""
        layout = self.compiled.layout
        return flagged(make_space(self.rows, layout.rows, layout.magnitudes, self.order))

    def flight(self, keeps: bool = True) -> Flight:
        """New work space for the closed forms; `keeps`: whether slopes and eigenvectors of modes
        are kept."""
        layout = self.compiled.layout
        known = None
        if keeps and len(layout.state) >= FEWEST_KEPT:
            tape = [*layout.instructions, *layout.shown]
            scaling = scaling_constants(tape, len(layout.state), layout.constants)
            known = scaling, sum(math.prod(layout.shape(name)) for name in ("M", "C", "J"))
        return make_flight(self.rows, layout.frequencies, layout.timed, known)

    @cached_property
    def rows(self) -> Rows:
        """Positions of quantities in the arrays of compiled functions."""
        given = self.boxes or self.parameters

        def make() -> Rows:
            boxes = dict(self.boxes or {name: (v, v) for name, v in self.parameters.items()})
            in_turn = int(self.system.impacts == "in turn")
            own = layout_rows(self.compiled)
            required = self._required(boxes)
            guards = guards_of(own.states, len(own.kinks), len(required))
            return own._replace(required=required, guards=guards, in_turn=in_turn)

        key = self.boxes is None, *given.items(), self.system.impacts
        return made_once(self.compiled, "rows of parameters", make, key, _MOST_ROWS)

    def _required(self, boxes: dict[str, tuple[float, float]]) -> Array:
        """Rows of thresholds that are not nonnegative for every state, and of kinetic laws that may
        be inadmissible, for parameters in boxes."""
        layout = self.compiled.layout
        contacts = self.compiled.equations.contacts
        opening = [i for i, c in enumerate(contacts) if c.opens]
        boxes = boxes | {f"{x}:{i}": (0.0, math.inf) for i in opening for x in ("lambda", "glue")}
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
        given: Mapping[str, float] = initial
        if structures := self.system.written_structures:
            # Values of a call replace declared ones; within each of the two they must not conflict.
            for values in (self.system.initial, initial):
                self.system.check_starts(values, "initial")
            given = start_of(structures, {**self.system.initial, **initial})
        for name, value in given.items():
            check_initial(declaration, name, value, self.system.started_unknowns)
        given = {**self.system.plain.initial, **given}
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
    numbers = checked_values(system, parameters)
    return Problem(system, numbers, *_accuracy(rtol, atol), exact=exact, origin=origin)


def _accuracy(rtol: float, atol: float) -> tuple[int, float, float]:
    """Order of the series, and tolerances of a step."""
    for name, value, low, high in (
        ("rtol", rtol, LEAST_RTOL, 1e-3),
        ("atol", atol, _LEAST_ATOL, 1.0),
    ):
        if not (isinstance(value, (int, float)) and low <= value <= high):
            raise DeclarationError(
                name, f"{value!r} is out of range", f"Choose {name} between {low:g} and {high:g}"
            )
    # Global accuracy: local steps are three digits finer than requested, at little cost with Taylor
    # series.
    tolerance = max(1e-3 * rtol, _FINEST)
    order = min((n for n in ORDERS if n >= -0.95 * math.log(tolerance)), default=ORDERS[-1])
    return order, tolerance, max(atol / rtol, _LEAST_UNIT)


def checked_values(system: System, parameters: Mapping[str, float] | None) -> dict[str, float]:
    """All parameters, checked: once for the same numbers."""
    if not isinstance(system, System):
        raise DeclarationError(
            "system",
            f"expected a System, got {type(system).__name__}",
            "Use ss.load or ss.catalogue",
        )
    values = {**system.values, **(parameters or {})}

    def check() -> dict[str, float]:
        system.declaration.check_parameters(values)
        return {name: float(value) for name, value in values.items()}

    key = _key(values)
    if key is None:
        return check()
    return dict(made_once(system, "admissible", check, key, _MOST_ADMISSIBLE))


def _key(values: Mapping[str, float]) -> tuple[object, ...] | None:
    """Cache key of numbers, by bits and types; None if some are not numbers."""
    try:
        bits = struct.pack(f"{len(values)}d", *values.values())
    except (struct.error, TypeError, ValueError, OverflowError):
        return None
    return (bits, *values, *map(type, values.values()))
