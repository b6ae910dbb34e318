"""A ball that bounces on a plate."""

from stickslip.model.system import DefaultSpan, Inertial, Parameter, System, Unilateral


def bouncing_ball(**given: float | str) -> System:
    """Ball on a plate that may be shaken, with infinitely many impacts in a finite time.

    On a plate at rest a ball dropped from h comes to rest after √(2h/g) (1 + e)/(1 − e). On a
    shaken plate it bounces once per period, twice, or irregularly, as the amplitude increases.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``g``, ``e``, ``A``, ``omega``; drive ``plate`` (its height, of t).

    References
    ----------
    P. J. Holmes, *The dynamics of repeated impacts with a sinusoidally vibrating table*, J. Sound
    Vib. 84 (1982), 173-189; J. Guckenheimer and P. Holmes, *Nonlinear Oscillations*, section 2.4.
    """
    return System(
        name="bouncing_ball",
        title="Bouncing ball",
        source="Holmes 1982",
        parameters={
            "m": Parameter(1.0, "kg", "mass", "(0, inf)"),
            "g": Parameter(9.81, "m/s^2", "acceleration of gravity", "(0, inf)"),
            "e": Parameter(0.8, "1", "restitution", "[0, 1]"),
            "A": Parameter(0.0, "m", "amplitude of the plate"),
            "omega": Parameter(20.0, "1/s", "frequency of the plate", "(0, inf)"),
        },
        drives={"plate": "A*sin(omega*t)"},
        coordinates={"y": Inertial("m", "height")},
        kinetic="m/2*d_y**2",
        potential="m*g*y",
        contacts={"plate": Unilateral("y - plate", restitution="e", unit="N")},
        initial={"y": 1.0},
        span=DefaultSpan((0, 5)),
        time_unit="s",
    ).configure(given)
