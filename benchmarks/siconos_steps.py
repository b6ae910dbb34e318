"""Moreau-Jean time stepping of M q'' + C q' + K q = push₀ + push₁ sin(push₂ t) with contacts by
Siconos; run by the system's Python.

Reads the mechanics, a start, a span and steps as JSON, and writes for every step the end and the
median of the seconds of its loop.
"""

import json
import sys
import time
from statistics import median

import numpy as np
import siconos.kernel as sk  # pyright: ignore[reportMissingImports]
import siconos.numerics as sn  # pyright: ignore[reportMissingImports]

CONTACT = ("normal", "tangent", "offset", "mu", "e")


def follow(given, step):
    """The end and the seconds of the loop."""
    d = len(given["M"])
    body = sk.LagrangianLinearTIDS(
        given["start"][:d],
        given["start"][d:],
        *(np.array(given[name]) for name in ("M", "K", "C")),
    )
    steady, swing, rate = (np.array(row) for row in given["push"])
    body.setFExtPtr(steady)
    model = sk.NonSmoothDynamicalSystem(0.0, given["span"])
    model.insertDynamicalSystem(body)
    for n, t, offset, mu, e in zip(*(given[x] for x in CONTACT), strict=True):
        relation = sk.LagrangianLinearTIR(np.array([n, t]), np.array([offset, 0.0]))
        law = sk.NewtonImpactFrictionNSL(e, 0.0, mu, 2)
        model.link(sk.Interaction(law, relation), body)
    steps = sk.TimeDiscretisation(0.0, step)
    solver = sk.FrictionContact(2, sn.SICONOS_FRICTION_2D_NSGS)  # Lemke is wrong for two contacts
    solver.numericsSolverOptions().dparam[0] = 1e-14  # a toy's impulses are small
    simulation = sk.TimeStepping(model, steps, sk.MoreauJeanOSI(0.5), solver)
    began = time.perf_counter()
    while simulation.hasNextEvent():
        # The force in the middle of the step, which the scheme of order one takes for the whole.
        middle = simulation.startingTime() + 0.5 * step
        body.setFExtPtr(steady + swing * np.sin(rate * middle))
        simulation.computeOneStep()
        simulation.nextStep()
    spent = time.perf_counter() - began
    return [*map(float, body.q()), *map(float, body.velocity())], spent


def main():
    """All steps, each several times."""
    given = json.load(sys.stdin)
    rows = []
    for step in given["steps"]:
        runs = [follow(given, step) for _ in range(given["rounds"])]
        rows.append([step, runs[0][0], median(r[1] for r in runs)])
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
