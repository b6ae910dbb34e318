"""Other tools on the three motions of ``benchmarks/motion.py``, each set up as its own manual
advises.

Every tool follows a motion in the same way: integrate one mode, stop at its boundary, change a few
parameters of the field, go on. The modes are written down once, as :class:`Switching`, and favour
the rivals: they are told which boundary ends which mode, so that none of them has to search among
the legs or to decide the corner of (4.2) that is touched on every return swing.

The tolerances are the loosest of a scan from which on the error of the end state stays below 1e-10.
The error is not monotone in the tolerance, so that a looser one may pass by luck; such a one is not
taken.

``python benchmarks/rivals.py`` prints the time per cycle of each; a benchmark takes :data:`RIVALS`
and interleaves the runs with its own.
"""

from __future__ import annotations

import importlib
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference_values import PROBLEMS, Problem

Run = Callable[[], tuple[NDArray[np.float64], int]]
"""A motion from start to end: -> final state, number of switches."""


# --- The motions ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Switching:
    """A plane field with parameters `p` that change where the motion crosses a boundary.

    Attributes
    ----------
    rates, boundary : callable
        ``rates(x, y, p)`` is the field, ``boundary(x, y, p)`` vanishes at the next switch; of
        numbers or of symbols.
    begin : callable
        ``begin(p)`` fills `p` for time 0 and returns the side, +1 or -1, to which the boundary will
        be crossed first.
    switch : callable
        ``switch(state, side, p)`` fills `p` for the mode behind a boundary that was crossed to
        `side`, and returns the side of the next crossing.
    final : callable
        ``final(state)`` completes the plane state to the state of the problem.
    size : int
        Number of parameters.
    """

    rates: Callable[[Any, Any, Any], tuple[Any, Any]]
    boundary: Callable[[Any, Any, Any], Any]
    begin: Callable[[Any], float]
    switch: Callable[[Any, float, Any], float]
    final: Callable[[Any], NDArray[np.float64]] = np.array
    size: int = 1


def slider(problem: Problem, exp: Callable[[Any], Any]) -> Switching:
    """Return (3.3) with k = alpha_0 = 1: the boundary is U = mu(alpha), p[0] is 1/nu in slip and 0
    in stick."""
    V, nu, mu_inf, mu_1, alpha_mu = (
        problem.parameters[name] for name in ("V", "nu", "mu_inf", "mu_1", "alpha_mu")
    )
    steepness, slip = 1 / alpha_mu, 1 / nu

    # The excess U - mu(alpha) is written out twice because a call costs the tools with Python
    # callbacks some percent; heyoka recognises the common subexpression.
    def rates(U: Any, alpha: Any, p: Any) -> tuple[Any, Any]:
        G = p[0] * (U - mu_inf - mu_1 * exp((1 - alpha) * steepness))
        return V - G, 1 - alpha + U * G

    def boundary(U: Any, alpha: Any, p: Any) -> Any:
        return U - mu_inf - mu_1 * exp((1 - alpha) * steepness)

    def begin(p: Any) -> float:
        p[0] = 0.0
        return 1.0

    def switch(state: Any, side: float, p: Any) -> float:
        p[0] = slip if side > 0 else 0.0
        return -side

    return Switching(rates, boundary, begin, switch)


def scaled_slider(problem: Problem, exp: Callable[[Any], Any]) -> Switching:
    """Return (3.6): the boundary is beta = 0, p[0] is 1 in slip and 0 in stick."""
    nu, b, mu_0, v_hat = (problem.parameters[name] for name in ("nu", "b", "mu_0", "v_hat"))
    drive = v_hat / nu * (1 - b * math.sqrt(nu))
    growth = b / math.sqrt(nu)
    healing = 1 / (nu * mu_0)

    def rates(beta: Any, gamma: Any, p: Any) -> tuple[Any, Any]:
        slip = p[0] * beta
        return drive + growth * slip - healing * gamma, mu_0 * slip - gamma

    def boundary(beta: Any, gamma: Any, p: Any) -> Any:
        return beta

    def begin(p: Any) -> float:
        p[0] = 1.0  # beta = 0 at the start, and rising
        return -1.0

    def switch(state: Any, side: float, p: Any) -> float:
        p[0] = 1.0 if side > 0 else 0.0
        return -side

    return Switching(rates, boundary, begin, switch)


def rocking_toy(problem: Problem, exp: Callable[[Any], Any]) -> Switching:
    """Return (4.2) in its simple regime: psi'' = p[0] - delta psi' - p[1] psi (I_b = 1), the
    boundary is psi = p[2].

    From (4.2b,c): on d = G_L^+ the left leg moves forward and d falls, on d = G_R^- the right leg
    moves forward and d rises. On the ramp of H these bounds are +-top + slope psi. A leg starts
    where psi meets its bound, rising for the left and falling for the right one, and stops where
    the ramp ends, at psi = +-psi_star.
    """
    delta, a, b, c = (problem.parameters[name] for name in ("delta", "a", "b", "c"))
    P, rho, psi_star, H_star = (
        problem.parameters[name] for name in ("P", "rho", "psi_star", "H_star")
    )
    slope = (c - H_star / (2 * psi_star)) / a
    top = (rho - P + H_star / 2) / a
    softened = b - c * slope
    x_R = x_L = psi_start = 0.0
    sliding = False

    def rates(psi: Any, d_psi: Any, p: Any) -> tuple[Any, Any]:
        return d_psi, p[0] - delta * d_psi - p[1] * psi

    def boundary(psi: Any, d_psi: Any, p: Any) -> Any:
        return psi - p[2]

    def stick(side: float, p: Any) -> float:
        d = x_R - x_L
        p[0] = c * d
        p[1] = b
        p[2] = (d - side * top) / slope
        return side

    def begin(p: Any) -> float:
        nonlocal x_R, x_L, sliding
        _, _, x_R, x_L = problem.initial
        sliding = False
        return stick(1.0, p)

    def switch(state: Any, side: float, p: Any) -> float:
        nonlocal x_R, x_L, psi_start, sliding
        psi = float(state[0])
        sliding = not sliding
        if sliding:
            psi_start = psi
            p[0] = c * side * top
            p[1] = softened
            p[2] = side * psi_star
            return side
        if side > 0:
            x_L -= slope * (psi - psi_start)
        else:
            x_R += slope * (psi - psi_start)
        return stick(-side, p)

    def final(state: Any) -> NDArray[np.float64]:
        moved = slope * (state[0] - psi_start) if sliding else 0.0
        return np.array([*state, x_R + max(moved, 0.0), x_L - min(moved, 0.0)])

    return Switching(rates, boundary, begin, switch, final, size=3)


MOTIONS: Mapping[str, Callable[[Problem, Callable[[Any], Any]], Switching]] = {
    "A": slider,
    "B": scaled_slider,
    "C": rocking_toy,
}


# --- The tools ------------------------------------------------------------------------------------


def prepare_heyoka(problem: Problem, motion: Callable[..., Switching], **options: Any) -> Run:
    """Compile one integrator whose event callback changes the parameters in place: quicker than one
    for each mode."""
    import heyoka

    switching = motion(problem, heyoka.exp)
    start = np.array(problem.initial[:2])
    x, y = heyoka.make_vars("x", "y")
    p = [heyoka.par[i] for i in range(switching.size)]
    switch = switching.switch
    switches = 0

    def callback(_: Any, side: int) -> bool:
        nonlocal switches
        switches += 1
        switch(state, side, parameters)
        return True  # go on

    integrator = heyoka.taylor_adaptive(
        list(zip((x, y), map(heyoka.expression, switching.rates(x, y, p)), strict=True)),
        start,
        pars=np.zeros(switching.size),
        t_events=[heyoka.t_event(switching.boundary(x, y, p), callback=callback)],
        **options,
    )
    # The views are taken once: fetching them anew at each event made B and C a third slower.
    state, parameters = integrator.state, integrator.pars
    switching.begin(parameters)
    starts_on_boundary = (
        float(motion(problem, math.exp).boundary(start[0], start[1], parameters)) == 0.0
    )

    def run() -> tuple[NDArray[np.float64], int]:
        nonlocal switches
        # heyoka reports such a start as an event; it changes nothing
        switches = -1 if starts_on_boundary else 0
        integrator.time = 0.0
        integrator.reset_cooldowns()
        state[:] = start
        switching.begin(parameters)
        integrator.propagate_until(problem.span)
        return switching.final(state), switches

    return run


def prepare_cvode(problem: Problem, motion: Callable[..., Switching], **options: Any) -> Run:
    """Set up CVODE with a root function, reinitialised at each switch."""
    from sksundae.cvode import CVODE  # type: ignore[import]

    switching = motion(problem, math.exp)
    rates, boundary = switching.rates, switching.boundary
    start = np.array(problem.initial[:2])
    p = [0.0] * switching.size
    side = 1.0

    def field(t: float, state: NDArray[np.float64], rate: NDArray[np.float64]) -> None:
        # plain floats are quicker than numpy's, and as quick as a compiled function called here
        x, y = state.tolist()
        rate[0], rate[1] = rates(x, y, p)

    def event(t: float, state: NDArray[np.float64], value: NDArray[np.float64]) -> None:
        x, y = state.tolist()
        value[0] = side * boundary(x, y, p)

    event.direction = [1]  # type: ignore[attr-defined]

    def run() -> tuple[NDArray[np.float64], int]:
        nonlocal side
        # A new solver for each run (under 1 % of its time): an old one keeps all events that it has
        # ever met.
        solver = CVODE(field, eventsfn=event, num_events=1, max_num_steps=100_000, **options)
        side = switching.begin(p)
        switches = 0
        now = 0.0
        state = start
        while True:
            solver.init_step(now, state)
            result = solver.step(problem.span, "normal", problem.span)
            if not result.success:
                raise RuntimeError(f"CVODE: {result.message}")
            now, state = result.t, result.y
            if result.status != 2:  # 2: stopped at a root
                return switching.final(state), switches
            side = switching.switch(state, side, p)
            switches = switches + 1

    return run


def prepare_scipy(problem: Problem, motion: Callable[..., Switching], **options: Any) -> Run:
    """Set up ``solve_ivp`` with a terminal event, called again after each switch."""
    from scipy.integrate import solve_ivp

    switching = motion(problem, math.exp)
    rates, boundary = switching.rates, switching.boundary
    start = np.array(problem.initial[:2])
    p = [0.0] * switching.size
    side = 1.0

    def field(t: float, state: NDArray[np.float64]) -> tuple[float, float]:
        x, y = state.tolist()  # as above
        return rates(x, y, p)

    def event(t: float, state: NDArray[np.float64]) -> float:
        x, y = state.tolist()
        return side * boundary(x, y, p)

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = 1  # type: ignore[attr-defined]

    def run() -> tuple[NDArray[np.float64], int]:
        nonlocal side
        side = switching.begin(p)
        switches = 0
        now = 0.0
        state = start
        while True:
            result = solve_ivp(field, (now, problem.span), state, events=event, **options)
            if not result.success:
                raise RuntimeError(f"solve_ivp: {result.message}")
            now = result.t[-1]
            state = result.y[:, -1]
            if result.status != 1:  # 1: stopped at an event
                return switching.final(state), switches
            side = switching.switch(state, side, p)
            switches = switches + 1

    return run


# --- The table ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Rival:
    """One tool on one motion.

    Attributes
    ----------
    setup : callable
        One of the ``prepare_...`` functions.
    problem : Problem
        What is run.
    motion : callable
        The motion of `problem` as a :class:`Switching`.
    options : mapping
        Method and tolerances, in the words of the tool.
    """

    setup: Callable[..., Run]
    problem: Problem
    motion: Callable[..., Switching]
    options: Mapping[str, Any] = field(default_factory=dict)

    def prepare(self) -> Run:
        """Build and compile all that can be used again, and return the run to be timed."""
        return self.setup(self.problem, self.motion, **self.options)


@dataclass(frozen=True)
class Tool:
    """A tool: the module it needs, how it is set up, and its options for each problem."""

    module: str
    setup: Callable[..., Run]
    options: Mapping[str, Mapping[str, Any]]


TOOLS: Mapping[str, Tool] = {
    # compact_mode costs half as much again in fields this small, fast_math saves a third on A and
    # some 7 % on B and C. Error at tol 1e-8 and 1e-9 (the time hardly depends on it): A 3e-10,
    # 2e-11; B 6e-10, 3e-12; C 4e-10, 4e-11.
    "heyoka": Tool(
        "heyoka",
        prepare_heyoka,
        {name: {"tol": 1e-9, "fast_math": True} for name in "ABC"},
    ),
    # At equal tolerance BDF takes up to four times as long as Adams and its error is larger; GMRES
    # takes up to twice as long as the dense solver. Most of the time goes into calling the
    # functions in Python, some 400 to 850 times a cycle, so that this says little of CVODE called
    # from C; functions compiled by numba are no quicker here. Error at the next looser tolerance: A
    # 1.8e-10 (1e-12), B 0.9e-10 by luck (3e-12), C 1.2e-10 (5e-13).
    "CVODE": Tool(
        "sksundae",
        prepare_cvode,
        {
            "A": {"method": "Adams", "rtol": 3e-13, "atol": 3e-13},
            "B": {"method": "Adams", "rtol": 1e-12, "atol": 1e-12},
            "C": {"method": "Adams", "rtol": 3e-13, "atol": 3e-13},
        },
    ),
    # At equal tolerance RK45 takes five to six times as long as DOP853 and Radau more than ten
    # times; LSODA takes 10 to 30 % longer to the same error. Compiled functions are no quicker.
    # Error at the next looser tolerance: A 1.0e-10 (3e-12), B 1.3e-10 (1e-11), C 1.2e-10 (3e-12).
    "SciPy": Tool(
        "scipy.integrate",
        prepare_scipy,
        {
            "A": {"method": "DOP853", "rtol": 2e-12, "atol": 2e-12},
            "B": {"method": "DOP853", "rtol": 5e-12, "atol": 5e-12},
            "C": {"method": "DOP853", "rtol": 2e-12, "atol": 2e-12},
        },
    ),
}


def find_rivals() -> tuple[dict[str, dict[str, Rival]], dict[str, str]]:
    """Return the rivals that are installed, by tool and problem, and for each other tool the reason
    of its absence."""
    rivals, absent = {}, {}
    for name, tool in TOOLS.items():
        try:
            importlib.import_module(tool.module)
        except ImportError as error:
            absent[name] = f"{tool.module} cannot be imported: {error}"
        else:
            rivals[name] = {
                key: Rival(tool.setup, PROBLEMS[key], MOTIONS[key], options)
                for key, options in tool.options.items()
            }
    return rivals, absent


RIVALS, ABSENT = find_rivals()


def time_interleaved(
    runs: Mapping[str, Run], rounds: int = 7, shortest: float = 0.02
) -> dict[str, float]:
    """Time several runs in turn, so that a change of the machine's pace meets all of them.

    Parameters
    ----------
    runs : mapping of str to callable
        What is timed; each is called once before.
    rounds : int
        Number of timings of each.
    shortest : float
        A timing repeats a run until about this many seconds have passed.

    Returns
    -------
    dict of str to float
        Median of the seconds per call.
    """
    repeats = {}
    for name, run in runs.items():
        run()
        begin = time.perf_counter()
        run()
        repeats[name] = max(1, round(shortest / (time.perf_counter() - begin)))
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            begin = time.perf_counter()
            for _ in range(repeats[name]):
                run()
            seconds[name].append((time.perf_counter() - begin) / repeats[name])
    return {name: median(values) for name, values in seconds.items()}


def main() -> None:
    """Print time per cycle, error and number of switches of each rival."""
    print(f"{'tool':<8} {'problem':<22} {'µs per cycle':>12} {'error':>9} {'switches':>9}")
    for key, problem in PROBLEMS.items():
        runs = {name: rivals[key].prepare() for name, rivals in RIVALS.items()}
        for name, seconds in time_interleaved(runs).items():
            state, switches = runs[name]()
            microseconds = 1e6 * seconds / problem.cycles
            title = f"{key} {problem.title}"
            print(
                f"{name:<8} {title:<22} {microseconds:>12.1f} {problem.error(state):>9.1e} "
                f"{switches:>9}"
            )
    for name, reason in ABSENT.items():
        print(f"{name}: {reason}")


if __name__ == "__main__":
    main()
