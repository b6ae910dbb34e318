"""The claims notice it when a formula of the library is changed on purpose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip import Contact, Internal, System, Viscous, catalogue
from stickslip.rate_independent.averaging import minima
from stickslip.rate_independent.dissipation import group_norm, polytope, weighted_l1
from stickslip.rate_independent.play.motion import PlayMotion
from stickslip_paper import claims

CLAIMS = {item.name: item for item in claims()}
Change = Callable[[System], System]


def law(name: str, text: str) -> Change:
    """Another law for an internal variable."""
    return lambda system: replace(system, internal={**system.internal, name: Internal(text)})


def function(signature: str, text: str) -> Change:
    return lambda system: replace(system, functions={**system.functions, signature: text})


def term(entry: str, old: str, new: str) -> Change:
    """Another term in an energy or a dissipation potential."""

    def change(system: System) -> System:
        text = getattr(system, entry)
        assert old in text
        return replace(system, **{entry: text.replace(old, new)})

    return change


def fact(name: str, text: str) -> Change:
    return lambda system: replace(system, facts={**system.facts, name: text})


def leg(name: str, threshold: str) -> Change:
    return lambda s: replace(
        s, contacts={**s.contacts, name: Contact("d_x_R", threshold=threshold, unit="N")}
    )


def force(name: str, text: str) -> Change:
    return lambda s: replace(s, coordinates={**s.coordinates, name: Viscous(force=text)})


LIMIT = "v_hat/nu*(1 - b*sqrt(nu)) {} b/sqrt(nu)*slip - gamma/(nu*mu_0)"
HEATING = "(mu(nu*gamma) {} sqrt(nu)*b*mu(0) + nu**2*beta)*slip - gamma"
MUTATIONS: dict[str, tuple[str, Change, list[str]]] = {
    "(3.6), sign of b": (
        "scaled_slider_limit",
        law("beta", LIMIT.format("-")),
        ["limit_beta_equation"],
    ),
    "(3.6), constant as printed": (
        "scaled_slider_limit",
        law("beta", "v_hat*nu*(1 - b*sqrt(nu)) + b/sqrt(nu)*slip - gamma/(nu*mu_0)"),
        ["limit_beta_equation", "limit_steady_state", "sticking_field"],
    ),
    "(3.6), stretching": (
        "scaled_slider_limit",
        fact("rho_b", "exp(pi*b/2)"),
        ["stretching_grows"],
    ),
    "(3.5), sign of B as printed": (
        "scaled_slider",
        function("heating", HEATING.format("-")),
        ["sign_of_the_unfolding", "scaled_gamma_equation"],
    ),
    "(3.3), exponent of U in the heating": (
        "spring_slider",
        law("alpha", "alpha_0 - alpha + k*U**2*(shear - d_U)"),
        ["planar_system", "state_is_heated_by_friction", "determinant"],
    ),
    "(3.3), viscosity": (
        "spring_slider",
        term("viscous", "nu/2", "nu"),
        ["explicit_flow_rule", "trace_formula"],
    ),
    "(3.3), viscous force of the load": (
        "spring_slider",
        force("U", "2*nu*shear"),
        ["planar_system"],
    ),
    "(4.1), mass of the body": (
        "rocking_toy_inertial",
        term("kinetic", "(m_W + m_b)/2", "m_W/2"),
        ["right_leg_equation", "left_leg_equation", "damped_hamiltonian_system"],
    ),
    "(4.1), pull": ("rocking_toy_inertial", function("P", "g*m_W"), ["right_leg_equation"]),
    "(4.2), threshold of the right leg": (
        "rocking_toy",
        leg("right leg", "rho + H_L(psi)"),
        ["boundary_curves", "piecewise_affine_loads"],
    ),
    "(4.2), sign of the coupling": (
        "rocking_toy",
        term("potential", "- c*(x_R", "+ c*(x_R"),
        ["restoring_force", "simplified_rocking_equation", "boundary_curves"],
    ),
    "section 4.3, where H_R ends to rise": (
        "rocking_toy",
        function("H_R(psi)", "H_star/2*(1 + clip(psi/psi_star, -1, 2))"),
        ["piecewise_affine_loads", "legs_share_the_weight"],
    ),
    "section 4.4, psi_3": ("rocking_toy", fact("psi_3", "psi_star/6"), ["turning_angle"]),
    "section 4.4, lower end of Gamma": (
        "rocking_oscillator",
        function("Gamma(psi)", "clip(G_L(psi), 0, X)"),
        ["reduced_oscillator"],
    ),
}


@pytest.mark.parametrize("name", MUTATIONS)
def test_changed_declarations_are_noticed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    system, change, noticing = MUTATIONS[name]
    declare = getattr(catalogue, system)

    def changed(**given: Any) -> System:
        return change(declare(**given))

    monkeypatch.setattr(catalogue, system, changed)
    assert_noticed(noticing)


def replace_minima(monkeypatch: pytest.MonkeyPatch, wrong: Any) -> None:
    for kind in (weighted_l1, group_norm, polytope):
        monkeypatch.setattr(kind, "least_thresholds", wrong)


def test_average_that_takes_the_mean_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    least = minima.least_thresholds

    def mean(varying: Any) -> Any:
        values = varying.over(np.arange(100) / 100).mean(axis=0)
        return least(varying)._replace(values=values, floors=values)

    replace_minima(monkeypatch, mean)
    assert_noticed(["example_average", "average_is_below_every_phase", "limit_solution"])


def test_average_that_vanishes_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    least = minima.least_thresholds

    def nothing(varying: Any) -> Any:
        found = least(varying)
        return found._replace(values=0.0 * found.values, floors=0.0 * found.values)

    replace_minima(monkeypatch, nothing)
    assert_noticed(["example_average", "average_is_below_every_phase", "limit_solution"])


def test_play_that_follows_the_wrong_bound_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right = PlayMotion.state

    def wrong(self: Any, t: Any, k: Any) -> Any:
        state = right(self, t, k)
        return state._replace(z=np.where(self.mode[k] > 0, state.now.high, state.z))

    monkeypatch.setattr(PlayMotion, "state", wrong)
    assert_noticed(["play_is_a_running_maximum", "limit_solution"])


def assert_noticed(names: list[str]) -> None:
    """Each of these claims no longer has the verdict that is expected."""
    for name in names:
        finding = CLAIMS[name].verify()
        assert finding.verdict is not CLAIMS[name].expected, f"{name}: {finding.measured}"


# Which claims watch over the declarations of the paper, quick ones first.
WATCHING = {
    "spring_slider": ["planar_system", "smaller_rectangle"],
    "scaled_slider": ["scaled_beta_equation", "scaled_gamma_equation"],
    "scaled_slider_limit": [
        "limit_beta_equation",
        "limit_gamma_equation",
        "limit_steady_state",
        "eigenvalues_of_the_focus",
        "stretching_grows",
        "travel_time_of_slip",
    ],
    "rocking_toy": [
        "simplified_rocking_equation",
        "boundary_curves",
        "extrema_of_the_curves",
        "end_of_the_simple_regime",
        "turning_angle",
    ],
    "rocking_toy_inertial": [
        "right_leg_equation",
        "left_leg_equation",
        "rocking_equation",
        "trivial_sliding",
    ],
    "rocking_oscillator": ["reduced_oscillator", "energy_of_the_switching"],
}


def formulas(system: System) -> list[tuple[str, str]]:
    """Every formula of a declaration, as entry and key."""
    found = [
        (entry, "")
        for entry in ("kinetic", "potential", "viscous")
        if getattr(system, entry) != 0.0
    ]
    found += [
        (entry, key)
        for entry in ("functions", "drives", "internal", "facts")
        for key in getattr(system, entry)
    ]
    found += [("contacts", key) for key in system.contacts]
    found += [("coordinates", key) for key, c in system.coordinates.items() if c.force != 0.0]
    return found


def scaled(system: System, entry: str, key: str) -> System:
    """The system with one formula 1% larger."""

    def more(text: object) -> str:
        return f"1.01*({text})"

    if not key:
        return replace(system, **{entry: more(getattr(system, entry))})
    old: Any = getattr(system, entry)[key]
    match entry:
        case "internal":
            new: Any = replace(old, law=more(old.law))
        case "contacts":
            new = replace(old, threshold=more(old.threshold))
        case "coordinates":
            new = replace(old, force=more(old.force))
        case _:
            new = more(old)
    return replace(system, **{entry: {**getattr(system, entry), key: new}})


@pytest.mark.parametrize(
    ("name", "entry", "key"),
    [(name, *formula) for name in WATCHING for formula in formulas(catalogue.get(name))],
)
def test_any_formula_that_is_changed_is_noticed(
    name: str, entry: str, key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    declare = getattr(catalogue, name)
    monkeypatch.setattr(catalogue, name, lambda **given: scaled(declare(**given), entry, key))
    noticed = (
        CLAIMS[claim].verify().verdict is not CLAIMS[claim].expected for claim in WATCHING[name]
    )
    assert any(noticed)
