"""A two-legged crawler whose spring is lengthened by two harmonics: the fastest gait for a given
effort, and the gait with the minimum cost of transport at a given speed, found by SLSQP with exact
derivatives of the cycle.

Prints speed and cost of transport of the initial, the fastest and the most economical gait.
"""

import numpy as np
from scipy.optimize import minimize

import stickslip as ss

crawler = ss.System(
    "crawler",
    parameters={
        "A": ss.Parameter(0.5, "m", "first harmonic of the length"),
        "B": ss.Parameter(0.05, "m", "second harmonic of the length"),
        "phi": ss.Parameter(0.5, "rad", "phase of the second harmonic"),
        "m": ss.Parameter(0.2, "kg", "mass of a leg"),
        "g": ss.Parameter(9.81, "m/s^2", "gravity"),
    },
    drives={"L": "1 + A*sin(t) + B*sin(2*t + phi)"},
    coordinates={"x_1": ss.Inertial("m"), "x_2": ss.Inertial("m")},
    kinetic="m/2*(d_x_1**2 + d_x_2**2)",
    potential="5*(x_2 - x_1 - L)**2",
    viscous="0.05*(d_x_2 - d_x_1)**2",
    contacts={
        "hind": ss.Contact("d_x_1", (0.1, 0.4), unit="N"),  # forward, backward
        "front": ss.Contact("d_x_2", (0.1, 0.4), unit="N"),
    },
    translation={"x_1": 1, "x_2": 1},
    initial={"x_2": 1.0},
    time_unit="s",
    span=(0.0, 60.0),
)
NAMES = ["A", "B", "phi"]
BOUNDS = [(0.1, 1.0), (0.0, 0.3), (-np.pi, np.pi)]
COST = "cost_of_transport:2*m*g"


def gait(values):
    return ss.find_cycle(crawler, parameters=dict(zip(NAMES, values, strict=True)))


def fastest(iterations=20):
    """The fastest gait with the initial effort A² + 4B² of the actuator."""
    start = np.array([crawler.values[name] for name in NAMES])
    effort = start[0] ** 2 + 4 * start[1] ** 2

    def speed(values):
        found = gait(values)
        slope = found.sensitivity(NAMES)["speed"].values
        return -found.speed, -slope

    same_effort = {
        "type": "eq",
        "fun": lambda v: v[0] ** 2 + 4 * v[1] ** 2 - effort,
        "jac": lambda v: np.array([2 * v[0], 8 * v[1], 0.0]),
    }
    return minimize(
        speed,
        start,
        jac=True,
        method="SLSQP",
        bounds=BOUNDS,
        constraints=[same_effort],
        options={"maxiter": iterations},
    )


def cheapest(least_speed, iterations=20):
    """The gait with the minimum cost of transport among those that are at least this fast."""
    known = {}  # of the last gait: SLSQP evaluates the same gait several times

    def at(values):
        if known.get("values") != tuple(values):
            found = gait(values)
            slopes = found.sensitivity(NAMES, of=["speed", COST])
            known.update(values=tuple(values), cycle=found, slopes=slopes)
        return known["cycle"], known["slopes"]

    fast_enough = {
        "type": "ineq",
        "fun": lambda v: at(v)[0].speed - least_speed,
        "jac": lambda v: at(v)[1]["speed"].values,
    }
    return minimize(
        lambda v: at(v)[0].cost_of_transport("2*m*g"),
        [crawler.values[name] for name in NAMES],
        jac=lambda v: at(v)[1][COST].values,
        method="SLSQP",
        bounds=BOUNDS,
        constraints=[fast_enough],
        options={"maxiter": iterations, "ftol": 1e-9},
    )


if __name__ == "__main__":
    start = gait([crawler.values[name] for name in NAMES])
    fast = fastest()
    cheap = cheapest(start.speed)
    for name, cycle in {"start": start, "fastest": gait(fast.x), "cheapest": gait(cheap.x)}.items():
        cost = cycle.cost_of_transport("2*m*g")
        print(f"{name:9} {cycle.speed:.6f} m/s, cost of transport {cost:.6f}")
    for found in (fast, cheap):
        values = ", ".join(f"{name} = {x:.6f}" for name, x in zip(NAMES, found.x, strict=True))
        print(f"{values}: {found.nfev} gaits, {found.message}")
    gait(fast.x).plot().savefig("gait.png")
