"""The forced oscillator with a dry damper behind a spring."""

from stickslip.model import laws
from stickslip.model.system import Condition, DefaultSpan, Inertial, Parameter, System


def jenkins_oscillator(**given: float | str) -> System:
    """Mass on a spring under a harmonic force, damped by a slider behind a second spring.

    Under a small force the slider sticks, and the resonance is that of both springs; under a large
    one the damper is weak, and the resonance is that of one spring. In between the damping has a
    maximum.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``c``, ``k``, ``k_d``, ``F_c``, ``P``, ``omega``; free function ``force``
        (of t).

    References
    ----------
    J. H. Griffin, *Friction damping of resonant stresses in gas turbine engine airfoils*, J. Eng.
    Power 102 (1980) 329-333. As long as the slider sticks, the amplitude is P over the modulus of k
    + k_d − mω² + icω. For k_d → ∞ this is Den Hartog's oscillator.
    """
    return System(
        name="jenkins_oscillator",
        title="Oscillator with a dry damper behind a spring",
        source="Griffin 1980",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "c": Parameter(0.05, "N*s/m", "viscous damping", "[0, inf)"),
            "k": Parameter(1.0, "N/m", "stiffness", "(0, inf)"),
            "k_d": Parameter(1.0, "N/m", "stiffness of the damper", "(0, inf)"),
            "F_c": Parameter(0.5, "N", "force at which the damper slides", "(0, inf)"),
            "P": Parameter(0.5, "N", "amplitude of the force", "(0, inf)"),
            "omega": Parameter(1.2, "rad/s", "angular frequency of the force", "(0, inf)"),
        },
        drives={"force": "P*cos(omega*t)"},
        coordinates={"x": Inertial("m", "position of the mass")},
        kinetic="m/2*d_x**2",
        potential="k/2*x**2 - force*x",
        viscous="c/2*d_x**2",
        contacts={"damper": laws.jenkins("d_x", unit="N", F_c="F_c", k="k_d")},
        span=DefaultSpan((0, 80)),
        time_unit="s",
        functions={"A_0": "P/sqrt((k + k_d - m*omega**2)**2 + (c*omega)**2)"},
        conditions={"slip": Condition("k_d*A_0 > F_c", "the damper never slides")},
        facts={
            "amplitude_stuck": "A_0",
            "omega_stuck": "sqrt((k + k_d)/m)",
            "omega_free": "sqrt(k/m)",
        },
    ).configure(given)
