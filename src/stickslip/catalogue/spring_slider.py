"""The spring slider with state-dependent friction, [M] (3.1)-(3.3)."""

from stickslip.model.system import (
    Contact,
    DefaultSpan,
    Formula,
    Internal,
    Parameter,
    System,
    Viscous,
)


def spring_slider(**given: float | str) -> System:
    """Block on a spring, whose friction μ(α) decreases with the state α (a temperature), which
    sliding increases.

    With the block at z and the load at ℓ, the coordinate is U = ℓ − z as in (3.3): the spring force
    is kU, and the sliding velocity ż = ℓ̇ − U̇ is that of U against a belt.

    Parameters
    ----------
    **given : float or str
        Parameters ``V``, ``k``, ``alpha_0``, ``nu``; free functions ``mu`` (of alpha), ``ell`` (the
        load, of t) or, in place of ``ell``, its rate ``shear`` (of t, where plateaus are easily
        written). A formula for ``V`` is used as ``shear``.

    References
    ----------
    A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
    preprint 2405 (2017), section 3. The facts hold for the constant rate V: the rectangle 0 ≤ U ≤
    U_max, α_0 ≤ α ≤ α_max is positively invariant if μ decreases (the proof of theorem 3.1, with
    μ(α_0) for μ(0)).
    """
    if isinstance(given.get("V"), str):
        given["shear"] = given.pop("V")
    steady = not given.keys() & {"ell", "shear"}
    drives: dict[str, Formula] = (
        {"shear": "V"} if "shear" in given else {"ell": "V*t", "shear": "d_ell"}
    )
    facts: dict[str, Formula] = {
        "U_max": "(mu(alpha_0) + nu*V)/k",
        "alpha_max": "alpha_0 + (mu(alpha_0) + nu*V)**2/nu",
    }
    return System(
        name="spring_slider",
        title="Spring slider with state-dependent friction",
        source="Mielke 2017, (3.1)-(3.3)",
        parameters={
            "V": Parameter(0.18, "", "rate of the load"),
            "k": Parameter(1.0, "", "stiffness of the spring", "(0, inf)"),
            "alpha_0": Parameter(1.0, "", "state after a long rest"),
            "nu": Parameter(0.02, "", "viscosity", "(0, inf)"),
        },
        functions={"mu(alpha)": "0.5 + exp(-(alpha - 1)/0.4)"},
        drives=drives,
        coordinates={"U": Viscous(meaning="stretch of the spring", force="nu*shear")},
        internal={
            "alpha": Internal("alpha_0 - alpha + k*U*(shear - d_U)", meaning="state of the surface")
        },
        potential="k/2*U**2",
        viscous="nu/2*d_U**2",
        contacts={"block": Contact("d_U", threshold="mu(alpha)", surface_speed="shear")},
        initial={"U": 0.5, "alpha": 1.0},
        span=DefaultSpan((0, 50)),
        facts=facts if steady else {},
    ).configure(given)
