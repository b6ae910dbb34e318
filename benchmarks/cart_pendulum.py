"""A benchmark problem with dry friction, by several tools: ``python benchmarks/cart_pendulum.py
[PYTHON]``.

A pendulum on a cart whose guide has dry friction, from rest, for ten seconds: the problem is stated
in ``docs/theory/benchmark-problem.md``, and ``tests/oracles/cart_pendulum.py`` solves it in thirty
digits without this package. Here the reference states, to twelve digits, and how far others are
from them in which time: events by hand with SciPy, a smoothed friction, and MuJoCo with PYTHON, by
default this one. The tables go to ``benchmarks/results/cart_pendulum.md``.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.arrays import Array

RESULTS = Path(__file__).parent / "results" / "cart_pendulum.md"
M, MASS, LENGTH, G, FRICTION, ANGLE = 1.0, 0.5, 0.7, 9.81, 1.0, 2.5
TIMES = np.arange(1.0, 11.0)
NAMES = ("x", "d_x", "phi", "d_phi")
State = Sequence[float] | Array

MUJOCO = """
import json, mujoco, time
MODEL = '''<mujoco><option timestep="{step}" integrator="{integrator}" {option}/>
  <worldbody><body><joint name="x" type="slide" axis="1 0 0" frictionloss="1" {joint}/>
  <inertial pos="0 0 0" mass="1" diaginertia="1e-9 1e-9 1e-9"/>
  <body><joint name="phi" type="hinge" axis="0 -1 0"/>
  <inertial pos="0 0 -0.7" mass="0.5" diaginertia="1e-9 1e-9 1e-9"/></body></body></worldbody>
  </mujoco>'''

def follow(**given):
    model = mujoco.MjModel.from_xml_string(MODEL.format(**given))
    data = mujoco.MjData(model)
    data.qpos[1] = 2.5
    begun, found = time.process_time(), []
    for _ in range(10):
        for _ in range(round(1.0 / model.opt.timestep)):
            mujoco.mj_step(model, data)
        found.append([float(data.qpos[0]), float(data.qpos[1])])
    return found, time.process_time() - begun

SOFT = dict(option="", joint="")
STIFF = 'solreffriction="{} 1" solimpfriction="0.9999 0.9999 0.001"'
NOSLIP = dict(option='noslip_iterations="10" noslip_tolerance="0"', joint="")
found = {
    "default settings, 2 ms": follow(step=0.002, integrator="implicitfast", **SOFT),
    "NoSlip, 2 ms": follow(step=0.002, integrator="implicitfast", **NOSLIP),
    "NoSlip, 0.02 ms": follow(step=0.00002, integrator="implicitfast", **NOSLIP),
    "Runge-Kutta, stiffer friction, 0.1 ms": follow(
        step=0.0001, integrator="RK4", option="", joint=STIFF.format(0.0002)
    ),
    "Runge-Kutta, stiffer friction, 0.01 ms": follow(
        step=0.00001, integrator="RK4", option="", joint=STIFF.format(0.00002)
    ),
}
print(json.dumps([mujoco.__version__, found]))
"""


def field(y: State, force: float, stuck: bool = False) -> list[float]:
    """Rates of (x, x', φ, φ') under a friction force on the cart."""
    _, v, phi, omega = y
    s, c = np.sin(phi), np.cos(phi)
    a = 0.0 if stuck else (rod(y) + force) / (M + MASS * s * s)
    return [v, a, omega, -(a * c + G * s) / LENGTH]


def rod(y: State) -> float:
    """Horizontal force of the rod on a cart at rest."""
    _, _, phi, omega = y
    return float(MASS * np.sin(phi) * (G * np.cos(phi) + LENGTH * omega**2))


def by_hand(rtol: float) -> Array:
    """Mode by mode with events."""
    t, y, found = 0.0, np.array([0.0, 0.0, ANGLE, 0.0]), []
    sigma = float(np.sign(rod(y)))
    while t < TIMES[-1]:
        stuck = sigma == 0.0

        def end(t: float, y: Array, stuck: bool = stuck) -> float:
            return FRICTION - abs(rod(y)) if stuck else float(y[1])

        vars(end)["terminal"] = True
        vars(end)["direction"] = -1.0 if stuck else -sigma

        def rates(t: float, y: Array, stuck: bool = stuck, sigma: float = sigma) -> list[float]:
            return field(y, -sigma * FRICTION, stuck)

        run = solve_ivp(
            rates,
            (t, TIMES[-1]),
            y,
            "DOP853",
            dense_output=True,
            events=end,
            rtol=rtol,
            atol=rtol,
        )
        found += [run.sol(time) for time in TIMES if t < time <= run.t[-1]]
        if run.status == 0:
            break
        t, y = float(run.t_events[0][0]), run.y_events[0][0].copy()
        y[1] = 0.0
        sigma = float(np.sign(rod(y))) if stuck or abs(rod(y)) > FRICTION else 0.0
    return np.array(found)[:, [0, 2]]


def smoothed(width: float) -> Array:
    """F tanh(x'/width)."""

    def rates(t: float, y: Array) -> list[float]:
        return field(y, -FRICTION * float(np.tanh(y[1] / width)))

    start = [0.0, 0.0, ANGLE, 0.0]
    run = solve_ivp(rates, (0.0, 10.0), start, "Radau", TIMES, rtol=1e-10, atol=1e-12)
    return run.y.T[:, [0, 2]]


def reference() -> Array:
    """States at the times, shape (times, 4), of a certified motion."""
    motion = ss.simulate(ss.catalogue.cart_pendulum(), (0.0, TIMES[-1]), rtol=1e-13)
    assert motion.certificate.ok
    states = motion.at(TIMES)
    return np.column_stack([states[name] for name in NAMES])


def timed(work: Callable[[], Array]) -> tuple[Array, float]:
    """What it gives, and seconds of the processor, the least of three."""
    found, seconds = work(), []
    for _ in range(3):
        begun = process_time()
        work()
        seconds.append(process_time() - begun)
    return found, min(seconds)


def main() -> None:
    """Run all, print it and keep it."""
    python = sys.argv[1] if len(sys.argv) > 1 else sys.executable
    exact = reference()
    told = subprocess.run([python, "-c", MUJOCO], capture_output=True, text=True, check=True)
    version, others = json.loads(told.stdout)
    rows: list[tuple[str, tuple[Array, float]]] = [
        ("**stickslip**, default settings", timed(ours)),
        ("SciPy, DOP853 with events by hand, 1e-12", timed(lambda: by_hand(1e-12))),
        ("SciPy, DOP853 with events by hand, 1e-6", timed(lambda: by_hand(1e-6))),
        *((f"SciPy, Radau, tanh(v/{w:g})", timed(lambda w=w: smoothed(w))) for w in (1e-2, 1e-4)),
        *((f"MuJoCo, {name}", (np.array(y), s)) for name, (y, s) in others.items()),
    ]
    lines = ["# A benchmark problem with dry friction", "", "## reference", ""]
    lines += ["| t, s | x, m | x', m/s | φ, rad | φ', rad/s |", "|---|---|---|---|---|"]
    for t, state in zip(TIMES, exact, strict=True):
        lines.append(f"| {t:g} | " + " | ".join(f"{x:.12f}" for x in state) + " |")
    lines += ["", "## tools", "", "| tool | error | processor, s |", "|---|---|---|"]
    for name, (found, seconds) in rows:
        error = float(np.max(np.abs(found - exact[:, [0, 2]])))
        lines.append(f"| {name} | {error:.1g} | {seconds:.2g} |")
    lines += ["", f"stickslip {ss.__version__}, MuJoCo {version}", ""]
    print("\n".join(lines))
    RESULTS.write_text("\n".join(lines), encoding="utf-8")


def ours() -> Array:
    """Positions and angles at the times, with the default tolerance and certified."""
    motion = ss.simulate(ss.catalogue.cart_pendulum(), (0.0, TIMES[-1]))
    assert motion.certificate.ok
    states = motion.at(TIMES)
    return np.column_stack([states["x"], states["phi"]])


if __name__ == "__main__":
    begun = perf_counter()
    main()
    print(f"{perf_counter() - begun:.0f} s")
