"""The rocking toy animal without translational inertia, [M] (4.2)."""

from stickslip.model.system import Condition, Contact, Inertial, Parameter, RateIndependent, System


def rocking_toy(**given: float | str) -> System:
    """A toy animal that is pulled forward by a weight: it walks because its rocking unloads the
    legs one after the other.

    The friction H_R(ψ) of the right leg increases from 0 at ψ ≤ −ψ* to H* at ψ ≥ ψ*; that of the
    left leg is H_R(−ψ).

    Parameters
    ----------
    **given : float or str
        Parameters ``I_b``, ``delta``, ``a``, ``b``, ``c``, ``P``, ``rho``, ``psi_star``,
        ``H_star``; free functions ``H_R``, ``H_L`` (of psi).

    References
    ----------
    A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
    preprint 2405 (2017), (4.2), with the pull P = g m_W/2. In simple walking the legs' distance
    switches between ±X, from X as ψ rises through ψ_3 to −X at ψ*, as long as |ψ| ≤ ψ_2; each
    period has the stride 2X.
    """
    return System(
        name="rocking_toy",
        title="Rocking toy animal without translational inertia",
        source="Mielke 2017, (4.2)",
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
        functions={"H_R(psi)": "H_star/2*(1 + clip(psi/psi_star, -1, 1))", "H_L(psi)": "H_R(-psi)"},
        coordinates={
            "psi": Inertial("rad", "rocking angle"),
            "x_R": RateIndependent("m", "position of the right leg"),
            "x_L": RateIndependent("m", "position of the left leg"),
        },
        kinetic="I_b/2*d_psi**2",
        potential="a/2*(x_R - x_L)**2 + b/2*psi**2 - c*(x_R - x_L)*psi - P*(x_R + x_L)",
        viscous="delta/2*d_psi**2",
        contacts={
            "right leg": Contact("d_x_R", threshold="rho + H_R(psi)", unit="N"),
            "left leg": Contact("d_x_L", threshold="rho + H_L(psi)", unit="N"),
        },
        translation={"x_R": 1, "x_L": 1},
        initial={"psi": 0.8, "x_R": -0.8},
        span=(0, 120),
        time_unit="s",
        conditions={
            "stable upright": Condition("a*b > c**2", "the upright position is unstable"),
            "stride": Condition(
                "P > rho + c*psi_star", "X is not positive: the pull does not move an unloaded leg"
            ),
            "hold": Condition("H_star > 2*P", "the loaded leg does not hold against the pull"),
            "corner": Condition(
                "H_star > 2*c*psi_star", "G+ has no minimum at psi_star: the legs do not alternate"
            ),
        },
        facts={
            "X": "(P - rho - c*psi_star)/a",
            "psi_2": "psi_star + 2*rho/c",
            "psi_3": "(H_star/2 - 2*P + 2*rho + c*psi_star)/(H_star/(2*psi_star) - c)",
        },
    ).configure(given)
