"""A user-defined friction coefficient μ(α) in the slider of Mielke 2017, section 3: the loss of
stability of steady sliding, cycles down to the viscosity 0.001, and averages of oscillating
friction.

Prints the Hopf point and its closed form, the periods, and the rate at which the resolved motions
converge to the averaged one.
"""

import numpy as np

import stickslip as ss

slider = ss.catalogue.spring_slider(mu="0.4 + 1.2/alpha", nu=0.05)


def hopf():
    """The rate of the load at which steady sliding loses stability."""
    steady = ss.continue_equilibrium(slider, "V", (0.02, 1.0))
    return steady.of_kind("Hopf")[0]


def periods(viscosities=(0.05, 0.01, 0.002, 0.001), V=0.1):
    """The period of stick-slip, and the time in stick, for decreasing viscosity."""
    found = {}
    for nu in viscosities:
        cycle = ss.find_cycle(slider, parameters={"nu": nu, "V": V})
        found[nu] = cycle.period, cycle.stick_time
    return found


def averaging(epsilons=(0.2, 0.1, 0.05), tolerance=1e-3):
    """The distance of motions in R³ under oscillating friction from the averaged one (Theorem 2.2).

    Each component has its own phase at which it rubs least.
    """
    friction = ss.WeightedL1([f"1 + 0.5*cos(2*pi*(s - {shift}))" for shift in (0.0, 0.3, 0.6)])
    stiffness = np.array([[2.0, -0.5, 0.0], [-0.5, 2.0, -0.5], [0.0, -0.5, 2.0]])
    problem = ss.Evolution(
        stiffness,
        ["3*sin(t)", "2*t", "t"],
        friction,
        [0.0, 0.0, 0.0],
        epsilon=epsilons[0],
        span=(0.0, 3.0),
    )
    return ss.averaging_study(problem, epsilons, tolerance=tolerance)


if __name__ == "__main__":
    point = hopf()
    print(f"Hopf at V = {point.value:.9f}, {point.note}")
    for nu, (period, stick) in periods().items():
        print(f"nu = {nu}: period {period:.6f}, of which in stick {stick:.6f}")
    study = averaging()
    print(study.summary())
    study.plot().savefig("averaging.png")
