"""A block on a shaken base, Newmark 1965."""

from stickslip.model.system import Condition, Contact, DefaultSpan, Inertial, Parameter, System
from stickslip.symbolic.formulas import TimeFunction


def sliding_base(**given: float | str | TimeFunction) -> System:
    """Block on a shaken base; it slides if friction cannot give it the acceleration of the base.

    The default acceleration is synthetic, three sines under an envelope; pass a measured one as
    ``a=ss.Samples(...)``, and the motion then covers the record.

    Parameters
    ----------
    **given : float or str or Samples
        Parameters ``m``, ``mu``, ``g``, ``S``; drive ``a`` (acceleration of the base, of t).

    References
    ----------
    N. M. Newmark, *Effects of earthquakes on dams and embankments*, Géotechnique 15 (1965) 139-160.
    A pulse of height A and length T that exceeds N = μg slides the block by (AT)²/(2N) (1 − N/A).
    """
    return System(
        name="sliding_base",
        title="Block on a shaken base",
        source="Newmark 1965",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "mu": Parameter(0.2, "1", "coefficient of friction", "[0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
            "S": Parameter(1.0, "m/s^2", "scale of the acceleration", "(0, inf)"),
        },
        functions={"envelope": "(t/2.5)**2*exp(2 - 2*t/2.5)"},
        drives={
            "a": "3*envelope*(sin(2*pi*1.1*t) + 0.7*sin(2*pi*2.3*t + 1) + 0.4*sin(2*pi*4.7*t))"
        },
        coordinates={"x": Inertial("m", "displacement relative to the base", force="-m*S*a")},
        kinetic="m/2*d_x**2",
        contacts={"base": Contact("d_x", threshold="mu*m*g", unit="N")},
        translation={"x": 1},
        span=DefaultSpan((0, 10)),
        time_unit="s",
        conditions={"friction": Condition("mu > 0", "without friction the block never sticks")},
        facts={"yield_acceleration": "mu*g"},
    ).configure(given)
