"""A mass in a dish that is shaken: a friction pendulum bearing without small angles."""

from stickslip.model.system import Condition, DefaultSpan, Inertial, Parameter, System, Unilateral
from stickslip.symbolic.formulas import TimeFunction


def pendulum_bearing(**given: float | str | TimeFunction) -> System:
    """Mass in a spherical dish that is shaken in two directions. Friction acts along the dish, and
    changes the normal force that causes it; for small displacements it is `isolated_floor`.

    Parameters
    ----------
    **given : float or str or Samples
        Parameters ``m``, ``mu``, ``g``, ``R``, ``S``; drives ``a_x``, ``a_y`` (accelerations of the
        ground, of t).

    References
    ----------
    V. A. Zayas, S. S. Low, S. A. Mahin, *A simple pendulum technique for achieving seismic
    isolation*, Earthquake Spectra 6 (1990) 317-333. J. L. Almazán, J. C. De la Llera, J. A. Inaudi,
    *Modelling aspects of structures isolated with the frictional pendulum system*, Earthquake
    Engineering and Structural Dynamics 27 (1998) 845-867: large displacements, and a normal force
    that varies.
    """
    return System(
        name="pendulum_bearing",
        title="Mass in a shaken dish",
        source="Zayas, Low, Mahin 1990; Almazán, De la Llera, Inaudi 1998",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "mu": Parameter(0.05, "1", "coefficient of friction", "[0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
            "R": Parameter(1.0, "m", "radius of the dish", "(0, inf)"),
            "S": Parameter(1.0, "m/s^2", "scale of the accelerations", "(0, inf)"),
        },
        functions={
            "envelope": "(t/3)**2*exp(2 - 2*t/3)",
            "across": "sqrt(x**2 + (R - z)**2)",
            "around": "sqrt(x**2 + y**2 + (R - z)**2)",
        },
        drives={
            "a_x": "4*envelope*(sin(2*pi*0.9*t) + 0.6*sin(2*pi*2.1*t + 1))",
            "a_y": "2.5*envelope*(sin(2*pi*0.7*t + 2) + 0.7*sin(2*pi*1.7*t))",
        },
        coordinates={
            "x": Inertial("m", "displacement relative to the ground, east", force="-m*S*a_x"),
            "y": Inertial("m", "displacement relative to the ground, north", force="-m*S*a_y"),
            "z": Inertial("m", "height above the deepest point of the dish"),
        },
        kinetic="m/2*(d_x**2 + d_y**2 + d_z**2)",
        potential="m*g*z",
        contacts={
            "dish": Unilateral(
                "R - around",
                (
                    "((R - z)*d_x + x*d_z)/across",
                    "(across**2*d_y - x*y*d_x + (R - z)*y*d_z)/(across*around)",
                ),
                mu="mu",
                unit="N",
            )
        },
        span=DefaultSpan((0, 15)),
        time_unit="s",
        conditions={"friction": Condition("mu > 0", "without friction the mass never sticks")},
        facts={"period": "2*pi*sqrt(R/g)", "steepest_rest": "atan(mu)"},
    ).configure(given)
