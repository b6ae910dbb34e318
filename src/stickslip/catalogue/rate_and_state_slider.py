"""The spring slider with rate-and-state friction and radiation damping, quasi-static."""

from stickslip.model.system import Condition, DefaultSpan, Internal, Parameter, System, Viscous


def rate_and_state_slider(**given: float | str) -> System:
    """A fault of unit area that is loaded by a spring: earthquakes with one degree of freedom.

    The stress on the fault is sigma·friction(v, theta) + eta·v. It increases with the slip rate v
    at any state theta, so that v follows from the stress. The fault never sticks, but between
    earthquakes it creeps at rates that are fifteen orders of magnitude smaller.

    Parameters
    ----------
    **given : float or str
        Parameters ``a``, ``b``, ``D_c``, ``mu_0``, ``v_0``, ``sigma``, ``eta``, ``k``, ``V``; free
        functions ``friction`` (of v, theta), ``evolution`` (of Omega = v theta/D_c; the ageing law
        unless given, ``"-Omega*log(Omega)"`` for the slip law) and ``load`` (of t).

    References
    ----------
    A. Ruina, *J. Geophys. Res.* 88 (1983), 10359: both laws; J. R. Rice and A. L. Ruina, *J. Appl.
    Mech.* 50 (1983), 343: steady sliding is stable for k above the critical stiffness; J. R. Rice,
    *J. Geophys. Res.* 98 (1993), 9885: radiation damping, eta = G/(2 c_s); N. Lapusta et al., *J.
    Geophys. Res.* 105 (2000), 23765: the form with asinh, and parameters like these.
    """
    return System(
        name="rate_and_state_slider",
        title="Spring slider with rate-and-state friction",
        source="Ruina 1983; Rice 1993",
        parameters={
            "a": Parameter(0.01, "1", "direct effect", "(0, inf)"),
            "b": Parameter(0.015, "1", "evolution effect", "[0, inf)"),
            "D_c": Parameter(8e-3, "m", "slip distance over which the state evolves", "(0, inf)"),
            "mu_0": Parameter(0.6, "1", "friction at the rate v_0", "(0, inf)"),
            "v_0": Parameter(1e-6, "m/s", "reference rate", "(0, inf)"),
            "sigma": Parameter(5e7, "Pa", "normal stress", "(0, inf)"),
            "eta": Parameter(5e6, "Pa*s/m", "radiation damping", "[0, inf)"),
            "k": Parameter(1e7, "Pa/m", "stiffness of the spring", "(0, inf)"),
            "V": Parameter(1e-9, "m/s", "rate of the load", "(0, inf)"),
        },
        functions={
            "friction(v, theta)": "a*asinh(v/(2*v_0)*exp((mu_0 + b*log(v_0*theta/D_c))/a))",
            "evolution(Omega)": "1 - Omega",
        },
        drives={"load": "V*t + sigma*mu_0/k"},
        coordinates={"x": Viscous("m", "slip", drag="sigma*friction(d_x, theta) + eta*d_x")},
        internal={"theta": Internal("evolution(d_x*theta/D_c)", "s", "state of the fault")},
        potential="k/2*(load - x)**2",
        initial={"theta": 8e6},
        span=DefaultSpan((0, 2e9)),
        time_unit="s",
        conditions={
            "earthquakes": Condition(
                "k*D_c < (b - a)*sigma - eta*V", "the spring is stiff: steady sliding is stable"
            )
        },
        facts={
            "steady_stress": "sigma*friction(V, D_c/V) + eta*V",
            "critical_stiffness": "((b - a)*sigma - eta*V)/D_c",
        },
    ).configure(given)
