"""Two faults with rate-and-state friction that load each other, Abe and Kato 2013."""

from stickslip.model.system import DefaultSpan, Internal, Parameter, System, Viscous


def two_block_rate_and_state(**given: float | str) -> System:
    """Two parts of a fault, coupled by a spring, each loaded by a spring: complex earthquake
    cycles.

    Each is a rate-and-state slider without mass, with radiation damping. The motion of a single
    slider is periodic; two that differ in strength or stiffness may alternate, double their
    periods, or be aperiodic. The parameters are those of the single slider, with a second block
    whose friction weakens more.

    Parameters
    ----------
    **given : float or str
        Parameters ``a_1``, ``a_2``, ``b_1``, ``b_2``, ``D_c``, ``mu_0``, ``v_0``, ``sigma``,
        ``eta``, ``k_1``, ``k_2``, ``k_12``, ``V``; free functions ``friction`` (of v, theta, a, b)
        and ``evolution`` (of Omega = v theta/D_c).

    References
    ----------
    Y. Abe and N. Kato, *Pure Appl. Geophys.* 170 (2013), 745-765: the model and its complex cycles;
    J. R. Rice, *J. Geophys. Res.* 98 (1993), 9885: radiation damping. The parameter values are not
    theirs.
    """
    blocks = (1, 2)
    return System(
        name="two_block_rate_and_state",
        title="Two coupled faults with rate-and-state friction",
        source="Abe and Kato 2013",
        parameters={
            "a_1": Parameter(0.01, "1", "direct effect of block 1", "(0, inf)"),
            "a_2": Parameter(0.01, "1", "direct effect of block 2", "(0, inf)"),
            "b_1": Parameter(0.015, "1", "evolution effect of block 1", "[0, inf)"),
            "b_2": Parameter(0.018, "1", "evolution effect of block 2", "[0, inf)"),
            "D_c": Parameter(8e-3, "m", "slip distance over which the states evolve", "(0, inf)"),
            "mu_0": Parameter(0.6, "1", "friction at the rate v_0", "(0, inf)"),
            "v_0": Parameter(1e-6, "m/s", "reference rate", "(0, inf)"),
            "sigma": Parameter(5e7, "Pa", "normal stress", "(0, inf)"),
            "eta": Parameter(5e6, "Pa*s/m", "radiation damping", "[0, inf)"),
            "k_1": Parameter(1e7, "Pa/m", "stiffness of the load on block 1", "(0, inf)"),
            "k_2": Parameter(1e7, "Pa/m", "stiffness of the load on block 2", "(0, inf)"),
            "k_12": Parameter(5e6, "Pa/m", "stiffness between the blocks", "[0, inf)"),
            "V": Parameter(1e-9, "m/s", "rate of the load", "(0, inf)"),
        },
        functions={
            "friction(v, theta, a, b)": ("a*asinh(v/(2*v_0)*exp((mu_0 + b*log(v_0*theta/D_c))/a))"),
            "evolution(Omega)": "1 - Omega",
        },
        drives={"pull": "V*t"},
        coordinates={
            f"x_{i}": Viscous(
                "m",
                f"slip of block {i}",
                drag=f"sigma*friction(d_x_{i}, theta_{i}, a_{i}, b_{i}) + eta*d_x_{i}",
            )
            for i in blocks
        },
        internal={
            f"theta_{i}": Internal(f"evolution(d_x_{i}*theta_{i}/D_c)", "s", f"state of block {i}")
            for i in blocks
        },
        potential=(
            "k_1/2*(pull + sigma*mu_0/k_1 - x_1)**2 + k_2/2*(pull + sigma*mu_0/k_2 - x_2)**2"
            " + k_12/2*(x_1 - x_2)**2"
        ),
        initial={"theta_1": 8e6, "theta_2": 4e6},
        span=DefaultSpan((0, 4e9)),
        time_unit="s",
        facts={f"critical_stiffness_{i}": f"((b_{i} - a_{i})*sigma - eta*V)/D_c" for i in blocks},
    ).configure(given)
