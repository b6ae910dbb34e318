"""The toy ramp walker: two feet that are loaded and lifted alternately."""

from stickslip.model.system import Condition, Inertial, Parameter, System, Unilateral


def ramp_walker(**given: float | str) -> System:
    """A toy with two legs that rocks its way down a ramp: figure 1.1(B) of [M].

    The body rocks by ψ on two elastic legs. The foot of the unloaded side slips first, and is
    lifted beyond ψ*; gravity along the ramp pulls it forward, while the other foot sticks. The feet
    are contacts that can open, with impacts where they land.

    The legs carry the weight at y = 0. While both feet are on the ground y does not move, and the
    normal force of the right one is N = (m_b/2 + m_l) g cos γ + k l sin ψ + d l ψ': for small
    angles and small d this is (4.1) of [M] with H_* = μ m_b g cos γ, ψ* = m_b g cos γ/(2 k l), ρ =
    μ m_l g cos γ, P = (m_b/2 + m_l) g sin γ, b = 2 k l² − m_b g h cos γ (m_W + m_b there is m_b/4
    here).

    Parameters
    ----------
    **given : float or str
        Parameters ``I_b``, ``m_b``, ``m_l``, ``g``, ``gamma``, ``k``, ``d``, ``l``, ``h``, ``a``,
        ``c``, ``mu``, ``e``, ``delta``.

    References
    ----------
    A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
    preprint 2405 (2017), figure 1.1(B) and section 4: the toy is described there, its equations are
    those of (4.1) with load transfer by feet in place of the functions H_R and H_L.
    """
    return System(
        name="ramp_walker",
        title="Toy ramp walker",
        source="after Mielke 2017, figure 1.1(B)",
        parameters={
            "I_b": Parameter(5e-4, "kg*m^2", "rotational inertia of the body", "(0, inf)"),
            "m_b": Parameter(0.1, "kg", "mass of the body", "(0, inf)"),
            "m_l": Parameter(0.002, "kg", "mass of a leg", "(0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "[0, inf)"),
            "gamma": Parameter(0.15, "rad", "slope of the ramp", "[0, 1.5]"),
            "k": Parameter(100.0, "N/m", "stiffness of a leg", "(0, inf)"),
            "d": Parameter(0.22, "N*s/m", "damping of a leg", "[0, inf)"),
            "l": Parameter(0.025, "m", "distance from the middle to a leg", "(0, inf)"),
            "h": Parameter(0.01, "m", "height of the centre of mass above the hips", "[0, inf)"),
            "a": Parameter(2.0, "N/m", "stiffness between the legs", "(0, inf)"),
            "c": Parameter(0.25, "N", "coupling of rocking and legs"),
            "mu": Parameter(0.3, "1", "coefficient of friction", "[0, inf)"),
            "e": Parameter(0.0, "1", "restitution of the feet", "[0, 1]"),
            "delta": Parameter(3.3e-4, "N*m*s", "damping of the rocking", "[0, inf)"),
        },
        functions={"G": "g*cos(gamma)"},
        coordinates={
            "psi": Inertial("rad", "rocking angle"),
            "y": Inertial("m", "height of the body above its rest position"),
            "x_R": Inertial("m", "displacement of the right foot"),
            "x_L": Inertial("m", "displacement of the left foot"),
            "z_R": Inertial("m", "height of the right foot"),
            "z_L": Inertial("m", "height of the left foot"),
        },
        kinetic=(
            "I_b/2*d_psi**2 + m_b/2*d_y**2 + m_b/8*(d_x_R + d_x_L)**2"
            " + m_l/2*(d_x_R**2 + d_x_L**2 + d_z_R**2 + d_z_L**2)"
        ),
        potential=(
            "k/2*(y - l*sin(psi) - z_R)**2 + k/2*(y + l*sin(psi) - z_L)**2"
            " + (m_b/2 + m_l)*G*(z_R + z_L) + m_b*G*h*cos(psi)"
            " - (m_b/2 + m_l)*g*sin(gamma)*(x_R + x_L)"
            " + a/2*(x_R - x_L)**2 - c*(x_R - x_L)*psi"
        ),
        viscous=(
            "delta/2*d_psi**2 + d/2*(d_y - l*d_psi - d_z_R)**2 + d/2*(d_y + l*d_psi - d_z_L)**2"
        ),
        contacts={
            "right foot": Unilateral("z_R", "d_x_R", "mu", restitution="e", unit="N"),
            "left foot": Unilateral("z_L", "d_x_L", "mu", restitution="e", unit="N"),
        },
        translation={"x_R": 1, "x_L": 1},
        initial={"psi": 0.16, "x_R": -0.03},
        span=(0, 8),
        time_unit="s",
        conditions={
            "upright": Condition(
                "2*k*l**2 > m_b*G*h + c**2/a", "the upright position is unstable: it falls over"
            ),
            "hold": Condition(
                "mu*cos(gamma) > sin(gamma)", "the ramp is too steep: both feet slide"
            ),
        },
        facts={"psi_star": "asin(m_b*G/(2*k*l))", "pull": "(m_b/2 + m_l)*g*sin(gamma)"},
    ).configure(given)
