"""A pendulum on a cart with friction on its track."""

from stickslip.model.system import Contact, Inertial, Parameter, System


def cart_pendulum(**given: float | str) -> System:
    """Pendulum on a cart with dry friction: inertia that depends on the angle.

    Large swings move the cart, which sticks in between. Once they have decayed so far that the rod
    cannot move the cart any more, the pendulum swings as if its pivot were fixed. This is the case
    if F_c exceeds the largest horizontal force of the rod.

    Parameters
    ----------
    **given : float or str
        Parameters ``M``, ``m``, ``l``, ``g``, ``F_c``, ``c``, ``A``, ``omega``; free function
        ``push`` (force on the cart, of t).

    References
    ----------
    The equations are found in textbooks; with friction: S. A. Campbell, S. Crawford and K.
    Morris, *Friction and the inverted pendulum stabilization problem*, J. Dyn. Syst. Meas. Control
    130 (2008), 054502.
    """
    return System(
        name="cart_pendulum",
        title="Pendulum on a cart with dry friction",
        source="Campbell, Crawford and Morris 2008",
        parameters={
            "M": Parameter(1.0, "kg", "mass of the cart", "(0, inf)"),
            "m": Parameter(0.5, "kg", "mass of the bob", "(0, inf)"),
            "l": Parameter(0.7, "m", "length of the rod", "(0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "[0, inf)"),
            "F_c": Parameter(1.0, "N", "friction under the cart", "[0, inf)"),
            "c": Parameter(0.0, "N*m*s", "viscous friction of the joint", "[0, inf)"),
            "A": Parameter(0.0, "N", "amplitude of a force on the cart"),
            "omega": Parameter(2.0, "1/s", "frequency of the force", "(0, inf)"),
        },
        functions={"push": "A*sin(omega*t)"},
        coordinates={
            "x": Inertial("m", "position of the cart", force="push"),
            "phi": Inertial("rad", "angle of the rod from the hanging position"),
        },
        kinetic="M/2*d_x**2 + m/2*(d_x**2 + 2*l*d_x*d_phi*cos(phi) + l**2*d_phi**2)",
        potential="-m*g*l*cos(phi)",
        viscous="c/2*d_phi**2",
        contacts={"track": Contact("d_x", threshold="F_c", unit="N")},
        translation={"x": 1},
        initial={"phi": 2.5},
        span=(0, 20),
        time_unit="s",
    ).configure(given)
