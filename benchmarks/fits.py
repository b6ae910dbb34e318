"""Fits of 10,000 samples: ``python benchmarks/fits.py``.

Two records with noise and a known truth: a forced oscillator with dry friction (stops included),
and a block on a belt with Stribeck's curve. Beside ``ss.fit`` stand

* lmfit (Levenberg-Marquardt by MINPACK, finite differences) on the motions of this library;
* lmfit on SciPy's ``solve_ivp``, once from event to event, with modes that are told, and once with
  a regularised sign;
* SciPy's ``least_squares`` on diffrax with a regularised sign, whose derivatives are diffrax's own,
  forward; compiled before time is taken;
* ``mujoco.sysid`` (Gauss-Newton, finite differences) on MuJoCo's motions of the oscillator, if it
  is installed. MuJoCo has no Stribeck curve.

All begin at the same point, within the same bounds. Times are those of the processor, medians of
rounds in which the tools take turns. Errors are those of the estimates in standard errors: against
the truth, which is mostly noise and the same for all, and against the least sum of squares of the
exact motion, which is the fault of the tool alone. Derivatives of the motion at the truth, as each
tool reckons them, are compared with complex steps of closed forms
(``tests/oracles/complex_step.py``) at 200 times. The table goes to ``benchmarks/results/fits.md``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.optimize import least_squares as untyped

import stickslip as ss
from fits_diffrax import Smooth, regularised_motion
from fits_mujoco import SETTINGS, Identification, absent
from motion import machine
from stickslip.arrays import Array

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from oracles import complex_step

RESULTS = Path(__file__).parent / "results" / "fits.md"
trust_region: Any = untyped  # its types say nothing of a function as Jacobian
SAMPLES = 10_000
ROUNDS = 5
RIVALS = ("scipy", "lmfit", "diffrax", "mujoco")
# Of the regularised sign: ten times as wide costs the same, and the estimates are off ten times as
# far. The tolerance of LSODA is the loosest with which lmfit does not stop early, because its
# differences are of noise; diffrax with 1e-6 takes twice as long, and is off 0.02 where it is off
# 0.1 standard errors with 1e-5.
WIDTH = 1e-6
NOTES = [
    "*Error*: the largest error of the estimates, in standard errors. It is mostly due to "
    "the noise of the record, and equal for all tools that find the minimum of the sum of squares. "
    "*Distance from the minimum*: the distance from the minimum for the exact motion, in standard "
    "errors, which is due to the tool. *Error of derivatives*: the largest error at the true "
    "parameters, compared with complex steps of closed forms, in units of the largest derivative "
    "with respect to the same parameter.",
    "",
    "The time of `ss.fit` includes fits to growing parts of the record, intervals, tests of the "
    "residuals and a certificate; with eight starts, the default, it searches the complete box. "
    "The other tools run one search from the given start, and return estimates and standard "
    "errors. For lmfit on `solve_ivp` with events, the boundary that ends each mode and the end of "
    "stick are given.",
    "",
    "In MuJoCo m is the mass of a body, k the stiffness of its slide joint, and F_c the "
    "`frictionloss` of the joint, which MuJoCo regularises; NoSlip then removes the creep. This "
    "friction has one value for stick and slip and does not depend on the speed, so the belt with "
    "Stribeck's curve is not among its models. The fits of `mujoco.sysid` run on one thread.",
]
STEP = 1e-4  # relative, of finite differences: MINPACK's own is lost in the error of the motion


class Leg(NamedTuple):
    """A mode as SciPy is told of it: its field, a height that falls to zero where it ends (or the
    time at which it does), and the next mode there."""

    rates: Callable[[float, Any], Any]
    height: Callable[[float, Any], float]
    then: Callable[[float, Any], str]
    ends: Callable[[float, Any], float] | None = None


@dataclass(frozen=True)
class Case:
    """A record and what is looked for in it.

    Attributes
    ----------
    system : System
    truth, start : dict of str to float
    bounds : dict of str to (float, float)
    end : float
        The record begins at 0.
    noise : float
    first : str
        The first mode.
    legs : callable
        ``legs(p)``, the modes for all parameters p.
    smooth : Smooth
        The regularised field.
    forms : ClosedForms
        For complex steps.
    force : callable, optional
        The force at times, if MuJoCo can represent the friction.
    """

    system: ss.System
    truth: dict[str, float]
    start: dict[str, float]
    bounds: dict[str, tuple[float, float]]
    end: float
    noise: float
    first: str
    legs: Callable[[dict[str, float]], dict[str, Leg]]
    smooth: Smooth
    forms: complex_step.ClosedForms
    force: Callable[[Array], Array] | None = None

    @property
    def names(self) -> list[str]:
        return list(self.truth)

    @cached_property
    def times(self) -> Array:
        return np.linspace(0.0, self.end, SAMPLES)

    @cached_property
    def data(self) -> Array:
        motion = ss.simulate(self.system, (0.0, self.end), parameters=self.truth, rtol=1e-12)
        noise = np.random.default_rng(16).standard_normal(SAMPLES)
        return motion.at(self.times)["x"] + self.noise * noise

    def values(self, p: Array) -> dict[str, float]:
        """All parameters."""
        return {**self.system.values, **dict(zip(self.names, map(float, p), strict=True))}

    @cached_property
    def problem(self) -> ss.FitProblem:
        return ss.fit_problem(
            self.system,
            {"t": self.times, "x": self.data},
            self.bounds,
            noise={"x": self.noise},
            parameters=self.start,
        )

    @cached_property
    def identifications(self) -> dict[str, Identification]:
        """The fits of ``mujoco.sysid``."""
        if self.force is None or absent():
            return {}
        return {
            name: Identification(
                setting, self.times, self.data, self.start, self.bounds, self.force
            )
            for name, setting in SETTINGS.items()
        }


# -- the two systems -------------------------------------------------------------------------------


def oscillator_legs(p: dict[str, float]) -> dict[str, Leg]:
    """Slip in both directions, and stick."""
    m, k, F_c, P, omega = (p[name] for name in ("m", "k", "F_c", "P", "omega"))

    def pull(t: Any, x: float) -> Any:
        return P * np.cos(omega * t) - k * x

    def slip(side: float) -> Leg:
        def then(t: float, y: Any) -> str:
            force = pull(t, y[0])
            return "stick" if abs(force) < F_c else "forward" if force > 0.0 else "backward"

        return Leg(
            lambda t, y: (y[1], (pull(t, y[0]) - side * F_c) / m), lambda t, y: side * y[1], then
        )

    def ends(t: float, y: Any) -> float:
        s = np.linspace(t, t + 4.0 * np.pi / omega, 400)
        height = F_c - np.abs(pull(s, y[0]))
        j = int(np.argmax(height < 0.0))
        end: Any = brentq(lambda s: F_c - abs(pull(s, y[0])), s[j - 1], s[j], xtol=1e-13)
        return end

    stick = Leg(
        lambda t, y: (0.0, 0.0),
        lambda t, y: 1.0,
        lambda t, y: "forward" if pull(t, y[0]) > 0.0 else "backward",
        ends,
    )
    return {"forward": slip(1.0), "backward": slip(-1.0), "stick": stick}


def belt_legs(p: dict[str, float]) -> dict[str, Leg]:
    """Slip behind the belt, and stick."""
    m, c, k, V, F_s, F_c, v_s = (p[n] for n in ("m", "c", "k", "V", "F_s", "F_c", "v_s"))

    def rates(t: float, y: Any) -> Any:
        friction = F_c + (F_s - F_c) * np.exp((y[1] - V) / v_s)
        return y[1], (friction - c * y[1] - k * y[0]) / m

    slip = Leg(rates, lambda t, y: V - y[1], lambda t, y: "stick")
    stick = Leg(
        lambda t, y: (V, 0.0),
        lambda t, y: 1.0,
        lambda t, y: "slip",
        lambda t, y: t + ((F_s - c * V) / k - y[0]) / V,
    )
    return {"slip": slip, "stick": stick}


def cases() -> dict[str, Case]:
    """The two records."""
    oscillator, belt = ss.catalogue.forced_oscillator(), ss.catalogue.belt_stribeck()
    return {
        "forced oscillator": Case(
            oscillator,
            {"m": 1.1, "k": 1.05, "F_c": 0.55},
            {"m": 1.0, "k": 1.0, "F_c": 0.6},
            {"m": (0.5, 2.0), "k": (0.5, 2.0), "F_c": (0.2, 0.9)},
            60.0,
            0.02,
            "forward",
            oscillator_legs,
            Smooth("oscillator", WIDTH),
            complex_step.forced_coulomb_oscillator(),
            lambda t: oscillator.values["P"] * np.cos(oscillator.values["omega"] * t),
        ),
        "belt, Stribeck": Case(
            belt,
            {"k": 1.1, "F_s": 1.05, "F_c": 0.45, "v_s": 0.35},
            {"k": 1.0, "F_s": 1.0, "F_c": 0.5, "v_s": 0.4},
            {"k": (0.5, 2.0), "F_s": (0.7, 1.5), "F_c": (0.2, 0.69), "v_s": (0.1, 1.0)},
            50.0,
            0.01,
            "slip",
            belt_legs,
            Smooth("belt", WIDTH),
            replace(complex_step.belt_with_stribecks_curve(), fine=0.1),
        ),
    }


# -- motions ---------------------------------------------------------------------------------------


def by_stickslip(case: Case, p: Array, times: Array) -> Array:
    """The positions, as somebody simulates who knows nothing of fits here."""
    motion = ss.simulate(case.system, (0.0, case.end), parameters=case.values(p), rtol=1e-9)
    return motion.at(times)["x"]


def by_events(case: Case, p: Array, times: Array) -> Array:
    """``solve_ivp`` from event to event."""
    legs = case.legs(case.values(p))
    t, y, mode = 0.0, np.zeros(2), case.first
    out = np.empty(len(times))
    done = 0
    while done < len(times):
        leg = legs[mode]
        if leg.ends is not None:
            end = leg.ends(t, y)
            last = int(np.searchsorted(times, end))
            velocity, _ = leg.rates(t, y)
            out[done:last] = y[0] + velocity * (times[done:last] - t)
            y = np.array([y[0] + velocity * (end - t), velocity])
        else:
            height: Any = partial(leg.height)
            height.terminal = True
            height.direction = -1
            found: Any = solve_ivp(
                leg.rates,
                (t, times[-1]),
                y,
                "DOP853",
                dense_output=True,
                events=height,
                rtol=1e-8,
                atol=1e-10,
            )
            end = found.t[-1] if found.status == 1 else np.inf
            last = int(np.searchsorted(times, end))
            if last > done:
                out[done:last] = found.sol(times[done:last])[0]
            y = found.y[:, -1]
        done, t = last, end
        if done < len(times):
            mode = leg.then(t, y)
    return out


def by_regularisation(case: Case, p: Array, times: Array) -> Array:
    """``solve_ivp`` with a regularised sign."""
    field = case.smooth.field(case.values(p), np)
    found: Any = solve_ivp(
        field, (0.0, case.end), np.zeros(2), "LSODA", t_eval=times, rtol=1e-10, atol=1e-12
    )
    return found.y[0]


# -- fits ------------------------------------------------------------------------------------------


def by_lmfit(case: Case, motion: Callable[[Case, Array, Array], Array]) -> Array:
    """Levenberg-Marquardt with forward differences."""
    lmfit: Any = import_module("lmfit")
    unknowns = lmfit.Parameters()
    for name, (low, high) in case.bounds.items():
        unknowns.add(name, case.start[name], min=low, max=high)

    def residuals(given: Any) -> Array:
        p = np.array([given[name].value for name in case.names])
        return (motion(case, p, case.times) - case.data) / case.noise

    found = lmfit.minimize(residuals, unknowns, epsfcn=STEP**2)
    return np.array([found.params[name].value for name in case.names])


def by_diffrax(case: Case, motion: Any) -> Array:
    """A trust region with derivatives of diffrax."""
    low, high = np.array(list(case.bounds.values())).T
    found = trust_region(
        lambda p: (motion.values(p) - case.data) / case.noise,
        np.array(list(case.start.values())),
        lambda p: motion.slopes(p) / case.noise,
        (low, high),
        x_scale="jac",
    )
    return found.x


def by_fit(case: Case, starts: int) -> Array:
    """``ss.fit``, with everything that it says of its result."""
    found = ss.fit(
        case.system,
        {"t": case.times, "x": case.data},
        case.bounds,
        noise={"x": case.noise},
        parameters=case.start,
        starts=starts,
    )
    return np.array(list(found.estimate.values()))


def forward_differences(case: Case, motion: Callable[[Case, Array, Array], Array]) -> Any:
    """Derivatives as lmfit takes them."""

    def slopes(p: Array, times: Array) -> Array:
        here = motion(case, p, times)
        steps = STEP * np.abs(p)
        moved = [motion(case, p + h * e, times) for h, e in zip(steps, np.eye(len(p)), strict=True)]
        return (np.array(moved) - here).T / steps

    return slopes


# -- the table -------------------------------------------------------------------------------------


def rows(name: str, case: Case) -> list[str]:
    """One record: all tools in turn."""
    smooth = regularised_motion(case.smooth, case.system.values, case.names, case.times)
    tools: dict[str, Callable[[], Array]] = {
        "`ss.fit`, one start": lambda: by_fit(case, 1),
        "`ss.fit`, eight starts": lambda: by_fit(case, 8),
        "lmfit, differences of our motions": lambda: by_lmfit(case, by_stickslip),
        "lmfit, `solve_ivp` with events": lambda: by_lmfit(case, by_events),
        "lmfit, `solve_ivp` regularised": lambda: by_lmfit(case, by_regularisation),
        "diffrax regularised": lambda: by_diffrax(case, smooth),
        **{name: tool.fit for name, tool in case.identifications.items()},
    }
    truth = np.array(list(case.truth.values()))
    exact = trust_region(
        case.problem.residuals, truth, case.problem.jacobian, x_scale="jac", xtol=1e-15, ftol=1e-15
    )
    error = np.sqrt(np.diag(np.linalg.inv(exact.jac.T @ exact.jac)))
    seconds: dict[str, list[float]] = {tool: [] for tool in tools}
    found: dict[str, Array] = {}
    for round_ in range(ROUNDS + 1):  # the first one compiles
        for tool, call in tools.items():
            begin = time.process_time()
            found[tool] = call()
            if round_:
                seconds[tool].append(time.process_time() - begin)
    wrong = slope_errors(case, smooth)
    base = median(seconds["`ss.fit`, one start"])
    made = []
    for tool in tools:
        spent = median(seconds[tool])
        off = np.max(np.abs(found[tool] - truth) / error)
        own = np.max(np.abs(found[tool] - exact.x) / error)
        made.append(
            f"| {name} | {tool} | {spent:.2f} | {spent / base:.2f} | {off:.2f} | {own:.1e} | "
            f"{wrong[tool]:.1e} |"
        )
        print(made[-1], flush=True)
    return made


def slope_errors(case: Case, smooth: Any) -> dict[str, float]:
    """Largest error of derivatives at the truth, in units of the largest derivative by each
    parameter."""
    chosen = np.arange(SAMPLES)[50::50]
    times = case.times[chosen]
    p = np.array(list(case.truth.values()))
    values = {**case.values(p), "x": 0.0, "d_x": 0.0}
    expected = complex_step.by_complex_step(case.forms, values, case.names, times)[0][0]
    size = np.max(np.abs(expected), axis=0)
    ours = case.problem.jacobian(p)[chosen] * case.noise
    reckoned = {
        "`ss.fit`, one start": ours,
        "`ss.fit`, eight starts": ours,
        "lmfit, differences of our motions": forward_differences(case, by_stickslip)(p, times),
        "lmfit, `solve_ivp` with events": forward_differences(case, by_events)(p, times),
        "lmfit, `solve_ivp` regularised": forward_differences(case, by_regularisation)(p, times),
        "diffrax regularised": smooth.slopes(p)[chosen],
        **{name: tool.slopes(p, chosen) for name, tool in case.identifications.items()},
    }
    return {tool: float(np.max(np.abs(J - expected) / size)) for tool, J in reckoned.items()}


def quicker(measured: list[str]) -> str:
    """Who takes less time than ``ss.fit`` from one start."""
    cells = [[cell.strip() for cell in row.split("|")] for row in measured]
    found = [f"{c[2]} ({c[1]}: {c[4]})" for c in cells if float(c[4]) < 1.0]
    return f"Faster than `ss.fit` from one start: {'; '.join(found) or 'none'}."


def versioned(package: str) -> str:
    """A package with its version."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return f"{package} is not installed"


def main() -> None:
    """Measure, print and write the table."""
    measured = [row for name, case in cases().items() for row in rows(name, case)]
    text = [
        "# Fits",
        "",
        f"{machine()}, {', '.join(map(versioned, RIVALS))}; {SAMPLES:,} samples, processor "
        "times, measured alternately in one run (`python benchmarks/fits.py`).",
        "",
        "| record | tool | seconds | times `ss.fit` | error, σ | distance from the minimum, σ | "
        "error of derivatives |",
        "|---|---|---|---|---|---|---|",
        *measured,
        "",
        *NOTES,
        "",
        quicker(measured),
        "",
        *([absent(), ""] if absent() else []),
    ]
    RESULTS.write_text("\n".join(text), encoding="utf-8")


if __name__ == "__main__":
    main()
