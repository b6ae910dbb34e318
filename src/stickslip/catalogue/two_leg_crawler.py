"""The two-leg crawler with directional friction."""

from stickslip.model.system import (
    Condition,
    Contact,
    DefaultSpan,
    Parameter,
    RateIndependent,
    System,
)


def two_leg_crawler(**given: float | str) -> System:
    """Two legs joined by a spring whose rest length oscillates; bristles make forward motion easier
    than backward motion.

    A leg needs the force f_plus to move forward and f_minus to move backward. The legs are
    quasistatic, and each position is relative to that of the leg at mid-stroke, so that L is the
    rest length minus its mean.

    Parameters
    ----------
    **given : float or str
        Parameters ``k``, ``f_plus``, ``f_minus``, ``D``, ``omega``; free function ``L`` (rest
        length, of t).

    References
    ----------
    A. DeSimone, P. Gidoni, G. Noselli, *Liquid crystal elastomer strips as soft crawlers*, J. Mech.
    Phys. Solids 84 (2015) 254-272. Each cycle with the stroke D moves the crawler by sgn(f_minus −
    f_plus) max(0, D − 2 min(f_plus, f_minus)/k).
    """
    return System(
        name="two_leg_crawler",
        title="Two-leg crawler with directional friction",
        source="DeSimone, Gidoni and Noselli 2015",
        parameters={
            "k": Parameter(1.0, "N/m", "stiffness of the spring", "(0, inf)"),
            "f_plus": Parameter(0.1, "N", "threshold against forward motion", "(0, inf)"),
            "f_minus": Parameter(0.4, "N", "threshold against backward motion", "(0, inf)"),
            "D": Parameter(1.0, "m", "stroke: largest minus smallest rest length", "[0, inf)"),
            "omega": Parameter(1.0, "rad/s", "angular frequency of the rest length", "(0, inf)"),
        },
        functions={
            "step": "piecewise(f_minus > f_plus, 1, -1)*max(D - 2*min(f_plus, f_minus)/k, 0)"
        },
        drives={"L": "D/2*sin(omega*t)"},
        coordinates={
            "x_1": RateIndependent("m", "position of the hind leg"),
            "x_2": RateIndependent("m", "position of the front leg"),
        },
        potential="k/2*(x_2 - x_1 - L)**2",
        contacts={
            "hind leg": Contact("d_x_1", threshold=("f_plus", "f_minus"), unit="N"),
            "front leg": Contact("d_x_2", threshold=("f_plus", "f_minus"), unit="N"),
        },
        translation={"x_1": 1, "x_2": 1},
        span=DefaultSpan((0, 40)),
        time_unit="s",
        conditions={
            "step": Condition(
                "D > 2*min(f_plus, f_minus)/k", "the stroke is too short: no leg moves"
            ),
            "direction": Condition(
                "abs(f_minus - f_plus) > 0", "without a preferred direction there is no net motion"
            ),
        },
        facts={"step_per_cycle": "step", "mean_speed": "step*omega/(2*pi)"},
    ).configure(given)
