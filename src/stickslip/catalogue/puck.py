"""A puck that is thrown on a table, with a constant side force."""

from stickslip.model.system import Condition, Contact, Inertial, Parameter, System


def puck(**given: float | str) -> System:
    """Puck thrown across a slightly tilted table. Friction opposes its velocity, and the side force
    turns the velocity, more quickly as the puck slows down; the puck stops with its velocity along
    the force.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``mu``, ``g``, ``F``.

    References
    ----------
    Coulomb's law in a plane. With the friction k = μmg it gives d(k·abs(v) + F·v_x)/dt = −(k² −
    F²)/m, so that a puck thrown with the velocity v stops after m (k·abs(v) + F·v_x)/(k² − F²), in
    whatever direction it is thrown.
    """
    return System(
        name="puck",
        title="Puck on a tilted table",
        source="Coulomb's law in a plane",
        parameters={
            "m": Parameter(0.2, "kg", "mass", "(0, inf)"),
            "mu": Parameter(0.2, "1", "coefficient of friction", "(0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
            "F": Parameter(0.3, "N", "side force, along x", "[0, inf)"),
        },
        functions={"k": "mu*m*g"},
        coordinates={
            "x": Inertial("m", "position along the force", force="F"),
            "y": Inertial("m", "position perpendicular to the force"),
        },
        kinetic="m/2*(d_x**2 + d_y**2)",
        contacts={"table": Contact(("d_x", "d_y"), threshold="k", unit="N")},
        initial={"d_x": -1.0, "d_y": 1.5},
        span=(0, 3),
        time_unit="s",
        conditions={"rest": Condition("mu*m*g > F", "the puck never stops")},
        facts={"friction": "k", "force_ratio": "F/k"},
    ).configure(given)
