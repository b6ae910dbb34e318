"""A velocity-step experiment on rate-and-state friction, as in a friction apparatus."""

from stickslip.model.system import Condition, DefaultSpan, Internal, Parameter, System


def velocity_step(**given: float | str) -> System:
    """A sample that is pushed by a spring whose load point changes its speed abruptly.

    The state is the coefficient of friction mu and phi = ln(v_0 theta/D_c): the slip rate v = v_0
    exp((mu − mu_0 − b phi)/a) follows from both, at all rates, so that the equations are not stiff
    at rest. The normal stress is constant; `trend` is an additional change of friction with the
    displacement of the load point, due to wear and consolidation.

    Parameters
    ----------
    **given : float or str
        Parameters ``a``, ``b``, ``D_c``, ``mu_0``, ``v_0``, ``k`` (per normal stress), ``V_1``,
        ``V_2``, ``t_step``, ``trend``; free function ``evolution`` (of Omega = v theta/D_c; the
        ageing law unless given, ``"-Omega*log(Omega)"`` for the slip law).

    References
    ----------
    J. H. Dieterich, *J. Geophys. Res.* 84 (1979), 2161: velocity steps, the ageing law; A. Ruina,
    *J. Geophys. Res.* 88 (1983), 10359: the slip law; C. Marone, *Annu. Rev. Earth Planet. Sci.* 26
    (1998), 643: how a and b are determined from such experiments, with the stiffness of the
    apparatus.
    """
    return System(
        name="velocity_step",
        title="Velocity step on rate-and-state friction",
        source="Dieterich 1979; Ruina 1983; Marone 1998",
        parameters={
            "a": Parameter(0.01, "1", "direct effect", "(0, inf)"),
            "b": Parameter(0.012, "1", "evolution effect", "[0, inf)"),
            "D_c": Parameter(10.0, "um", "slip distance over which the state evolves", "(0, inf)"),
            "mu_0": Parameter(0.6, "1", "friction at the rate v_0", "(0, inf)"),
            "v_0": Parameter(3.0, "um/s", "reference rate", "(0, inf)"),
            "k": Parameter(2e-3, "1/um", "stiffness per normal stress", "(0, inf)"),
            "V_1": Parameter(3.0, "um/s", "speed before the step", "(0, inf)"),
            "V_2": Parameter(10.0, "um/s", "speed after the step", "(0, inf)"),
            "t_step": Parameter(20.0, "s", "time of the step"),
            "trend": Parameter(0.0, "1/um", "change of friction with displacement"),
        },
        functions={
            "evolution(Omega)": "1 - Omega",
            "v": "v_0*exp((mu - mu_0 - b*phi)/a)",
            "measured": "mu + trend*way",
        },
        drives={
            "V": "V_1 + (V_2 - V_1)*heaviside(t - t_step)",
            "way": "V_1*t + (V_2 - V_1)*max(t - t_step, 0)",
        },
        internal={
            "mu": Internal("k*(V - v)", "1", "coefficient of friction"),
            "phi": Internal(
                "v_0/D_c*exp(-phi)*evolution(v/v_0*exp(phi))", "1", "ln(v_0 theta/D_c), the state"
            ),
        },
        initial={"mu": 0.6, "phi": 0.0},
        span=DefaultSpan((0, 60)),
        time_unit="s",
        conditions={
            "steady sliding": Condition(
                "k*D_c > b - a", "the apparatus is too soft: steady sliding is unstable"
            )
        },
        facts={
            "steady_before": "mu_0 + (a - b)*log(V_1/v_0)",
            "steady_after": "mu_0 + (a - b)*log(V_2/v_0)",
            "critical_stiffness": "(b - a)/D_c",
        },
    ).configure(given)
