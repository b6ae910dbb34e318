"""A crawler of two legs whose spring is lengthened by two harmonics: the gait that is fastest for a
given effort, by SLSQP with exact derivatives of the cycle.

Prints the gait before and after, and its speed.
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


def gait(values):
    return ss.find_cycle(crawler, parameters=dict(zip(NAMES, values, strict=True)))


def fastest(iterations=20):
    """The fastest gait with A² + 4B² as at the start, which is the effort of the actuator."""
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
    bounds = [(0.1, 1.0), (0.0, 0.3), (-np.pi, np.pi)]
    return minimize(
        speed,
        start,
        jac=True,
        method="SLSQP",
        bounds=bounds,
        constraints=[same_effort],
        options={"maxiter": iterations},
    )


if __name__ == "__main__":
    found = fastest()
    before, after = gait([crawler.values[name] for name in NAMES]), gait(found.x)
    print(f"{before.speed:.6f} m/s, {before.energy_per_distance:.6f} N")
    print(f"{after.speed:.6f} m/s, {after.energy_per_distance:.6f} N, {found.message}")
    print(dict(zip(NAMES, found.x.round(6), strict=True)), f"{found.nfev} gaits")
    after.plot().savefig("gait.png")
