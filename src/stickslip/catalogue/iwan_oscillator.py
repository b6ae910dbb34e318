"""The forced oscillator with a joint of many sliders."""

from stickslip.model import laws
from stickslip.model.system import DefaultSpan, Inertial, Parameter, System


def iwan_oscillator(**given: float | str) -> System:
    """Mass on a spring under a harmonic force, with a bolted joint: sliders of all strengths.

    Weak sliders slip at any amplitude A, and the energy that they dissipate per cycle grows like A
    to the power 3 + chi; once all slip the joint force is F_c.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``c``, ``k``, ``k_j``, ``F_c``, ``chi``, ``P``, ``omega``; free function
        ``force`` (of t).

    References
    ----------
    W. D. Iwan, *A distributed-element model for hysteresis and its steady-state dynamic response*,
    J. Appl. Mech. 33 (1966) 893-900; D. J. Segalman, *A four-parameter Iwan model for lap-type
    joints*, J. Appl. Mech. 72 (2005) 752-760, for the power law. Up to full slip a cycle of
    amplitude A dissipates 4 k_j (1 + χ) A^(3+χ)/((2 + χ)(3 + χ) φ^(1+χ)), φ = (F_c/k_j)(2 + χ)/(1 +
    χ).
    """
    return System(
        name="iwan_oscillator",
        title="Oscillator with a joint of many sliders",
        source="Iwan 1966; Segalman 2005",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "c": Parameter(0.02, "N*s/m", "viscous damping", "[0, inf)"),
            "k": Parameter(1.0, "N/m", "stiffness", "(0, inf)"),
            "k_j": Parameter(1.0, "N/m", "stiffness of the joint", "(0, inf)"),
            "F_c": Parameter(0.5, "N", "largest force of the joint", "(0, inf)"),
            "chi": Parameter(0.0, "1", "exponent of the distribution", "(-1, inf)"),
            "P": Parameter(0.2, "N", "amplitude of the force", "(0, inf)"),
            "omega": Parameter(1.2, "rad/s", "angular frequency of the force", "(0, inf)"),
        },
        drives={"force": "P*cos(omega*t)"},
        coordinates={"x": Inertial("m", "position of the mass")},
        kinetic="m/2*d_x**2",
        potential="k/2*x**2 - force*x",
        viscous="c/2*d_x**2",
        contacts={"joint": laws.iwan("d_x", unit="N", F_c="F_c", k="k_j", chi="chi", elements=6)},
        span=DefaultSpan((0, 60)),
        time_unit="s",
        facts={
            "full_slip": "F_c/k_j*(2 + chi)/(1 + chi)",
            "omega_stuck": "sqrt((k + k_j)/m)",
            "omega_free": "sqrt(k/m)",
        },
    ).configure(given)
