"""A curling stone, a ring on ice."""

from stickslip.model.system import Condition, Contact, Inertial, Parameter, System


def curling_stone(**given: float | str) -> System:
    """Curling stone on a ring, rotating slowly while it slides, on ice whose friction decreases
    with the speed.

    It moves in a straight line: under uniform pressure the lateral forces at its front and at its
    back cancel. A real stone curls by a metre, because the friction at the two differs; the cause
    is still debated.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``a``, ``b``, ``mu``, ``v_0``, ``g``.

    References
    ----------
    A. R. Penner, *The physics of sliding cylinders and curling rocks*, Am. J. Phys. 69 (2001)
    332-339, on what makes a stone curl. The friction law was chosen for this catalogue.
    """
    return System(
        name="curling_stone",
        title="Curling stone on ice",
        source="after Penner 2001",
        parameters={
            "m": Parameter(19.0, "kg", "mass", "(0, inf)"),
            "a": Parameter(0.06, "m", "radius of the running band", "(0, inf)"),
            "b": Parameter(0.145, "m", "radius of the stone", "(0, inf)"),
            "mu": Parameter(0.03, "1", "coefficient of friction at rest", "[0, inf)"),
            "v_0": Parameter(0.3, "m/s", "speed over which friction decreases", "(0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
        },
        coordinates={
            "x": Inertial("m", "distance"),
            "y": Inertial("m", "deflection to the left"),
            "phi": Inertial("rad", "angle of rotation"),
        },
        kinetic="m/2*(d_x**2 + d_y**2) + m*b**2/4*d_phi**2",
        contacts={
            "ice": Contact(
                ("d_x", "d_y", "d_phi"),
                "mu*m*g",
                dissipation="ring(v1, v2, a*v3)",
                kinetic="mu*m*g/sqrt(1 + speed/v_0)",
                unit="N",
            )
        },
        initial={"d_x": 2.4, "d_phi": 2.5},
        span=(0, 30),
        time_unit="s",
        conditions={"friction": Condition("mu > 0", "the body never comes to rest")},
    ).configure(given)
