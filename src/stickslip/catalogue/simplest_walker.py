"""The simplest walking model: two rigid legs, a heavy hip and feet without weight."""

from stickslip.model.system import Inertial, Internal, Jump, Parameter, System


def simplest_walker(**given: float | str) -> System:
    """Two legs that walk down a slope under gravity alone.

    The feet are so light that the stance leg is an inverted pendulum unaffected by the swing leg,
    and the swing leg a pendulum moved by the hip: internal variables. The unit of time is √(l/g).
    The swing foot would scuff the ground when the legs pass each other, which is ignored; heel
    strike is where φ − 2θ rises through zero. At γ = 0.009 there are two cycles. The long one,
    which is the initial state, is stable, with the multipliers −0.190 ± 0.558 i and the step period
    3.88246. It is stable up to γ = 0.0151, where its period doubles; above 0.019 no gait remains.
    Heights are measured from the foot, see :func:`rimless_wheel`.

    Parameters
    ----------
    **given : float or str
        Parameter ``gamma``.

    References
    ----------
    M. Garcia, A. Chatterjee, A. Ruina and M. Coleman, *The simplest walking model: stability,
    complexity, and scaling*, J. Biomech. Eng. 120 (1998), 281-288.
    """
    return System(
        name="simplest_walker",
        title="The simplest walking model",
        source="Garcia, Chatterjee, Ruina and Coleman 1998",
        parameters={"gamma": Parameter(0.009, "", "slope", "[0, 1.57)")},
        coordinates={"theta": Inertial("", "angle of the stance leg from the slope's normal")},
        internal={
            "phi": Internal("d_phi", "", "angle between the legs"),
            "d_phi": Internal(
                "sin(theta - gamma) + d_theta**2*sin(phi) - cos(theta - gamma)*sin(phi)",
                "",
                "its rate",
            ),
        },
        kinetic="d_theta**2/2",
        potential="cos(theta - gamma)",
        jumps={
            "heel_strike": Jump(
                when="phi - 2*theta",
                direction="rising",
                to={
                    "theta": "-theta",
                    "d_theta": "cos(2*theta)*d_theta",
                    "phi": "-2*theta",
                    "d_phi": "cos(2*theta)*(1 - cos(2*theta))*d_theta",
                },
            )
        },
        initial={
            "theta": 0.2003109,
            "d_theta": -0.199832473,
            "phi": 0.4006218,
            "d_phi": -0.015822999,
        },
        span=(0, 40),
    ).configure(given)
