"""The harmonically forced oscillator with dry friction, Den Hartog 1931."""

from stickslip.model.system import Condition, Contact, DefaultSpan, Inertial, Parameter, System


def forced_oscillator(**given: float | str) -> System:
    """Mass on a spring with dry friction under a harmonic force: m ẍ + k x + F_c Sign(ẋ) ∋ P cos
    ωt.

    The default has two stops per period; with little friction (F_c = 0.3, omega = 0.8) the motion
    is non-stop.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``k``, ``F_c``, ``P``, ``omega``; free function ``force`` (of t).

    References
    ----------
    J. P. Den Hartog, *Forced vibrations with combined Coulomb and viscous friction*, Trans. ASME 53
    (1931) 107-115. The facts are his, for non-stop motion: with r = ω√(m/k) and β = F_c/P the
    amplitude is (P/k)√(V_r² − β²U_r²).
    """
    return System(
        name="forced_oscillator",
        title="Forced oscillator with dry friction",
        source="Den Hartog 1931",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "k": Parameter(1.0, "N/m", "stiffness", "(0, inf)"),
            "F_c": Parameter(0.6, "N", "dry friction", "[0, inf)"),
            "P": Parameter(1.0, "N", "amplitude of the force", "(0, inf)"),
            "omega": Parameter(0.4, "rad/s", "angular frequency of the force", "(0, inf)"),
        },
        functions={
            "r": "omega*sqrt(m/k)",
            "V_r": "1/(1 - r**2)",
            "U_r": "sin(pi/r)/(r*(1 + cos(pi/r)))",
        },
        drives={"force": "P*cos(omega*t)"},
        coordinates={"x": Inertial("m", "position of the mass")},
        kinetic="m/2*d_x**2",
        potential="k/2*x**2 - force*x",
        contacts={"friction": Contact("d_x", threshold="F_c", unit="N")},
        span=DefaultSpan((0, 100)),
        time_unit="s",
        conditions={
            "motion": Condition(
                "F_c < P", "the force does not overcome the friction: the mass stays at rest"
            )
        },
        facts={"r": "r", "beta": "F_c/P", "nonstop_amplitude": "P/k*sqrt(V_r**2 - (F_c/P*U_r)**2)"},
    ).configure(given)
