"""Other tools on two motions with friction in a plane: a puck that is thrown, and a floor on
sliding bearings that is shaken in two directions.

No tool here knows friction in a plane but by a smooth law in its place, k u/√(|u|² + ε²). That is
given to SciPy's Radau and to heyoka at several lengths ε, each with the tolerance that its error
asks for: their rows are for the errors that they reach. ``python benchmarks/motion.py planes``
measures them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss

Array = NDArray[np.float64]
Run = Callable[[], tuple[Array, int]]
LENGTHS = (1e-2, 1e-4, 1e-6)  # of the smooth law, in the unit of velocities
BATCH = 500  # motions in one call


@dataclass(frozen=True)
class Motion:
    """A motion, and its accelerations without friction as a function of time and state.

    Attributes
    ----------
    title : str
    system : System
    span : float
    friction : float
        The friction force over the mass.
    pull : callable
        Accelerations from t, x, y and the sine and the exponential of a tool.
    """

    title: str
    system: ss.System
    span: float
    friction: float
    pull: Callable[..., tuple[Any, Any]]


def _puck_pull(t: Any, x: Any, y: Any, sin: Any, exp: Any) -> tuple[Any, Any]:
    return 0.3 / 0.2 + 0.0 * t, 0.0 * t


def _floor_pull(t: Any, x: Any, y: Any, sin: Any, exp: Any) -> tuple[Any, Any]:
    envelope = t * t / 9.0 * exp(2.0 - 2.0 * t / 3.0)
    turn = 2.0 * np.pi
    east = 2.5 * envelope * (sin(0.9 * turn * t) + 0.6 * sin(2.1 * turn * t + 1.0))
    north = 1.8 * envelope * (sin(0.6 * turn * t + 2.0) + 0.7 * sin(1.7 * turn * t))
    stiffness = 9.81 / 1.5
    return -east - stiffness * x, -north - stiffness * y


MOTIONS = (
    Motion("puck", ss.catalogue.puck(), 3.0, 0.2 * 9.81, _puck_pull),
    Motion("isolated floor", ss.catalogue.isolated_floor(), 15.0, 0.05 * 9.81, _floor_pull),
)


def start(motion: Motion) -> Array:
    """The first state: x, y, ẋ, ẏ."""
    initial = motion.system.initial
    return np.array([float(initial.get(name, 0.0)) for name in ("x", "y", "d_x", "d_y")])


def by_stickslip(motion: Motion, rtol: float = 1e-10) -> Run:
    """``simulate`` with everything a user gets."""

    def run() -> tuple[Array, int]:
        found = ss.simulate(motion.system, (0.0, motion.span), rtol=rtol)
        return found.knots.state[-1], found.n_switches

    return run


def by_loop(motion: Motion) -> Run:
    """The compiled loop over a batch of equal motions on one core."""
    from stickslip.motion.problem import pose
    from stickslip.motion.simulate_many import follow_all

    problem = pose(motion.system)
    states = np.tile(problem.initial_state({}), (BATCH, 1))
    table = np.tile(list(problem.parameters.values()), (BATCH, 1))

    def run() -> tuple[Array, int]:
        now, *_ = follow_all(problem, table, states, (0.0, motion.span), 10**6, 1)
        return now.y[0], int(now.counters[0, 1])

    return run


def by_scipy(motion: Motion, length: float) -> Run:
    """Radau on the smooth law."""
    from scipy.integrate import solve_ivp

    def rates(t: float, y: Array) -> list[float]:
        east, north = motion.pull(t, y[0], y[1], np.sin, np.exp)
        over = motion.friction / np.sqrt(y[2] ** 2 + y[3] ** 2 + length**2)
        return [y[2], y[3], east - over * y[2], north - over * y[3]]

    tolerance = min(1e-4, 1e-2 * length)

    def run() -> tuple[Array, int]:
        found = solve_ivp(
            rates,
            (0.0, motion.span),
            start(motion),
            "Radau",
            rtol=tolerance,
            atol=1e-2 * tolerance,
        )
        return found.y[:, -1], 0

    return run


def by_heyoka(motion: Motion, length: float) -> Run:
    """Taylor series of the smooth law, which is stiff: steps are as short as ε/k asks."""
    import heyoka

    x, y, v, w = heyoka.make_vars("x", "y", "v", "w")
    east, north = motion.pull(heyoka.time, x, y, heyoka.sin, heyoka.exp)
    over = motion.friction / heyoka.sqrt(v * v + w * w + length**2)
    system = [(x, v), (y, w), (v, east - over * v), (w, north - over * w)]
    integrator = heyoka.taylor_adaptive(system, start(motion), tol=min(1e-6, 1e-2 * length))

    def run() -> tuple[Array, int]:
        integrator.time = 0.0
        integrator.state[:] = start(motion)
        integrator.propagate_until(motion.span)
        return integrator.state.copy(), 0

    return run


def table(time_interleaved: Callable[..., dict[str, float]]) -> list[str]:
    """Table of both motions, and what the errors are against."""
    lines = [
        "| motion | tool | µs per motion | times stickslip (loop) | error | switches |",
        "|---|---|---|---|---|---|",
    ]
    tools: dict[str, Callable[[Motion, float], Run]] = {"SciPy, Radau": by_scipy}
    try:
        import heyoka  # noqa: F401
    except ImportError:
        pass
    else:
        tools["heyoka"] = by_heyoka
    for motion in MOTIONS:
        reference, _ = by_stickslip(motion, 1e-13)()
        size = np.max(np.abs(reference[:2]))
        runs: dict[str, Run] = {
            "stickslip, loop": by_loop(motion),
            "stickslip, simulate": by_stickslip(motion),
        }
        for name, tool in tools.items():
            for length in LENGTHS if name != "heyoka" else LENGTHS[:2]:
                runs[f"{name}, ε = {length:g} m/s"] = partial(_once, tool(motion, length))
        results = {name: run() for name, run in runs.items()}
        seconds = time_interleaved(runs, rounds=3)
        own = seconds["stickslip, loop"] / BATCH
        for name, spent in seconds.items():
            state, switches = results[name]
            each = spent / (BATCH if name.endswith("loop") else 1)
            off = np.max(np.abs(state[:2] - reference[:2])) / size
            lines.append(
                f"| {motion.title} | {name} | {each * 1e6:.1f} | {each / own:.1f} | {off:.1e} | "
                f"{switches or ''} |"
            )
    return [
        *lines,
        "",
        "Errors are those of the last place, against stickslip at rtol = 1e-13; for the puck that "
        "is the closed form to rounding (`tests/references/test_planar_friction.py`).",
    ]


def _once(run: Run) -> tuple[Array, int]:
    return run()
