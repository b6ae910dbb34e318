"""One mode of a bowed string."""

from stickslip.model.system import Condition, Contact, Inertial, Parameter, System


def bowed_string(**given: float | str) -> System:
    """One mode of a string under a bow whose friction decreases with the sliding speed.

    If the bow is pressed with less than F_min, it slides steadily and the string is silent.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``f``, ``zeta``, ``F``, ``V``, ``mu_s``, ``mu_d``, ``v_0``.

    References
    ----------
    L. Cremer, *The Physics of the Violin*, MIT Press 1984; J. H. Smith and J. Woodhouse, *The
    tribology of rosin*, J. Mech. Phys. Solids 48 (2000) 1633-1681, for the hyperbola μ_d + (μ_s −
    μ_d) v_0/(v_0 + |u|). Steady sliding is unstable if F (μ_s − μ_d) v_0/(v_0 + V)² exceeds the
    damping 4πζfm.
    """
    return System(
        name="bowed_string",
        title="One mode of a bowed string",
        source="Cremer 1984; Smith and Woodhouse 2000",
        parameters={
            "m": Parameter(5e-4, "kg", "modal mass", "(0, inf)"),
            "f": Parameter(196.0, "Hz", "frequency of the mode", "(0, inf)"),
            "zeta": Parameter(0.005, "1", "damping ratio", "[0, inf)"),
            "F": Parameter(0.2, "N", "force on the bow", "[0, inf)"),
            "V": Parameter(0.1, "m/s", "speed of the bow", "(0, inf)"),
            "mu_s": Parameter(0.8, "1", "coefficient of friction", "[0, inf)"),
            "mu_d": Parameter(0.3, "1", "coefficient of friction", "[0, inf)"),
            "v_0": Parameter(0.1, "m/s", "speed over which friction decreases", "(0, inf)"),
        },
        functions={
            "w": "2*pi*f",
            "F_min": "2*zeta*w*m*(v_0 + V)**2/((mu_s - mu_d)*v_0)",
        },
        coordinates={"x": Inertial("m", "displacement under the bow")},
        kinetic="m/2*d_x**2",
        potential="m*w**2/2*x**2",
        viscous="zeta*w*m*d_x**2",
        contacts={
            "bow": Contact(
                "d_x",
                threshold="F*mu_s",
                surface_speed="V",
                kinetic="F*(mu_d + (mu_s - mu_d)*v_0/(v_0 + speed))",
                unit="N",
            )
        },
        span=(0, 0.15),
        time_unit="s",
        conditions={"sound": Condition("F > F_min", "the bow slides steadily: no sound")},
        facts={"least_bow_force": "F_min", "smallest_amplitude": "V/w"},
    ).configure(given)
