"""Drill strings of 2 and of 20 inertias: maps of stick over rotary speed and weight on the bit, and
the friction of the bit identified from a noisy record of the speeds of table and bit.

Prints the fraction of each map in which the bit sticks, and the fitted and true torques.
"""

import numpy as np

import stickslip as ss

RPM = 2 * np.pi / 60  # rad/s
TRUTH = {"mu_s": 0.048, "mu_k": 0.032}  # torque at the bit, per weight on it, in m


def drill_string(collars=1):
    """A table driven by a motor, a pipe divided into parts, and a bit with friction.

    Angles are those in the frame that turns evenly with the table.
    """
    last = collars
    angles = [f"a{i}" for i in range(collars + 1)]
    part = 374.0 / collars  # kg m², inertia of pipe, collars and bit
    twists = " + ".join(f"(a{i + 1} - a{i})**2" for i in range(collars))
    rates = " + ".join(f"(d_a{i + 1} - d_a{i})**2" for i in range(collars))
    pipe = " + ".join(f"{part}/2*d_{name}**2" for name in angles[1:])
    return ss.System(
        f"drill string of {collars + 1} inertias",
        parameters={
            "Omega": ss.Parameter(120 * RPM, "rad/s", "speed of the table", "(0, inf)"),
            "W": ss.Parameter(1.2e5, "N", "weight on the bit", "(0, inf)"),
            "mu_s": ss.Parameter(TRUTH["mu_s"], "m", "torque at rest, per weight"),
            "mu_k": ss.Parameter(TRUTH["mu_k"], "m", "torque at high speed, per weight"),
            "k": ss.Parameter(473.0, "N*m/rad", "torsional stiffness of the pipe"),
            "tau": ss.Parameter(0.01, "s", "damping of the pipe over its stiffness"),
            "c": ss.Parameter(50.0, "N*m*s/rad", "damping by the mud, at the bit"),
        },
        coordinates={name: ss.Inertial("rad") for name in angles},
        kinetic=f"2122.0/2*d_a0**2 + {pipe}",
        potential=f"k*{collars}/2*({twists}) + 3000/2*a0**2",
        viscous=f"4000/2*d_a0**2 + c/2*d_a{last}**2 + tau*k*{collars}/2*({rates})",
        contacts={
            "bit": ss.laws.stribeck(
                f"d_a{last}", F_s="mu_s*W", F_c="mu_k*W", v_s=2.0, surface_speed="-Omega"
            )
        },
        outputs={"bit_speed": ss.Output(f"Omega + d_a{last}", "rad/s", "speed of the bit")},
        time_unit="s",
        span=(0.0, 60.0),
    )


def sticking(string, speeds=9, weights=5):
    """The fraction of the time in which the bit sticks."""
    over = {"Omega": np.linspace(40, 160, speeds) * RPM, "W": np.linspace(4e4, 2e5, weights)}
    return ss.sweep(string, over, ["stick_fraction", "high:bit_speed"])


def record(string, seed=1):
    """The speeds of table and bit over 30 s, sampled at 20 Hz, with noise."""
    t = np.linspace(0.0, 30.0, 601)
    motion = ss.simulate(string, (0.0, 30.0)).at(t)
    noise = 0.3 * np.random.default_rng(seed).standard_normal((2, len(t)))
    table = string.values["Omega"] + motion["d_a0"] + noise[0]
    return {"t": t, "table": table, "bit": motion["bit_speed"] + noise[1]}


def calibrated(string, data, starts=4):
    """The two torques of the bit, fitted to the record."""
    observe = {"table": "Omega + d_a0", "bit": "bit_speed"}
    return ss.fit(string, data, {"mu_s": (0.01, 0.1), "mu_k": (0.01, 0.1)}, observe, starts=starts)


if __name__ == "__main__":
    short, long = drill_string(1), drill_string(19)
    for string in (short, long):
        found = sticking(string)
        stick = found["stick_fraction"].values
        print(
            f"{string.name}: sticks at {np.mean(stick > 0):.0%}, "
            f"not settled {np.mean(np.isnan(stick)):.0%}"
        )
        found.plot().savefig(f"{string.name}.png".replace(" ", "-"))
    fit = calibrated(short, record(short))
    for name, truth in TRUTH.items():
        low, high = fit.interval[name]
        print(f"{name} = {fit.estimate[name]:.5f} (95 %: {low:.5f} to {high:.5f}), truth {truth}")
    fit.plot().savefig("drill-string-fit.png")
