"""Small systems that the tests share: every declaration is compiled once and reused with other parameters."""

from __future__ import annotations

from stickslip import Contact, Inertial, Internal, Parameter, RateIndependent, System, Viscous


def parameters(**defaults: float) -> dict[str, Parameter]:
    """Parameters without unit and meaning."""
    return {name: Parameter(value) for name, value in defaults.items()}


def oscillator() -> System:
    """m x'' + c x' + k x + mu Sign(x' - V) ∋ f + F cos(omega t + phi)."""
    return System(
        name="oscillator",
        parameters=parameters(m=1.0, c=0.0, k=1.0, mu=0.5, f=0.0, F=1.0, omega=0.5, phi=0.0, V=0.0),
        coordinates={"x": Inertial()},
        kinetic="m/2*d_x**2",
        potential="k/2*x**2 - (f + F*cos(omega*t + phi))*x",
        viscous="c/2*d_x**2",
        contacts={"ground": Contact("d_x", "mu", surface_speed="V")},
    )


def dashpot() -> System:
    """c z' + k z + mu Sign(z') ∋ f + F cos(omega t + phi)."""
    return System(
        name="dashpot",
        parameters=parameters(c=1.0, k=0.0, mu=1.0, f=0.0, F=1.0, omega=1.0, phi=0.0),
        coordinates={"z": Viscous()},
        potential="k/2*z**2 - (f + F*cos(omega*t + phi))*z",
        viscous="c/2*d_z**2",
        contacts={"ground": Contact("d_z", "mu")},
    )


def play() -> System:
    """a z + mu Sign(z') ∋ f + F cos(omega t + phi), the play operator."""
    return System(
        name="play",
        parameters=parameters(a=1.0, mu=1.0, f=0.0, F=1.0, omega=1.0, phi=0.0),
        coordinates={"z": RateIndependent()},
        potential="a/2*z**2 - (f + F*cos(omega*t + phi))*z",
        contacts={"ground": Contact("d_z", "mu")},
    )


def scaled_slider_limit() -> System:
    """(3.6)"""
    return System(
        name="scaled slider limit",
        parameters=parameters(nu=1e-3, b=0.5, mu_0=1.0, v_hat=1.0),
        internal={
            "beta": Internal("v_hat/nu*(1 - b*sqrt(nu)) + b/sqrt(nu)*max(beta, 0) - gamma/(nu*mu_0)"),
            "gamma": Internal("mu_0*max(beta, 0) - gamma"),
        },
    )


def rocking_toy() -> System:
    """(4.2)"""
    return System(
        name="rocking toy",
        parameters=parameters(I_b=1.0, delta=0.04, a=1.0, b=1.0, c=0.3, rho=0.2, psi_star=1.0, H_star=3.0, P=1.0),
        functions={"H_R(psi)": "clip(H_star*(psi + psi_star)/(2*psi_star), 0, H_star)", "H_L(psi)": "H_R(-psi)"},
        coordinates={"psi": Inertial(), "x_R": RateIndependent(), "x_L": RateIndependent()},
        kinetic="I_b/2*d_psi**2",
        potential="a/2*(x_R - x_L)**2 + b/2*psi**2 - c*(x_R - x_L)*psi - P*(x_R + x_L)",
        viscous="delta/2*d_psi**2",
        contacts={"right leg": Contact("d_x_R", "rho + H_R(psi)"), "left leg": Contact("d_x_L", "rho + H_L(psi)")},
        translation={"x_R": 1, "x_L": 1},
    )
