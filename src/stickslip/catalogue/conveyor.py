"""A parcel that is handed over from one belt to another."""

from stickslip.model.system import Condition, Contact, Inertial, Parameter, System


def conveyor(**given: float | str) -> System:
    """Parcel that passes from one belt to another at a right angle. Both belts exert friction on
    it, each in proportion to the part of the weight that it bears, and the parcel turns the corner
    in a slip.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``mu``, ``g``, ``V_1``, ``V_2``, ``L``; function ``share`` (part of the
        weight on the second belt, of x).

    References
    ----------
    Coulomb's law with two supports. As long as the first belt carries more of the weight, it holds
    the parcel against the friction of the second: slip begins where both carry the same, at x = 0.
    """
    return System(
        name="conveyor",
        title="Parcel handed over between two belts",
        source="Coulomb's law with two supports",
        parameters={
            "m": Parameter(2.0, "kg", "mass of the parcel", "(0, inf)"),
            "mu": Parameter(0.4, "1", "coefficient of friction of both belts", "(0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
            "V_1": Parameter(1.0, "m/s", "speed of the first belt, along x", "[0, inf)"),
            "V_2": Parameter(0.8, "m/s", "speed of the second belt, along y", "[0, inf)"),
            "L": Parameter(0.1, "m", "length of the parcel", "(0, inf)"),
        },
        functions={"share(x)": "(1 + tanh(2*x/L))/2"},
        coordinates={
            "x": Inertial("m", "position of the parcel along the first belt"),
            "y": Inertial("m", "position along the second belt"),
        },
        kinetic="m/2*(d_x**2 + d_y**2)",
        contacts={
            "first belt": Contact(
                ("d_x", "d_y"), "mu*m*g*(1 - share(x))", surface_speed=("V_1", 0), unit="N"
            ),
            "second belt": Contact(
                ("d_x", "d_y"), "mu*m*g*share(x)", surface_speed=(0, "V_2"), unit="N"
            ),
        },
        initial={"x": -0.4, "d_x": 1.0},
        span=(0, 1.5),
        time_unit="s",
        conditions={
            "hand-over": Condition("V_1 > 0", "the parcel does not reach the second belt"),
        },
    ).configure(given)
