"""Rate-independent friction that arises from a wiggly energy, Mielke 2012."""

from stickslip.model.system import Condition, DefaultSpan, Parameter, System, Viscous


def wiggly_energy(**given: float | str) -> System:
    """Viscous motion in an energy with many small wells: dry friction in the limit ε → 0.

    ε^γ ż + z + ρ cos(z/ε) = ℓ(t). The wells have the size ε, but their slopes do not vanish: the
    load must exceed them by ρ. In the limit z is the play operator of ℓ with the threshold ρ,
    although no term of the energy contains it and the viscosity vanishes.

    Parameters
    ----------
    **given : float or str
        Parameters ``epsilon``, ``gamma``, ``rho``; free function ``ell`` (load, of t).

    References
    ----------
    A. Mielke, *Emergence of rate-independent dissipation from viscous systems with wiggly
    energies*, Continuum Mech. Thermodyn. 24 (2012) 591-606.
    """
    return System(
        name="wiggly_energy",
        title="Dry friction from a wiggly energy",
        source="Mielke 2012",
        parameters={
            "epsilon": Parameter(0.05, "", "size of the wells", "(0, inf)"),
            "gamma": Parameter(1.0, "", "exponent of the viscosity", "(0, inf)"),
            "rho": Parameter(1.0, "", "largest slope of the wells", "[0, inf)"),
        },
        drives={"ell": "5*t - t**2"},
        coordinates={"z": Viscous(meaning="position")},
        potential="z**2/2 + rho*epsilon*sin(z/epsilon) - ell*z",
        viscous="epsilon**gamma/2*d_z**2",
        span=DefaultSpan((0, 5)),
        conditions={
            "wells": Condition("rho > epsilon", "the energy is convex: there are no wells")
        },
        facts={"threshold": "rho"},
    ).configure(given)
