"""A wheel without a rim that rolls down a slope from spoke to spoke."""

from stickslip.model.system import Condition, Inertial, Jump, Parameter, System


def rimless_wheel(**given: float | str) -> System:
    """Spokes around a mass, each an inverted pendulum until the next one strikes the ground.

    The stance leg changes where the wheel leans by α + γ; the impact is plastic, and conserves the
    angular momentum about the new foot. In the limit cycle the rate after each impact is cot(2α)
    √(4 (g/l) sin α sin γ); the deviation of its square is multiplied by cos² 2α in each step.
    Heights are measured from the foot, so the energy jumps by the loss of the impact minus the
    descent of the foot; in the cycle the jump vanishes. The impact of a wheel that falls backward
    is not modelled.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``g``, ``l``, ``alpha``, ``gamma``.

    References
    ----------
    T. McGeer, *Passive dynamic walking*, Int. J. Robot. Res. 9 (1990), 62-82; M. J. Coleman,
    A. Chatterjee and A. Ruina, *Motions of a rimless spoked wheel: a simple three-dimensional
    system with impacts*, Dyn. Stab. Syst. 12 (1997), 139-159.
    """
    return System(
        name="rimless_wheel",
        title="Rimless wheel",
        source="McGeer 1990; Coleman, Chatterjee and Ruina 1997",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "g": Parameter(1.0, "m/s^2", "acceleration of gravity", "(0, inf)"),
            "l": Parameter(1.0, "m", "length of a spoke", "(0, inf)"),
            "alpha": Parameter(0.3, "rad", "half of the angle between spokes", "(0, 0.7853)"),
            "gamma": Parameter(0.08, "rad", "slope", "[0, 1.57)"),
        },
        coordinates={"theta": Inertial("rad", "angle of the spoke from the vertical")},
        kinetic="m*l**2/2*d_theta**2",
        potential="m*g*l*cos(theta)",
        jumps={
            "leg_exchange": Jump(
                when="theta - gamma - alpha",
                direction="rising",
                to={"theta": "gamma - alpha", "d_theta": "cos(2*alpha)*d_theta"},
            )
        },
        conditions={
            "walks": Condition(
                "2*sin(alpha)*sin(gamma)/tan(2*alpha)**2 > 1 - cos(alpha - gamma)",
                "at the rate of its cycle the wheel does not pass the vertical, and falls back",
            )
        },
        facts={
            "rate_after_exchange": "sqrt(4*g/l*sin(alpha)*sin(gamma))/tan(2*alpha)",
            "multiplier": "cos(2*alpha)**2",
        },
        initial={"theta": -0.22, "d_theta": 0.5},
        span=(0, 30),
        time_unit="s",
    ).configure(given)
