"""Derivatives through events.

A block on a belt, static above kinetic friction: x at t = 20 as a function of the speed V of the
belt. A program that steps with a fixed step and asks ``if`` has a derivative, too, the one that
automatic differentiation of it gives: it forgets that the times of the switches depend on V. Here
that derivative is computed by a complex step, which is exact to rounding. Finite differences of the
same program see its steps. ``python benchmarks/wrong/gradients.py``
"""

from __future__ import annotations

from time import perf_counter

from table import table, timed, versions

import stickslip as ss

END, V, F_S, F_K = 20.0, 0.3, 1.0, 0.6


def stepped(V: complex, h: float) -> complex:
    """x at the end by semi-implicit Euler steps, asking which mode it is in at each."""
    x, v = 0.0 + 0.0j, 0.0 + 0.0j
    stuck = False
    for _ in range(round(END / h)):
        if stuck and x.real > F_S:
            stuck = False
        if stuck:
            v = V + 0.0j
        else:
            before = (v - V).real
            force = F_K * (1.0 if before < 0 else -1.0)
            v = v + h * (force - x)
            after = (v - V).real
            if before * after < 0 and abs(x.real) <= F_S:
                stuck, v = True, V + 0.0j
        x = x + h * v
    return x


def truth() -> tuple[float, float]:
    """The derivative, and seconds, by stickslip; checked by Richardson's differences of it."""
    block = ss.catalogue.belt_block()

    def derivative() -> float:
        motion = ss.simulate(block, (0.0, END))
        return float(motion.sensitivity(["V"])["x"].isel(time=-1, parameter=0))

    value, seconds = timed(derivative)
    h = 1e-4
    x = {
        k: ss.simulate(block, (0.0, END), parameters={"V": V + k * h}).final["x"]
        for k in (-2, -1, 1, 2)
    }
    differences = (8 * (x[1] - x[-1]) - (x[2] - x[-2])) / (12 * h)
    assert abs(differences - value) < 1e-6 * abs(value), (differences, value)
    return value, seconds


def report() -> str:
    """The table."""
    value, seconds = truth()
    rows: list[list[object]] = []
    for h in (1e-3, 1e-4):
        began = perf_counter()
        forward = stepped(complex(V, 1e-30), h).imag / 1e-30
        spent = perf_counter() - began
        rows.append(
            [f"automatic, steps of {h:g}", f"{forward:.4f}", _off(forward, value), f"{spent:.2g}"]
        )
    for d in (1e-2, 1e-4, 1e-6):
        began = perf_counter()
        slope = (stepped(V + d, 1e-4) - stepped(V - d, 1e-4)).real / (2 * d)
        spent = perf_counter() - began
        name = f"differences of ±{d:g}, steps of 1e-4"
        rows.append([name, f"{slope:.4f}", _off(slope, value), f"{spent:.2g}"])
    rows.append(["**stickslip**, through every switch", f"{value:.10f}", "", f"{seconds:.2g}"])
    return table(["derivative", "∂x(20)/∂V", "error", "seconds"], rows) + f"\n\n{versions()}\n"


def _off(found: float, value: float) -> str:
    return f"{100 * abs(found - value) / abs(value):.2g} %"


if __name__ == "__main__":
    print(report())
