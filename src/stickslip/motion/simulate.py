"""From a system and initial values to its motion."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stickslip import expressions as ex
from stickslip.declaration import check_initial
from stickslip.errors import DeclarationError
from stickslip.motion.outcome import Outcome
from stickslip.system import System

CHUNK = 4096  # steps between looks at the clock and the keyboard
Array = np.ndarray


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
        Use closed forms for affine modes; False: Taylor steps everywhere (the two check each other).
    """

    system: System
    parameters: dict[str, float]
    order: int
    tolerance: float
    atol: float
    exact: bool = True

    @cached_property
    def compiled(self):  # noqa: ANN201
        """Machine code and layout of the system."""
        from stickslip.equations.compiled import compile_system

        return compile_system(self.system)

    @cached_property
    def constants(self) -> tuple[Array, Array, Array, Array, Array]:
        """Constants K, mass matrix M, viscous matrix C, contact directions J and drive frequencies ω."""
        from stickslip.motion.engine import run_setup

        layout, s = self.compiled.layout, self.compiled.layout.sizes
        p = np.array([self.parameters[name] for name in self.system.parameters], dtype=float)
        K = np.zeros(max(layout.constants, 1))
        M, C = np.zeros((s["nq"], s["nq"])), np.zeros((s["nz"], s["nz"]))
        J = np.zeros((len(layout.u), s["nq"] + s["nz"] + s["nr"]))
        omega = np.zeros(layout.frequencies)
        run_setup(self.compiled.setup, p, K, M, C, J, omega)
        return K, M, C, J, omega

    @property
    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """K, M, C and J."""
        return self.constants[:4]

    @cached_property
    def closed_forms(self) -> tuple[Array, ...]:
        """Storage of the closed forms of affine modes, filled while the motion is computed."""
        from stickslip.motion import affine

        layout = self.compiled.layout
        switches, n = len(layout.u) + len(layout.kinks), layout.sizes["n"]
        capacity = 64 if self.exact and switches <= 30 and n <= 24 and layout.frequencies <= 6 else 0
        doubtful = len(self.tables[-1])
        return affine.tables(capacity, n, len(layout.u), len(layout.kinks), doubtful, 2 + 2 * layout.frequencies)

    @cached_property
    def tables(self) -> tuple[Array, ...]:
        """Integer tables of the layout: sizes, rows of u, λ, s⁺, s⁻, guards, and the rows that bound the step."""
        layout = self.compiled.layout
        sizes = np.array([layout.sizes[k] for k in ("n", "nq", "nz", "nr", "na", "mq", "mz", "mr", "kinks")])
        rows = [np.array(r, dtype=np.int64) for r in (layout.u, layout.force, layout.plus, layout.minus, layout.kinks)]
        watched = np.unique(np.concatenate(rows)) if any(len(r) for r in rows) else np.zeros(0, np.int64)
        return sizes, *rows, watched[watched >= layout.sizes["n"]], self._doubtful_thresholds()

    def _doubtful_thresholds(self) -> Array:
        """Rows of thresholds that are not nonnegative for every state."""
        boxes = {name: (v, v) for name, v in self.parameters.items()}
        layout, contacts = self.compiled.layout, self.compiled.equations.contacts
        sides = [(layout.plus[i], c.plus) for i, c in enumerate(contacts)] + [(layout.minus[i], c.minus) for i, c in enumerate(contacts)]
        return np.array(sorted({row for row, s in sides if ex.bounds(s, boxes)[0] < 0.0}), dtype=np.int64)

    def initial_state(self, initial: Mapping[str, float]) -> Array:
        """State vector of initial values (declared defaults where none is given)."""
        declaration = self.system.declaration
        for name, value in initial.items():
            check_initial(declaration, name, value)
        given = {**self.system.initial, **initial}
        return np.array([float(given.get(name, 0.0)) for name in declaration.state])


def pose(system: System, parameters: Mapping[str, float] | None = None, rtol: float = 1e-10, atol: float = 1e-12,
         exact: bool = True) -> Problem:
    """Check parameters and tolerances, and bind them to a system.

    Raises
    ------
    DeclarationError
        If a parameter is unknown or not admissible, or a tolerance is not in range.
    """
    if not isinstance(system, System):
        raise DeclarationError("system", f"expected a System, got {type(system).__name__}", "Use ss.load or ss.catalogue")
    values = {**system.values, **{k: v for k, v in (parameters or {}).items()}}
    system.declaration.check_parameters(values)
    for name, value, low, high in (("rtol", rtol, 1e-13, 1e-3), ("atol", atol, 1e-30, 1.0)):
        if not (isinstance(value, (int, float)) and low <= value <= high):
            raise DeclarationError(name, f"{value!r} is out of range", f"Choose {name} between {low:g} and {high:g}")
    # Global quality: local steps are kept three digits finer than asked for; with Taylor series that is nearly free.
    tolerance = max(1e-3 * rtol, 1e-16)
    order = max(8, min(24, math.ceil(-0.5 * math.log(tolerance)) + 1))
    return Problem(system, {k: float(v) for k, v in values.items()}, order, tolerance, max(atol / rtol, 1e-6), exact)


def simulate(system: System, t_span: tuple[float, float] | None = None, initial: Mapping[str, float] | None = None,
             parameters: Mapping[str, float] | None = None, *, rtol: float = 1e-10, atol: float = 1e-12,
             max_events: int = 1_000_000, progress: Callable[[float], None] | None = None):  # noqa: ANN201
    """The motion of a system, switch by switch.

    Parameters
    ----------
    system : System
    t_span : (float, float), optional
        Start and end; by default the system's own span.
    initial : mapping of str to float, optional
        Initial values of coordinates, rates ``d_x`` of inertial coordinates and internal variables; what is not
        given has its declared default, or 0.
    parameters : mapping of str to float, optional
        Values that replace the defaults.
    rtol, atol : float
        Global quality: relative to the size of the motion, and the smallest size that counts.
    max_events : int
        Limit on the number of events.
    progress : callable, optional
        Called now and then with the fraction done.

    Returns
    -------
    Trajectory
        Always; how the computation ended is its ``outcome``.

    Raises
    ------
    DeclarationError
        If an argument is wrong, or the initial state violates |∂Φ| ≤ s of a rate-independent coordinate.
    """
    from stickslip.motion.trajectory import Trajectory

    started = time.perf_counter()
    problem = pose(system, parameters, rtol, atol)
    start, end = check_span(system.span if t_span is None else t_span)
    y = problem.initial_state(initial or {})
    if max_events < 1:
        raise DeclarationError("max_events", f"{max_events} is not positive", "Allow at least one event")
    code, knots = follow(problem, start, end, y, max_events, progress)
    outcome = Outcome.from_code(code)
    if outcome is Outcome.NO_BOUNDED_RATE and len(knots.time) == 1 and knots.time[0] == start:
        check_stable_start(problem, start, y)
    trajectory = Trajectory(problem, (start, end), knots, outcome, rtol)
    trajectory.wall_time = time.perf_counter() - started
    return trajectory


def check_span(span: object) -> tuple[float, float]:
    """Refuse a time span that is none."""
    try:
        start, end = (float(s) for s in span)  # type: ignore[union-attr]
    except (TypeError, ValueError):
        raise DeclarationError("t_span", f"{span!r} is not a time span", "Give (start, end)") from None
    if not (math.isfinite(start) and math.isfinite(end) and start < end):
        raise DeclarationError("t_span", f"({start:g}, {end:g}) is not a time span", "Give start < end, both finite")
    return start, end


def follow(problem: Problem, start: float, end: float, y: Array, max_events: int, progress: Callable[[float], None] | None = None):  # noqa: ANN201
    """Run the compiled loop chunk by chunk; Ctrl-C between two chunks keeps what is done."""
    from stickslip.motion import engine
    from stickslip.motion.closed_form import make_closed_form
    from stickslip.motion.trajectory import Knots

    compiled, layout = problem.compiled, problem.compiled.layout
    nc, nk, n = len(layout.u), len(layout.kinks), len(y)
    clock = np.array([start, 0.0, start, end - start])
    counters = np.array([0, 0, -1, 0, 0], dtype=np.int64)
    y = y.copy()
    mode, settled, reg = np.zeros(nc, np.int64), np.full(nc, 9, np.int64), np.ones(nk, np.int64)
    pieces: list[Knots] = []
    size = 64
    code = engine.FULL
    try:
        while code in (engine.FULL, engine.NEED):
            if code == engine.NEED:
                make_closed_form(problem, mode, reg)
            size = min(2 * size, CHUNK)
            record = Knots.empty(size, n, nc, nk)
            code, count = engine.integrate(
                compiled.jets, compiled.residual, *problem.tables, layout.rows, max(layout.magnitudes, 1), *problem.constants,
                problem.closed_forms, problem.order, problem.tolerance, problem.atol, end, max_events, clock, y, mode, settled, reg, counters, True,
                record.time, record.state, record.mode, record.region, record.cause)
            pieces.append(record.first(count))
            if progress is not None:
                progress((clock[0] - start) / (end - start))
    except KeyboardInterrupt:
        code = Outcome.INTERRUPTED.code
    knots = Knots.joined(pieces) if pieces else Knots.empty(0, n, nc, nk)
    if len(knots.time) == 0 or clock[0] > knots.time[-1]:
        knots = Knots.joined([knots, Knots.single(clock[0], y, mode, reg)])
    return code, knots


def check_stable_start(problem: Problem, start: float, y: Array) -> None:
    """Explain an initial state outside the stable set of the rate-independent coordinates."""
    equations, declaration = problem.compiled.equations, problem.system.declaration
    values = {**problem.parameters, **dict(zip(declaration.state, map(float, y), strict=True)), "t": start}
    acting = [c for c in equations.contacts if c.kind == "rate-independent"]
    for c, force in zip(acting, equations.rate.force, strict=True):
        held = ex.evaluate(force, values)
        plus, minus = ex.evaluate(c.plus, values), ex.evaluate(c.minus, values)
        excess = max(-plus - held, held - minus)
        if excess > 1e-9 * (abs(held) + plus + minus):
            name = next(iter(c.direction))
            raise DeclarationError(
                f"initial.{name}", f"the contact '{c.name}' would have to hold the force {held:.6g}, which exceeds its threshold"
                f" {minus if held > 0 else plus:.6g} by {excess:.6g}", f"Start with '{name}' inside the stable set")
