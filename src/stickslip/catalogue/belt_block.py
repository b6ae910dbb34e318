"""The block on a belt with static above kinetic friction."""

from stickslip.model.system import Condition, Contact, DefaultSpan, Inertial, Parameter, System


def belt_block(**given: float | str) -> System:
    """Block on a spring, carried along by a belt until the spring force exceeds the static
    friction.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``k``, ``V``, ``F_s``, ``F_k``; free function ``belt`` (speed of the belt,
        of t).

    References
    ----------
    V. L. Popov, *Contact Mechanics and Friction*, Springer 2010, chapter 12. With Δ = F_s − F_k and
    ω = √(k/m), the cycle at constant belt speed V has the period 2Δ/(kV) + (2/ω)(π −
    arctan(ωΔ/(kV))) and the spring force stays in F_k ± √(Δ² + kmV²).
    """
    return System(
        name="belt_block",
        title="Block on a belt, static above kinetic friction",
        source="Popov 2010, chapter 12",
        parameters={
            "m": Parameter(1.0, "kg", "mass of the block", "(0, inf)"),
            "k": Parameter(1.0, "N/m", "stiffness of the spring", "(0, inf)"),
            "V": Parameter(0.3, "m/s", "speed of the belt", "(0, inf)"),
            "F_s": Parameter(1.0, "N", "static friction", "[0, inf)"),
            "F_k": Parameter(0.6, "N", "kinetic friction", "[0, inf)"),
        },
        functions={"Delta": "F_s - F_k", "omega": "sqrt(k/m)"},
        drives={"belt": "V"},
        coordinates={"x": Inertial("m", "position of the block")},
        kinetic="m/2*d_x**2",
        potential="k/2*x**2",
        contacts={
            "belt contact": Contact(
                "d_x", threshold="F_s", surface_speed="belt", kinetic="F_k", unit="N"
            )
        },
        span=DefaultSpan((0, 50)),
        time_unit="s",
        conditions={"stick-slip": Condition("F_s > F_k", "static and kinetic friction are equal")},
        facts={
            "period": "2*Delta/(k*V) + 2/omega*(pi - atan(omega*Delta/(k*V)))",
            "slip_duration": "2/omega*(pi - atan(omega*Delta/(k*V)))",
            "smallest_force": "F_k - sqrt(Delta**2 + k*m*V**2)",
            "largest_force": "F_k + sqrt(Delta**2 + k*m*V**2)",
        },
    ).configure(given)
