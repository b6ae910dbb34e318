"""The block on a belt with Stribeck's curve."""

from stickslip.model import laws
from stickslip.model.system import Condition, DefaultSpan, Inertial, Parameter, System


def belt_stribeck(**given: float | str) -> System:
    """Block on a spring and a damper on a belt, with friction that decreases with the speed.

    Below the belt speed V_c the decreasing friction destabilises steady sliding, and stick-slip
    results.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``c``, ``k``, ``V``, ``F_s``, ``F_c``, ``v_s``; free function ``belt``
        (speed of the belt, of t).

    References
    ----------
    R. I. Leine, D. H. van Campen, A. de Kraker and L. van den Steen, *Stick-slip vibrations induced
    by alternate friction models*, Nonlinear Dynamics 16 (1998) 41-54. With friction F_c + (F_s −
    F_c) exp(−|u|/v_s), steady sliding loses its stability where c = ((F_s − F_c)/v_s) exp(−V/v_s).
    """
    return System(
        name="belt_stribeck",
        title="Block on a belt with Stribeck's curve",
        source="Leine, van Campen, de Kraker and van den Steen 1998",
        parameters={
            "m": Parameter(1.0, "kg", "mass of the block", "(0, inf)"),
            "c": Parameter(0.2, "N*s/m", "viscous damping", "[0, inf)"),
            "k": Parameter(1.0, "N/m", "stiffness of the spring", "(0, inf)"),
            "V": Parameter(0.2, "m/s", "speed of the belt", "(0, inf)"),
            "F_s": Parameter(1.0, "N", "static friction", "(0, inf)"),
            "F_c": Parameter(0.5, "N", "friction at high speed", "(0, inf)"),
            "v_s": Parameter(0.4, "m/s", "speed over which friction decreases", "(0, inf)"),
        },
        drives={"belt": "V"},
        coordinates={"x": Inertial("m", "position of the block")},
        kinetic="m/2*d_x**2",
        potential="k/2*x**2",
        viscous="c/2*d_x**2",
        contacts={
            "belt contact": laws.stribeck(
                "d_x", surface_speed="belt", unit="N", F_s="F_s", F_c="F_c", v_s="v_s"
            )
        },
        span=DefaultSpan((0, 50)),
        time_unit="s",
        conditions={
            "falling": Condition("F_s > F_c", "friction does not decrease with the speed"),
            "slow": Condition("V < V_c", "steady sliding is stable"),
        },
        functions={"V_c": "v_s*log((F_s - F_c)/(c*v_s))"},
        facts={"critical_speed": "V_c"},
    ).configure(given)
