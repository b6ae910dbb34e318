"""The plate compactor, [M] figure 1.1(A)."""

from stickslip.model.system import Condition, Contact, DefaultSpan, Inertial, Parameter, System


def plate_compactor(**given: float | str) -> System:
    """A plate pulled over the ground while a rotating imbalance modulates its normal force, N = mg
    + F cos Ωt.

    It moves in short steps at the moments when the normal force is small, far below the friction
    μmg of its weight.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``g``, ``mu``, ``F``, ``Omega``, ``k``, ``V``; free function ``pull``
        (position of the far end of the spring, of t).

    References
    ----------
    A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
    preprint 2405 (2017), figure 1.1(A) and section 2. For fast shaking the effective threshold is
    the smallest one (theorem 2.2, where inertia plays no part).
    """
    return System(
        name="plate_compactor",
        title="Plate compactor: friction under a shaken weight",
        source="Mielke 2017, figure 1.1(A)",
        parameters={
            "m": Parameter(100.0, "kg", "mass of the plate", "(0, inf)"),
            "g": Parameter(9.81, "m/s^2", "gravity", "[0, inf)"),
            "mu": Parameter(0.6, "", "coefficient of friction", "[0, inf)"),
            "F": Parameter(900.0, "N", "force of the imbalance", "[0, inf)"),
            "Omega": Parameter(60.0, "rad/s", "angular speed of the imbalance", "(0, inf)"),
            "k": Parameter(5000.0, "N/m", "stiffness of the pulling spring", "(0, inf)"),
            "V": Parameter(0.1, "m/s", "speed of the pull"),
        },
        drives={"pull": "V*t"},
        coordinates={"x": Inertial("m", "position of the plate")},
        kinetic="m/2*d_x**2",
        potential="k/2*(x - pull)**2",
        contacts={"ground": Contact("d_x", threshold="mu*max(m*g + F*cos(Omega*t), 0)", unit="N")},
        span=DefaultSpan((0, 4)),
        time_unit="s",
        conditions={
            "ground contact": Condition(
                "F <= m*g", "the plate lifts off; in the model it then slides without friction"
            )
        },
        facts={"mean_threshold": "mu*m*g", "smallest_threshold": "mu*max(m*g - F, 0)"},
    ).configure(given)
