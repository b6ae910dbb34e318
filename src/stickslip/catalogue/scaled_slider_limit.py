"""The scaled spring slider at lowest order, [M] (3.6)."""

from stickslip.model.system import Condition, Internal, Parameter, System


def scaled_slider_limit(**given: float | str) -> System:
    """The scaled spring slider at lowest order in ν: linear in slip (β > 0) and in stick (β < 0).

    Parameters
    ----------
    **given : float
        Parameters ``nu``, ``b``, ``mu_0``, ``v_hat``.

    References
    ----------
    A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
    preprint 2405 (2017), (3.6), with v̂/ν corrected from v̂ν. The facts: steady sliding (β_*, γ_*),
    the frequency ω_b/√ν with which slip turns about it, the duration π√ν/ω_b of a slip and its
    stretching ρ_b, both at lowest order.
    """
    return System(
        name="scaled_slider_limit",
        title="Scaled spring slider at lowest order",
        source="Mielke 2017, (3.6), corrected",
        parameters={
            "nu": Parameter(0.01, "", "viscosity", "(0, inf)"),
            "b": Parameter(1.0, "", "unfolding parameter"),
            "mu_0": Parameter(1.0, "", "friction at rest", "(0, inf)"),
            "v_hat": Parameter(1.0, "", "scaled rate of the load", "(0, inf)"),
        },
        functions={"slip": "max(beta, 0)"},
        internal={
            "beta": Internal(
                "v_hat/nu*(1 - b*sqrt(nu)) + b/sqrt(nu)*slip - gamma/(nu*mu_0)",
                meaning="scaled excess over the threshold",
            ),
            "gamma": Internal("mu_0*slip - gamma", meaning="scaled state of the surface"),
        },
        initial={"beta": 0.0, "gamma": 0.4},
        span=(0, 40),
        conditions={
            "unstable focus": Condition(
                "b > sqrt(nu)", "steady sliding is stable; slip may never end"
            ),
            "focus": Condition("b < 2", "steady sliding is a node"),
        },
        facts={
            "beta_star": "v_hat",
            "gamma_star": "mu_0*v_hat",
            "omega_b": "sqrt(1 - b**2/4)",
            "rho_b": "exp(pi*b/(2*sqrt(1 - b**2/4)))",
            "slip_duration": "pi*sqrt(nu)/sqrt(1 - b**2/4)",
        },
    ).configure(given)
