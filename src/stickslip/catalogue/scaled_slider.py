"""The scaled spring slider, [M] (3.5)."""

from stickslip.model.system import Condition, Internal, Parameter, System


def scaled_slider(**given: float | str) -> System:
    """The spring slider close to the loss of stability of its steady sliding, scaled without
    approximation.

    V = ν v̂, U = μ̃(α) + ν²β, α = 1 + νγ, μ̃(α) = μ(νγ) + √ν bμ(0): β > 0 is slip, β < 0 is stick.

    Parameters
    ----------
    **given : float or str
        Parameters ``nu``, ``b``, ``mu_0``, ``v_hat``; free function ``mu`` (of s = νγ) with 1 +
        μ(0)μ'(0) = 0.

    References
    ----------
    A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
    preprint 2405 (2017), (3.5), with the sign of √ν B corrected: an instability for b > 0 needs +.
    """
    return System(
        name="scaled_slider",
        title="Scaled spring slider",
        source="Mielke 2017, (3.5), corrected",
        parameters={
            "nu": Parameter(0.01, "", "viscosity", "(0, inf)"),
            "b": Parameter(1.0, "", "unfolding parameter"),
            "mu_0": Parameter(1.0, "", "friction at rest", "(0, inf)"),
            "v_hat": Parameter(1.0, "", "scaled rate of the load", "(0, inf)"),
        },
        functions={
            "mu(s)": "mu_0*exp(-s/mu_0**2)",
            "slip": "max(beta, 0)",
            "heating": "(mu(nu*gamma) + sqrt(nu)*b*mu(0) + nu**2*beta)*slip - gamma",
        },
        internal={
            "beta": Internal(
                "(v_hat - slip - d_mu(nu*gamma)*heating)/nu",
                meaning="scaled excess over the threshold",
            ),
            "gamma": Internal("heating", meaning="scaled state of the surface"),
        },
        initial={"beta": 0.0, "gamma": 0.4},
        span=(0, 40),
        conditions={
            "scaling": Condition(
                "abs(1 + mu(0)*d_mu(0)) < 1e-9", "(3.4) fails: mu(0)*mu'(0) is not -1"
            ),
            "unstable focus": Condition(
                "b > sqrt(nu)", "steady sliding is stable; slip may never end"
            ),
            "focus": Condition("b < 2", "steady sliding is a node"),
        },
    ).configure(given)
