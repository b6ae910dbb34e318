"""Evolutions as data, the solver function, its result, and everything that can go wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import skfem
from scipy import sparse
from skfem.models.poisson import laplace

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, StickslipError
from stickslip.rate_independent.dissipation import (
    Ellipsoid,
    GroupNorm,
    Polytope,
    Product,
    WeightedL1,
)
from stickslip.rate_independent.evolution import evolve as evolve_module
from stickslip.rate_independent.evolution.evolution import Evolution
from stickslip.rate_independent.evolution.evolve import evolve
from stickslip.rate_independent.evolution.history import History
from stickslip.rate_independent.evolution.outcome import EvolutionOutcome
from stickslip.rate_independent.sets.stable_sets import Boxes
from stickslip.rate_independent.solvers.choose import choose_solver
from stickslip.rate_independent.solvers.dense import BoxSteps

STIFF = np.array([[2.0, 0.5, 0.0], [0.5, 1.5, -0.3], [0.0, -0.3, 1.0]])
LOADS = ["3*sin(2*t)", "2*t", "-2*sin(3*t)"]


def three(**given) -> Evolution:
    """Three coupled components whose thresholds oscillate out of phase."""
    weights = [f"1 + cos(2*pi*(s + {k}/3))/2" for k in range(3)]
    arguments = {
        "A": STIFF,
        "load": LOADS,
        "dissipation": WeightedL1(weights),
        "initial": np.zeros(3),
    }
    return Evolution(**{**arguments, "epsilon": 0.5, "span": (0, 3), **given})


# --- What is refused ------------------------------------------------------------------------------

asymmetric = STIFF + np.array([[0, 0, 0.25], [0, 0, 0], [0, 0, 0]])
laplacian = sparse.diags_array(
    [-np.ones(29_999), 2.0 * np.ones(30_000), -np.ones(29_999)],
    offsets=[-1, 0, 1],  # pyright: ignore[reportArgumentType]
)
free = sparse.csr_array(laplacian.copy())
free[0, 0] = free[-1, -1] = 1.0
disc = skfem.MeshTri.init_circle(3)
nowhere_held = sparse.csr_array(laplace.assemble(skfem.Basis(disc, skfem.ElementTriP1())))
table = np.zeros((4, 3))
table[2, 1] = np.nan


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"A": asymmetric}, ["A[0, 2]", "0.25", "symmetric"]),
        ({"A": sparse.csr_array(asymmetric)}, ["A[0, 2]", "0.25", "symmetric"]),
        ({"A": STIFF[:2]}, ["A", "(2, 3)", "square"]),
        ({"A": np.diag([1.0, -1.0, 1.0])}, ["A[1, 1] = -1", "positive definite"]),
        ({"A": np.ones((3, 3))}, ["positive definite", "eigenvalue"]),
        ({"A": sparse.csr_array(np.ones((3, 3)))}, ["positive definite", "pivot"]),
        ({"A": nowhere_held}, ["positive definite", "translation"]),
        (
            {"A": sparse.csr_array(np.array([[1, 2, 0], [2, 1, 0], [0, 0, 1.0]]))},
            ["positive definite", "factorisation is -3"],
        ),
        ({"A": free}, ["positive definite", "translation"]),
        (
            {"A": sparse.csr_array(laplacian - 0.5 * sparse.eye_array(30_000))},
            ["positive definite", "energy"],
        ),
        ({"A": [[1.0, "x"], [0.0, 1.0]]}, ["A", "numbers"]),
        ({"A": np.diag([1.0, np.nan, 1.0])}, ["A", "finite"]),
        ({"load": LOADS[:2]}, ["load", "(2,)", "(3,) is needed"]),
        ({"load": ["t", "t", "u"]}, ["load[2]", "unknown name 'u'"]),
        ({"load": lambda t: np.zeros(4)}, ["load", "(4,) at t = 0", "(3,) is needed"]),
        (
            {"load": lambda t: np.array([0.0, np.inf if t == 1.5 else 0.0, 0.0])},
            ["load[1]", "inf at t = 1.5"],
        ),
        ({"load": (np.arange(4.0), table)}, ["load[1]", "nan at t = 2"]),
        ({"load": (np.arange(4.0), np.zeros((4, 2)))}, ["load", "(4, 2)", "(4, 3) is needed"]),
        ({"load": (np.array([0.0, 2.0, 1.0, 3.0]), np.zeros((4, 3)))}, ["load", "increase"]),
        ({"load": (np.array([0.0, 2.0]), np.zeros((2, 3)))}, ["span", "0 <= t <= 2"]),
        ({"load": 5.0}, ["load", "()", "(3,) is needed"]),
        ({"load": None}, ["load", "NoneType", "a formula"]),
        ({"initial": [0.0, 0.0]}, ["initial", "(2,)", "3 rows"]),
        ({"initial": [0.0, np.nan, 0.0]}, ["initial[1]", "nan"]),
        ({"initial": [0.0, 0.0, 2.0]}, ["initial", "by 1.25", "component 2", "-2", "settled"]),
        ({"dissipation": WeightedL1([1.0, 1.0])}, ["dissipation", "2 components", "3 rows"]),
        ({"dissipation": "1"}, ["dissipation", "str"]),
        ({"epsilon": 0.0}, ["epsilon", "0.0"]),
        ({"span": (1, 1)}, ["span", "(1, 1)"]),
    ],
)
def test_bad_problems_are_refused(given: dict, words: list[str]) -> None:
    if "A" in given and sparse.issparse(given["A"]) and given["A"].shape[0] > 3:
        n = given["A"].shape[0]
        given |= {
            "dissipation": WeightedL1(np.ones(n)),
            "initial": np.zeros(n),
            "load": lambda t: np.zeros(n),
        }
    with pytest.raises(DeclarationError) as caught:
        three(**given)
    for word in words:
        assert word in str(caught.value)


def test_negative_weights_and_sets_without_zero_are_refused() -> None:
    with pytest.raises(DeclarationError, match="negative"):
        three(dissipation=WeightedL1(["cos(2*pi*s)", "1", "1"]))
    with pytest.raises(DeclarationError, match=r"0|origin"):
        three(dissipation=Polytope(vertices=np.eye(3) + 1.0))


@pytest.mark.parametrize(
    ("times", "given", "words"),
    [
        ((0.5, 3.0), {}, ["times", "0.5", "is given at 0"]),
        ((0.0, 1.0, 0.5), {}, ["times", "do not increase"]),
        ("soon", {}, ["times", "do not increase"]),
        ((0.0, 1.0, 2.0), {"steps": 4}, ["steps"]),
        (None, {"steps": 0}, ["steps", "0"]),
        (None, {"tolerance": 0.0}, ["tolerance", "0.0"]),
        (None, {"kkt": float("nan")}, ["kkt", "nan"]),
        (None, {"output": 0}, ["output", "0"]),
        (None, {"output": [0.0, 4.0]}, ["output", "0 to 3"]),
        (None, {"solver": "magic"}, ["solver", "'magic'", "dense"]),
        (
            None,
            {"observables": {"energy": lambda t, z: 0.0}},
            ["observables.energy", "already used"],
        ),
    ],
)
def test_bad_arguments_are_refused(times, given: dict, words: list[str]) -> None:
    with pytest.raises(DeclarationError) as caught:
        evolve(three(), times, **given)
    for word in words:
        assert word in str(caught.value)


# --- The start ------------------------------------------------------------------------------------


def test_settled_takes_the_nearest_stable_state_in_the_energy_norm() -> None:
    """The nearest point, by its variational inequality ⟨A(z₀ − z*), z − z*⟩ ≤ 0 for every stable
    z."""
    z0 = np.array([1.0, -3.0, 2.0])
    problem = Evolution.settled(STIFF, LOADS, WeightedL1([1.0, 0.5, 2.0]), z0, span=(0, 1))
    rng = np.random.default_rng(0)
    forces = rng.uniform(-1.0, 1.0, (500, 3)) * [1.0, 0.5, 2.0]
    stable = np.linalg.solve(STIFF, (problem.ell.over(np.zeros(1))[0] - forces).T).T
    assert np.max((stable - problem.initial) @ STIFF @ (z0 - problem.initial)) <= 1e-12
    inside = Evolution.settled(
        STIFF, LOADS, WeightedL1(9 * np.ones(3)), [0.1, 0.2, 0.3], span=(0, 1)
    )
    np.testing.assert_array_equal(inside.initial, [0.1, 0.2, 0.3])


def test_settled_with_many_components() -> None:
    n = 2000
    A = sparse.diags_array(
        [-np.ones(n - 1), 2.1 * np.ones(n), -np.ones(n - 1)],
        offsets=[-1, 0, 1],  # pyright: ignore[reportArgumentType]
    )
    start = np.sin(np.arange(n) / 50.0) * 30.0
    problem = Evolution.settled(A, lambda t: np.full(n, 0.2), WeightedL1(np.full(n, 0.1)), start)
    force = problem.force(0.0, problem.initial)
    assert np.abs(force).max() <= 0.1 * (1 + 1e-8)
    # It moved where, and only where, the force was on its bound afterwards.
    moved = problem.initial - start
    assert np.all(np.abs(force[moved > 0] - 0.1) < 1e-8) and np.all(
        np.abs(force[moved < 0] + 0.1) < 1e-8
    )
    assert 0 < np.count_nonzero(moved) < n


def test_load_kinds_agree() -> None:
    knots = np.linspace(0.0, 3.0, 13)
    values = np.column_stack([np.sin(knots), knots, -np.cos(knots) + 1.0])
    by_table = three(load=(knots, values))
    by_call = three(load=lambda t: np.array([np.interp(t, knots, values[:, i]) for i in range(3)]))
    assert by_table.span == (0.0, 3.0)
    one, other = evolve(by_table, steps=300), evolve(by_call, steps=300)
    np.testing.assert_allclose(one.z, other.z, rtol=0, atol=1e-12)
    # adaptive steps end at the knots
    assert set(knots) <= set(evolve(by_table, tolerance=1e-2).times)


# --- Times and output -----------------------------------------------------------------------------


def test_times_and_output() -> None:
    problem = three()
    times = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, 3, 151)[1:]])
    given = evolve(problem, times)
    np.testing.assert_array_equal(given.times, times)
    np.testing.assert_array_equal(given.dataset["step_time"], times)
    assert given.steps == 199

    asked = [0.0, 0.3, 1.0 + 1e-15, 3.0]
    chosen = evolve(problem, times, output=asked)
    np.testing.assert_allclose(chosen.times, asked, rtol=0, atol=1e-14)
    assert chosen.steps == 200  # 0.3 was not among the times, 1 was
    assert np.abs(chosen.z[-1] - given.z[-1]).max() < 1e-3
    np.testing.assert_array_equal(chosen.final, chosen.z[-1])

    strided = evolve(problem, times, output=40)
    np.testing.assert_array_equal(strided.times, times[::40])
    np.testing.assert_array_equal(strided.z, given.z[::40])
    np.testing.assert_array_equal(strided.final, given.final)

    uniform = evolve(
        problem,
        (0, 3),
        steps=30,
        observables={"spread": lambda t, z: np.ptp(z), "twice": lambda t, z: 2 * z},
    )
    np.testing.assert_allclose(uniform.times, np.linspace(0, 3, 31), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(uniform.dataset["spread"], np.ptp(uniform.z, axis=1))
    np.testing.assert_array_equal(uniform.dataset["twice"], 2 * uniform.z)


def test_memory_bounds_what_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = evolve(three(), steps=5000)
    monkeypatch.setattr(evolve_module, "KEPT", 3000)
    thinned = evolve(three(), steps=5000)
    assert thinned.z.size <= 3000 and thinned.steps == 5000
    np.testing.assert_array_equal(thinned.times, whole.times[:: thinned.dataset.attrs["stride"]])
    np.testing.assert_array_equal(thinned.z, whole.z[:: thinned.dataset.attrs["stride"]])
    np.testing.assert_array_equal(thinned.final, whole.final)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-3])
def test_adaptive_steps_resolve_the_phase_as_the_tolerance_asks(tolerance: float) -> None:
    history = evolve(three(), tolerance=tolerance)
    assert history.certificate.ok, history.certificate.verdict
    assert history.certificate["length of a step in periods"].value <= 1 / 8
    shorter = evolve(three(), tolerance=tolerance / 10)
    assert shorter.steps > history.steps
    fine = evolve(three(), steps=60_000, output=history.times).z
    assert np.abs(history.z - fine).max() < tolerance


# --- The certificate ------------------------------------------------------------------------------


def test_columns_are_what_they_say() -> None:
    """Energy, increments and the two-sided estimate, from the states alone."""
    problem = three()
    history = evolve(problem, steps=400)
    t = history.times
    z = history.z
    data = history.dataset
    load = problem.ell.over(t)
    energy = 0.5 * np.einsum("ki,ij,kj->k", z, STIFF, z) - np.sum(load * z, axis=1)
    np.testing.assert_allclose(data["energy"], energy, rtol=0, atol=1e-12)
    d = np.diff(z, axis=0)
    half = 0.5 * np.einsum("ki,ij,kj->k", d, STIFF, d)
    np.testing.assert_allclose(data["increment"][1:], half, rtol=0, atol=1e-13)
    psi = problem.dissipation
    after = [psi.value(s, v) for s, v in zip(t[1:] / 0.5, d, strict=True)]
    before = [psi.value(s, v) for s, v in zip(t[:-1] / 0.5, d, strict=True)]
    change = np.diff(energy)
    upper = change + after + np.sum(np.diff(load, axis=0) * z[:-1], axis=1)
    np.testing.assert_allclose(upper, -half, rtol=0, atol=1e-12)
    lower = change + before + np.sum(np.diff(load, axis=0) * z[1:], axis=1)
    np.testing.assert_allclose(lower, half + data["gap"][1:], rtol=0, atol=1e-12)
    assert np.all(lower > -1e-12)
    balance = data["energy"] - data["energy"][0] + data["dissipated"] - data["work"]
    np.testing.assert_allclose(balance, np.cumsum(data["defect"]), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(data["slipping"][1:], np.count_nonzero(d, axis=1))
    certificate = history.certificate
    assert certificate["energy balance from below"].value == pytest.approx(
        half.sum() / history.energy_scale
    )
    assert certificate["energy balance from above"].value == pytest.approx(
        lower.sum() / history.energy_scale
    )
    assert certificate.to_dict()["verdict"] == certificate.verdict


def test_the_certificate_refuses_what_is_not_resolved() -> None:
    coarse = evolve(three(), steps=6).certificate  # one step per period sees no oscillation at all
    assert coarse["length of a step in periods"].value == pytest.approx(1.0)
    assert coarse["stability"].value < 1e-12 and not coarse.ok
    assert "length of a step" in coarse.verdict
    rough = evolve(three(), steps=60).certificate
    assert not rough.ok and "energy balance" in rough.verdict and "between steps" in rough.verdict


class Lazy:
    """A solver that does not move."""

    block = 16

    def advance(self, z: Array, loads: Array, sets) -> tuple[Array, Array]:
        return np.tile(z, (len(loads), 1)), np.zeros(len(loads))


def test_no_solver_is_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evolve_module, "choose_solver", lambda *_: Lazy())
    history = evolve(three(), steps=300)
    assert history.outcome is EvolutionOutcome.NOT_CONVERGED
    # The last state that was kept is stable, the next one would not have been.
    problem = three()
    t = float(history.dataset["step_time"][-1])
    assert problem.dissipation.contains(problem.force(t, history.final), t / 0.5)
    assert not problem.dissipation.contains(
        problem.force(t + 0.01, history.final), (t + 0.01) / 0.5
    )


@pytest.mark.parametrize("steps", [10, 40, 160, 640])
def test_the_error_estimate_is_a_bound(steps: int) -> None:
    """Thresholds and loads affine within the steps: nothing overshoots, and √(2 Σ defect) bounds
    the error."""
    knots = np.linspace(0.0, 2.0, 11)
    rng = np.random.default_rng(3)
    values = np.cumsum(rng.normal(size=(11, 3)), axis=0)
    values -= values[0]
    problem = Evolution(STIFF, (knots, values), WeightedL1([0.5, 1.0, 0.7]), np.zeros(3))
    exact = evolve(problem, steps=40_960)
    history = evolve(problem, steps=steps)
    # Between the steps, where z is affine; at their ends these states are exact.
    error = (
        np.column_stack([np.interp(exact.times, history.times, z) for z in history.z.T]) - exact.z
    )
    in_energy = np.sqrt(np.einsum("ki,ij,kj->k", error, STIFF, error)).max()
    assert history.certificate["stability between steps"].value < 1e-12
    assert 1e-4 < in_energy <= history.certificate["error of z"].value


# --- How it can end -------------------------------------------------------------------------------


def test_interrupted_and_continued() -> None:
    def stop(fraction: float) -> None:
        if fraction > 0.4:
            raise KeyboardInterrupt

    problem = three()
    times = np.linspace(0, 3, 20_001)
    whole = evolve(problem, times, observables={"first": lambda t, z: z[0]})
    part = evolve(problem, times, observables={"first": lambda t, z: z[0]}, progress=stop)
    assert part.outcome is EvolutionOutcome.INTERRUPTED and "start=result" in part.message
    assert 0 < part.steps < 20_000
    rest = evolve(problem, times, observables={"first": lambda t, z: z[0]}, start=part)
    assert rest.outcome.ok and rest.wall_time > part.wall_time
    np.testing.assert_allclose(rest.z, whole.z, rtol=0, atol=1e-12)
    for name in ("step_time", "dissipated", "work", "first"):
        np.testing.assert_allclose(rest.dataset[name], whole.dataset[name], rtol=0, atol=1e-11)
    longer = evolve(problem, (0, 4), tolerance=1e-2, start=rest)
    assert longer.times[-1] == 4.0 and longer.steps > rest.steps
    assert evolve(problem, times, start=rest).steps == rest.steps  # nothing is left to do


def test_only_its_own_result_is_continued() -> None:
    part = evolve(three(), (0, 1), steps=50)
    for other, words in (
        (three(epsilon=0.4), "epsilon"),
        (three(A=STIFF + np.eye(3)), "energy"),
        (Evolution([[1.0]], "t", WeightedL1([1.0]), [0.0]), "3 components"),
    ):
        with pytest.raises(DeclarationError, match=words):
            evolve(other, start=part)
    with pytest.raises(DeclarationError, match=r"observables\.first"):
        evolve(three(), start=part, observables={"first": lambda t, z: z[0]})


def test_undefined_loads_and_thresholds_stop_it() -> None:
    late = three(load=lambda t: np.full(3, np.nan if 1.8 < t < 2.0 else t))
    history = evolve(late, steps=300)
    assert history.outcome is EvolutionOutcome.UNDEFINED
    assert float(history.dataset["step_time"][-1]) == pytest.approx(1.8)
    assert "nan" in history.message and "load[0]" in history.message
    # A threshold that is negative in a gap of the phases at which declarations are looked at.
    narrow = WeightedL1(["1 - 2*exp(-((s - 0.3)/0.005)**2)", "1", "1"])
    stopped = evolve(three(dissipation=narrow), steps=3000)
    assert stopped.outcome is EvolutionOutcome.UNDEFINED and "negative" in stopped.message
    assert float(stopped.dataset["step_time"][-1]) == pytest.approx(0.15, abs=0.01)


def test_a_jump_of_the_load_is_named() -> None:
    jump = three(load=["piecewise(t < 1.1, 0, 5)", "0", "0"])
    history = evolve(jump)
    assert history.outcome is EvolutionOutcome.JUMP and "1.1" in history.message
    assert float(history.dataset["step_time"][-1]) == pytest.approx(1.1, abs=1e-9)
    assert evolve(jump, steps=300).outcome.ok  # with given times, it is a step like others


def test_a_tolerance_below_rounding_is_not_reached() -> None:
    history = evolve(three(), steps=300, kkt=1e-25)
    assert history.outcome is EvolutionOutcome.NOT_CONVERGED and "KKT residual" in history.message


def test_nothing_is_said_without_a_terminal(capsys: pytest.CaptureFixture) -> None:
    evolve(three(), steps=300)
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


def test_a_person_at_a_terminal_sees_a_bar(
    capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    evolve(three(), steps=300)
    captured = capsys.readouterr()
    assert captured.out == "" and "evolving" in captured.err
    fractions: list[float] = []
    evolve(three(), steps=20_000, progress=fractions.append)
    assert len(fractions) > 3 and np.all(np.diff(fractions) > 0.0) and fractions[-1] == 1.0


def test_outcomes_have_numbers() -> None:
    for outcome in EvolutionOutcome:
        assert EvolutionOutcome.from_code(outcome.code) is outcome and outcome.message
    with pytest.raises(ValueError, match="99"):
        EvolutionOutcome.from_code(99)


# --- Every kind of potential, and which solver takes it -------------------------------------------

KINDS = {
    "boxes": WeightedL1([1.0, 0.5, 2.0, 1.0], lower=[2.0, 0.5, 0.1, 1.0]),
    "groups": GroupNorm([1.0, 0.5]),
    "ellipsoid": Ellipsoid(np.diag([1.0, 4.0, 0.25, 1.0])),
    "vertices": Polytope(vertices=np.vstack([np.eye(4), -2.0 * np.eye(4)])),
    "half-spaces": Polytope(normals=np.vstack([np.eye(4), -np.eye(4)]), offsets=np.ones(8)),
    "product": Product((WeightedL1([1.0, 0.5]), Ellipsoid(np.diag([1.0, 2.0])))),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_potential(kind: str) -> None:
    """One step is the projection onto K in the metric of A⁻¹; a whole evolution is certified."""
    psi = KINDS[kind]
    rng = np.random.default_rng(5)
    root = rng.normal(size=(4, 4))
    A = root @ root.T + np.eye(4)
    problem = Evolution(
        A, lambda t: 3.0 * np.sin([t, 2 * t, 3 * t, t]), psi, np.zeros(4), span=(0, 1.0)
    )
    history = evolve(problem, steps=60, tolerance=2e-2)
    assert history.outcome.ok and history.certificate.ok, history.certificate.verdict
    assert history.dataset["slipping"].max() >= 1
    k = int(np.argmax(history.dataset["slipping"].values))
    t = float(history.times[k])
    before = history.z[k - 1]
    after = history.z[k]
    pulled, held = problem.force(t, before), problem.force(t, after)
    assert psi.distance(held) < 1e-7
    # ξ is the projection: ⟨A⁻¹(r − ξ), η − ξ⟩ ≤ 0 for every η in K, that is, Ψ(d) ≤ ⟨ξ, d⟩.
    d = np.linalg.solve(A, pulled - held)
    assert psi.value(0.0, d) - held @ d < 1e-7 * np.abs(d).max()


def test_loads_and_bounds_in_any_form() -> None:
    """Read-only, by columns or whole numbers: the steps are the same, and nothing of it changes."""
    rng = np.random.default_rng(2)
    loads = rng.integers(-9, 9, (40, 3)).astype(float)
    upper = np.ones((1, 3))
    states, effort = BoxSteps(STIFF).advance(np.zeros(3), loads, Boxes(-upper, upper))
    assert effort.any()
    columns = np.asfortranarray(loads)
    columns.setflags(write=False)
    start = np.zeros(3, int)
    same = BoxSteps(np.asfortranarray(STIFF)).advance(
        start, columns, Boxes(np.broadcast_to(-1.0, (1, 3)), np.ones((1, 3), int))
    )
    np.testing.assert_array_equal(same[0], states)
    np.testing.assert_array_equal(same[1], effort)
    np.testing.assert_array_equal(columns, loads)
    assert not start.any()


def test_which_solver_takes_what() -> None:
    names = {
        kind: type(choose_solver(_small(psi), None, 1e-8)).__name__ for kind, psi in KINDS.items()
    }
    assert names.pop("boxes") == "BoxSteps" and set(names.values()) == {"ProjectionSteps"}
    for psi in (WeightedL1(np.ones(1000)), GroupNorm(np.ones(500))):
        large = Evolution(sparse.eye_array(1000), lambda t: np.zeros(1000), psi, np.zeros(1000))
        assert type(choose_solver(large, None, 1e-8)).__name__ == "MultigridSteps"
    assert (
        type(choose_solver(_small(KINDS["groups"]), "multigrid", 1e-8)).__name__ == "MultigridSteps"
    )
    for kind, solver in (("ellipsoid", "multigrid"), ("groups", "sparse")):
        with pytest.raises(DeclarationError, match="does not support"):
            choose_solver(_small(KINDS[kind]), solver, 1e-8)


def _small(psi) -> Evolution:
    return Evolution(np.eye(4), ["t"] * 4, psi, np.zeros(4))


# --- Files and pictures ---------------------------------------------------------------------------


def test_saved_and_opened_again(tmp_path: Path) -> None:
    history = evolve(
        three(), (0, 1), steps=200, output=10, observables={"first": lambda t, z: z[:2]}
    )
    history.save(tmp_path / "history.nc")
    again = History.open(tmp_path / "history.nc")
    assert again.dataset.identical(history.dataset)
    assert again.outcome is history.outcome and again.certificate == history.certificate
    assert repr(again) == repr(history) and "200 steps" in repr(again)
    on, direct = (evolve(three(), (0, 2), start=h, tolerance=1e-2) for h in (again, history))
    np.testing.assert_array_equal(on.z, direct.z)

    with pytest.raises(StickslipError, match="no such file"):
        History.open(tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("text")
    with pytest.raises(StickslipError, match="not an evolution"):
        History.open(tmp_path / "text.nc")
    with pytest.raises(StickslipError, match="cannot be written"):
        history.save(tmp_path / "missing" / "history.nc")


def test_pictures() -> None:
    few = evolve(three(), tolerance=1e-2).plot()
    assert [axes.get_ylabel() for axes in few.axes] == ["$z_{1}$", "$z_{2}$", "$z_{3}$", "energy"]
    n = 12
    A = 2.0 * np.eye(n) - 0.5 * np.eye(n, k=1) - 0.5 * np.eye(n, k=-1)
    many = evolve(
        Evolution(A, lambda t: np.full(n, 3.0 * t), WeightedL1(np.ones(n)), np.zeros(n)), steps=50
    ).plot()
    assert [axes.get_ylabel() for axes in many.axes[:3]] == ["component", "slipping", "energy"]


@pytest.mark.parametrize(
    ("angle", "steps"), [("2*pi*s", 64), ("1.2*sin(2*pi*s)", 37)], ids=["turning", "swinging"]
)
def test_steps_with_an_averaged_ellipse_reach_rounding(angle: str, steps: int) -> None:
    c, s = f"15/8*cos({angle})", f"15/8*sin({angle})"
    psi = Ellipsoid([[f"17/8 + {c}", s], [s, f"17/8 - {c}"]])
    load = ["2*sin(2*pi*t)", "2*sin(4*pi*t)"]
    problem = Evolution(
        [[1.0, 0.3], [0.3, 0.5]], load, psi, [0.0, 0.0], epsilon=0.1, span=(0, 1)
    ).averaged()
    found = evolve(problem, steps=steps)
    assert found.outcome.ok
    assert found.dataset["residual"].max() <= 1e-12
    assert found.dataset["distance"].max() <= 1e-12
