"""Starts at unknowns of structures, and jumps to them, beside the same chain by formulas."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from bodies import chain, clamped, typed
from stickslip.model.system_file import loads


def both(**parts: Any) -> tuple[ss.System, ss.System]:
    """A driven chain that rubs at its first mass, as a structure and as formulas."""
    mass, stiffness = chain(3)
    damping = 0.05 * mass + 0.1 * stiffness
    body = ss.Structure(mass, stiffness, damping, names={"tip": 2})
    given: dict[str, Any] = {"parameters": {"F": ss.Parameter(1.0)}, "span": (0.0, 20.0), **parts}
    one = ss.System(
        "body",
        structures={"u": body},
        forces={"u[tip]": "F*cos(t)"},
        contacts={"foot": ss.Contact("d_u[0]", 0.1)},
        **given,
    )
    rub = {"foot": ss.Contact("d_q0", 0.1)}
    two = typed(mass, stiffness, damping, {2: "F*cos(t)"}, contacts=rub, **given)
    return one, two


def test_maps_over_unknowns(tmp_path: Path) -> None:
    one, two = both()
    free, also = {"F": 0.0}, [0.3, -0.4]
    found = ss.sweep(
        replace(one, initial={"u[1]": 0.2}).with_parameters(**free),
        {"u[tip]": also, "d_u[1]": [0.0, 0.5]},
        ["state:u_mode_1", "time"],
        out=tmp_path / "map",
        initial={"u[0]": 0.1},
    )
    again = ss.sweep(
        replace(two, initial={"q1": 0.2}).with_parameters(**free),
        {"q2": also, "d_q1": [0.0, 0.5]},
        ["time", *(f"state:q{i}" for i in range(3))],
        initial={"q0": 0.1},
    )
    assert found.dataset["time"].dims == ("u[tip]", "d_u[1]")
    # Where they come to rest depends on where they begin.
    inverse = np.array([one.unknown(f"u[{i}]")["u_mode_1"] for i in range(3)])
    mass = chain(3)[0]
    mode = sum((inverse @ mass)[i] * again[f"state:q{i}"].values for i in range(3))
    np.testing.assert_allclose(found["state:u_mode_1"].values, mode, atol=1e-9)
    assert len(np.unique(np.round(mode, 9))) > 1
    stored: Any = ss.open(tmp_path / "map")
    np.testing.assert_array_equal(stored["time"].values, found["time"].values)
    assert found.plot("time") is not None


def test_basins_over_unknowns() -> None:
    one, two = both()
    first = ss.basin(one, {"u[tip]": "-1:1:3", "d_u[1]": "-1:1:3"})
    second = ss.basin(two, {"q2": "-1:1:3", "d_q1": "-1:1:3"})
    np.testing.assert_array_equal(first["attractor"].values, second["attractor"].values)
    np.testing.assert_allclose(first["period"].values, second["period"].values, rtol=1e-9)
    assert first.plot() is not None


@pytest.mark.parametrize("name", ["tip", "1"])
def test_derivatives_by_unknowns(name: str) -> None:
    one, two = both()
    place = {"tip": 2, "1": 1}[name]
    motions = (
        ss.simulate(one, initial={"u[0]": 0.3, "d_u[tip]": 0.2}),
        ss.simulate(two, initial={"q0": 0.3, "d_q2": 0.2}),
    )
    times = [1.0, 7.0, 19.0]
    first = motions[0].sensitivity(
        [f"u[{name}]", f"d_u[{name}]", "F"], times, of=["u[tip]", "d_u[0]"], second_opinion=True
    )
    second = motions[1].sensitivity([f"q{place}", f"d_q{place}", "F"], times, of=["q2", "d_q0"])
    for x, y in (("u[tip]", "q2"), ("d_u[0]", "d_q0"), ("d_switch_time", "d_switch_time")):
        np.testing.assert_allclose(first[x].values, second[y].values, rtol=1e-7, atol=1e-9)
    differences = first["u[tip]_by_differences"].values
    np.testing.assert_allclose(first["u[tip]"].values, differences, atol=1e-5)


def test_starts_that_are_fitted() -> None:
    one, two = both()
    truth = {"u[tip]": 0.4, "d_u[1]": -0.3}
    t = np.linspace(0.1, 20.0, 60)
    motion = ss.simulate(one, initial={"u[0]": 0.2, **truth})
    data = ss.Recording({"t": t, "u[tip]": motion.at(t)["u[tip]"]}, begin=0.0)
    free = {"u[tip]": (-1.0, 1.0), "d_u[1]": (-1.0, 1.0), "F": (0.5, 2.0)}
    problem = ss.fit_problem(one, data, free, initial={"u[0]": "F/5"})
    same = ss.fit_problem(
        two,
        ss.Recording({"t": t, "q2": motion.at(t)["u[tip]"]}, begin=0.0),
        {"q2": (-1.0, 1.0), "d_q1": (-1.0, 1.0), "F": (0.5, 2.0)},
        initial={"q0": "F/5"},
    )
    exact = np.array([0.4, -0.3, 1.0])
    np.testing.assert_allclose(problem.residuals(exact), 0.0, atol=1e-8)
    p = exact + 0.02
    np.testing.assert_allclose(problem.residuals(p), same.residuals(p), atol=1e-8)
    np.testing.assert_allclose(problem.jacobian(p), same.jacobian(p), rtol=1e-6, atol=1e-7)
    found = ss.fit(one, data, free, initial={"u[0]": "F/5"}, starts=2)
    np.testing.assert_allclose(found.values, exact, atol=1e-6)
    begun = ss.simulate(found.system).at(0.0)
    assert begun["u[tip]"] == pytest.approx(0.4, abs=1e-6)
    held = ss.fit_problem(one, data, free)
    assert held.start.tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    "to",
    [
        {"d_u[tip]": "d_u[tip] + F"},
        {"u[1]": "u[0] - 0.2", "u[tip]": "2*u[1]", "d_u[1]": 0.0},
        {"d_u[0]": "-0.5*d_u[0]", "d_u[1]": "-0.5*d_u[1]"},
    ],
)
def test_jumps_to_unknowns(to: dict[str, Any]) -> None:
    kicks = {
        "kick": ss.Jump("sin(0.7*t)", to, "rising"),
        "stop": ss.Jump("t - 9.9", {"d_u[tip]": "0"}),
    }
    names = {"u[tip]": "q2", "u[0]": "q0", "u[1]": "q1"}

    def renamed(text: Any) -> Any:
        for old, new in names.items():
            text = text.replace(old, new) if isinstance(text, str) else text
        return text

    others = {
        name: replace(jump, to={renamed(x): renamed(value) for x, value in jump.to.items()})
        for name, jump in kicks.items()
    }
    one, two = (replace(s, jumps=j) for s, j in zip(both(), (kicks, others), strict=True))
    first, second = ss.simulate(one), ss.simulate(two)
    assert first.certificate.ok and len(first.jumps) == len(second.jumps) > 2
    np.testing.assert_allclose(
        first.jumps["energy_change"], second.jumps["energy_change"], atol=1e-11
    )
    times = np.linspace(0.0, 20.0, 41)
    for x, y in names.items():
        found = sum(w * first.at(times)[mode] for mode, w in one.unknown(x).items())
        np.testing.assert_allclose(found, second.at(times)[y], atol=1e-10)
    assert loads(one.to_toml()) == one and "landing" in str(one.equations())


@pytest.mark.parametrize(
    ("to", "said"),
    [
        ({"d_u[top]": "1"}, r"jumps.kick.to.'d_u\[top\]': no such degree of freedom.*tip"),
        ({"d_w[0]": "1"}, r"jumps.kick.to.'d_w\[0\]': no such degree of freedom"),
        ({"u[3]": "1"}, r"jumps.kick.to.'u\[3\]'.*Use an index from 0 to 2"),
        ({"u[tip]": "1 +"}, r"jumps.kick.to.'u\[tip\]': .* is not a formula"),
        ({"u[tip]": "z"}, r"jumps.kick.to.'u\[tip\]': unknown name 'z'"),
        ({"u[tip]": "1", "u[2]": "2"}, "has two new values"),
        ({"u[tip]": "1", "u_mode_2": "2"}, "a new value of the mode u_mode_2 is given as well"),
    ],
)
def test_jumps_to_no_unknown_are_refused(to: dict[str, str], said: str) -> None:
    with pytest.raises(ss.DeclarationError, match=said):
        replace(both()[0], jumps={"kick": ss.Jump("t - 3", to)})


@pytest.mark.parametrize(
    ("names", "initial", "said"),
    [
        (("u[top]",), {}, r"u\[top\]'?: no such degree of freedom.*tip"),
        (("u[5]",), {}, r"u\[5\]'?: no such degree of freedom"),
        (("u[tip]", "u[2]"), {}, "it is the same degree of freedom as u"),
        (("u[tip]", "u_mode_1"), {}, "initial value of the mode u_mode_1 is given as well"),
        (("u[tip]",), {"u[2]": 1.0}, "it is the same degree of freedom as u"),
        (("u[tip]",), {"u_mode_2": 1.0}, "initial value of the mode u_mode_2 is given as well"),
    ],
)
def test_starts_that_make_no_sense_are_refused(
    names: tuple[str, ...], initial: dict[str, float], said: str
) -> None:
    system = both()[0]
    axes = {name: [0.0, 0.1] for name in names}
    with pytest.raises(ss.DeclarationError, match=said):
        ss.sweep(system, axes, ["time"], initial=initial)
    with pytest.raises(ss.DeclarationError, match=said):
        ss.basin(system, axes, initial=initial)
    data = ss.Recording({"t": [1.0, 2.0, 3.0], "u[0]": [0.0, 0.1, 0.2]}, begin=0.0)
    free: dict[str, Any] = dict.fromkeys(names, (-1.0, 1.0))
    with pytest.raises(ss.DeclarationError, match=said):
        ss.fit_problem(system, data, free, initial=initial)
    with pytest.raises(ss.DeclarationError, match=said):
        ss.simulate(system, (0.0, 1.0), initial={**initial, **dict.fromkeys(names, 0.1)})
    with pytest.raises(ss.DeclarationError, match=said):
        ss.simulate(replace(system, initial={**initial, **dict.fromkeys(names, 0.1)}), (0.0, 1.0))
    every = {**initial, **dict.fromkeys(names, 0.1)}
    with pytest.raises(ss.DeclarationError, match=said):
        ss.simulate(system, (0.0, 1.0)).sensitivity([*every], [1.0])
    with pytest.raises(ss.DeclarationError, match=said):
        ss.simulate_many(system, (0.0, 1.0), initial={x: [v, 0.2] for x, v in every.items()})
    with pytest.raises(ss.DeclarationError, match=said):
        system.evaluate("u[0]", every)


@pytest.mark.parametrize("name", ["u[tip]", "u[2]", "d_u[1]", "u_mode_1"])
def test_what_is_free_is_not_given(name: str) -> None:
    system = both()[0]
    table = {"t": [1.0, 2.0, 3.0], "u[0]": [0.0, 0.1, 0.2]}
    data = ss.Recording(table, begin=0.0)
    said = "its value is given by|same degree of freedom|of the mode u_mode_1 is given as well"
    free: dict[str, Any] = {name: (-1.0, 1.0)}
    assert ss.fit_problem(system, data, free).names == [name]
    given = {"u[tip]": 0.1} if name != "d_u[1]" else {name: 0.1}
    with pytest.raises(ss.DeclarationError, match=said):
        ss.fit_problem(system, data, free, initial=given)
    with pytest.raises(ss.DeclarationError, match=said):
        ss.fit_problem(system, ss.Recording(table, begin=0.0, initial=given), free)


def test_derivatives_by_one_name_twice_are_refused() -> None:
    motion = ss.simulate(both()[0], (0.0, 1.0))
    for name in ("F", "u[tip]", "u_mode_1"):
        with pytest.raises(ss.DeclarationError, match="it is given twice"):
            motion.sensitivity([name, name], [1.0])


def test_what_no_start_determines_is_refused() -> None:
    body = ss.Structure(*clamped(4), names={"tip": 6}).reduced(keep=["tip"], modes=2)
    system = ss.System("s", structures={"u": body}, span=(0.0, 0.1))
    said = "not a coordinate of the reduced structure"
    with pytest.raises(ss.DeclarationError, match=rf"over.'u\[2\]': it is {said}"):
        ss.sweep(system, {"u[2]": [0.0, 0.1]}, ["time"])
    with pytest.raises(ss.DeclarationError, match=rf"sensitivity.'u\[2\]': it is {said}"):
        ss.simulate(system).sensitivity(["u[2]"], [0.1])
    with pytest.raises(ss.DeclarationError, match=rf"jumps.kick.to.'u\[2\]': it is {said}"):
        replace(system, jumps={"kick": ss.Jump("t - 0.05", {"u[2]": 0.0})})
    kicked = replace(system, jumps={"kick": ss.Jump("t - 0.05", {"d_u[tip]": 1.0})})
    motion = ss.simulate(kicked)
    assert motion.certificate.ok
    rate = system.unknown("d_u[tip]")
    k = motion.knots
    (at,) = np.flatnonzero(np.abs(k.time - 0.05) < 1e-12)
    state = dict(zip(system.declaration.state, k.state[at], strict=True))
    assert sum(w * state[x] for x, w in rate.items()) == pytest.approx(1.0, abs=1e-12)


def free() -> ss.System:
    body = ss.Structure(
        np.diag([1.0, 2.0]),
        [[3.0, -1.0], [-1.0, 2.0]],
        ss.ModalDamping(0.02),
        names={"root": 0, "tip": 1},
    )
    return ss.System("free", structures={"u": body})


@pytest.mark.parametrize("of", ["1/u[tip]", "exp(1000*u[tip])", "u[tip]/(u[tip] - 0.1)"])
def test_a_ring_down_does_not_pass_through_poles(of: str) -> None:
    with pytest.raises(ss.DeclarationError, match="becomes undefined or infinite"):
        ss.ring_down(free(), (0.0, 60.0), of=of, initial={"u_mode_1": 1.0})


@pytest.mark.parametrize("of", ["1/u[tip]", "sqrt(u[tip])"])
def test_a_backbone_needs_a_slope_at_rest(of: str) -> None:
    with pytest.raises(ss.DeclarationError, match="no finite slope"):
        ss.backbone(free(), (0.01, 0.02), of=of, points=2)


def dying(case: str) -> ss.System:
    """Structures whose joint holds while they come to rest: the blade of the tutorial, or a random
    chain."""
    if case == "blade":
        blade = ss.Structure(*clamped(60), ss.ModalDamping(0.005), names={"rub": 44, "tip": 118})
        body, place, k = blade.reduced(keep=["rub", "tip"], modes=4), "d_u[rub]", 1.3e6
    else:
        rng = np.random.default_rng(int(case))
        n = int(rng.integers(2, 7))
        mass, stiffness = chain(n)
        ratio = 10.0 ** rng.uniform(-2.5, -0.5)
        stiff = stiffness * 10.0 ** rng.uniform(0.0, 4.0)
        body = ss.Structure(mass, stiff, ss.ModalDamping(ratio), names={"tip": n - 1})
        place, k = "d_u[0]", 3.0
    return ss.System(
        "dying",
        parameters={"F": 0.0},
        structures={"u": body},
        forces={"u[tip]": "F*cos(120*t)"},
        contacts={"joint": ss.laws.jenkins(place, F_c=1e9, k=k)},
    )


@pytest.mark.parametrize("case", ["blade", *map(str, range(1, 7))])
def test_a_map_certifies_a_rest_as_a_motion_does(case: str) -> None:
    # What is left of the motion is tiny beside what it was, and is measured by itself.
    system = dying(case)
    found = ss.sweep(system, {"u[tip]": [5e-4, 0.3]}, ["time", "duration"])
    assert np.all(found["outcome"] == ss.Outcome.AT_REST.code)
    assert found.certificate.ok
    assert np.all(found["certificate"] < 1e-9)
    for start in (5e-4, 0.3):
        assert ss.simulate(system, (0.0, 50.0), initial={"u[tip]": start}).certificate.ok
