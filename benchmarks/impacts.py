"""Other tools on two motions with impacts: the woodpecker toy and the spool between its stops.

Everything that is affine is told to them: in each mode, a set of closed contacts of which the
friction sticks or slips, the accelerations are a q + c + s sin ωt, and the mode ends where a linear
function of state and time falls through zero; there an impulse may change the rates. The *order* of
the modes is told, too: it is that of the periodic motion (R. I. Leine, Ch. Glocker and D. H. van
Campen 2003, for the woodpecker), so that neither heyoka nor SciPy has to watch the other contacts
or to decide anything. Started elsewhere they would walk through the poles.

Siconos time stepping (Moreau and Jean) locates no events and is told nothing; it is of order one,
so that its rows are for the errors that it reaches at given steps. It is that of the system's
Python, run as a process of its own.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss

Array = NDArray[np.float64]
Run = Callable[[], tuple[Array, int]]
SICONOS = "/usr/bin/python3"


@dataclass(frozen=True)
class Mode:
    """One mode of the known order.

    Attributes
    ----------
    stiffness, constant, wave : arrays, shapes (d, d), (d,), (d,)
        Accelerations stiffness·q + constant + wave sin ωt.
    guard : array, shape (2d + 2,)
        Weights of q, rates, 1 and sin ωt in the function that ends the mode where it falls below 0.
    jumps : tuple of arrays, shape (d, d)
        Matrices on the rates there: that of an impulse that sticks, then of those that slip with a
        positive and with a negative rate of slip afterwards. None: nothing jumps.
    slip : array, shape (d,)
        Direction of slip.
    """

    stiffness: Array
    constant: Array
    wave: Array
    guard: Array
    jumps: tuple[Array, Array, Array] | None = None
    slip: Array | None = None

    def jump(self, rates: Array) -> Array:
        """The rates after the end of the mode."""
        if self.jumps is None or self.slip is None:
            return rates
        for sign, jump in zip((1.0, -1.0), self.jumps[1:], strict=True):
            slipped = jump @ rates
            if sign * float(self.slip @ slipped) > 0:
                return slipped
        return self.jumps[0] @ rates


@dataclass(frozen=True)
class Motion:
    """A motion in a known order of modes: the first ones, then a cycle.

    Attributes
    ----------
    title : str
    system : System
    first, cycle : sequence of Mode
    span, cycles, omega : float
    sizes : array, shape (2d,)
        What errors of places and rates are relative to.
    """

    title: str
    system: ss.System
    first: Sequence[Mode]
    cycle: Sequence[Mode]
    span: float
    cycles: float
    omega: float
    sizes: Array

    @property
    def start(self) -> Array:
        names = [*self.system.coordinates, *(f"d_{x}" for x in self.system.coordinates)]
        return np.array([self.system.initial.get(name, 0.0) for name in names], dtype=float)

    def mode(self, number: int) -> Mode:
        """The mode after that many ends of modes."""
        if number < len(self.first):
            return self.first[number]
        return self.cycle[(number - len(self.first)) % len(self.cycle)]


@dataclass(frozen=True)
class Body:
    """Masses with linear forces and contacts.

    Attributes
    ----------
    M, K, load : arrays
        M q'' + K q = load + forces of the contacts.
    normal, tangent, offset : arrays, shapes (c, d), (c, d), (c,)
    mu, e : arrays, shape (c,)
    """

    M: Array
    K: Array
    load: Array
    normal: Array
    tangent: Array
    offset: Array
    mu: Array
    e: Array

    def forces(self, closed: int | None, state: str) -> tuple[Array, Array, Array]:
        """Accelerations a q + c with one contact closed, and weights of (q, 1) in its forces."""
        d = len(self.M)
        affine = np.column_stack([-self.K, self.load])
        inverse = np.linalg.inv(self.M)
        if closed is None:
            return inverse @ affine, np.zeros(d + 1), np.zeros(d + 1)
        n, t = self.normal[closed], self.tangent[closed]
        if state == "stick":
            W = np.array([n, t]).T
            force = -np.linalg.solve(W.T @ inverse @ W, W.T @ inverse @ affine)
            return inverse @ (affine + W @ force), force[0], force[1]
        w = n - (self.mu[closed] if state == "slip+" else -self.mu[closed]) * t
        held = -(n @ inverse @ affine) / (n @ inverse @ w)
        return inverse @ (affine + np.outer(w, held)), held, (w - n) @ t / (t @ t) * held

    def impulse(self, contact: int) -> tuple[Array, Array, Array]:
        """Matrices on the rates: an impulse of one contact that sticks, slips with u > 0, u < 0."""
        d = len(self.M)
        inverse = np.linalg.inv(self.M)
        n, t = self.normal[contact], self.tangent[contact]
        W = np.array([n, t]).T
        asked = np.array([(1 + self.e[contact]) * n, t])
        stick = np.eye(d) - inverse @ W @ np.linalg.solve(W.T @ inverse @ W, asked)
        slips = []
        for sign in (1.0, -1.0):
            w = n - sign * self.mu[contact] * t
            slips.append(np.eye(d) - np.outer(inverse @ w, asked[0]) / (n @ inverse @ w))
        return stick, slips[0], slips[1]


def bird() -> Body:
    """The woodpecker by hand: beak, lower edge, upper edge."""
    p = ss.catalogue.woodpecker().values
    arm = np.array([1.0, p["l_M"], p["l_G"]])
    M = np.diag([p["m_M"], p["J_M"], p["J_S"]]) + p["m_S"] * np.outer(arm, arm)
    spring = np.array([0.0, 1.0, -1.0])
    play = p["r_M"] - p["r_0"]
    sleeve = [1.0, p["r_M"], 0.0]
    return Body(
        M,
        p["c_phi"] * np.outer(spring, spring),
        -p["g"] * (np.array([p["m_M"], 0.0, 0.0]) + p["m_S"] * arm),
        np.array([[0.0, 0.0, -p["h_S"]], [0.0, p["h_M"], 0.0], [0.0, -p["h_M"], 0.0]]),
        np.array([[1.0, p["l_M"], p["l_G"] - p["l_S"]], sleeve, sleeve]),
        np.array([p["l_M"] + p["l_G"] - p["l_S"] - p["r_0"], play, play]),
        np.full(3, p["mu"]),
        np.array([p["e_1"], p["e_2"], p["e_3"]]),
    )


def woodpecker() -> Motion:
    """Ten cycles of pecking. The order of the modes is that of the periodic motion."""
    body = bird()
    d = 3

    def made(closed: int | None, state: str, ends: str, at: int) -> Mode:
        a, held, rubs = body.forces(closed, state)
        guard = np.zeros(2 * d + 2)
        if ends == "gap":
            guard[:d], guard[2 * d] = body.normal[at], body.offset[at]
        elif ends == "rest":
            guard[d : 2 * d] = -body.tangent[at] if state == "slip-" else body.tangent[at]
        elif ends == "force":
            guard[:d], guard[2 * d] = held[:d], held[d]
        else:  # friction of a stick reaches the side that slips downwards
            room = body.mu[at] * held - rubs
            guard[:d], guard[2 * d] = room[:d], room[d]
        impulse = body.impulse(at) if ends == "gap" else None
        return Mode(a[:, :d], a[:, d], np.zeros(d), guard, impulse, body.tangent[at])

    beak, lower, upper = 0, 1, 2
    order = [
        made(lower, "slip-", "rest", lower),
        made(lower, "stick", "slides", lower),
        made(lower, "slip-", "force", lower),
        made(None, "", "gap", upper),
        made(None, "", "gap", beak),
        made(None, "", "gap", upper),
        made(upper, "slip+", "force", upper),
        made(None, "", "gap", lower),
        made(None, "", "gap", lower),
    ]
    sizes = np.array([0.2, 0.1, 0.5, 0.3, 20.0, 20.0])
    system = ss.catalogue.woodpecker()
    return Motion("woodpecker", system, order[-1:], order, 1.46, 10.0, 1.0, sizes)


def spool() -> Motion:
    """Four periods and a half of the pressure. The order of the modes is that of the first
    period."""
    system = ss.catalogue.limit_stops()
    p = system.values
    a = np.array([[-p["k"] / p["M"]]])
    mean, swing = ((p["area"] * p[x]) / p["M"] for x in ("P_0", "P_1"))
    rub = p["F_c"] / p["M"]

    def moving(sign: float, ends: str) -> Mode:
        guards = {
            "rest": [0.0, sign, 0.0, 0.0],
            "left": [1.0, 0.0, -p["left"], 0.0],
            "right": [-1.0, 0.0, p["right"], 0.0],
        }
        back = np.array([[-p["e"]]])
        bounce = None if ends == "rest" else (back, back, back)
        return Mode(
            a,
            np.array([mean - p["F_0"] / p["M"] - sign * rub]),
            np.array([swing]),
            np.array(guards[ends]),
            bounce,
            np.ones(1),
        )

    def resting(sign: float) -> Mode:
        zero = np.zeros(1)
        load = [a[0, 0], 0.0, mean - p["F_0"] / p["M"], swing]
        guard = -sign * np.array(load) + np.array([0.0, 0.0, rub, 0.0])
        return Mode(np.zeros((1, 1)), zero, zero, guard)

    # A fourth rebound, of 1e-13 m within 1e-9 s, is left out: the tools pass over it.
    rebounds = [moving(1.0, "rest"), moving(-1.0, "left")]
    order = [
        resting(1.0),
        moving(1.0, "right"),
        moving(-1.0, "rest"),
        moving(1.0, "rest"),
        resting(-1.0),
        moving(-1.0, "left"),
        *rebounds,
        *rebounds,
        *rebounds,
    ]
    stop = np.zeros((1, 1))
    order[-1] = replace(order[-1], jumps=(stop, stop, stop))
    sizes = np.array([1e-3, 2.0])
    return Motion("spool between stops", system, [], order, 0.0188, 4.7, p["omega"], sizes)


# --- The tools ------------------------------------------------------------------------------------


def prepare_scipy(motion: Motion, **options: Any) -> Run:
    """``solve_ivp`` with a terminal event, called again after each mode."""
    from scipy.integrate import solve_ivp

    d = len(motion.sizes) // 2

    def run() -> tuple[Array, int]:
        now, y, number = 0.0, motion.start, 0
        while True:
            mode = motion.mode(number)
            field, guard = _field(mode, d, motion.omega)
            found = solve_ivp(field, (now, motion.span), y, events=guard, **options)
            now, y = found.t[-1], found.y[:, -1]
            if found.status != 1:
                return y, number
            y = np.concatenate([y[:d], mode.jump(y[d:])])
            number += 1

    return run


def _field(mode: Mode, d: int, omega: float) -> tuple[Callable[..., Any], Callable[..., float]]:
    whole = np.zeros((2 * d, 2 * d))
    whole[:d, d:] = np.eye(d)
    whole[d:, :d] = mode.stiffness
    constant = np.concatenate([np.zeros(d), mode.constant])
    wave = np.concatenate([np.zeros(d), mode.wave])
    shaken = bool(np.any(wave))
    weights, one, sine = mode.guard[: 2 * d], mode.guard[2 * d], mode.guard[2 * d + 1]
    if not shaken:

        def field(t: float, y: Array) -> Array:
            return whole @ y + constant

    else:

        def field(t: float, y: Array) -> Array:
            return whole @ y + constant + wave * np.sin(omega * t)

    def guard(t: float, y: Array) -> float:
        return float(weights @ y) + one + sine * np.sin(omega * t)

    guard.terminal = True  # type: ignore[attr-defined]
    guard.direction = -1  # type: ignore[attr-defined]
    return field, guard


def prepare_heyoka(motion: Motion, **options: Any) -> Run:
    """One integrator of which the event's callback changes parameters and rates in place."""
    import heyoka

    d = len(motion.sizes) // 2
    names = [f"q{i}" for i in range(d)] + [f"v{i}" for i in range(d)]
    variables: Any = heyoka.make_vars(*names)
    sine: Any = heyoka.sin(motion.omega * heyoka.time)
    every = [*motion.first, *motion.cycle]
    # Only what is not zero in every mode is a parameter.
    places: list[Callable[[Mode], float]] = []

    def entry(read: Callable[[Mode], float]) -> Any:
        if all(read(mode) == 0.0 for mode in every):
            return None
        places.append(read)
        return heyoka.par[len(places) - 1]

    def total(terms: list[tuple[Any, Any]]) -> Any:
        kept = [weight * factor for weight, factor in terms if weight is not None]
        return sum(kept[1:], kept[0]) if kept else heyoka.expression(0.0)

    rates = []
    for i in range(d):
        terms = [(entry(lambda m, i=i, j=j: m.stiffness[i, j]), variables[j]) for j in range(d)]
        terms.append((entry(lambda m, i=i: m.constant[i]), heyoka.expression(1.0)))
        terms.append((entry(lambda m, i=i: m.wave[i]), sine))
        rates.append(total(terms))
    factors = [*variables, heyoka.expression(1.0), sine]
    guard = total([(entry(lambda m, j=j: m.guard[j]), factors[j]) for j in range(2 * d + 2)])
    tables = {id(mode): np.array([read(mode) for read in places]) for mode in every}
    number = 0

    def callback(_: Any, side: int) -> bool:
        nonlocal number
        mode = motion.mode(number)
        state[d:] = mode.jump(state[d:])
        number += 1
        pars[:] = tables[id(motion.mode(number))]
        return True

    event = heyoka.t_event(guard, callback=callback, direction=heyoka.event_direction.negative)
    system = [
        *zip(variables[:d], variables[d:], strict=True),
        *zip(variables[d:], rates, strict=True),
    ]
    integrator = heyoka.taylor_adaptive(
        system, motion.start, pars=np.zeros(len(places)), t_events=[event], **options
    )
    state, pars = integrator.state, integrator.pars

    def run() -> tuple[Array, int]:
        nonlocal number
        number = 0
        integrator.time = 0.0
        integrator.reset_cooldowns()
        state[:] = motion.start
        pars[:] = tables[id(motion.mode(0))]
        integrator.propagate_until(motion.span)
        return state.copy(), number

    return run


# The loosest tolerances of a scan from which on the error stays below 1e-10. For the spool that is
# the loosest at which heyoka passes over no mode; SciPy passes over the last rebounds of 1e-9 m at
# all of them, which the end, two rests later, does not show.
OPTIONS: dict[str, dict[str, dict[str, Any]]] = {
    "woodpecker": {
        "heyoka": {"tol": 1e-9, "fast_math": True},
        "SciPy": {"method": "DOP853", "rtol": 3e-12, "atol": 3e-12},
    },
    "spool between stops": {
        "heyoka": {"tol": 1e-10, "fast_math": True},
        "SciPy": {"method": "DOP853", "rtol": 1e-10, "atol": 1e-10, "max_step": 5e-4},
    },
}
PREPARE = {"heyoka": prepare_heyoka, "SciPy": prepare_scipy}
RTOL = 1e-6  # from 3e-5 on the error is below 1e-11
BATCH = 2000
MAP = 100_000
PERIOD = 0.145976
SICONOS_STEPS = (1e-4, 1e-5)


def one_call(motion: Motion, rtol: float = RTOL) -> Run:
    """``simulate`` with its result."""
    names = [*motion.system.coordinates, *(f"d_{x}" for x in motion.system.coordinates)]

    def run() -> tuple[Array, int]:
        found = ss.simulate(motion.system, (0.0, motion.span), rtol=rtol)
        return np.array([found.final[name] for name in names]), found.n_switches

    return run


def batch(motion: Motion) -> Run:
    """The compiled loop over a batch of equal motions on one core."""
    from stickslip.motion.problem import pose
    from stickslip.motion.simulate_many import follow_all as advance

    problem = pose(motion.system, rtol=RTOL)
    states = np.tile(problem.initial_state({}), (BATCH, 1))
    table = np.tile(list(problem.parameters.values()), (BATCH, 1))

    def run() -> tuple[Array, int]:
        now, *_ = advance(problem, table, states, (0.0, motion.span), 10**6, 1)
        return now.y[0], int(now.counters[0, 1])

    return run


def reference(motion: Motion) -> tuple[Array, str]:
    """The end that errors are measured against, and how far two ways to it are apart."""
    own, _ = one_call(motion, 1e-13)()
    try:
        other, _ = prepare_heyoka(motion, tol=1e-16)()
    except ImportError:
        return own, "errors are relative to stickslip at rtol = 1e-13"
    apart = np.max(np.abs(own - other) / motion.sizes)
    return other, (
        f"errors are relative to heyoka at tol = 1e-16, from which stickslip at rtol = 1e-13 "
        f"differs by {apart:.1e}"
    )


def return_map(rounds: int = 3) -> list[str]:
    """Seconds for one period of the woodpecker from many states."""
    rng = np.random.default_rng(0)
    start = {
        "phi_S": rng.uniform(-0.4, -0.15, MAP),
        "d_y": rng.uniform(-0.5, -0.2, MAP),
        "d_phi_S": rng.uniform(-9.0, -6.0, MAP),
    }
    spent = []
    share = 0.0
    for _ in range(rounds):
        began = time.perf_counter()
        ended = ss.simulate_many(
            ss.catalogue.woodpecker(), (0.0, PERIOD), initial=start, rtol=RTOL, workers=2
        )
        spent.append(time.perf_counter() - began)
        share = float(np.mean(ended.dataset["outcome"].values == 0))
    seconds = median(spent)
    return [
        f"The return map of the woodpecker from {MAP:,} states, one period each, two workers: "
        f"{seconds:.2f} s ({seconds / MAP * 1e6:.1f} µs each); {share:.2%} of them finished."
    ]


def feet(n: int) -> ss.System:
    """Feet that fall, bounce until they rest, and drag one body."""
    names = [f"y{i}" for i in range(n)]
    return ss.System(
        name="feet",
        coordinates={name: ss.Inertial() for name in [*names, "x"]},
        kinetic=" + ".join(f"d_{name}**2/2" for name in [*names, "x"]),
        potential=" + ".join(f"9.81*{name}" for name in names),
        contacts={name: ss.Unilateral(name, "d_x", 0.1, restitution=0.5) for name in names},
        initial={name: 0.1 for name in names} | {"d_x": 50.0},
        span=(0.0, 2.0),
    )


def on_feet(rounds: int = 5) -> list[str]:
    """Milliseconds of 42 impacts and a slide, in the compiled loop, for one foot and more."""
    from stickslip.motion.problem import pose
    from stickslip.motion.simulate_many import follow_all as advance

    said = []
    for n in (1, 2, 3, 4, 8, 20):
        problem = pose(feet(n))
        states = np.tile(problem.initial_state({}), (40, 1))
        spent = []
        for _ in range(rounds):
            began = time.perf_counter()
            advance(problem, np.zeros((40, 0)), states.copy(), (0.0, 2.0), 10**6, 1)
            spent.append((time.perf_counter() - began) / 40 * 1e3)
        said.append(f"{n}: {median(spent):.2f} ms")
    return ["A body on feet that land together, 42 impacts and a slide: " + ", ".join(said) + "."]


def table(time_interleaved: Callable[..., dict[str, float]]) -> list[str]:
    """Table of the two motions, by all tools in turn.

    Parameters
    ----------
    time_interleaved : function
        That of ``rivals.py``.
    """
    lines = [
        "| motion | tool | µs per cycle | times stickslip (loop) | error | switches |",
        "|---|---|---|---|---|---|",
    ]
    notes = []
    for motion in (woodpecker(), spool()):
        exact, how = reference(motion)
        notes.append(f"{motion.title[0].upper()}{motion.title[1:]}: {how}.")
        runs = {"stickslip, loop": batch(motion), "stickslip, simulate": one_call(motion)}
        for tool, options in OPTIONS[motion.title].items():
            try:
                runs[f"{tool}, order of modes known"] = PREPARE[tool](motion, **options)
            except ImportError as error:
                notes.append(f"{tool} was not measured: {error}.")
        ends = {name: run() for name, run in runs.items()}
        cycles = {n: motion.cycles * (BATCH if n.endswith("loop") else 1) for n in runs}
        seconds = {n: s / cycles[n] for n, s in time_interleaved(runs).items()}
        rows = [(n, s, ends[n][0], str(ends[n][1])) for n, s in seconds.items()]
        if motion.title == "woodpecker":
            try:
                rows += [
                    (f"Siconos, steps of {step:g} s", spent / motion.cycles, end, "")
                    for step, end, spent in run_siconos(of_the_bird(), SICONOS_STEPS)
                ]
            except OSError as error:
                notes.append(f"Siconos was not measured: {error}.")
        for name, spent, end, switches in rows:
            error = np.max(np.abs(end - exact) / motion.sizes)
            lines.append(
                f"| {motion.title} | {name} | {spent * 1e6:.2f} |"
                f" {spent / seconds['stickslip, loop']:.1f} | {error:.1e} | {switches} |"
            )
    notes.append(
        "heyoka and SciPy are given the order of the modes; their switches are ends of modes (91 "
        "and 53 if none is missed), those of stickslip changes of contacts. Siconos is not given "
        "the order and has first order; it has no friction with a given threshold for the spool."
    )
    return [*lines, "", *return_map(), "", *on_feet(), "", *notes]


def of_the_bird() -> dict[str, Any]:
    """The woodpecker, as :func:`run_siconos` takes it."""
    body, motion = bird(), woodpecker()
    given = {name: getattr(body, name).tolist() for name in body.__dataclass_fields__}
    still = np.zeros_like(body.load).tolist()
    return given | {
        "C": np.zeros_like(body.M).tolist(),
        "push": [given.pop("load"), still, still],
        "start": motion.start.tolist(),
        "span": motion.span,
    }


def run_siconos(
    given: dict[str, Any], steps: Sequence[float], rounds: int = 3
) -> list[tuple[float, Array, float]]:
    """Moreau-Jean time stepping of a body in a process of the system's Python: for every step, the
    median of the seconds of its loop, and the end. Raises OSError if it is not there."""
    given = {**given, "steps": list(steps)}
    ended = subprocess.run(
        [SICONOS, str(Path(__file__).parent / "siconos_steps.py")],
        input=json.dumps(given | {"rounds": rounds}),
        capture_output=True,
        text=True,
        check=False,
    )
    if ended.returncode != 0:
        raise OSError((ended.stderr.strip().splitlines() or ["no word"])[-1])
    rows = json.loads(ended.stdout.strip().splitlines()[-1])
    return [(step, np.array(end), seconds) for step, end, seconds in rows]
