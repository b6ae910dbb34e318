"""Damping of structures by parameters, beside the same by numbers and by formulas of modes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss
from bodies import chain
from stickslip.model.system_file import loads

PARAMETERS = {"zeta": ss.Parameter(0.02, range="[0, 1)"), "a": ss.Parameter(0.05)}


def damped(rule: Any, **parts: Any) -> ss.System:
    """A driven chain that rubs, with some damping."""
    body = ss.Structure(*chain(4), rule, names={"tip": 3})
    given: dict[str, Any] = {"parameters": PARAMETERS, "span": (0.0, 20.0), **parts}
    return ss.System(
        "chain",
        structures={"u": body},
        forces={"u[tip]": "cos(t)"},
        contacts={"foot": ss.Contact("d_u[0]", 0.1)},
        **given,
    )


RULES: dict[str, tuple[Any, Any]] = {
    "one ratio": (ss.ModalDamping("zeta"), ss.ModalDamping(0.02)),
    "some ratios": (
        ss.ModalDamping(["2*zeta", 0.03, "zeta + a"]),
        ss.ModalDamping([0.04, 0.03, 0.07]),
    ),
    "of the mass": (ss.ProportionalDamping("a", 0.0), ss.ProportionalDamping(0.05, 0.0)),
    "of both": (ss.ProportionalDamping("a", "zeta/2"), ss.ProportionalDamping(0.05, 0.01)),
    "of the stiffness": (ss.ProportionalDamping(0.1, "zeta"), ss.ProportionalDamping(0.1, 0.02)),
}


@pytest.mark.parametrize("what", RULES)
def test_damping_by_parameters_is_that_of_their_values(what: str) -> None:
    by_name, by_number = map(damped, RULES[what])
    motion, same = ss.simulate(by_name), ss.simulate(by_number)
    assert motion.certificate.ok
    times = np.linspace(0.0, 20.0, 21)
    np.testing.assert_allclose(motion.at(times)["u[tip]"], same.at(times)["u[tip]"], atol=1e-11)
    again = loads(by_name.to_toml())
    body, same_body = by_name.structures["u"], again.structures["u"]
    assert isinstance(body, ss.Structure) and isinstance(same_body, ss.Structure)
    assert again == by_name and same_body.damping == RULES[what][0]
    assert "of" in str(body.summary())
    more = ss.simulate(by_name, parameters={"zeta": 0.1, "a": 0.2})
    assert abs(more.at(20.0)["u[tip]"] - motion.at(20.0)["u[tip]"]) > 1e-3


def test_a_reduced_structure_keeps_its_rule() -> None:
    body = ss.Structure(*chain(8), ss.ModalDamping("zeta"), names={"tip": 7})
    small = body.reduced(keep=["tip"], modes=2)
    system = ss.System("s", parameters=PARAMETERS, structures={"u": small}, span=(0.0, 50.0))
    mode = 1.0 / system.unknown("u[tip]")["u_mode_1"]
    decay = ss.ring_down(system, initial={"u_mode_1": mode}, parameters={"zeta": 0.04})
    np.testing.assert_allclose(decay["damping"].values[:-1], 0.04, rtol=1e-9)


def test_derivatives_by_a_damping_ratio() -> None:
    system = damped(ss.ModalDamping(["zeta", "a"]))
    motion = ss.simulate(system)
    found = motion.sensitivity(["zeta", "a"], [20.0], of=["u[tip]"], second_opinion=True)
    np.testing.assert_allclose(found["u[tip]"], found["u[tip]_by_differences"], rtol=1e-6)


def test_a_damping_ratio_is_fitted() -> None:
    system = damped(ss.ModalDamping("zeta"))
    t = np.linspace(0.2, 20.0, 80)
    tip = ss.simulate(system, parameters={"zeta": 0.055}).at(t)["u[tip]"]
    data = ss.Recording({"t": t, "u[tip]": tip}, begin=0.0)
    found = ss.fit(system, data, {"zeta": (0.005, 0.3)}, starts=2)
    assert found.values[0] == pytest.approx(0.055, abs=1e-8)


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        ("zetb", r"structures.u.damping: unknown name 'zetb'. Did you mean 'zeta'\?"),
        ("zeta +", r"structures.u.damping: .* is not a formula"),
        ("zeta*u[tip]", r"structures.u.damping: 'u' is not allowed here"),
        ("zeta*t", r"structures.u.damping: 't' is not allowed here"),
        ("-zeta", r"structures.u.damping: -0.02 is outside the admissible range"),
    ],
)
def test_damping_that_is_none_is_refused(rule: str, said: str) -> None:
    with pytest.raises(ss.DeclarationError, match=said):
        damped(ss.ModalDamping(rule))
    with pytest.raises(ss.DeclarationError, match=said):
        damped(ss.ProportionalDamping(0.0, rule))


def test_damping_that_feeds_in_for_some_parameters_is_refused_for_these() -> None:
    system = damped(ss.ModalDamping("a"))
    said = r"structures.u.damping: -0.1 is outside the admissible range"
    for compute in (
        lambda: ss.simulate(system, parameters={"a": -0.1}),
        lambda: ss.sweep(system, {"a": [-0.1, 0.1]}, ["time"]),
        lambda: system.with_parameters(a=-0.1),
    ):
        with pytest.raises(ss.DeclarationError, match=said):
            compute()


def test_a_structure_alone_does_not_know_its_parameters() -> None:
    body = ss.Structure(*chain(3), ss.ModalDamping("zeta"))
    with pytest.raises(ss.DeclarationError, match="'zeta' is a formula of parameters"):
        _ = body.modal_damping
    assert "zeta of critical" in str(body.summary())


@pytest.mark.parametrize("surplus", [1, 3])
@pytest.mark.parametrize("n", [1, 4])
def test_more_ratios_than_modes_are_refused(n: int, surplus: int) -> None:
    ratios = [0.01 * (i + 1) for i in range(n + surplus)]
    with pytest.raises(ss.DeclarationError, match=rf"{n + surplus} ratios, but .* {n} mode"):
        ss.Structure(*chain(n), ss.ModalDamping(ratios))
    for fewer in range(1, n + 1):
        body = ss.Structure(*chain(n), ss.ModalDamping(ratios[:fewer]))
        each = [*ratios[:fewer], *[ratios[fewer - 1]] * (n - fewer)]
        np.testing.assert_allclose(body.modal_damping, 2.0 * np.array(each) * body.frequencies)


def test_a_reduced_structure_keeps_the_ratios_of_its_modes() -> None:
    body = ss.Structure(*chain(6), ss.ModalDamping([0.01, 0.02, 0.03, 0.04, 0.05, 0.06]))
    small = body.reduced(keep=[5], modes=2)
    np.testing.assert_allclose(
        small.modal_damping, 2.0 * np.array([0.01, 0.02, 0.03]) * small.frequencies
    )
