"""A block on a shaken base, Newmark 1965."""

from math import exp, pi, sin

from stickslip.model.system import Condition, Contact, Inertial, Parameter, System
from stickslip.symbolic.formulas import TimeFunction
from stickslip.symbolic.samples import Samples


def sliding_base(**given: float | str | TimeFunction) -> System:
    """Block on a base that is shaken by a recorded acceleration; it slides where friction is too
    weak to carry it along.

    The record is a synthetic one, 10 s at 50 samples a second; ``a=ss.Samples(...)`` takes another.

    Parameters
    ----------
    **given : float or str or Samples
        Parameters ``m``, ``mu``, ``g``, ``S``; drive ``a`` (acceleration of the base, of t).

    References
    ----------
    N. M. Newmark, *Effects of earthquakes on dams and embankments*, Géotechnique 15 (1965) 139-160.
    A pulse of height A and length T that exceeds N = μg slides the block by (AT)²/(2N) (1 − N/A).
    """
    times = [0.02 * i for i in range(501)]
    record = Samples(times, [round(_shaking(t), 4) for t in times])
    return System(
        name="sliding_base",
        title="Block on a shaken base",
        source="Newmark 1965",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "mu": Parameter(0.2, "1", "coefficient of friction", "[0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
            "S": Parameter(1.0, "m/s^2", "what 1 in the record stands for", "(0, inf)"),
        },
        drives={"a": record},
        coordinates={"x": Inertial("m", "displacement relative to the base", force="-m*S*a")},
        kinetic="m/2*d_x**2",
        contacts={"base": Contact("d_x", threshold="mu*m*g", unit="N")},
        translation={"x": 1},
        span=(0, 10),
        time_unit="s",
        conditions={"friction": Condition("mu > 0", "nothing holds the block")},
        facts={"yield_acceleration": "mu*g"},
    ).configure(given)


def _shaking(t: float) -> float:
    """Three sines under an envelope, m/s²: a short strong earthquake."""
    envelope = (t / 2.5) ** 2 * exp(2.0 - 2.0 * t / 2.5)
    waves = sin(2 * pi * 1.1 * t) + 0.7 * sin(2 * pi * 2.3 * t + 1.0) + 0.4 * sin(2 * pi * 4.7 * t)
    return 3.0 * envelope * waves
