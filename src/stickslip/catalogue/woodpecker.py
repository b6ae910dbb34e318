"""The woodpecker toy: it pecks its way down a pole."""

from stickslip.model.system import Inertial, Parameter, System, Unilateral


def woodpecker(**given: float | str) -> System:
    """A sleeve on a pole and a woodpecker on a spring: friction with normal forces that depend on
    the motion, and impacts.

    The sleeve jams against the pole while the bird swings towards it and back, and slides down a
    little whenever it is not jammed; the beak strikes the pole. Contacts: the beak, the lower and
    the upper edge of the sleeve.

    Parameters
    ----------
    **given : float or str
        Parameters ``m_M``, ``J_M``, ``m_S``, ``J_S``, ``c_phi``, ``g``, ``r_0``, ``r_M``, ``h_M``,
        ``l_M``, ``l_G``, ``h_S``, ``l_S``, ``mu``, ``e_1`` (beak), ``e_2``, ``e_3`` (sleeve).

    References
    ----------
    F. Pfeiffer, *Mechanische Systeme mit unstetigen Übergängen*, Ing.-Arch. 54 (1984), 232-240;
    R. I. Leine, Ch. Glocker and D. H. van Campen, *Nonlinear dynamics and modeling of some wooden
    toys with impact and friction*, J. Vib. Control 9 (2003), 25-78: these parameters.
    """
    return System(
        name="woodpecker",
        title="The woodpecker toy",
        source="Pfeiffer 1984; Leine, Glocker and van Campen 2003",
        parameters={
            "m_M": Parameter(0.0003, "kg", "mass of the sleeve", "(0, inf)"),
            "J_M": Parameter(5e-9, "kg*m^2", "inertia of the sleeve", "(0, inf)"),
            "m_S": Parameter(0.0045, "kg", "mass of the woodpecker", "(0, inf)"),
            "J_S": Parameter(7e-7, "kg*m^2", "inertia of the woodpecker", "(0, inf)"),
            "c_phi": Parameter(0.0056, "N*m/rad", "stiffness of the spring", "(0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "[0, inf)"),
            "r_0": Parameter(0.0025, "m", "radius of the pole", "(0, inf)"),
            "r_M": Parameter(0.0031, "m", "inner radius of the sleeve", "(0, inf)"),
            "h_M": Parameter(0.0058, "m", "half of the height of the sleeve", "(0, inf)"),
            "l_M": Parameter(0.010, "m", "distance from the pole to the spring", "(0, inf)"),
            "l_G": Parameter(
                0.015, "m", "distance from the spring to the bird's centre of mass", "(0, inf)"
            ),
            "h_S": Parameter(0.020, "m", "height of the beak above the spring", "(0, inf)"),
            "l_S": Parameter(
                0.0201,
                "m",
                "horizontal distance of the beak from the bird's centre of mass",
                "(0, inf)",
            ),
            "mu": Parameter(0.3, "1", "coefficient of friction", "[0, inf)"),
            "e_1": Parameter(0.5, "1", "restitution of the beak", "[0, 1]"),
            "e_2": Parameter(0.0, "1", "restitution of the lower edge", "[0, 1]"),
            "e_3": Parameter(0.0, "1", "restitution of the upper edge", "[0, 1]"),
        },
        coordinates={
            "y": Inertial("m", "height"),
            "phi_M": Inertial("rad", "angle of the sleeve"),
            "phi_S": Inertial("rad", "angle of the woodpecker"),
        },
        kinetic=(
            "m_M/2*d_y**2 + J_M/2*d_phi_M**2 + J_S/2*d_phi_S**2"
            " + m_S/2*(d_y + l_M*d_phi_M + l_G*d_phi_S)**2"
        ),
        potential="m_M*g*y + m_S*g*(y + l_M*phi_M + l_G*phi_S) + c_phi/2*(phi_M - phi_S)**2",
        contacts={
            "beak": Unilateral(
                "l_M + l_G - l_S - r_0 - h_S*phi_S",
                "d_y + l_M*d_phi_M + (l_G - l_S)*d_phi_S",
                "mu",
                restitution="e_1",
                unit="N",
            ),
            "lower edge": Unilateral(
                "r_M - r_0 + h_M*phi_M", "d_y + r_M*d_phi_M", "mu", restitution="e_2", unit="N"
            ),
            "upper edge": Unilateral(
                "r_M - r_0 - h_M*phi_M", "d_y + r_M*d_phi_M", "mu", restitution="e_3", unit="N"
            ),
        },
        translation={"y": 1},
        initial={
            "phi_M": -0.1034,
            "phi_S": -0.2788,
            "d_y": -0.3411,
            "d_phi_S": -7.4583,
        },
        span=(0, 1),
        time_unit="s",
    ).configure(given)
