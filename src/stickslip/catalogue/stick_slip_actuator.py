"""The inertia drive: a slider that a sawtooth carries one way."""

from stickslip.model import laws
from stickslip.model.system import Condition, DefaultSpan, Inertial, Parameter, System


def stick_slip_actuator(**given: float | str) -> System:
    """Slider on a rod that a piezo moves slowly forward and fast back: it sticks, then slips.

    Parameters
    ----------
    **given : float or str
        Parameters ``m``, ``F_c``, ``A``, ``T``, ``share``; free function ``rod`` (speed of the rod,
        of t).

    References
    ----------
    Z. M. Zhang, Q. An, J. W. Li and W. J. Zhang, *Piezoelectric friction-inertia actuator: a
    critical review and future perspective*, Int. J. Adv. Manuf. Technol. 62 (2012) 669-685. On the
    way back, of duration τ = (1 − share) T, friction slows the slider down by F_c τ/m, and then
    accelerates it for the same time; in each period it makes a step of A/share − F_c τ²/m.
    """
    return System(
        name="stick_slip_actuator",
        title="Inertia drive: a slider on a sawtooth",
        source="Zhang, An, Li and Zhang 2012",
        parameters={
            "m": Parameter(0.01, "kg", "mass of the slider", "(0, inf)"),
            "F_c": Parameter(0.1, "N", "friction", "(0, inf)"),
            "A": Parameter(1e-6, "m", "stroke of the rod", "(0, inf)"),
            "T": Parameter(1e-3, "s", "period", "(0, inf)"),
            "share": Parameter(0.8, "1", "fraction of the period of the forward stroke", "(0, 1)"),
        },
        functions={"back": "(1 - share)*T"},
        drives={"rod": "piecewise(mod(t, T) < share*T, A/(share*T), -A/back)"},
        coordinates={"x": Inertial("m", "position of the slider")},
        kinetic="m/2*d_x**2",
        contacts={"rod contact": laws.coulomb("d_x", surface_speed="rod", unit="N", F_c="F_c")},
        translation={"x": 1},
        span=DefaultSpan((0, 0.01)),
        time_unit="s",
        conditions={
            "slip": Condition(
                "F_c*back/m < A/(share*T) + A/back", "friction carries the slider back"
            ),
            "catch up": Condition(
                "share > 1/2", "the forward stroke is too short for the slider to catch up"
            ),
        },
        facts={"step": "A/share - F_c*back**2/m", "mean_speed": "(A/share - F_c*back**2/m)/T"},
    ).configure(given)
