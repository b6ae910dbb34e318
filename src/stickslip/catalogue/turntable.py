"""A block on a turntable, held by a spring."""

from stickslip.model.system import Condition, Contact, DefaultSpan, Inertial, Parameter, System


def turntable(**given: float | str) -> System:
    """Block on a rotating disc, held by a weak spring whose end is fixed away from the axis. The
    disc carries the block along until the spring is stretched, the block slips back, and sticks
    again, in a loop. Without the spring (``k=0``) it is carried around, or thrown off.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``mu``, ``mu_k``, ``g``, ``k``, ``R``, ``Omega_0``; drive ``Omega``
        (angular velocity of the disc, of t).

    References
    ----------
    The block on a belt (V. L. Popov, *Contact Mechanics and Friction*, Springer 2010, chapter 12)
    with two components. While the disc carries it from the place R of the spring's end through the
    angle φ, friction is R times the distance of (k − mΩ²)(cos φ, sin φ) from (k, 0); it slips where
    that is μmg. Without a spring it is carried around as long as mΩ²R < μmg.
    """
    return System(
        name="turntable",
        title="Block on a turntable, held by a spring",
        source="with two components: Popov 2010, chapter 12",
        parameters={
            "m": Parameter(0.1, "kg", "mass of the block", "(0, inf)"),
            "mu": Parameter(0.3, "1", "coefficient of static friction", "[0, inf)"),
            "mu_k": Parameter(0.2, "1", "coefficient of kinetic friction", "[0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
            "k": Parameter(4.0, "N/m", "stiffness of the spring", "[0, inf)"),
            "R": Parameter(0.1, "m", "distance of the end of the spring from the axis", "(0, inf)"),
            "Omega_0": Parameter(1.0, "rad/s", "angular velocity of the disc", "(0, inf)"),
        },
        functions={"s": "mu*m*g", "K": "k - m*Omega_0**2"},
        drives={"Omega": "Omega_0"},
        coordinates={
            "x": Inertial("m", "position of the block, from the axis"),
            "y": Inertial("m", "position across"),
        },
        kinetic="m/2*(d_x**2 + d_y**2)",
        potential="k/2*((x - R)**2 + y**2)",
        contacts={
            "disc": Contact(
                ("d_x", "d_y"),
                threshold="s",
                kinetic="mu_k*m*g",
                surface_speed=("-Omega*y", "Omega*x"),
                unit="N",
            )
        },
        initial={"x": 0.1, "d_y": 0.1},
        span=DefaultSpan((0, 20)),
        time_unit="s",
        conditions={
            "carried": Condition("s > m*Omega_0**2*R", "the block does not stick at the start"),
            "drop": Condition("mu >= mu_k", "kinetic friction is above static friction"),
        },
        facts={"slip_angle": "acos((K**2 + k**2 - (s/R)**2)/(2*k*K))"},
    ).configure(given)
