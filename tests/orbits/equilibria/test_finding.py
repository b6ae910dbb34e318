"""Equilibria, sets of them, and their branches, against closed forms and against the motion."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from flows import flow
from stickslip import (
    Contact,
    Inertial,
    Parameter,
    RateIndependent,
    System,
    Viscous,
    catalogue,
    simulate,
)
from stickslip.errors import ConvergenceError, DeclarationError, StickslipError
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.branches.equilibrium_curves import fold_curve, hopf_curve
from stickslip.orbits.continuation.branch import Branch
from stickslip.orbits.equilibria.equilibrium import Equilibrium, EquilibriumSet
from stickslip.orbits.equilibria.finding import equilibria
from systems import parameters

KINDS = {"inertial": Inertial, "viscous": Viscous, "rate-independent": RateIndependent}


def only(system: System, **values: float) -> Equilibrium:
    (found,) = equilibria(system, parameters=values).isolated
    return found


def only_set(system: System, **values: float) -> EquilibriumSet:
    found = equilibria(system, parameters=values)
    assert not found.isolated
    (one,) = found.sets
    return one


# -- sets in stick ---------------------------------------------------------------------------------


def blocks(kind: str, joint: bool = False) -> System:
    """Two blocks on springs, joined by a spring, with loads; `joint`: with friction between them,
    too."""
    contacts = {"first": Contact("d_x", ("s_1", "r_1")), "second": Contact("d_y", ("s_2", "r_2"))}
    if joint:
        contacts["joint"] = Contact("d_y - d_x", "s_3")
    rates = "d_x**2 + d_y**2"
    return System(
        name=f"{kind} blocks",
        parameters=parameters(
            k=1.0, l=2.0, c=0.5, f=0.3, g=-0.2, s_1=1.0, s_2=0.6, s_3=0.4, r_1=0.7, r_2=0.9
        ),
        coordinates={x: KINDS[kind]() for x in "xy"},
        kinetic=f"({rates})/2" if kind == "inertial" else 0.0,
        viscous=f"({rates})/2" if kind == "viscous" else 0.0,
        potential="k/2*x**2 + l/2*y**2 + c/2*(x - y)**2 - f*x - g*y",
        contacts=contacts,
    )


positive = st.floats(0.1, 3.0)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=15, deadline=None)
@given(k=positive, l=positive, c=positive, f=st.floats(-2, 2), s=st.tuples(*[positive] * 4))
def test_the_extent_of_a_set_in_stick(
    kind: str,
    k: float,
    l: float,  # noqa: E741
    c: float,
    f: float,
    s: tuple,
) -> None:
    # K x = (f, g) + λ with −s⁺ ≤ λ ≤ s⁻, so that x is a linear image of a box.
    names = ("s_1", "r_1", "s_2", "r_2")
    found = only_set(blocks(kind), k=k, l=l, c=c, f=f, **dict(zip(names, s, strict=True)))
    K = np.linalg.inv([[k + c, -c], [-c, l + c]])
    centre = K @ [f, -0.2]
    low = np.array([-s[0], -s[2]])
    high = np.array([s[1], s[3]])
    largest = centre + np.maximum(K * low, K * high).sum(axis=1)
    smallest = centre + np.minimum(K * low, K * high).sum(axis=1)
    assert found.exact
    assert found.dimension == 2
    assert set(found.modes.values()) == {"stick"}
    for i, x in enumerate("xy"):
        assert found.extent[x] == pytest.approx((smallest[i], largest[i]), rel=1e-8, abs=1e-9)
    assert all(low < found.state[x] < high for x, (low, high) in found.extent.items() if x in "xy")


@pytest.mark.parametrize("kind", ["inertial", "viscous"])
def test_more_contacts_than_directions(kind: str) -> None:
    # Three friction forces hold two blocks: x = K⁻¹(load + Jᵀλ).
    found = only_set(blocks(kind, joint=True))
    K = np.linalg.inv([[1.5, -0.5], [-0.5, 2.5]])
    image = K @ np.array([[1.0, 0.0, -1.0], [0.0, 1.0, 1.0]])
    low, high = np.array([-1.0, -0.6, -0.4]), np.array([0.7, 0.9, 0.4])
    centre = K @ [0.3, -0.2]
    assert found.dimension == 2
    for i, x in enumerate("xy"):
        ends = [
            centre[i] + f(image[i] * low, image[i] * high).sum() for f in (np.minimum, np.maximum)
        ]
        assert found.extent[x] == pytest.approx(ends, rel=1e-8)


def test_motion_stays_in_the_set_and_leaves_from_outside() -> None:
    system = blocks("inertial")
    found = only_set(system)
    rest = simulate(system, (0, 20), initial=found.state)
    assert rest.n_switches == 0
    assert rest.final == pytest.approx(found.state, abs=1e-12)
    corner = {x: found.extent[x][1] for x in "xy"}
    assert (
        simulate(system, (0, 20), initial={x: v - 1e-9 for x, v in corner.items()}).n_switches == 0
    )
    beyond = {**corner, "x": corner["x"] + 1e-3}
    assert simulate(system, (0, 20), initial=beyond).final["x"] < beyond["x"] - 1e-5


def test_the_rocking_toy_at_rest() -> None:
    # |(a − c²/b)d ∓ P| ≤ ρ + H_R,L(ψ) with ψ = cd/b and H_R = H*(ψ + ψ*)/(2ψ*) inside |ψ| ≤ ψ*.
    found = only_set(catalogue.rocking_toy())
    a = 1.0
    b = 1.0
    c = 0.3
    rho = 0.2
    H_star = 3.0
    P = 1.0
    d = (rho + H_star / 2 - P) / (a - c**2 / b + H_star * c / (2 * b))
    assert found.extent["psi"] == pytest.approx((-c * d / b, c * d / b), rel=1e-10)
    assert found.extent["x_R"] == (-math.inf, math.inf)
    assert found.dimension == 2
    assert found.stable
    assert found.eigenvalues is not None
    assert len(found.eigenvalues) == 2
    assert found.exact


def test_a_set_with_curved_boundary() -> None:
    # Friction holds a pendulum where |sin ψ| ≤ s: around the bottom and around the top.
    pendulum = System(
        name="pendulum",
        parameters=parameters(s=0.4),
        coordinates={"psi": Inertial()},
        kinetic="d_psi**2/2",
        potential="-cos(psi)",
        contacts={"joint": Contact("d_psi", "s")},
    )
    found = equilibria(pendulum)
    assert found.certificate.ok
    top, bottom = found.sets
    assert all(s.exact and s.dimension == 1 for s in found.sets)
    assert all(s.repeats["psi"] == pytest.approx(2.0 * math.pi) for s in found.sets)
    ends = np.arcsin([-0.4, 0.4])
    assert bottom.extent["psi"] == pytest.approx(ends, abs=1e-11)
    assert top.extent["psi"] == pytest.approx(ends - math.pi, abs=1e-11)
    assert "and every 6.28318531 of psi" in top.describe()
    # In a box, each set is told by itself.
    middles = [np.mean(s.extent["psi"]) for s in equilibria(pendulum, box={"psi": (-4, 7)}).sets]
    assert middles == pytest.approx([-math.pi, 0.0, math.pi, 2.0 * math.pi], abs=1e-11)


def test_a_stuck_slider() -> None:
    found = only_set(catalogue.spring_slider(), V=0.0)
    assert found.extent["U"] == pytest.approx((-1.5, 1.5), abs=1e-7)
    assert found.extent["alpha"] == pytest.approx((1.0, 1.0), abs=1e-7)
    assert found.stable
    assert found.eigenvalues == pytest.approx((-1.0,))


def test_a_part_of_the_system_sticks() -> None:
    # The first block slides on a belt, the second one rests on the ground: K x = (s, λ), |λ| ≤ r.
    system = System(
        name="blocks on a belt and on the ground",
        parameters=parameters(V=0.3, s=1.0, r=0.5),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="x**2/2 + y**2 + (x - y)**2/4",
        contacts={"belt": Contact("d_x", "s", surface_speed="V"), "ground": Contact("d_y", "r")},
    )
    found = only_set(system)
    K = np.linalg.inv([[1.5, -0.5], [-0.5, 2.5]])
    ends = np.array([K @ [1.0, -0.5], K @ [1.0, 0.5]])
    assert found.modes == {"belt": "slip-", "ground": "stick"}
    assert found.dimension == 1
    assert found.exact
    for i, x in enumerate("xy"):
        assert found.extent[x] == pytest.approx(ends[:, i], rel=1e-9)
    assert found.eigenvalues == pytest.approx((1j * math.sqrt(1.5), -1j * math.sqrt(1.5)))


# -- isolated --------------------------------------------------------------------------------------


def test_blocks_on_a_belt() -> None:
    found = only(catalogue.block_chain(4), V=0.2)
    assert set(found.modes.values()) == {"slip-"}
    assert [found.state[f"x_{i}"] for i in range(1, 5)] == pytest.approx([0.6] * 4, rel=1e-13)
    # Undamped: ω² = 1 + 2·0.5·(1 − cos(jπ/4)).
    omega = sorted({round(abs(z), 9) for z in found.eigenvalues})
    assert omega == pytest.approx(
        [math.sqrt(2 - math.cos(j * math.pi / 4)) for j in range(4)], abs=1e-8
    )
    assert found.stable is None


def test_a_belt_in_the_other_direction() -> None:
    assert only(catalogue.belt_block(), V=0.5).modes == {"belt contact": "slip-"}
    assert only(catalogue.spring_slider(), V=-0.4).modes == {"block": "slip+"}


def test_steady_walking_away() -> None:
    # (4.1) with a heavy weight slides without rocking: 2νv = g m_W − 2(ρ + H*/2).
    toy = catalogue.rocking_toy_inertial()
    found = only(toy, m_W=2.0)
    assert found.drift == pytest.approx({"x_R": 1966.0, "x_L": 1966.0}, rel=1e-12)
    assert found.state["d_x_R"] == pytest.approx(1966.0, rel=1e-12)
    assert set(found.modes.values()) == {"slip+"}
    assert found.stable
    assert len(found.eigenvalues) == 5  # six states, one translation


def test_carried_along_by_a_belt() -> None:
    # Nothing but the belt acts on the block: it rides with it, or slips with less friction than is
    # there: not steady.
    block = System(
        name="rider",
        parameters=parameters(V=0.7, s=1.0, f=0.3),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="-f*x",
        contacts={"belt": Contact("d_x", "s", surface_speed="V")},
    )
    found = only(block)
    assert found.modes == {"belt": "stick"}
    assert found.stable
    assert found.drift == pytest.approx({"x": 0.7})
    assert not len(equilibria(block, parameters={"f": 2.0}))


def test_several_equilibria_with_stability() -> None:
    found = equilibria(flow({"x": "v", "v": "-0.2*v + x - x**3"}, {"x": 0.3}))
    assert sorted((round(e.state["x"], 9), e.stable) for e in found.isolated) == [
        (-1, True),
        (0, False),
        (1, True),
    ]
    assert [e.stable for e in found.isolated] == [True, True, False]
    assert found.table["stable"].tolist() == ["yes", "yes", "no"]


@settings(max_examples=12, deadline=None)
@given(
    mu=st.sampled_from(["2/sqrt(alpha)", "2/(1 + alpha)"]),
    nu=st.floats(0.03, 0.3),
    V=st.floats(0.05, 1.0),
)
def test_stability_is_that_of_the_motion(mu: str, nu: float, V: float) -> None:
    system = catalogue.spring_slider(mu=mu)
    (found,) = equilibria(
        system, parameters={"nu": nu, "V": V}, box={"alpha": (1.0, 30.0)}
    ).isolated
    rate = max(z.real for z in found.eigenvalues)
    assume(abs(rate) > 0.1)
    time = 8.0 / abs(rate)
    near = {"U": found.state["U"] + 1e-7, "alpha": found.state["alpha"]}
    values = simulate(system, (0.0, time), initial=near, parameters={"nu": nu, "V": V}).at(
        np.linspace(0.75 * time, time, 200)
    )
    apart = np.max(np.hypot(values["U"] - found.state["U"], values["alpha"] - found.state["alpha"]))
    assert (apart < 1e-7) == bool(found.stable)


def test_an_equilibrium_on_a_kink() -> None:
    found = only(flow({"x": "p - x - 0.5*abs(x)"}, p=0.0))
    assert found.state == pytest.approx({"x": 0.0}, abs=1e-14)
    assert found.boundary == ("x = 0",)
    assert found.stable is None
    assert only(flow({"x": "p - x - 0.5*abs(x)"}, p=0.3)).boundary == ()


def test_none() -> None:
    found = equilibria(flow({"x": "1 + p*x**2"}, p=1.0))
    assert len(found) == 0
    assert found.message.startswith(
        "no equilibrium was found (tried 1 of 1 combinations of modes and regions with 64 starts "
    )
    virtual = equilibria(flow({"x": "1 + abs(x)"}))
    assert "beyond the boundary (x = 0)" in virtual.message


def test_only_inside_the_box() -> None:
    wells = flow({"x": "x - x**3"})
    assert len(equilibria(wells)) == 3
    (one,) = equilibria(wells, box={"x": (0.5, 2.0)})
    assert one.state["x"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("attempt", "message"),
    [
        (lambda: equilibria(catalogue.forced_oscillator()), "depend on time .*'force'.*find_cycle"),
        (lambda: equilibria("spring_slider"), "expected a System"),  # type: ignore[arg-type]
        (lambda: equilibria(catalogue.spring_slider(), parameters={"W": 1.0}), "unknown parameter"),
        (
            lambda: equilibria(catalogue.spring_slider(), box={"u": (0, 1)}),
            "box.u: unknown state",
        ),
        (lambda: equilibria(catalogue.spring_slider(), box={"U": (1, 0)}), "not a range"),
        (lambda: continue_equilibrium(catalogue.spring_slider(), "W", (0, 1)), "unknown parameter"),
        (
            lambda: continue_equilibrium(catalogue.spring_slider(), "nu", (0, 1)),
            "outside the admissible range",
        ),
        (lambda: continue_equilibrium(catalogue.spring_slider(), "V", (1, 0)), "low < high"),
        (
            lambda: continue_equilibrium(catalogue.spring_slider(), "V", 3),  # type: ignore[arg-type]
            "expected a pair of numbers",
        ),
        (
            lambda: continue_equilibrium(catalogue.spring_slider(), "V", (0, 1), start={"x": 1}),
            "not a part of the state",
        ),
        (
            lambda: continue_equilibrium(
                catalogue.spring_slider(),
                "V",
                (0.3, 1.0),
                start=only(catalogue.spring_slider(), V=0.2),
            ),
            "the start is at V = 0.2, outside",
        ),
    ],
)
def test_wrong_arguments(attempt, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        attempt()


def test_nothing_to_start_from() -> None:
    with pytest.raises(ConvergenceError, match="P = 1: only sets of equilibria in stick"):
        continue_equilibrium(catalogue.rocking_toy(), "P", (0.5, 1.5))


# -- branches --------------------------------------------------------------------------------------


def certified(branch) -> None:
    assert branch.points["defect"].values.max() < 1e-12
    assert branch.points["margin"].values.min() > -1e-12


def test_folds() -> None:
    system = flow({"x": "p + x - x**3"}, {"x": 1.0}, p=0.0)
    branch = continue_equilibrium(system, "p", (-1.0, 1.0))
    certified(branch)
    assert [s.kind for s in branch.special] == ["fold", "fold"]
    fold = 2 / math.sqrt(27)
    assert sorted(s.value for s in branch.special) == pytest.approx([-fold, fold], rel=1e-14)
    x = branch.points["x"].values
    assert branch.points["p"].values == pytest.approx(x**3 - x, abs=1e-12)
    inner = np.abs(x) < 1 / math.sqrt(3) - 1e-9
    outer = np.abs(x) > 1 / math.sqrt(3) + 1e-9
    assert set(branch.points["stable"].values[inner]) == {0}
    assert set(branch.points["stable"].values[outer]) == {1}
    for s in branch.special:
        assert branch.points["p"].values[s.index] == s.value


def test_curves_of_folds_meet_in_a_cusp() -> None:
    system = flow({"x": "p + q*x - x**3"}, {"x": 1.0}, p=0.0, q=1.0)
    fold = continue_equilibrium(system, "p", (-1.0, 1.0)).of_kind("fold")[0]
    curve = fold_curve(system, fold, "p", "q", ranges={"p": (-1.0, 1.0), "q": (-1.0, 2.0)})
    p, q = curve.points["p"].values, curve.points["q"].values
    assert p**2 == pytest.approx(4 * q**3 / 27, abs=1e-13)
    (cusp,) = curve.special
    assert cusp.kind == "cusp"
    assert (cusp.parameters["p"], cusp.parameters["q"]) == pytest.approx((0.0, 0.0), abs=1e-8)
    assert (
        curve.ended
        == "first point: p = -1, the end of the range; last point: p = 1, the end of the range"
    )
    (axes,) = curve.plot().axes
    drawn = np.concatenate(
        [xy for line in axes.get_lines() if len(xy := np.asarray(line.get_xydata())) > 1]
    )
    assert drawn[:, 0] ** 2 == pytest.approx(4 * drawn[:, 1] ** 3 / 27, abs=1e-12)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$p$", "$q$")


def test_bogdanov_takens() -> None:
    # x' = y, y' = b₁ + b₂x + x² + xy: folds at b₁ = b₂²/4, Hopf points at b₁ = 0, b₂ < 0 with l₁ >
    # 0.
    system = flow({"x": "y", "y": "b_1 + b_2*x + x**2 + x*y"}, b_1=-0.1, b_2=-0.2)
    branch = continue_equilibrium(system, "b_1", (-1.0, 1.0))
    certified(branch)
    (hopf,), (fold,) = branch.of_kind("Hopf"), branch.of_kind("fold")
    assert hopf.value == pytest.approx(0.0, abs=1e-14)
    assert hopf.data["frequency"] == pytest.approx(math.sqrt(0.2), rel=1e-12)
    assert hopf.note == "subcritical"
    assert fold.value == pytest.approx(0.01, rel=1e-13)
    ranges = {"b_1": (-1.0, 1.0), "b_2": (-1.0, 1.0)}
    folds = fold_curve(system, fold, "b_1", "b_2", ranges=ranges)
    assert folds.points["b_1"].values == pytest.approx(
        folds.points["b_2"].values ** 2 / 4, abs=1e-12
    )
    (organising,) = folds.special
    assert organising.kind == "Bogdanov-Takens"
    assert (organising.parameters["b_1"], organising.parameters["b_2"]) == pytest.approx(
        (0, 0), abs=1e-8
    )
    hopfs = hopf_curve(system, hopf, "b_1", "b_2", ranges=ranges)
    assert hopfs.points["b_1"].values == pytest.approx(0.0, abs=1e-12)
    assert hopfs.points["frequency"].values ** 2 == pytest.approx(
        -hopfs.points["b_2"].values, abs=1e-10
    )
    assert "the frequency vanishes" in hopfs.ended
    assert [s.kind for s in hopfs.special] == ["Bogdanov-Takens"]


def test_bautin() -> None:
    # l₁ = 2b on the line of Hopf points a = 0.
    laws = {
        "x": "a*x - y + b*x*(x**2 + y**2) - x*(x**2 + y**2)**2",
        "y": "x + a*y + b*y*(x**2 + y**2) - y*(x**2 + y**2)**2",
    }
    system = flow(laws, a=-0.5, b=-0.4)
    (hopf,) = continue_equilibrium(system, "a", (-1.0, 1.0), start={"x": 0.0, "y": 0.0}).of_kind(
        "Hopf"
    )
    curve = hopf_curve(system, hopf, "a", "b", ranges={"a": (-1.0, 1.0), "b": (-1.0, 1.0)})
    assert curve.points["lyapunov"].values == pytest.approx(2 * curve.points["b"].values, abs=1e-12)
    (bautin,) = curve.special
    assert bautin.kind == "Bautin"
    assert bautin.parameters["b"] == pytest.approx(0.0, abs=1e-12)


def test_hopf_points_of_the_slider_in_two_parameters() -> None:
    system = catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)
    (hopf,) = continue_equilibrium(system, "V", (0.02, 0.5)).of_kind("Hopf")
    curve = hopf_curve(system, hopf, "V", "nu", ranges={"V": (0.02, 0.5), "nu": (0.005, 0.3)})
    assert curve.ended.count("the end of the range") == 2
    V, nu, U, alpha = (curve.points[name].values for name in ("V", "nu", "U", "alpha"))
    slope = -(alpha**-1.5)
    trace = -1 - (1 + U * slope) / nu
    assert trace == pytest.approx(0.0, abs=1e-8)
    assert pytest.approx(U, rel=1e-12) == 2 / np.sqrt(alpha) + nu * V
    assert alpha == pytest.approx(1 + V * U, rel=1e-12)
    assert curve.points["frequency"].values == pytest.approx(
        np.sqrt((1 - V * slope) / nu), rel=1e-9
    )
    near = np.argmin(np.abs(nu - 0.05))
    assert V[near] == pytest.approx(hopf.value, abs=0.02)


@pytest.mark.parametrize("start", [{"x": 0.0}, {"x": 0.7}])
def test_a_branch_point(start: dict[str, float]) -> None:
    system = flow({"x": "p*x - x**3"}, p=0.5)
    branch = continue_equilibrium(system, "p", (-1.0, 1.0), start=start)
    (crossing,) = branch.special
    assert crossing.kind == "branch point"
    assert crossing.value == pytest.approx(0.0, abs=1e-12)
    assert crossing.state["x"] == pytest.approx(0.0, abs=1e-12)
    x, p = branch.points["x"].values, branch.points["p"].values
    assert (x if start["x"] == 0.0 else p - x**2) == pytest.approx(0.0, abs=1e-9)


def test_a_branch_goes_on_across_a_kink() -> None:
    branch = continue_equilibrium(flow({"x": "p - x - 0.5*abs(x)"}, p=0.5), "p", (-1.0, 1.0))
    certified(branch)
    (boundary,) = branch.special
    assert boundary.kind == "boundary equilibrium"
    assert boundary.value == pytest.approx(0.0, abs=1e-14)
    assert boundary.note == "x = 0; the branch continues"
    p, x = branch.points["p"].values, branch.points["x"].values
    assert x == pytest.approx(np.where(p > 0, p / 1.5, p / 0.5), abs=1e-12)
    assert np.all(np.diff(p) > 0)


def test_a_branch_turns_at_a_kink() -> None:
    branch = continue_equilibrium(flow({"x": "p - abs(x)"}, {"x": 0.3}, p=0.5), "p", (-1.0, 1.0))
    certified(branch)
    (boundary,) = branch.special
    assert boundary.note == "x = 0; the branch turns back"
    x = branch.points["x"].values
    assert branch.points["p"].values == pytest.approx(np.abs(x), abs=1e-12)
    assert (x.min(), x.max()) == pytest.approx((-1.0, 1.0))


def test_a_branch_ends_on_a_boundary() -> None:
    # Where x falls below 0 the field is that of another equilibrium far away.
    system = flow({"x": "piecewise(x > 0, p - x, p - 5 - x)"}, {"x": 0.3}, p=0.5)
    branch = continue_equilibrium(system, "p", (-1.0, 1.0))
    (boundary,) = branch.special
    assert boundary.note == "x = 0; no equilibrium continues from there"
    assert branch.ended.startswith("first point: boundary equilibrium at p = ")
    assert branch.ended.endswith("x = 0; last point: p = 1, the end of the range")


def test_from_slip_through_stick_to_slip() -> None:
    # The friction force passes from μ to −μ while the belt stands still.
    branch = continue_equilibrium(catalogue.spring_slider(mu="1.5", nu=0.1), "V", (-0.3, 0.3))
    certified(branch)
    assert [s.kind for s in branch.special] == ["boundary equilibrium"] * 2
    modes, V, U = (branch.points[name].values for name in ("mode_block", "V", "U"))
    assert list(dict.fromkeys(modes.tolist())) == [1, 0, -1]
    assert V[modes == 0] == pytest.approx(0.0, abs=1e-12)
    assert (U[modes == 0].min(), U[modes == 0].max()) == pytest.approx((-1.5, 1.5), abs=0.05)
    assert np.all(V[modes == -1] > -1e-12)


def test_relative_equilibria_are_followed() -> None:
    toy = catalogue.rocking_toy_inertial()
    branch = continue_equilibrium(toy, "m_W", (0.5, 3.0), start=only(toy, m_W=2.0))
    certified(branch)
    m_W = branch.points["m_W"].values
    assert branch.points["drift_x_R"].values == pytest.approx(
        (100 * m_W / 2 - 1.7) / 0.05, rel=1e-11
    )


def test_files(tmp_path) -> None:
    branch = continue_equilibrium(
        catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05), "V", (0.02, 0.5)
    )
    branch.save(tmp_path / "branch.nc")
    again = Branch.open(tmp_path / "branch.nc")
    assert again.points.equals(branch.points)
    assert (again.special, again.ended, again.parameter) == (
        branch.special,
        branch.ended,
        branch.parameter,
    )
    assert (again.system, again.parameters) == (branch.system, branch.parameters)
    branch.table.to_csv(tmp_path / "branch.csv", index=False)
    header, *rows = (tmp_path / "branch.csv").read_text().splitlines()
    assert len(rows) == branch.points.sizes["point"]
    assert {"V", "U", "alpha", "eigenvalue_real_1", "stable", "mode_block"} <= set(
        header.split(",")
    )
    assert "Hopf at V = 0.224849301296, frequency = " in branch.message
    (tmp_path / "no.nc").write_text("nothing")
    for name in ("no.nc", "missing.nc"):
        with pytest.raises(StickslipError, match=name):
            Branch.open(tmp_path / name)
    with pytest.raises(StickslipError, match="cannot be written"):
        branch.save(tmp_path / "no folder" / "branch.nc")


def test_parameters_have_units_of_their_own() -> None:
    # The same slider in units a million times smaller has the same Hopf point.
    system = catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)
    scaled = replace(
        system,
        parameters={**system.parameters, "V": Parameter(0.18e6), "micro": Parameter(1e-6)},
        drives={"ell": "V*t", "shear": "micro*V"},
        facts={},
    )
    (hopf,) = continue_equilibrium(scaled, "V", (0.02e6, 0.5e6)).of_kind("Hopf")
    assert hopf.value == pytest.approx(0.224849301296112e6, rel=1e-12)


@pytest.mark.parametrize("kind", ["fold", "Hopf"])
def test_curves_need_their_point(kind: str) -> None:
    system = catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)
    (hopf,) = continue_equilibrium(system, "V", (0.02, 0.5)).of_kind("Hopf")
    ranges = {"V": (0.02, 0.5), "nu": (0.005, 0.3)}
    if kind == "fold":
        with pytest.raises(DeclarationError, match="special point of kind 'Hopf'"):
            fold_curve(system, hopf, "V", "nu", ranges=ranges)
        return
    for names, given_ranges, message in (
        (("V", "V"), ranges, "are the same"),
        (("V", "W"), {**ranges, "W": (0, 1)}, "unknown parameter"),
        (("V", "nu"), {"V": (0.02, 0.5)}, r"ranges\.nu: the range is missing"),
        (("V", "nu"), {**ranges, "V": (0.3, 0.5)}, r"the point lies at V = 0\.2248"),
    ):
        with pytest.raises(DeclarationError, match=message):
            hopf_curve(system, hopf, *names, ranges=given_ranges)


def test_more_regions_than_can_be_tried() -> None:
    # A contraction, so that its zero is the limit of x ← 1 + 0.3|x_{i+1} − i|; 2¹⁴ regions.
    laws = {f"x{i}": f"1 - x{i} + 0.3*abs(x{(i + 1) % 14} - {i})" for i in range(14)}
    x = np.zeros(14)
    for _ in range(100):
        x = 1 + 0.3 * np.abs(np.roll(x, -1) - np.arange(14))
    found = only(flow(laws))
    assert list(found.state.values()) == pytest.approx(x.tolist(), rel=1e-12)
    assert found.stable


def test_what_a_prompt_shows_is_short() -> None:
    found = equilibria(catalogue.rocking_toy())
    assert repr(found) == "<Equilibria: isolated 0, sets 1>"
    shown = repr(found[0])
    assert shown.startswith(
        "<EquilibriumSet of dimension 2, right leg: stick, left leg: stick: -0.15441"
    )
    assert shown.endswith("d_psi = 0, any x_R, any x_L>")
