"""The rocking toy animal with inertia, [M] (4.1)."""

from stickslip.model.system import Condition, Contact, Inertial, Parameter, System


def rocking_toy_inertial(**given: float | str) -> System:
    """A toy animal that is pulled forward by a weight over the edge of the table, with the masses
    of weight, body and legs.

    Parameters
    ----------
    **given : float or str
        Parameters ``I_b``, ``m_W``, ``m_b``, ``m_l``, ``g``, ``delta``, ``nu``, ``a``, ``b``,
        ``c``, ``rho``, ``psi_star``, ``H_star``; free functions ``H_R``, ``H_L`` (of psi).

    References
    ----------
    A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
    preprint 2405 (2017), (4.1). With the pull P = g m_W/2 fixed and all masses and ν vanishing it
    becomes ``rocking_toy``.
    """
    return System(
        name="rocking_toy_inertial",
        title="Rocking toy animal with inertia",
        source="Mielke 2017, (4.1)",
        parameters={
            "I_b": Parameter(1.0, "kg*m^2", "rotational inertia of the body", "(0, inf)"),
            "m_W": Parameter(0.02, "kg", "mass of the weight", "[0, inf)"),
            "m_b": Parameter(0.02, "kg", "mass of the body", "[0, inf)"),
            "m_l": Parameter(0.01, "kg", "mass of the legs on one side", "(0, inf)"),
            "g": Parameter(100.0, "m/s^2", "gravity", "[0, inf)"),
            "delta": Parameter(0.04, "N*m*s", "damping of the rocking", "[0, inf)"),
            "nu": Parameter(0.05, "N*s/m", "viscous friction of a leg", "[0, inf)"),
            "a": Parameter(1.0, "N/m", "stiffness between the legs", "(0, inf)"),
            "b": Parameter(1.0, "N*m", "stiffness of the rocking", "(0, inf)"),
            "c": Parameter(0.3, "N", "coupling of rocking and legs"),
            "rho": Parameter(0.2, "N", "dry friction in the joints", "(0, inf)"),
            "psi_star": Parameter(
                1.0, "rad", "angle at which one side carries all weight", "(0, inf)"
            ),
            "H_star": Parameter(3.0, "N", "friction of a leg that carries all weight", "[0, inf)"),
        },
        functions={
            "P": "g*m_W/2",
            "H_R(psi)": "H_star/2*(1 + clip(psi/psi_star, -1, 1))",
            "H_L(psi)": "H_R(-psi)",
        },
        coordinates={
            "psi": Inertial("rad", "rocking angle"),
            "x_R": Inertial("m", "position of the right leg"),
            "x_L": Inertial("m", "position of the left leg"),
        },
        kinetic="I_b/2*d_psi**2 + (m_W + m_b)/2*(d_x_R + d_x_L)**2 + m_l/2*(d_x_R**2 + d_x_L**2)",
        potential="a/2*(x_R - x_L)**2 + b/2*psi**2 - c*(x_R - x_L)*psi - P*(x_R + x_L)",
        viscous="delta/2*d_psi**2 + nu/2*(d_x_R**2 + d_x_L**2)",
        contacts={
            "right leg": Contact("d_x_R", threshold="rho + H_R(psi)", unit="N"),
            "left leg": Contact("d_x_L", threshold="rho + H_L(psi)", unit="N"),
        },
        translation={"x_R": 1, "x_L": 1},
        initial={"psi": 0.8, "x_R": -0.8},
        span=(0, 120),
        time_unit="s",
        conditions={
            "stable upright": Condition("a*b > c**2", "the upright position is unstable"),
            "stride": Condition(
                "P > rho + c*psi_star", "X is not positive: the pull does not move an unloaded leg"
            ),
            "hold": Condition("H_star > 2*P", "the loaded leg does not hold against the pull"),
            "corner": Condition(
                "H_star > 2*c*psi_star", "G+ has no minimum at psi_star: the legs do not alternate"
            ),
        },
        facts={"P": "P", "sliding_speed": "max(P - rho - H_star/2, 0)/nu"},
    ).configure(given)
