"""A floor on sliding bearings, shaken in two directions."""

from stickslip.model.system import Condition, Contact, DefaultSpan, Inertial, Parameter, System
from stickslip.symbolic.formulas import TimeFunction


def isolated_floor(**given: float | str | TimeFunction) -> System:
    """Floor on spherical sliding bearings, under an earthquake with two components: the friction
    force opposes the velocity and is limited in magnitude, so that the two directions interact.

    The default accelerations are synthetic, sines under an envelope; pass measured ones as
    ``a_x=ss.Samples(...)`` and ``a_y=ss.Samples(...)``.

    Parameters
    ----------
    **given : float or str or Samples
        Parameters ``m``, ``mu``, ``g``, ``R``, ``S``; drives ``a_x``, ``a_y`` (accelerations of the
        ground, of t).

    References
    ----------
    V. A. Zayas, S. S. Low, S. A. Mahin, *A simple pendulum technique for achieving seismic
    isolation*, Earthquake Spectra 6 (1990) 317-333: on bearings of the radius R the floor swings
    with the period 2π√(R/g), whatever its mass. M. C. Constantinou, A. Mokha, A. Reinhorn, *Teflon
    bearings in base isolation II*, J. Struct. Eng. 116 (1990) 455-474, on both directions at once.
    """
    return System(
        name="isolated_floor",
        title="Floor on sliding bearings, shaken in two directions",
        source="Zayas, Low, Mahin 1990; Constantinou, Mokha, Reinhorn 1990",
        parameters={
            "m": Parameter(1000.0, "kg", "mass of the floor", "(0, inf)"),
            "mu": Parameter(0.05, "1", "coefficient of friction of the bearings", "[0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
            "R": Parameter(1.5, "m", "radius of the bearings", "(0, inf)"),
            "S": Parameter(1.0, "m/s^2", "scale of the accelerations", "(0, inf)"),
        },
        functions={"envelope": "(t/3)**2*exp(2 - 2*t/3)"},
        drives={
            "a_x": "2.5*envelope*(sin(2*pi*0.9*t) + 0.6*sin(2*pi*2.1*t + 1))",
            "a_y": "1.8*envelope*(sin(2*pi*0.6*t + 2) + 0.7*sin(2*pi*1.7*t))",
        },
        coordinates={
            "x": Inertial("m", "displacement relative to the ground, east", force="-m*S*a_x"),
            "y": Inertial("m", "displacement relative to the ground, north", force="-m*S*a_y"),
        },
        kinetic="m/2*(d_x**2 + d_y**2)",
        potential="m*g/(2*R)*(x**2 + y**2)",
        contacts={"bearings": Contact(("d_x", "d_y"), threshold="mu*m*g", unit="N")},
        span=DefaultSpan((0, 15)),
        time_unit="s",
        conditions={"friction": Condition("mu > 0", "without friction the floor never sticks")},
        facts={"period": "2*pi*sqrt(R/g)", "largest_offset": "mu*R"},
    ).configure(given)
