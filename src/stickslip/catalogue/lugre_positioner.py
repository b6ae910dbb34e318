"""A positioned mass that hunts, Canudas de Wit et al. 1995."""

from stickslip.model import laws
from stickslip.model.system import Condition, Inertial, Internal, Parameter, System


def lugre_positioner(**given: float | str) -> System:
    """Mass with LuGre friction under a PID controller: it never comes to rest at its setpoint.

    While it sticks, the integral grows until the mass breaks away; it overshoots and sticks on the
    other side (hunting).

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``K_p``, ``K_i``, ``K_d``, ``x_d``, ``sigma_0``, ``sigma_1``, ``sigma_2``,
        ``F_s``, ``F_c``, ``v_s``.

    References
    ----------
    C. Canudas de Wit, H. Olsson, K. J. Åström and P. Lischinsky, *A new model for control of
    systems with friction*, IEEE Trans. Automatic Control 40 (1995) 419-425, table I for the
    friction, section IV for the controller. Without friction the loop is stable if K_d K_p > m K_i.
    """
    return System(
        name="lugre_positioner",
        title="Positioning with integral action: hunting, LuGre friction",
        source="Canudas de Wit, Olsson, Åström and Lischinsky 1995",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "K_p": Parameter(3.0, "N/m", "proportional gain", "(0, inf)"),
            "K_i": Parameter(4.0, "N/(m*s)", "integral gain", "[0, inf)"),
            "K_d": Parameter(6.0, "N*s/m", "derivative gain", "[0, inf)"),
            "x_d": Parameter(1.0, "m", "target position"),
            "sigma_0": Parameter(1e5, "N/m", "stiffness of the bristles", "(0, inf)"),
            "sigma_1": Parameter(1e5**0.5, "N*s/m", "damping of the bristles", "[0, inf)"),
            "sigma_2": Parameter(0.4, "N*s/m", "viscous friction", "[0, inf)"),
            "F_s": Parameter(1.5, "N", "static friction", "(0, inf)"),
            "F_c": Parameter(1.0, "N", "sliding friction", "(0, inf)"),
            "v_s": Parameter(0.001, "m/s", "speed over which friction decreases", "(0, inf)"),
        },
        coordinates={
            "x": Inertial("m", "position", force="-K_p*(x - x_d) - K_i*e - K_d*d_x"),
        },
        internal={"e": Internal("x - x_d", "m*s", "integral of the error")},
        kinetic="m/2*d_x**2",
        contacts={
            "guide": laws.lugre(
                "d_x",
                unit="N",
                F_s="F_s",
                F_c="F_c",
                v_s="v_s",
                sigma_0="sigma_0",
                sigma_1="sigma_1",
                sigma_2="sigma_2",
            )
        },
        span=(0, 40),
        time_unit="s",
        conditions={
            "control": Condition("K_d*K_p > m*K_i", "the loop without friction is unstable")
        },
    ).configure(given)
