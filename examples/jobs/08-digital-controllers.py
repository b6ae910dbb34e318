"""A carriage with stiction under PD and PID controllers that sample at 1 kHz, with delay,
quantisation and noise of the measured position.

Prints the remaining error or the amplitude of hunting, and the fraction of time at rest. Writes the
PID loop as an FMU, for Simulink and Modelica, if pythonfmu is installed.
"""

import numpy as np

import stickslip as ss

PARAMETERS = {
    "m": ss.Parameter(2.0, "kg", "mass"),
    "F_s": ss.Parameter(1.5, "N", "friction at rest"),
    "F_k": ss.Parameter(1.0, "N", "friction in motion"),
    "goal": ss.Parameter(1.0, "m"),
    "k_p": ss.Parameter(40.0, "N/m"),
    "k_i": ss.Parameter(60.0, "N/(m*s)"),
    "k_d": ss.Parameter(12.0, "N*s/m"),
    "T": ss.Parameter(1e-3, "s", "sampling period"),
    "sigma": ss.Parameter(2e-3, "m", "noise of the measured position"),
}


def carriage(k_i=60.0, delay=0, quantum=0.0, seed=None, until=40.0):
    """The closed loop. The delay is in periods; with a seed the measured position has noise."""
    seen = "x" if seed is None else "(x + sigma*w)"
    internal = {
        "I": ss.Sampled("T", f"I + T*(goal - {seen})", unit="m*s"),
        "F": ss.Sampled("T", f"k_p*(goal - {seen}) + k_i*I - k_d*d_x", unit="N", quantum=quantum),
    }
    force = "F"
    for i in range(delay):
        internal[f"F_{i}"] = ss.Sampled("T", force, unit="N")
        force = f"F_{i}"
    return ss.System(
        "carriage",
        parameters=PARAMETERS,
        drives={} if seed is None else {"w": ss.noise((0.0, until), 4e-3, seed=seed)},
        coordinates={"x": ss.Inertial("m", "position")},
        internal=internal,
        kinetic="m*d_x**2/2",
        potential=f"-{force}*x",
        contacts={"rail": ss.Contact("d_x", "F_s", kinetic="F_k", unit="N")},
        time_unit="s",
        span=(0.0, until),
    ).with_parameters(k_i=k_i)


def hunting(motion):
    """The final error, the amplitude of hunting, and the fraction of time at rest."""
    end = motion.t_span[1]
    late = motion.at(np.linspace(end / 2, end, 10_001))
    return abs(1.0 - motion.final["x"]), np.ptp(late["x"]), np.mean(late["d_x"] == 0.0)


if __name__ == "__main__":
    loops = {
        "PD": carriage(k_i=0.0),
        "PID": carriage(),
        "PID, 2 ms late": carriage(delay=2),
        "PID, steps of 0.02 N": carriage(quantum=0.02),
        "PID, noise of 2 mm": carriage(seed=1),
    }
    for name, system in loops.items():
        motion = ss.simulate(system)
        error, swing, rest = hunting(motion)
        print(
            f"{name}: {1e3 * error:.2f} mm off, swings by {1e3 * swing:.2f} mm, "
            f"rests {rest:.0%}, certified: {motion.certificate.ok}"
        )
    try:
        ss.export(loops["PID"], "carriage.fmu")
    except ss.StickslipError as error:
        print(error)
    ss.simulate(loops["PID"]).plot("x", "F", "mode_rail").savefig("hunting.png")
