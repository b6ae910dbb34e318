"""Derivatives of motions by complex step: closed forms from switch to switch, whose times are found
in complex arithmetic.

Parameters and initial values are given an imaginary part of 1e-30. Every formula between switches
is analytic, and Newton's method brings the time of a switch to where its guard vanishes as a
complex number, so that imaginary parts are derivatives to all digits, without any difference and
without a word of variations or saltation matrices. Where there is no closed form an independent
integrator follows the motion for a complex while.

References
----------
W. Squire, G. Trapp, *Using complex variables to estimate derivatives of real functions*, SIAM
Review 40 (1998) 110-112.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from stickslip.arrays import Array

STEP = 1e-30
Values = Mapping[str, Any]
State = tuple[Any, ...]


class Exit(NamedTuple):
    """Where a mode ends: a guard that falls to zero, and what comes then, (mode, state)."""

    guard: Callable[[Any, State, Values], Any]
    enter: Callable[[Any, State, Values], tuple[str, State]]


@dataclass(frozen=True)
class ClosedForms:
    """A system that has closed forms in each of its modes.

    Attributes
    ----------
    begin : callable
        First mode and state, of the values.
    flows : dict of str to callable
        ``flow(t, t0, y0, p)``, the state at t of a mode that was entered at t0.
    exits : dict of str to list of Exit
    fine : float
        Between guards are looked at.
    """

    begin: Callable[[Values], tuple[str, State]]
    flows: dict[str, Callable[[Any, Any, State, Values], State]]
    exits: dict[str, list[Exit]]
    fine: float

    def motion(self, values: Values, times: Array) -> tuple[Array, Array]:
        """States at some times, shape (states, times), and times of switches; complex."""
        mode, y = self.begin(values)
        t: Any = 0.0
        switches = []
        states: list[State] = []
        while True:
            met = self._first_exit(mode, t, y, values, times[-1])
            end = np.inf if met is None else met[1].real
            flow = self.flows[mode]
            here = times[len(states) :]
            states += [flow(s, t, y, values) for s in here[here < end]]
            if met is None:
                return np.array(states, complex).T, np.array(switches, complex)
            leave, when = met
            mode, y = leave.enter(when, flow(when, t, y, values), values)
            t = when
            switches.append(when)

    def _first_exit(
        self, mode: str, t: Any, y: State, values: Values, end: float
    ) -> tuple[Exit, Any] | None:
        """The first guard that falls to zero, and when."""
        flow = self.flows[mode]
        first = None
        start = t.real
        steps = int(np.ceil((end - start) / self.fine)) if end > start else 0
        for leave in self.exits[mode]:

            def height(s: Any, leave: Exit = leave) -> Any:
                return leave.guard(s, flow(s, t, y, values), values)

            for i in range(1, steps + 1):
                a, b = start + i * self.fine, start + (i + 1) * self.fine
                assert i > 1 or height(a).real > 0.0, "a mode ends before it is looked at"
                if height(b).real < 0.0:
                    root: Any = brentq(lambda s, f=height: f(s).real, a, b, xtol=1e-14)
                    if root <= end and (first is None or root < first[1].real):
                        first = leave, _complex_root(height, root)
                    break
        return first


def _complex_root(height: Callable[[Any], Any], root: Any) -> Any:
    """The root by Newton's method; the slope needs not be exact for the limit to be."""
    h = 1e-6
    slope = ((height(root + h) - height(root - h)) / (2.0 * h)).real
    for _ in range(4):
        root = root - height(root) / slope
    return root


def by_complex_step(
    system: ClosedForms, values: Mapping[str, float], names: list[str], times: Array
) -> tuple[Array, Array, Array]:
    """Derivatives of states and of times of switches.

    Returns
    -------
    slopes : array, shape (states, times, names)
    switches : array, shape (switches,)
    late : array, shape (switches, names)
    """
    slopes = []
    late = []
    switches = np.zeros(0)
    for name in names:
        moved = {**values, name: values[name] + 1j * STEP}
        states, when = system.motion(moved, times)
        slopes.append(np.imag(states) / STEP)
        late.append(np.imag(when) / STEP)
        switches = np.real(when)
    return np.stack(slopes, -1), switches, np.stack(late, -1)


# -- four systems ----------------------------------------------------------------------------------


def forced_coulomb_oscillator() -> ClosedForms:
    """m x'' + k x + F_c Sign(x') ∋ P cos ωt, from (x, d_x) = (0, 0) with P > F_c."""

    def slip(side: float) -> Callable[[Any, Any, State, Values], State]:
        def flow(t: Any, t0: Any, y: State, p: Values) -> State:
            w = cmath.sqrt(p["k"] / p["m"])
            size = p["P"] / (p["k"] - p["m"] * p["omega"] ** 2)
            middle = -side * p["F_c"] / p["k"]
            a = y[0] - middle - size * cmath.cos(p["omega"] * t0)
            b = (y[1] + size * p["omega"] * cmath.sin(p["omega"] * t0)) / w
            c, s = cmath.cos(w * (t - t0)), cmath.sin(w * (t - t0))
            x = middle + size * cmath.cos(p["omega"] * t) + a * c + b * s
            v = -size * p["omega"] * cmath.sin(p["omega"] * t) + w * (b * c - a * s)
            return x, v

        return flow

    def pull(t: Any, y: State, p: Values) -> Any:
        return p["P"] * cmath.cos(p["omega"] * t) - p["k"] * y[0]

    def comes_to_rest(t: Any, y: State, p: Values) -> tuple[str, State]:
        force = pull(t, y, p).real
        if abs(force) < p["F_c"].real:
            return "stick", (y[0], 0.0)
        return ("forward" if force > 0.0 else "backward"), (y[0], 0.0)

    def starts(mode: str) -> Callable[[Any, State, Values], tuple[str, State]]:
        return lambda t, y, p: (mode, y)

    return ClosedForms(
        lambda p: ("forward", (p["x"], p["d_x"])),
        {"forward": slip(1.0), "backward": slip(-1.0), "stick": lambda t, t0, y, p: y},
        {
            "forward": [Exit(lambda t, y, p: y[1], comes_to_rest)],
            "backward": [Exit(lambda t, y, p: -y[1], comes_to_rest)],
            "stick": [
                Exit(lambda t, y, p: p["F_c"] - pull(t, y, p), starts("forward")),
                Exit(lambda t, y, p: p["F_c"] + pull(t, y, p), starts("backward")),
            ],
        },
        1e-2,
    )


def belt_with_two_frictions() -> ClosedForms:
    """m x'' + c x' + k x = F_k in slip behind a belt of the speed V, up to F_s in stick."""

    def slip(t: Any, t0: Any, y: State, p: Values) -> State:
        decay = p["c"] / (2.0 * p["m"])
        w = cmath.sqrt(p["k"] / p["m"] - decay**2)
        a = y[0] - p["F_k"] / p["k"]
        b = (y[1] + decay * a) / w
        shrunk = cmath.exp(-decay * (t - t0))
        c, s = cmath.cos(w * (t - t0)), cmath.sin(w * (t - t0))
        x = shrunk * (a * c + b * s)
        v = shrunk * w * (b * c - a * s) - decay * x
        return p["F_k"] / p["k"] + x, v

    def sticks(t: Any, y: State, p: Values) -> tuple[str, State]:
        assert abs((p["k"] * y[0] + p["c"] * p["V"]).real) < p["F_s"].real
        return "stick", (y[0], p["V"])

    return ClosedForms(
        lambda p: ("slip", (p["x"], p["d_x"])),
        {"slip": slip, "stick": lambda t, t0, y, p: (y[0] + p["V"] * (t - t0), p["V"])},
        {
            "slip": [Exit(lambda t, y, p: p["V"] - y[1], sticks)],
            "stick": [
                Exit(
                    lambda t, y, p: p["F_s"] - p["k"] * y[0] - p["c"] * p["V"],
                    lambda t, y, p: ("slip", y),
                )
            ],
        },
        1e-2,
    )


def belt_with_stribecks_curve() -> ClosedForms:
    """m x'' + c x' + k x = F_c + (F_s − F_c) exp(−(V − x')/v_s) in slip behind the belt, by DOP853:
    y(t) is reached at s = 1 with dy/ds = (t − t₀) f(y), where t − t₀ is complex."""
    rest = belt_with_two_frictions()

    def slip(t: Any, t0: Any, y: State, p: Values) -> State:
        m, c, k, V, F_s, F_c, v_s = (complex(p[n]) for n in "m c k V F_s F_c v_s".split())
        length = t - t0

        def rates(s: float, now: Array) -> tuple[Any, Any]:
            x, v = now.tolist()
            friction = F_c + (F_s - F_c) * cmath.exp((v - V) / v_s)
            return length * v, length * (friction - c * v - k * x) / m

        start = np.array(y, complex)
        end = solve_ivp(rates, (0.0, 1.0), start, "DOP853", rtol=1e-12, atol=1e-14)
        return tuple(end.y[:, -1])

    return replace(rest, flows={**rest.flows, "slip": slip}, fine=0.4)


def ball_on_a_shaken_plate() -> ClosedForms:
    """y'' = −g above the plate A sin ωt, which it leaves with e times the speed of approach."""

    def flight(t: Any, t0: Any, y: State, p: Values) -> State:
        s = t - t0
        return y[0] + y[1] * s - p["g"] * s**2 / 2.0, y[1] - p["g"] * s

    def rebounds(t: Any, y: State, p: Values) -> tuple[str, State]:
        plate = p["A"] * p["omega"] * cmath.cos(p["omega"] * t)
        return "flight", (y[0], plate - p["e"] * (y[1] - plate))

    return ClosedForms(
        lambda p: ("flight", (p["y"], p["d_y"])),
        {"flight": flight},
        {
            "flight": [
                Exit(lambda t, y, p: y[0] - p["A"] * cmath.sin(p["omega"] * t), rebounds),
            ]
        },
        1e-3,
    )
