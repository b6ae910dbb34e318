"""Structures in systems: the same motions as of formulas, closed forms, published problems."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss
from bodies import beam, chain, clamped, form, random_body, typed

DRIVEN: dict[str, Any] = {"parameters": {"omega": ss.Parameter(0.7), "F": ss.Parameter(1.0)}}


def both(contacts: Any, names: dict[str, str], n: int = 6, **parts: Any) -> list[ss.System]:
    """A driven chain with contacts, as a structure and as formulas; names of unknowns are replaced
    in the second."""
    mass, stiffness = chain(n)
    damping = 0.02 * mass + 0.03 * stiffness
    body = ss.Structure(mass, stiffness, damping, names={"tip": n - 1, "mid": 2})
    force = "F*cos(omega*t)"
    replaced: Any = parts
    for old, new in names.items():
        replaced = renamed(replaced, old, new)
    return [
        ss.System(
            "chain",
            structures={"u": body},
            forces={"u[tip]": force},
            contacts=contacts(*names),
            **DRIVEN,
            **parts,
        ),
        typed(
            mass,
            stiffness,
            damping,
            {n - 1: force},
            contacts=contacts(*names.values()),
            **DRIVEN,
            **replaced,
        ),
    ]


def renamed(item: Any, old: str, new: str) -> Any:
    """Texts with another name."""
    if isinstance(item, str):
        return item.replace(old, new)
    if isinstance(item, dict):
        return {renamed(k, old, new): renamed(v, old, new) for k, v in item.items()}
    return item


NAMES = {"u[tip]": "q5", "u[mid]": "q2", "u[0]": "q0"}
CONTACTS: dict[str, Any] = {
    "a constraint": lambda tip, mid, first: {
        "wire": ss.Bilateral(f"{tip} - {first}", f"d_{mid}", 0.2)
    },
    "a dry contact": lambda tip, mid, first: {"rub": ss.Contact(f"d_{mid}", 0.4)},
    "with another threshold at rest": lambda tip, mid, first: {
        "rub": ss.Contact(f"d_{tip} - d_{first}", 0.4, kinetic=0.3)
    },
    "on a belt": lambda tip, mid, first: {
        "rub": ss.Contact(f"d_{mid}", 0.4, "0.1*sin(t)", "0.4/(1 + speed)")
    },
    "under a spring": lambda tip, mid, first: {"rub": ss.Contact(f"d_{mid}", f"0.3 + {tip}**2")},
    "Jenkins": lambda tip, mid, first: {
        "j": ss.laws.jenkins(f"d_{tip} - 0.5*d_{first}", F_c=0.3, k=2.0)
    },
    "Iwan": lambda tip, mid, first: {
        "j": ss.laws.iwan(f"d_{tip}", F_c=0.5, k=2.0, elements=3)
    },
    "LuGre": lambda tip, mid, first: {
        "l": ss.laws.lugre(
            f"d_{mid}", F_s=0.4, F_c=0.3, v_s=0.1, sigma_0=50.0, sigma_1=1.0
        )
    },
    "a gap": lambda tip, mid, first: {
        "stop": ss.Unilateral(f"{tip} + 0.4", f"d_{mid}", 0.3, restitution=0.6)
    },
    "in a plane": lambda tip, mid, first: {"disc": ss.Contact((f"d_{mid}", f"d_{tip}"), 0.4)},
}  # fmt: skip


@pytest.mark.parametrize("kind", CONTACTS)
def test_a_chain_moves_as_it_does_as_formulas(kind: str) -> None:
    """With a cubic spring, a start of its unknowns, and every kind of contact."""
    rate = "d_u[mid]" if kind == "a constraint" else "d_u[tip]"
    parts = {"potential": "0.1/4*u[0]**4", "initial": {"u[mid]": 0.5, rate: 0.2}}
    body, formulas = both(CONTACTS[kind], NAMES, **parts)
    first, second = (ss.simulate(system, (0.0, 25.0)) for system in (body, formulas))
    assert first.certificate.ok and second.certificate.ok
    assert first.n_switches == second.n_switches
    switches = [len(motion.events) + len(motion.impacts) for motion in (first, second)]
    assert switches[0] == switches[1] > (-1 if kind == "LuGre" else 1)
    times = np.linspace(0.0, 25.0, 101)
    here, there = first.at(times), second.at(times)
    for unknown, coordinate in (("u[tip]", "q5"), ("u[mid]", "q2")):
        for rate in ("", "d_"):
            one, other = here[rate + unknown], there[rate + coordinate]
            np.testing.assert_allclose(one, other, atol=1e-11, err_msg=unknown)
    for name in there:
        if name.startswith("friction_"):
            np.testing.assert_allclose(here[name], there[name], atol=1e-9, err_msg=name)
    np.testing.assert_allclose(first["u[0]"][-1], second["q0"][-1], atol=1e-11)  # has no name
    np.testing.assert_allclose(here["dissipated_energy"], there["dissipated_energy"], atol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_random_bodies_move_as_formulas(seed: int) -> None:
    """Full matrices, damping that couples modes, contacts along several unknowns."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 6))
    mass, stiffness, damping = random_body(rng, n)
    weights = rng.normal(size=n)
    force = "3*sin(1.3*t)"

    def contacts(rates: list[str]) -> dict[str, Any]:
        way = " + ".join(f"({w!r})*{rate}" for w, rate in zip(weights.tolist(), rates, strict=True))
        return {
            "rub": ss.Contact(way, 0.2),
            "j": ss.laws.jenkins(f"{rates[0]} - {rates[1]}", F_c=0.2, k=3.0),
        }

    body = ss.System(
        "body",
        structures={"u": ss.Structure(mass, stiffness, damping)},
        forces={"u[0]": force},
        contacts=contacts([f"d_u[{i}]" for i in range(n)]),
    )
    other = typed(
        mass, stiffness, damping, {0: force}, contacts=contacts([f"d_q{i}" for i in range(n)])
    )
    first, second = (ss.simulate(system, (0.0, 30.0)) for system in (body, other))
    assert first.certificate.ok and second.certificate.ok
    assert first.n_switches == second.n_switches > 3
    times = np.linspace(0.0, 30.0, 61)
    for i in range(n):
        np.testing.assert_allclose(
            first.at(times)[f"u[{i}]"], second.at(times)[f"q{i}"], atol=1e-11
        )


def test_cycles_are_those_of_formulas() -> None:
    body, formulas = both(CONTACTS["a dry contact"], NAMES)
    found = [
        ss.find_cycle(system, ss.simulate(system, (0.0, 180.0))) for system in (body, formulas)
    ]
    assert all(cycle.certificate.ok for cycle in found)
    assert found[0].period == pytest.approx(found[1].period, abs=1e-11)
    one, other = (np.sort_complex(np.asarray(cycle.multipliers, complex)) for cycle in found)
    np.testing.assert_allclose(np.abs(one), np.abs(other), atol=1e-8)
    motions = [cycle.trajectory for cycle in found]
    starts = [float(m.knots.time[0]) for m in motions]
    times = np.linspace(0.0, found[0].period, 33)[:-1]
    phases = [np.mod(times - start, found[0].period) + start for start in starts]
    tip = motions[0].at(phases[0])["u[tip]"]
    np.testing.assert_allclose(tip, motions[1].at(phases[1])["q5"], atol=1e-11)

    for unknown, coordinate in (("u[tip]", "q5"), ("u[mid]", "q2")):
        ends, exact = found[0].extrema[unknown], found[1].extrema[coordinate]
        np.testing.assert_allclose(ends, exact, atol=1e-11)
        h, exact_h = found[0].harmonic[unknown], found[1].harmonic[coordinate]
        assert abs(h - exact_h) < 1e-10
    lag = found[0].relative_phase["u[tip]"]
    assert lag == pytest.approx(found[1].relative_phase["q5"], abs=1e-9)


def test_responses_are_those_of_formulas() -> None:
    """A mass on a spring with a Jenkins element: of the unknown, its force, and phases."""
    parts: dict[str, Any] = {"parameters": {"omega": ss.Parameter(1.0), "F": ss.Parameter(0.3)}}
    law = ss.laws.jenkins
    body = ss.System(
        "body",
        structures={"u": ss.Structure([[2.0]], [[2.0]], [[0.1]], ["x"])},
        forces={"u[x]": "F*cos(omega*t)"},
        contacts={"j": law("d_u[x]", F_c=0.2, k=1.0)},
        **parts,
    )
    other = typed(
        [[2.0]] * np.ones((1, 1)),
        2.0 * np.ones((1, 1)),
        0.1 * np.ones((1, 1)),
        {0: "F*cos(omega*t)"},
        contacts={"j": law("d_q0", F_c=0.2, k=1.0)},
        **parts,
    )
    first, second = (
        ss.frequency_response(system, "omega", (0.9, 1.2), points=3) for system in (body, other)
    )
    assert (first.coordinate, second.coordinate) == ("u[x]", "q0")
    assert first.certificate.ok and second.certificate.ok
    for name in ("peak_amplitude", "peak_omega"):
        if name in second.dataset:
            np.testing.assert_allclose(first[name], second[name], rtol=1e-7)
    with pytest.raises(ss.DeclarationError, match=r"unknown component u\[9\]"):
        ss.frequency_response(body, "omega", (0.9, 1.2), of="u[9]")


def test_one_mode_with_one_contact_is_the_scalar_oscillator() -> None:
    """Half swings about ±F_c/k lose 2F_c/k of their amplitude each."""
    body = ss.Structure([[2.0]], [[8.0]], names=["x"])
    system = ss.System(
        "oscillator",
        structures={"u": body},
        contacts={"rub": ss.Contact("d_u[x]", 1.0)},
        initial={"u[x]": 2.1},
        span=(0.0, 20.0),
    )
    motion = ss.simulate(system)
    turns = motion.at(np.arange(9) * np.pi / 2.0)["u[x]"]
    exact = [2.1, -1.85, 1.6, -1.35, 1.1, -0.85, 0.6, -0.35, 0.1]
    np.testing.assert_allclose(turns, exact, atol=1e-13)
    assert float(motion["u[x]"][-1]) == pytest.approx(0.1, abs=1e-13)


@pytest.mark.parametrize("n", [5, 24])
def test_what_sticks_runs_backwards(n: int) -> None:
    """Without damping, and as long as its damper sticks, a body comes back with its rates turned:
    nothing is lost. Where the damper slips, the energy that it takes is missing."""
    mass, stiffness = chain(n)
    body = ss.Structure(mass, stiffness, names={"tip": n - 1})
    damper = ss.laws.jenkins("d_u[tip]", F_c="F_c", k=2.0)
    system = ss.System(
        "chain",
        structures={"u": body},
        contacts={"damper": damper},
        parameters={"F_c": ss.Parameter(10.0)},
        initial={"d_u[tip]": 1.0},
    )
    there = ss.simulate(system, (0.0, 30.0))
    turned = {x: (-v if x.startswith("d_") else v) for x, v in there.final.items()}
    back = ss.simulate(system, (0.0, 30.0), initial=turned)
    start = np.array([float(there[x][0]) for x in there.final])
    signs = np.array([-1.0 if x.startswith("d_") else 1.0 for x in there.final])
    assert np.max(np.abs(signs * np.array(list(back.final.values())) - start)) < 1e-11
    assert there.certificate.ok and back.certificate.ok
    slips = ss.simulate(system, (0.0, 30.0), parameters={"F_c": 0.05})
    lost = float(slips["energy"][0] - slips["energy"][-1])
    assert lost == pytest.approx(float(slips["dissipated_energy"][-1]), rel=1e-10)
    assert lost > 0.1


def test_sdnd100_of_code_aster() -> None:
    """Code_Aster V5.01.100: m = 1, k = 10,000, μN = 1, released at 0.85 mm."""
    system = ss.System(
        "SDND100",
        structures={"u": ss.Structure([[1.0]], [[1e4]])},
        contacts={"plane": ss.Contact("d_u[0]", 1.0)},
        initial={"u[0]": 0.85e-3},
    )
    motion = ss.simulate(system, (0.0, 0.2))
    turns = motion.at(np.arange(1, 5) * np.pi / 100.0)["u[0]"]
    np.testing.assert_allclose(turns, [-0.65e-3, 0.45e-3, -0.25e-3, 0.05e-3], atol=1e-16)
    assert float(motion["u[0]"][-1]) == pytest.approx(0.05e-3, abs=1e-16)


def test_sdnd106_of_code_aster() -> None:
    """Code_Aster V5.01.106: two free masses joined by a spring, one on the ground with 3000 N at
    rest and 2000 N sliding, 3000 N on the other up to 0.2 s."""
    body = ss.Structure(5.0 * np.eye(2), 1e4 * np.array([[1.0, -1.0], [-1.0, 1.0]]))
    assert np.count_nonzero(body.frequencies == 0.0) == 1
    system = ss.System(
        "SDND106",
        structures={"u": body},
        forces={"u[1]": "3000*heaviside(0.2 - t)"},
        contacts={"ground": ss.Contact("d_u[0]", 3000.0, kinetic=2000.0)},
    )
    motion = ss.simulate(system, (0.0, 1.0))
    assert motion.certificate.ok
    switches = [float(t) for t in motion.events["time"] if t not in (0.2,)]
    assert switches[0] == pytest.approx(np.pi / 2.0 / np.sqrt(2000.0), abs=1e-12)
    assert any(t == pytest.approx(0.314923, abs=1e-6) for t in switches)
    assert float(motion.at(0.314923)["u[0]"]) == pytest.approx(3.955606, abs=1e-6)


def test_a_contact_that_holds_makes_the_beam_the_held_beam() -> None:
    """NLvib, example 8: while its node sticks the beam swings as the held one does."""
    mass, stiffness = clamped(8)
    held = [i for i in range(16) if i != 4]
    fixed = ss.Structure(mass[np.ix_(held, held)], stiffness[np.ix_(held, held)])
    body = ss.Structure(mass, stiffness, names={"rub": 4, "tip": 14})
    start = np.insert(fixed.modes[:, 0], 4, 0.0)
    system = ss.System(
        "beam",
        structures={"u": body.reduced(["rub", "tip"], 6)},
        contacts={"damper": ss.Contact("d_u[rub]", 1e9)},
    )
    small = system.structures["u"]
    assert isinstance(small, ss.Structure)
    # the kept unknowns and their fixed modes hold this one, too
    basis = np.asarray(small.basis)
    own = np.linalg.lstsq(basis, start)[0]
    modes = small.in_modes(own)
    initial = {f"u_mode_{i}": float(a) for i, a in enumerate(modes, 1)}
    span = 2.0 * np.pi / 248.97320477
    motion = ss.simulate(system, (0.0, span), initial=initial)
    assert motion.certificate.ok and motion.n_switches == 0
    tip = motion.at(np.array([0.0, 0.25, 0.5, 1.0]) * span)["u[tip]"]
    np.testing.assert_allclose(tip / tip[0], [1.0, 0.0, -1.0, 1.0], atol=2e-3)


def test_a_reduced_beam_moves_as_the_whole() -> None:
    """A driven cantilever with a Jenkins element at its tip: twelve modes against all."""
    mass, stiffness = clamped(10)
    n = len(mass)
    whole = ss.Structure(mass, stiffness, ss.ModalDamping(0.02), names={"tip": n - 2})
    systems = [
        ss.System(
            "beam",
            structures={"u": body},
            forces={"u[tip]": "1000*sin(110*t)"},
            contacts={"damper": ss.laws.jenkins("d_u[tip]", F_c=300.0, k=1e5)},
        )
        for body in (whole, whole.reduced(keep=["tip"], modes=6))
    ]
    first, second = (ss.simulate(system, (0.0, 0.3)) for system in systems)
    assert first.certificate.ok and second.certificate.ok
    assert first.n_switches == second.n_switches > 8
    times = np.linspace(0.0, 0.3, 200)
    size = np.max(np.abs(first.at(times)["u[tip]"]))
    np.testing.assert_allclose(
        second.at(times)["u[tip]"], first.at(times)["u[tip]"], atol=1e-4 * size
    )
    root = second["u[0]"]  # unknowns that were not kept are there as well
    np.testing.assert_allclose(root[-1], first["u[0]"][-1], atol=1e-3 * size)


def test_a_free_beam_drifts() -> None:
    """A force through the middle of a beam moves its centre of mass by ft²/2m."""
    mass, stiffness = beam(4)
    body = ss.Structure(mass, stiffness)
    system = ss.System("free", structures={"u": body}, forces={"u[4]": 100.0})
    motion = ss.simulate(system, (0.0, 0.1))
    assert motion.certificate.ok
    ones = np.tile([1.0, 0.0], 5)
    last = np.array([float(motion[f"u[{i}]"][-1]) for i in range(10)])
    total = float(ones @ mass @ ones)
    assert ones @ mass @ last / total == pytest.approx(100.0 * 0.1**2 / 2.0 / total, rel=1e-9)


@pytest.mark.parametrize("n", [4, 5, 6, 9])
def test_two_bodies_in_one_structure(n: int) -> None:
    """One is driven, the other touched: rounding of the modes, which may belong to both, neither
    shortens the steps nor keeps a motion from being certified."""
    stiffness = np.zeros((n, n))
    for i in range(n - 2):
        way = np.eye(n)[i] - np.eye(n)[i + 2]
        stiffness += (1.0 + 0.3 * i) * np.outer(way, way)
    body = ss.Structure(np.diag(1.0 + 0.37 * np.arange(n)), stiffness)
    system = ss.System(
        "apart",
        structures={"u": body},
        forces={"u[1]": "cos(2.3*t + 0.3)"},
        contacts={"rub": ss.Contact("d_u[0]", 0.12)},
    )
    motion = ss.simulate(system, (0.0, 10.0))
    assert motion.certificate.ok
    assert len(motion.knots.time) < 40
    assert abs(float(motion["u[0]"][-1])) < 1e-13
    moved = [i for i in range(1, n, 2)]
    mass = body.mass[moved, moved]
    middle = mass @ [float(motion[f"u[{i}]"][-1]) for i in moved]
    w, phase = 2.3, 0.3
    free = (np.cos(phase) - np.cos(10.0 * w + phase)) / w**2 - np.sin(phase) / w * 10.0
    assert middle == pytest.approx(free, rel=1e-10)


def test_two_structures_and_a_coordinate() -> None:
    """Joined by springs and contacts; the same as one chain of all three."""
    mass, stiffness = chain(3)
    body = ss.Structure(mass, stiffness, names=["a", "b", "c"])
    system = ss.System(
        "three",
        coordinates={"x": ss.Inertial()},
        structures={"u": body, "w": body},
        kinetic="d_x**2/2",
        potential="(u[c] - x)**2/2 + (x - w[c])**2/2",
        contacts={"rub": ss.Contact("d_u[c] - d_w[a]", 0.1)},
        initial={"x": 1.0, "d_w[b]": -0.5},
    )
    names = [*(f"{s}{i}" for s in "uw" for i in range(3)), "x"]
    rates = [f"d_{name}" for name in names]
    twice = np.kron(np.eye(2), mass), np.kron(np.eye(2), stiffness)
    other = ss.System(
        "typed",
        coordinates={name: ss.Inertial() for name in names},
        kinetic=form(twice[0], rates[:6]) + " + d_x**2/2",
        potential=form(twice[1], names[:6]) + " + (u2 - x)**2/2 + (x - w2)**2/2",
        contacts={"rub": ss.Contact("d_u2 - d_w0", 0.1)},
        initial={"x": 1.0, "d_w1": -0.5},
    )
    first, second = (ss.simulate(s, (0.0, 30.0)) for s in (system, other))
    assert first.n_switches == second.n_switches > 3
    times = np.linspace(0.0, 30.0, 50)
    here, there = first.at(times), second.at(times)
    for one, two in (("x", "x"), ("u[c]", "u2"), ("d_w[a]", "d_w0")):
        np.testing.assert_allclose(here[one], there[two], atol=1e-11)


def small(**parts: Any) -> ss.System:
    mass, stiffness = chain(3)
    return ss.System(
        "s", structures={"u": ss.Structure(mass, stiffness, names={"tip": 2})}, **parts
    )


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "no such name": ({"potential": "u[top]"}, r"unknown component u\[top\]. .*tip"),
    "no such index": ({"potential": "u[3]"}, r"unknown component u\[3\]. Use an index from 0 to 2"),
    "negative": ({"potential": "u[-1]"}, "is not a number or a name"),
    "a slice": ({"potential": "u[0:1]"}, "is not a number or a name"),
    "a formula": ({"potential": "u[u[0]]"}, "is not a number or a name"),
    "a fraction": ({"potential": "u[1.5]"}, "is not a number or a name"),
    "all of it": ({"potential": "u**2"}, r"Name one of its components, like u\[0\]"),
    "a rate in an energy": ({"potential": "d_u[0]"}, "'d_u' is not allowed here"),
    "no structure": ({"potential": "v[0]"}, "unknown structure 'v'. Known here: u"),
    "one number": ({"potential": "t[0]"}, "'t' is a single number"),
    "not closed": ({"potential": "u[0"}, "potential: .* is not a formula"),
    "a sum that goes on": ({"potential": "u[0]**2 -"}, "potential: .* is not a formula"),
    "a comment": ({"potential": "u[0]**2 # soft"}, "potential: '#' is not allowed"),
    "a constraint that does not hold": (
        {
            "contacts": {"wire": ss.Bilateral("u[tip] - u[0]", "d_u[1]", 0.2)},
            "initial": {"u[0]": 1.0},
        },
        r"contacts.'wire'.constraint: it is -1 at the initial state",
    ),
    "a force on nothing": ({"forces": {"u[top]": 1.0}}, r"forces.'u\[top\]': no such"),
    "a force on all": ({"forces": {"u": 1.0}}, r"forces.u: no such degree of freedom"),
    "a force on a rate": ({"forces": {"d_u[0]": 1.0}}, r"not on its rate. Write u\[0\]"),
    "a force of nothing": ({"forces": {"u[0]": "z"}}, r"forces.'u\[0\]': unknown name 'z'"),
    "a force on a coordinate": (
        {"coordinates": {"x": ss.Inertial()}, "kinetic": "d_x**2/2", "forces": {"x": 1.0}},
        "Write it under coordinates.x.force",
    ),
    "a start of nothing": ({"initial": {"u[7]": 1.0}}, r"initial.'u\[7\]': no such"),
    "a start that is none": ({"initial": {"u[0]": np.nan}}, "not a finite number"),
    "a name twice": (
        {"coordinates": {"u": ss.Inertial()}, "kinetic": "d_u**2/2"},
        "structures.u: the name 'u' is declared twice",
    ),
    "a mode's name": (
        {"coordinates": {"u_mode_1": ss.Inertial()}, "kinetic": "d_u_mode_1**2/2"},
        "needs the name 'u_mode_1', which is already used",
    ),
    "a direction that is none": (
        {"contacts": {"c": ss.Contact("u[0]", 1.0)}},
        "not a linear combination of rates",
    ),
    "a direction of zero": (
        {"contacts": {"c": ss.Contact("0*d_u[0]", 1.0)}},
        "the direction is zero",
    ),
    "a law along nothing": (
        {"contacts": {"c": ss.laws.jenkins("d_u[top]", F_c=1.0, k=1.0)}},
        r"contacts.'c'.direction: unknown component d_u\[top\]",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_with_unknowns_is_said(what: str) -> None:
    parts, said = WRONG[what]
    with pytest.raises(ss.DeclarationError, match=said):
        small(**parts)


def test_units_are_checked_before_laws_take_them_over() -> None:
    mass, stiffness = chain(2)
    body = ss.Structure(mass, stiffness, unit="furlongs")
    with pytest.raises(ss.DeclarationError, match=r"structures\.u\.unit: cannot parse 'furlongs'"):
        ss.System(
            "s",
            structures={"u": body},
            contacts={"c": ss.laws.jenkins("d_u[0]", F_c=1.0, k=1.0)},
        )


@pytest.mark.parametrize(
    "contact",
    [
        ss.Contact("d_u[0] - d_u[0]", 1.0),
        ss.laws.jenkins("d_u[0] - d_u[0]", F_c=1.0, k=1.0),
        ss.laws.iwan("0*d_u[0]", F_c=1.0, k=1.0),
        ss.laws.dahl("d_u[0] - d_u[0]", F_c=1.0, k=1.0),
        ss.laws.stribeck("d_u[0] - d_u[0]", F_s=2.0, F_c=1.0, v_s=0.1),
    ],
)
def test_contacts_without_a_direction_are_refused(contact: Any) -> None:
    with pytest.raises(
        ss.DeclarationError, match=r"contacts\.'c'\.direction: the direction is zero"
    ):
        small(contacts={"c": contact})


def test_events_of_a_constraint_without_friction() -> None:
    """It has no mode that anyone sees, so that nothing switches."""
    system = small(contacts={"wire": ss.Bilateral("u[tip] - u[0]")}, initial={"u[1]": 1.0})
    motion = ss.simulate(system, (0.0, 5.0))
    assert motion.certificate.ok
    assert len(motion.events) == 0


def test_whatever_starts_somewhere_starts_at_unknowns() -> None:
    """As motions do: maps, basins, many motions, fits; with what is declared of other unknowns."""
    system = small(
        parameters={"F": ss.Parameter(1.0), "a": ss.Parameter(0.1)},
        contacts={"foot": ss.Contact("d_u[tip]", 0.1)},
        coordinates={"y": ss.Inertial()},
        kinetic="d_y**2/2",
        potential="y**2/2",
        viscous="d_u[0]**2/10 + d_y**2/10",
        initial={"u[0]": 0.3, "y": 0.2},
        span=(0.0, 5.0),
    )
    start = {"u[tip]": 0.4, "d_u[1]": -0.2}
    alone = ss.simulate(system, (0.0, 5.0), initial=start)
    t = np.linspace(0.0, 5.0, 21)
    many = ss.simulate_many(
        system, (0.0, 5.0), initial={"u[tip]": [0.4, 0.0], "d_u[1]": [-0.2, 0.0]}
    )
    for name in ("u_mode_1", "u_mode_2", "y"):
        arrived = float(many.table[f"final_{name}"].iloc[0])
        assert arrived == pytest.approx(alone.at(5.0)[name], abs=1e-9)
    data = {"t": t, "u[tip]": alone.at(t)["u[tip]"]}
    problem = ss.fit_problem(
        system, data, {"a": (0.0, 1.0)}, initial={"u[tip]": "4*a", "d_u[1]": -0.2}
    )
    np.testing.assert_allclose(problem.residuals(np.array([0.1])), 0.0, atol=1e-8)
    ss.basin(system, {"y": [0.0, 0.1], "d_y": [0.0, 0.1]}, initial=start)
    found = ss.sweep(system, {"F": [1.0, 2.0]}, ["high:u[tip]"], initial=start)
    other = {name: alone.dataset[name][0].item() for name in ("u_mode_1", "u_mode_2", "u_mode_3")}
    other |= {f"d_{name}": alone.dataset[f"d_{name}"][0].item() for name in other}
    again = ss.sweep(system, {"F": [1.0, 2.0]}, ["high:u[tip]"], initial=other)
    np.testing.assert_allclose(found["high:u[tip]"], again["high:u[tip]"], rtol=1e-9)
    with pytest.raises(ss.DeclarationError, match=r"u\[9\].*no such degree of freedom"):
        ss.sweep(system, {"F": [1.0, 2.0]}, ["period"], initial={"u[9]": 1.0})
    with pytest.raises(ss.DeclarationError, match="u_mode_1: it already varies along an axis"):
        ss.sweep(system, {"u_mode_1": [1.0, 2.0]}, ["period"], initial={"u[1]": 1.0})


def test_a_ring_down_names_the_force_that_drives() -> None:
    system = small(forces={"u[tip]": "2*cos(t)"})
    with pytest.raises(ss.DeclarationError, match=r"the force on u\[tip\], 2\*cos\(t\)"):
        ss.ring_down(system, (0.0, 5.0), initial={"u[tip]": 1.0})


def test_basins_over_modes() -> None:
    """Units of amplitudes follow from that of the energy, and may be missing."""
    system = small(
        contacts={"foot": ss.Contact("d_u[tip]", 0.1)},
        forces={"u[tip]": "cos(t)"},
        viscous="d_u[0]**2/10",
        span=(0.0, 20.0),
    )
    found = ss.basin(system, {"u_mode_1": [-0.1, 0.1], "d_u_mode_1": [-0.1, 0.1]})
    assert found.dataset["low_u_mode_1"].attrs["units"] == "1"
    assert found.dataset["period"].attrs["units"] == "1"


def test_other_things_are_no_structures() -> None:
    with pytest.raises(ss.DeclarationError, match=r"structures.u: expected a structure, got a num"):
        ss.System("s", structures={"u": 3.0})  # type: ignore[dict-item]
    with pytest.raises(ss.DeclarationError, match=r"structures.'u v': 'u v' is not a name"):
        ss.System("s", structures={"u v": ss.Structure([[1.0]], [[1.0]])})


def test_starts_at_unknowns() -> None:
    system = small(initial={"u[0]": 0.5, "d_u[tip]": 0.25}, span=(0.0, 1.0))
    motion = ss.simulate(system)
    assert float(motion["u[0]"][0]) == pytest.approx(0.5, abs=1e-15)
    assert float(motion["d_u[2]"][0]) == pytest.approx(0.25, abs=1e-15)
    other = ss.simulate(system, initial={"u[2]": -1.0, "d_u[2]": 0.0})
    values = [float(other[name][0]) for name in ("u[0]", "u[1]", "u[tip]", "d_u[tip]")]
    np.testing.assert_allclose(values, [0.5, 0.0, -1.0, 0.0], atol=1e-15)
    again = ss.simulate(system, (1.0, 2.0), initial=motion.final)
    assert float(again["u[1]"][0]) == pytest.approx(float(motion["u[1]"][-1]), abs=1e-15)
    mass, stiffness = chain(3)
    reduced = ss.Structure(mass, stiffness, names={"tip": 2}).reduced(["tip"], 1)
    held = ss.System("s", structures={"u": reduced})
    with pytest.raises(ss.DeclarationError, match="not a coordinate of the reduced structure"):
        ss.simulate(held, (0.0, 1.0), initial={"u[0]": 1.0})


def test_formulas_of_results_name_unknowns() -> None:
    system = small(initial={"u[tip]": 1.0}, span=(0.0, 5.0))
    assert system.evaluate("2*u[tip] - u[1]", {"u[tip]": 3.0, "u[1]": 1.0}) == pytest.approx(5.0)
    motion = ss.simulate(system)
    slopes = motion.sensitivity(["u_mode_1"], [0.0], of=["u[tip] - u[0]"])
    row = {name: system.unknown(name)["u_mode_1"] for name in ("u[tip]", "u[0]")}
    assert float(slopes["u[tip] - u[0]"].squeeze()) == pytest.approx(row["u[tip]"] - row["u[0]"])
    with pytest.raises(ss.DeclarationError, match=r"unknown quantity 'u\[9\]'"):
        _ = motion["u[9]"]
    assert {"u[tip]", "d_u[tip]"} <= set(motion.dataset.data_vars)
    motion.plot("u[0]", "d_u[tip]")
    shown = str(system.equations())
    assert "u_mode,1" in shown


def test_equations_say_what_unknowns_are() -> None:
    system = small(potential="u[tip]**4/4", forces={"u[0]": "cos(t)"})
    text = str(system.equations())
    weight = system.unknown("u[tip]")["u_mode_1"]
    assert f"u_tip = {weight:.15g} u_mode,1" in text
    assert f"{weight:.15g} u_tip³" in text
    assert "load_u_0 = cos(t)" in text
    system._repr_html_()
    system.equations(latex=True)
