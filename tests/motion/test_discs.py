"""Disc arithmetic against complex arithmetic: no row strays further than its bound, and the bound
is not idle."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from scipy import special

from flows import taylor_series
from stickslip import System, Viscous
from stickslip.motion.discs.spreading import spread, spread_state
from stickslip.motion.discs.tables import BALL, OFF, DiscTape
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.problem import Problem, pose
from stickslip.motion.steps.arrays import Instant
from stickslip.motion.steps.step_size import fill_powers

# Forces as formulas, and as functions of complex time t and position x.
FORCES: dict[str, Callable[[complex, complex], complex]] = {
    "exp(-((t - 1)/0.3)**2)": lambda t, x: np.exp(-(((t - 1) / 0.3) ** 2)),
    "sin(3*t + x0)": lambda t, x: np.sin(3 * t + x),
    "cos(2*t)*x0": lambda t, x: np.cos(2 * t) * x,
    "tanh((t - 0.7)/0.2)": lambda t, x: np.tanh((t - 0.7) / 0.2),
    "1/(1 + ((t - 1)/0.5)**2)": lambda t, x: 1 / (1 + ((t - 1) / 0.5) ** 2),
    "log(2 + t + x0**2)": lambda t, x: np.log(2 + t + x**2),
    "sqrt(3 + t)*exp(x0)": lambda t, x: np.sqrt(3 + t) * np.exp(x),
    "(2 + t)**1.7": lambda t, x: (2 + t) ** 1.7,
    "atan(t + x0)": lambda t, x: np.arctan(t + x),
    "asinh(2*t - x0)": lambda t, x: np.arcsinh(2 * t - x),
    "erf(2*t - x0)": lambda t, x: special.erf(2 * t - x),
    "sinh(t)/cosh(x0)": lambda t, x: np.sinh(t) / np.cosh(x),
    "tan(0.4*t)": lambda t, x: np.tan(0.4 * t),
    "x0**7 - t**3": lambda t, x: x**7 - t**3,
}


@cache
def problem() -> Problem:
    """A coordinate for every force, so that its rate is the force."""
    names = [f"x{i}" for i in range(len(FORCES))]
    return pose(System(
        "forces",
        coordinates={x: Viscous(force=f) for x, f in zip(names, FORCES, strict=True)},
        viscous=" + ".join(f"d_{x}**2/2" for x in names),
    ))  # fmt: skip


@pytest.mark.parametrize("radius", [1e-3, 0.03, 0.15])
@pytest.mark.parametrize("t", [0.0, 0.6, 1.3])
def test_rows_stay_in_their_discs(t: float, radius: float) -> None:
    p = problem()
    flow = p.flow()
    space = flow.space
    none = np.zeros(0, np.int64)
    n = len(FORCES)
    k = p.constants
    y = np.linspace(0.2, 0.9, n)
    resolve(p.rows, k, space, none)
    taylor_series(p.machine, flow, Instant(t, y, none, none), p.order, space.W)
    fill_powers(space.reaches, radius)
    space.discs[n, BALL] = radius
    space.discs[n, OFF] = 0.0
    spread_state(space.W, p.order, space.reaches, p.rows.watched[:n], space.discs)
    program = p.rows.program
    inverses = (space.Rq, space.Rz, space.B)
    tape = DiscTape(
        program, k.K, space.W, space.discs, *inverses, space.balls, space.reaches, p.order
    )
    spread(tape, none, none, 0, len(program.code))
    # An analytic function strays most on the circle; the position is the polynomial that stands in
    # the table.
    circle = radius * np.exp(2j * np.pi * np.arange(64) / 64)
    x = np.polyval(space.W[0, : p.order + 1][::-1], circle)
    for i, force in enumerate(FORCES.values()):
        values = np.array([force(t + tau, at) for tau, at in zip(circle, x, strict=True)])
        strays = np.max(np.abs(values - force(t, y[0])))
        bound = space.discs[p.rows.program.rates[i], :2].sum()
        assert strays <= bound * (1 + 1e-12) + 1e-15
        if radius < 0.01:
            assert bound <= 20 * strays + 1e-12
