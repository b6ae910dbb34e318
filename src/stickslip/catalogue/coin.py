"""A coin that slides and spins on a table."""

from stickslip.model.system import Condition, Contact, Inertial, Parameter, System


def coin(**given: float | str) -> System:
    """Coin thrown across a table with spin: a disc under uniform pressure.

    The faster it spins, the smaller the friction against its sliding. However it is thrown, sliding
    and spinning end at the same instant, with the same ratio of speeds. The parameters are those of
    a one-euro coin.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``a``, ``mu``, ``g``.

    References
    ----------
    Z. Farkas, G. Bartels, T. Unger & D. E. Wolf, *Frictional coupling between sliding and spinning
    motion*, Phys. Rev. Lett. 90 (2003) 248302: v/(aω) tends to 0.653 as the coin comes to rest, if
    it both slides and spins at the start.
    """
    return System(
        name="coin",
        title="Coin that slides and spins",
        source="Farkas et al. 2003",
        parameters={
            "m": Parameter(7.5e-3, "kg", "mass", "(0, inf)"),
            "a": Parameter(11.6e-3, "m", "radius", "(0, inf)"),
            "mu": Parameter(0.2, "1", "coefficient of friction", "[0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
        },
        coordinates={
            "x": Inertial("m", "position of the centre"),
            "y": Inertial("m", "position across"),
            "phi": Inertial("rad", "angle of rotation"),
        },
        kinetic="m/2*(d_x**2 + d_y**2) + m*a**2/4*d_phi**2",
        contacts={
            "face": Contact(
                ("d_x", "d_y", "d_phi"), "mu*m*g", dissipation="disc(v1, v2, a*v3)", unit="N"
            )
        },
        initial={"d_x": 0.3, "d_phi": 60.0},
        span=(0, 0.4),
        time_unit="s",
        conditions={"friction": Condition("mu > 0", "the body never comes to rest")},
        facts={"largest_moment": "2/3*mu*m*g*a"},
    ).configure(given)
