"""The rocking toy animal as an oscillator, [M] section 4.4."""

from stickslip.model.system import Condition, Inertial, Parameter, System


def rocking_oscillator(**given: float | str) -> System:
    """The rocking angle alone, with the legs' distance d = G(ψ, ψ̇): I_b ψ̈ + δψ̇ + bψ − c G(ψ, ψ̇)
    = 0.

    Γ decreases from X at ψ ≤ ψ_3 along G_L⁺ to −X at ψ ≥ ψ*, which is one clip. G jumps where ψ̇
    changes sign while |ψ| < ψ*; motions that would slide along that jump are outside the validity
    of the oscillator.

    Parameters
    ----------
    **given : float
        Parameters ``I_b``, ``delta``, ``a``, ``b``, ``c``, ``P``, ``rho``, ``psi_star``,
        ``H_star``.

    References
    ----------
    A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
    preprint 2405 (2017), section 4.4: the rocking toy in simple periodic motion, |ψ| ≤ ψ_2. One
    period feeds in the energy 2cX(ψ_3 + ψ*) and moves the toy by 2X.
    """
    return System(
        name="rocking_oscillator",
        title="Rocking angle of the toy animal in simple motion",
        source="Mielke 2017, section 4.4",
        parameters={
            "I_b": Parameter(1.0, "kg*m^2", "rotational inertia of the body", "(0, inf)"),
            "delta": Parameter(0.04, "N*m*s", "damping of the rocking", "[0, inf)"),
            "a": Parameter(1.0, "N/m", "stiffness between the legs", "(0, inf)"),
            "b": Parameter(1.0, "N*m", "stiffness of the rocking", "(0, inf)"),
            "c": Parameter(0.3, "N", "coupling of rocking and legs"),
            "P": Parameter(1.0, "N", "pull on each leg", "[0, inf)"),
            "rho": Parameter(0.2, "N", "dry friction in the joints", "(0, inf)"),
            "psi_star": Parameter(
                1.0, "rad", "angle at which one side carries all weight", "(0, inf)"
            ),
            "H_star": Parameter(3.0, "N", "friction of a leg that carries all weight", "[0, inf)"),
        },
        functions={
            "X": "(P - rho - c*psi_star)/a",
            "G_L(psi)": "(-P + c*psi + rho + H_star/2*(1 - psi/psi_star))/a",
            "Gamma(psi)": "clip(G_L(psi), -X, X)",
            "G(psi, d_psi)": "piecewise(d_psi >= 0, Gamma(psi), -Gamma(-psi))",
        },
        coordinates={"psi": Inertial("rad", "rocking angle", force="c*G(psi, d_psi)")},
        kinetic="I_b/2*d_psi**2",
        potential="b/2*psi**2",
        viscous="delta/2*d_psi**2",
        initial={"psi": -1.67},
        span=(0, 63),
        time_unit="s",
        conditions={
            "stable upright": Condition("a*b > c**2", "the upright position is unstable"),
            "stride": Condition(
                "P > rho + c*psi_star", "X is not positive: the pull does not move an unloaded leg"
            ),
            "hold": Condition("H_star > 2*P", "psi_3 is not in [-psi_star, psi_star]"),
            "corner": Condition(
                "H_star > 2*c*psi_star", "G_L does not fall: the legs do not alternate"
            ),
        },
        facts={
            "X": "X",
            "psi_2": "psi_star + 2*rho/c",
            "psi_3": "(H_star/2 - 2*P + 2*rho + c*psi_star)/(H_star/(2*psi_star) - c)",
            "energy_per_period": "2*c*X*((H_star/2 - 2*P + 2*rho + "
            "c*psi_star)/(H_star/(2*psi_star) - c) + psi_star)",
        },
    ).configure(given)
