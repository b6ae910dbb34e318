"""Cycles of dampers behind springs beside harmonic balance: ``python
benchmarks/harmonic_balance.py``.

The catalogue's ``jenkins_oscillator``, and its ``cantilever`` of 16 elements reduced to 20
coordinates, under a harmonic force. The rival is our own, as the literature has it, with all that
helps it: linear parts are eliminated exactly, so that the harmonics of the damper's displacement
are the only unknowns; even ones are left out, since the cycles are symmetric; the force of the
damper follows from samples of half a period (alternating frequency and time), by a scan of clipped
sums that NumPy does in log2 N passes; Newton's method has the exact derivative of that, and starts
from one harmonic, and before that from the linear response with a damper that sticks. Each number
of harmonics has the fewest samples with which twice as many change the error by less than a
quarter, and the fewest that reach a goal.

Errors are those of the amplitude (largest displacement of the mass, or of the tip), against the
certified cycle, which is itself followed for a period by matrix exponentials. Times are the least
of rounds in which all take turns, of the processor, in one process: a point alone, and points of a
response with ten frequencies, each of which starts from the one before. To
``benchmarks/results/harmonic_balance.md`` and ``harmonic_balance.png``, with the machine named.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

import stickslip as ss
from stickslip.errors import ConvergenceError
from stickslip.palette import LINES

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from adversarial.references.linear import Body, Touch, follow

Array = Any
RESULTS = Path(__file__).parent / "results"
HARMONICS = (1, 3, 7, 21, 63)
SAMPLES = tuple(2**k for k in range(3, 15))  # of half a period
ROUNDS = 5
CLOSE = 1e-10  # Newton's steps, relative
MOST_STEPS = 60
GOALS = (1e-3, 1e-6)
POINTS = 10  # of a response
NOTES = [
    "One Jenkins element under a harmonic force, in steady motion "
    "(`python benchmarks/harmonic_balance.py`). The harmonic balance is our own implementation: "
    "linear parts are eliminated exactly, only odd harmonics of the damper's displacement are "
    "unknown, its force is computed from samples of half a period, and Newton's method uses their "
    "exact derivative. Errors are those of the amplitude. stickslip returns a cycle with a "
    "certificate, its multipliers and its modes; harmonic balance returns harmonics. A point of a "
    f"response starts from the previous cycle, of {POINTS} frequencies between 0.9 "
    "and 1.1 times that of the single point. Times are processor times, minima of "
    f"{ROUNDS} rounds.",
    "",
    "Goals were a point in no more time than harmonic balance at an error of 1e-3, and in a tenth "
    "of its time at 1e-6. Both are missed. Except for the oscillator at 1e-3, they cannot be "
    "reached: the motion of a period, of which Newton's method needs at least three, takes 0.15 ms "
    "for the oscillator and 0.6 ms for the beam, and its audit 0.07 and 1.8 ms. Harmonic balance "
    "with one damper has as many unknowns as harmonics, whatever the number of modes.",
    "",
    "Contacts without a spring are not included. Their force jumps when a slip reverses, so its "
    "harmonics decrease only like 1/h, and the alternating frequency/time method needs a spring in "
    "series with them, or a regularised law.",
    "",
]
FEW = 32  # samples of half a period, for a start
FINE = 512  # samples of a period for amplitudes, refined by Newton's method


@dataclass(frozen=True)
class Problem:
    """A linear structure under a harmonic force, with one Jenkins element.

    Attributes
    ----------
    system : System
        What stickslip gets.
    seen, unit : str
        Whose amplitude it is.
    omega, force, limit, stiffness : float
    modes : list of str
        Coordinates of unit mass.
    matrices : tuple of arrays
        Of these: squares of frequencies, damping, and what the damper and the load see.
    response : callable
        For an angular frequency: displacements of the damper by a force at the damper and by one at
        the load, and of what is seen by both.
    """

    system: ss.System
    seen: str
    unit: str
    omega: float
    force: float
    limit: float
    stiffness: float
    response: Callable[[Array], tuple[Array, Array, Array, Array]]
    modes: list[str]
    matrices: tuple[Array, Array, Array, Array]


def oscillator() -> Problem:
    """One mass."""
    system = ss.catalogue.jenkins_oscillator()
    p = system.values

    def response(omega: Array) -> tuple[Array, Array, Array, Array]:
        found = 1.0 / (p["k"] - p["m"] * omega**2 + 1j * p["c"] * omega)
        return found, found, found, found

    return Problem(
        system,
        "x",
        "m",
        p["omega"],
        p["P"],
        p["F_c"],
        p["k_d"],
        response,
        ["x"],
        (np.array([p["k"]]), np.array([p["c"]]), np.ones(1), np.ones(1)),
    )


def beam() -> Problem:
    """A cantilever of 16 elements by twenty coordinates: the damper, the tip, and 18 modes."""
    whole = ss.catalogue.cantilever(16)
    body: Any = whole.structures["u"]
    body = body.reduced(["rub", "tip"], 18)
    system = replace(whole, structures={"u": body})
    p = system.values
    rub, tip = (body.modes[body.indices[name]] for name in ("rub", "tip"))

    def response(omega: Array) -> tuple[Array, Array, Array, Array]:
        w = np.asarray(omega)[..., None]
        gains = 1.0 / (body.squares - w**2 + 1j * w * body.modal_damping)
        across = (gains * rub * tip).sum(-1)
        return (gains * rub * rub).sum(-1), across, across, (gains * tip * tip).sum(-1)

    return Problem(
        system,
        "u[tip]",
        "m",
        p["omega"],
        p["F"],
        p["F_c"],
        p["k_d"],
        response,
        [f"u_mode_{i}" for i in range(1, len(rub) + 1)],
        (body.squares, body.modal_damping, rub, tip),
    )


# -- harmonic balance ------------------------------------------------------------------------------


class Balance:
    """Harmonic balance with odd harmonics up to one, and samples of half a period."""

    def __init__(self, problem: Problem, highest: int, samples: int) -> None:
        self.problem = problem
        self.samples = samples
        self.orders = np.arange(1, highest + 1, 2)
        angles = np.pi / samples * np.arange(samples)
        self.waves = waves_of(self.orders, angles)
        self.analysis = 2.0 / samples * self.waves.T  # of what changes its sign in half a period
        self.fine = waves_of(self.orders, 2.0 * np.pi / FINE * np.arange(FINE))

    def cycle(self, omega: float, start: Array | None = None) -> tuple[Array, float]:
        """Harmonics of the damper's displacement, and the amplitude of what is seen.

        Raises
        ------
        RuntimeError
            If Newton's method does not converge.
        """
        p = self.problem
        own, driven, across, seen = p.response(self.orders * omega)
        load = np.zeros(2 * len(self.orders))
        load[0], load[len(self.orders)] = p.force * driven[0].real, -p.force * driven[0].imag
        matrix = as_real(own)
        x = self.begun(omega, own[0], driven[0]) if start is None else start
        held, slopes = self.damper(x)
        off = x + matrix @ (self.analysis @ held) - load
        for _ in range(MOST_STEPS):
            step = np.linalg.solve(np.eye(len(x)) + matrix @ (self.analysis @ slopes), off)
            part, size = 1.0, np.linalg.norm(off)
            while True:  # less of the step where all of it leads astray
                held, slopes = self.damper(x - part * step)
                there = x - part * step + matrix @ (self.analysis @ held) - load
                if part < 1e-3 or np.linalg.norm(there) < size:
                    break
                part /= 2.0
            x, off = x - part * step, there
            if np.linalg.norm(step) <= CLOSE * np.linalg.norm(x):
                break
        else:
            raise RuntimeError("no convergence")
        force = as_complex(self.analysis @ held)
        found = -across * force
        found[0] += p.force * seen[0]
        return x, self.amplitude(found)

    def begun(self, omega: float, own: complex, driven: complex) -> Array:
        """Where Newton's method starts: the solution with one harmonic and few samples, and for
        that a damper that sticks."""
        x = np.zeros(2 * len(self.orders))
        if len(self.orders) > 1:
            x[:: len(self.orders)], _ = Balance(self.problem, 1, FEW).cycle(omega)
            return x
        p = self.problem
        stuck = p.force * driven / (1.0 + p.stiffness * own)
        x[:] = stuck.real, -stuck.imag
        return x

    def damper(self, x: Array) -> tuple[Array, Array]:
        """Forces of the damper at the samples, and their derivatives by the harmonics."""
        k, limit = self.problem.stiffness, self.problem.limit
        u = self.waves @ x
        moved = k * np.diff(u, prepend=-u[-1])
        add, low, high = scanned(moved, limit)
        # what it is at the end, it was at the begin with the other sign
        first = -np.clip(0.0, low[-1], high[-1])
        for _ in range(4):
            first = -np.clip(first + add[-1], low[-1], high[-1])
        held = np.clip(first + add, low, high)
        slips = np.abs(held) >= limit
        if not np.any(slips):
            return k * u, k * self.waves
        last = np.maximum.accumulate(np.where(slips, np.arange(len(u)), -1))
        turned = np.where(last < 0, -1.0, 1.0)
        since = np.where(last < 0, np.flatnonzero(slips)[-1], last)
        return held, k * (self.waves - turned[:, None] * self.waves[since])

    def amplitude(self, harmonics: Array) -> float:
        """The largest value of a sum of harmonics."""
        parts = np.concatenate([harmonics.real, -harmonics.imag])
        angle = 2.0 * np.pi / FINE * int(np.argmax(self.fine @ parts))
        turns = harmonics * 1j * self.orders
        for _ in range(3):
            at = np.exp(1j * self.orders * angle)
            slope = float((turns * at).real.sum())
            angle -= slope / float((turns * 1j * self.orders * at).real.sum())
        return float((harmonics * np.exp(1j * self.orders * angle)).real.sum())


def waves_of(orders: Array, angles: Array) -> Array:
    """Cosines and sines as columns."""
    turns = np.outer(angles, orders)
    return np.hstack([np.cos(turns), np.sin(turns)])


def as_real(gains: Array) -> Array:
    """Complex gains as a matrix for parts of cosines and sines."""
    real, imaginary = np.diag(gains.real), np.diag(gains.imag)
    return np.block([[real, imaginary], [-imaginary, real]])


def as_complex(parts: Array) -> Array:
    """Parts of cosines and sines as amplitudes of exp(i h ω t)."""
    half = len(parts) // 2
    return parts[:half] - 1j * parts[half:]


def scanned(moved: Array, limit: float) -> tuple[Array, Array, Array]:
    """All of s → clip(s + moved, −limit, limit) up to each sample, as clip(s + add, low, high)."""
    add = moved.copy()
    low, high = np.full(len(moved), -limit), np.full(len(moved), limit)
    width = 1
    while width < len(moved):
        later = add[width:].copy(), low[width:].copy(), high[width:].copy()
        before = add[:-width].copy(), low[:-width].copy(), high[:-width].copy()
        add[width:] = before[0] + later[0]
        low[width:] = np.clip(before[1] + later[0], later[1], later[2])
        high[width:] = np.clip(before[2] + later[0], later[1], later[2])
        width *= 2
    return add, low, high


def chosen(problem: Problem, exact: float) -> list[Balance]:
    """Of each number of harmonics those with the fewest samples that twice as many hardly improve,
    and those with the fewest that reach a goal, as twice as many do."""
    found = dict[tuple[int, int], Balance]()
    for highest in HARMONICS:
        balances = [Balance(problem, highest, n) for n in SAMPLES if n >= 2 * highest]
        errors = [abs(b.cycle(problem.omega)[1] / exact - 1.0) for b in balances]
        pairs = list(zip(balances, errors, errors[1:], strict=False))
        settled = [b for b, one, two in pairs if abs(one - two) < 0.25 * two]
        best = settled[0] if settled else balances[-1]
        found[highest, best.samples] = best
        for goal in GOALS:
            good = [b for b, one, two in pairs if max(one, two) <= goal]
            if good:
                found[highest, good[0].samples] = good[0]
    return [found[key] for key in sorted(found)]


# -- stickslip -------------------------------------------------------------------------------------


def certified(problem: Problem, start: Any = None, omega: float | None = None) -> ss.Cycle:
    """A certified cycle."""
    cycle = ss.find_cycle(
        problem.system, start, parameters={"omega": problem.omega if omega is None else omega}
    )
    assert cycle.certificate.ok
    return cycle


def next_cycle(problem: Problem, cycle: ss.Cycle | None, omega: float) -> ss.Cycle:
    """The cycle at another frequency, from a neighbour; from its state if it is far from it."""
    try:
        return certified(problem, cycle, omega)
    except ConvergenceError:
        assert cycle is not None
        return certified(problem, beginning(problem, cycle), omega)


def beginning(problem: Problem, cycle: ss.Cycle) -> dict[str, float]:
    """The state of a cycle where the force begins its period, to start from at another one."""
    whole = np.ceil(float(cycle.trajectory.knots.time[0]) / cycle.period)
    state = cycle.trajectory.at(whole * cycle.period)
    return {name: float(state[name]) for name in problem.system.declaration.state}


def amplitude(problem: Problem, cycle: ss.Cycle) -> float:
    """Of what is seen."""
    return cycle.extrema[problem.seen][1]


def difference(problem: Problem, cycle: ss.Cycle) -> tuple[float, float]:
    """By how much the state misses itself after a period, and the amplitude its own, if the cycle
    is followed by matrix exponentials (``tests/adversarial/references/linear.py``)."""
    trajectory = cycle.trajectory
    begin = float(trajectory.knots.time[0])
    times = begin + cycle.period * np.linspace(0.0, 1.0, 200)
    forces = np.asarray(trajectory.at(times)["friction_damper"])
    turn = int(np.flatnonzero(forces[:-1] * forces[1:] < 0.0)[0])
    relaxed = float(
        brentq(  # pyright: ignore[reportArgumentType]
            lambda t: float(trajectory.at(t)["friction_damper"]),
            times[turn],
            times[turn + 1],
            xtol=1e-15 * abs(times[turn]),
        )
    )
    state = trajectory.at(relaxed)
    modes = problem.modes
    u, v = (np.array([float(state[f"{rate}{x}"]) for x in modes]) for rate in ("", "d_"))
    squares, damping, rub, load = problem.matrices
    n = len(modes)
    touch = Touch(rub, problem.limit, problem.limit, spring=problem.stiffness)
    phase = problem.omega * relaxed
    body = Body(
        np.eye(n),
        np.diag(damping),
        np.diag(squares),
        (touch,),
        problem.force * load,
        problem.omega,
        phase,
        np.zeros(n),
    )
    fine = np.linspace(0.0, cycle.period, 2001)
    found = follow(body, u, v, cycle.period, fine)
    size = np.max(np.abs(found.states[:, :n]))
    missed = float(np.max(np.abs(found.states[-1, :n] - u))) / size
    largest = 0.0
    for _ in range(4):
        seen = found.states[:, :n] @ load
        top = int(np.argmax(seen))
        largest = float(seen[top])
        fine = np.linspace(fine[max(top - 1, 0)], fine[min(top + 1, len(fine) - 1)], 200)
        found = follow(body, u, v, float(fine[-1]), fine)
    return missed, abs(largest / amplitude(problem, cycle) - 1.0)


# -- measured --------------------------------------------------------------------------------------


def timed(jobs: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Least of rounds in which all take turns, in seconds of the processor; the first one does not
    count."""
    found: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(ROUNDS + 1):
        for name, job in jobs.items():
            begun = time.process_time()
            job()
            found[name].append(time.process_time() - begun)
    return {name: min(seconds[1:]) for name, seconds in found.items()}


@dataclass(frozen=True)
class Row:
    """One line of the table: highest harmonic (0: stickslip), samples, errors and seconds of a
    point, and seconds of each point of a response."""

    harmonics: int
    samples: int
    error: float
    alone: float
    along: float


def measured(problem: Problem) -> tuple[list[Row], str]:
    """All rows of a problem, and what is said of its cycle."""
    cycle = certified(problem)
    exact = amplitude(problem, cycle)
    missed, off = difference(problem, cycle)
    omegas = np.linspace(0.9, 1.1, POINTS) * problem.omega
    balances = {str(i): b for i, b in enumerate(chosen(problem, exact), 1)}

    def response(balance: Balance) -> None:
        x = None
        for omega in omegas:
            x, _ = balance.cycle(omega, x)

    def followed() -> None:
        cycle = None
        for omega in omegas:
            cycle = next_cycle(problem, cycle, omega)

    alone: dict[str, Callable[[], object]] = {"0": lambda: certified(problem)}
    along: dict[str, Callable[[], object]] = {"0": followed}
    for name, balance in balances.items():
        alone[name] = lambda balance=balance: balance.cycle(problem.omega)
        along[name] = lambda balance=balance: response(balance)
    points, lines = timed(alone), timed(along)
    start = beginning(problem, cycle)
    period = timed({"": lambda: ss.simulate(problem.system, (0.0, cycle.period), initial=start)})[
        ""
    ]
    rows = [
        Row(
            int(balance.orders[-1]),
            2 * balance.samples,
            abs(balance.cycle(problem.omega)[1] / exact - 1.0),
            points[name],
            lines[name] / POINTS,
        )
        for name, balance in balances.items()
    ]
    rows.append(Row(0, 0, max(off, 1e-16), points["0"], lines["0"] / POINTS))
    said = (
        f"The amplitude is {exact:.12g} {problem.unit}; computed for a period by matrix "
        f"exponentials, the certified cycle closes to {missed:.1e}, and its amplitude agrees to "
        f"{off:.1e}. The simulation of a period takes {1e3 * period:.2g} ms; the remaining time is "
        "for the derivatives that Newton's method and the multipliers require, and for the "
        "certificate."
    )
    return rows, said


def within(rows: list[Row], goal: float) -> Row | None:
    """The fastest harmonic balance that reaches an error."""
    good = [row for row in rows if row.harmonics and row.error <= goal]
    return min(good, key=lambda row: row.alone) if good else None


def table(problem: Problem, rows: list[Row], said: str) -> list[str]:
    """A section of the page."""
    own = rows[-1]
    lines = [
        f"## {problem.system.title}",
        "",
        "| | samples of a period | error | a single point, ms | times stickslip | "
        "a point of a response, ms | times stickslip |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        name = f"harmonics to {row.harmonics}" if row.harmonics else "**stickslip**, certified"
        lines.append(
            f"| {name} | {row.samples or ''} | {row.error:.1e} | {1e3 * row.alone:.3g} | "
            f"{row.alone / own.alone:.2g} | {1e3 * row.along:.3g} | {row.along / own.along:.2g} |"
        )
    lines += ["", said]
    for goal in GOALS:
        best = within(rows, goal)
        if best is None:
            lines += ["", f"None of these numbers of harmonics reaches an error of {goal:g}."]
            continue
        times = best.alone / own.alone, best.along / own.along
        lines += [
            "",
            f"At an error of {goal:g}, the fastest harmonic balance (harmonics to "
            f"{best.harmonics}, {best.samples} samples) takes {times[0]:.2g} times as long as "
            f"stickslip for a single point, and {times[1]:.2g} times as long for a point of a "
            "response.",
        ]
    return [*lines, ""]


def figure(results: dict[str, list[Row]]) -> None:
    """Errors over times, for both problems; numbers are the highest harmonics."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(8.0, 4.2), layout="constrained")
    for ax, (name, rows) in zip(drawn.subplots(1, 2, sharey=True), results.items(), strict=True):
        balance = [row for row in rows if row.harmonics]
        own = rows[-1]
        for column, color, marker, word in (
            ("alone", LINES[0], "o", "a point alone"),
            ("along", LINES[1], "s", "a point of a response"),
        ):
            seconds = [getattr(row, column) for row in balance]
            errors = [row.error for row in balance]
            label = f"harmonic balance, {word}"
            ax.loglog(seconds, errors, marker, color=color, label=label)
            ax.loglog(
                getattr(own, column),
                own.error,
                marker="*",
                markersize=13,
                linestyle="",
                color=color,
                label=f"stickslip, {word}",
            )
        for highest in HARMONICS:
            best = min((r for r in balance if r.harmonics == highest), key=lambda r: r.error)
            ax.annotate(
                f"{highest}",
                (best.alone, best.error),
                textcoords="offset points",
                xytext=(7, -3),
                fontsize=8,
            )
        ax.set_title(name, fontsize=10)
        ax.set_xlabel("time of a point [s]")
        ax.grid(alpha=0.3)
        ax.margins(x=0.12)
    first = drawn.axes[0]
    first.set_ylabel("relative error of the amplitude [1]")
    drawn.legend(
        *first.get_legend_handles_labels(), fontsize=8, ncols=2, loc="outside lower center"
    )
    drawn.savefig(RESULTS / "harmonic_balance.png", dpi=150)


def main() -> None:
    """Run everything, print it and keep it."""
    from motion import machine  # here, since it imports all rivals

    argparse.ArgumentParser(description=__doc__).parse_args()
    results = dict[str, list[Row]]()
    lines = ["# Cycles compared with harmonic balance", "", machine(), "", *NOTES]
    for problem in (oscillator(), beam()):
        rows, said = measured(problem)
        results[problem.system.title] = rows
        lines += table(problem, rows, said)
    figure(results)
    lines += [
        "Errors as functions of computing times; the numbers are the highest harmonics.",
        "",
        "![errors over times](harmonic_balance.png)",
        "",
    ]
    print("\n".join(lines))
    (RESULTS / "harmonic_balance.md").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
