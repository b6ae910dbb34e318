"""The play operator with an oscillating threshold, [M] section 2.2."""

from stickslip.model.system import Contact, DefaultSpan, Parameter, RateIndependent, System


def oscillating_play(**given: float | str) -> System:
    """Rate-independent z under the load ℓ(t) with the threshold ρ(t/ε): 0 ∈ ρ(t/ε) Sign(ż) + z −
    ℓ(t).

    Parameters
    ----------
    **given : float or str
        Parameter ``epsilon``; free functions ``rho`` (of s = t/ε, of period 1) and ``ell`` (of t).

    References
    ----------
    A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
    preprint 2405 (2017), section 2.2. The motion waits for the smallest threshold: as ε → 0, z
    follows the play operator with min ρ.
    """
    return System(
        name="oscillating_play",
        title="Play operator with an oscillating threshold",
        source="Mielke 2017, section 2.2",
        parameters={"epsilon": Parameter(0.1, "", "period of the threshold", "(0, inf)")},
        functions={"rho(s)": "1 + 0.5*cos(2*pi*s)"},
        drives={"ell": "5*t - t**2"},
        coordinates={"z": RateIndependent(meaning="position")},
        potential="z**2/2 - ell*z",
        contacts={"friction": Contact("d_z", threshold="rho(t/epsilon)")},
        span=DefaultSpan((0, 5)),
    ).configure(given)
