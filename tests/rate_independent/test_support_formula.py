"""Dissipation potentials by a formula: against the kinds with closed forms, against a cone program,
by duality, in evolutions and files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from adversarial import dense_steps
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.rate_independent.dissipation import (
    Dissipation,
    Ellipsoid,
    GroupNorm,
    Polytope,
    Product,
    SupportFormula,
    WeightedL1,
)
from stickslip.rate_independent.dissipation.formula_sets import FormulaSets
from stickslip.rate_independent.sets.cones import ConeForm, balls, product_of_cones, solve_cones

KNOWN: dict[str, tuple[str, Dissipation]] = {
    "ellipse": ("sqrt(v1**2 + (3*v2)**2)", Ellipsoid(np.diag([1.0, 9.0]))),
    "ellipsoid": (
        "2*sqrt(2*v1**2 + v1*v2 + v2**2 + 0.5*v3**2 - 0.3*v2*v3)",
        Ellipsoid(4.0 * np.array([[2, 0.5, 0], [0.5, 1, -0.15], [0, -0.15, 0.5]])),
    ),
    "box": (
        "abs(v1) + 2*abs(v2) + max(v3, 0) - 0.5*min(v3, 0)",
        WeightedL1([1.0, 2.0, 1.0], [1.0, 2.0, 0.5]),
    ),
    "diamond": (
        "max(abs(v1), abs(v2))",
        Polytope(vertices=[[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]),
    ),
    "pentagon": (
        "max(v1 + v2, v1 - 2*v2, -v1 + 0.5*v2, -v1 - v2, 0.3*v2)",
        Polytope(vertices=[[1, 1], [1, -2], [-1, 0.5], [-1, -1], [0, 0.3]]),
    ),
    "groups": (
        "sqrt(v1**2 + v2**2) + 2*sqrt(v3**2 + v4**2)",
        GroupNorm([1.0, 2.0], size=2),
    ),
    "product": (
        "sqrt(v1**2 + 4*v2**2) + abs(v3)",
        Product([Ellipsoid(np.diag([1.0, 4.0])), WeightedL1([1.0])]),
    ),
}
MOVING: dict[str, tuple[str, Dissipation]] = {
    "boxes": (
        "(2 + cos(2*pi*s))*abs(v1) + (2 - cos(2*pi*s))*abs(v2)",
        WeightedL1(["2 + cos(2*pi*s)", "2 - cos(2*pi*s)"]),
    ),
    "ellipses": (
        "sqrt((2 + cos(2*pi*s))*v1**2 + sin(2*pi*s)*v1*v2 + 2*v2**2)",
        Ellipsoid([["2 + cos(2*pi*s)", "sin(2*pi*s)/2"], ["sin(2*pi*s)/2", "2"]]),
    ),
    "diamonds": (
        "(2 + cos(2*pi*s))*max(abs(v1), abs(v2))",
        Polytope(
            vertices=[
                ["2 + cos(2*pi*s)", "0"],
                ["-2 - cos(2*pi*s)", "0"],
                ["0", "2 + cos(2*pi*s)"],
                ["0", "-2 - cos(2*pi*s)"],
            ]
        ),
    ),
}


def by_gradients(text: str) -> FormulaSets:
    """What a formula is if it is not recognised."""
    return FormulaSets(SupportFormula(text).convex)


def spd(rng: np.random.Generator, n: int) -> Array:
    root = rng.normal(size=(n, n))
    return root @ root.T / n + 0.3 * np.eye(n)


@pytest.mark.parametrize("name", KNOWN)
@pytest.mark.parametrize("recognised", [True, False])
def test_sets_of_known_kinds(name: str, recognised: bool) -> None:
    text, known = KNOWN[name]
    formula = SupportFormula(text) if recognised else by_gradients(text)
    assert not recognised or not isinstance(SupportFormula(text).form, FormulaSets)
    rng = np.random.default_rng(1)
    n = known.dimension
    assert formula.dimension == n
    for k in range(9):
        xi = rng.normal(size=n) * 10.0 ** rng.uniform(-1.0, 1.0)
        if k % 3 == 0:
            xi[rng.integers(n)] = 0.0
        M = spd(rng, n)
        size = np.abs(xi).max() + 1.0
        assert formula.support(xi) == pytest.approx(known.support(xi), rel=1e-14)
        assert formula.gauge(xi) == pytest.approx(known.gauge(xi), rel=1e-9)
        for metric in (None, M):
            y = known.project(xi, 0.0, metric)
            assert np.abs(formula.project(xi, 0.0, metric) - y).max() <= 1e-13 * size
        # On the boundary, and just inside.
        edge = known.project(50.0 * xi)
        assert formula.distance(edge) <= 1e-13 * size
        assert formula.gauge(edge) == pytest.approx(1.0, rel=1e-13)
        assert formula.excess(0.999 * edge) <= 0.0
        assert formula.contains(edge)
        assert not formula.contains(1.001 * edge)
        if known.distance(xi) > 1e-3:
            slope, expected = (part.projection(xi)[1] for part in (formula, known))
            assert np.abs(slope - expected).max() < 1e-12


@pytest.mark.parametrize("name", [*KNOWN, *MOVING])
def test_evolutions_of_known_kinds(name: str) -> None:
    """The same states to 1e-10, recognised or not, and certificates that say the same."""
    text, known = (KNOWN | MOVING)[name]
    rng = np.random.default_rng(3)
    n = known.dimension
    A = spd(rng, n)
    load = [f"{3 * (i + 1)}*sin({1 + i}*t + {i})*t" for i in range(n)]
    histories = [
        ss.evolve(
            ss.Evolution.settled(A, load, psi, np.zeros(n), epsilon=0.7, span=(0.0, 1.0)),
            steps=8,
        )
        for psi in (known, SupportFormula(text), by_gradients(text))
    ]
    first = histories[0]
    z = first.dataset["z"].values
    for other in histories[1:]:
        assert np.abs(other.dataset["z"].values - z).max() <= 1e-10 * np.abs(z).max()
        for residual in ("stability", "KKT residual"):
            assert other.certificate[residual].value < 1e-11
        overshoot = other.certificate["stability between steps"].value
        known_overshoot = first.certificate["stability between steps"].value
        assert overshoot <= 1.1 * known_overshoot + 1e-9


@pytest.mark.parametrize("name", MOVING)
def test_averages_of_known_kinds(name: str) -> None:
    text, known = MOVING[name]
    rng = np.random.default_rng(4)
    average = known.average()
    for formula in (SupportFormula(text), *([by_gradients(text)] if name == "ellipses" else [])):
        own = formula.average()
        for v in rng.normal(size=(2, 2)):
            cost = average.value(0.0, v)
            assert own.value(0.0, v) == pytest.approx(cost, rel=1e-7)
        assert own.bounded


def as_cones(lengths: Array, lines: Array, roots: list[Array], shift: Array) -> ConeForm:
    """The sum of segments, of images of balls, and of a point."""
    n = len(shift)
    segments = balls(lengths, 1)
    parts = [segments, *(balls(np.ones(1), root.shape[1]) for root in roots)]
    sizes = [len(lengths), *(root.shape[1] for root in roots)]
    form = product_of_cones(parts, sizes)
    image = np.hstack([lines.T, *roots])
    # One more unknown that is 1 moves all by the shift.
    matrix = np.zeros((len(form.offset) + 2, image.shape[1] + 1))
    matrix[:-2, :-1] = form.matrix
    matrix[-2:, -1] = 1.0, -1.0
    offset = np.concatenate([form.offset, [1.0, -1.0]])
    kinds = (*form.cones, ("nonnegative", 2))
    return ConeForm(matrix, offset, kinds, np.hstack([image, shift.reshape(n, 1)]))


@pytest.mark.parametrize("seed", range(4))
def test_projections_by_a_cone_program(seed: int) -> None:
    """K is a sum of segments and flat and full ellipsoids that share components: no product."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    lines = rng.normal(size=(2, n)).round(2)
    lengths = rng.uniform(0.2, 1.0, 2).round(2)
    flat = rng.normal(size=(n, min(2, n - 1))).round(2)
    full = np.diag(rng.uniform(0.5, 1.5, n).round(2))
    shift = 0.2 * np.eye(n)[int(rng.integers(n))]

    def linear(row: Array) -> str:
        return "+".join(f"({x})*v{i + 1}" for i, x in enumerate(row.tolist()))

    norms = [
        "sqrt(" + "+".join(f"({linear(column)})**2" for column in root.T) + ")"
        for root in (flat, full)
    ]
    sizes = [f"{a}*abs({linear(row)})" for a, row in zip(lengths.tolist(), lines, strict=True)]
    formula = SupportFormula("+".join([*sizes, *norms, linear(shift)]))
    assert formula.convex.proved
    assert isinstance(formula.form, FormulaSets)
    form = as_cones(lengths, lines, [flat, full], shift)
    for k in range(6):
        xi = rng.normal(size=n) * 3.0
        M = np.eye(n) if k % 2 else spd(rng, n)
        expected = solve_cones([form], M @ xi, M)[0]
        y = formula.project(xi, 0.0, M)
        assert np.abs(y - expected).max() < 1e-4  # an interior-point method knows it to the root
        off, other = (float((xi - x) @ M @ (xi - x)) for x in (y, expected))
        assert off <= other + 1e-9
        d = M @ (xi - y)
        # What it is to be nearest, to rounding: ⟨y, d⟩ = R(d), and y in K.
        assert y @ d == pytest.approx(formula.support(d), rel=1e-12, abs=1e-13)
        assert formula.distance(y) < 1e-12
        assert formula.projection(xi)[1] == pytest.approx(
            np.column_stack(
                [
                    (formula.project(xi + h) - formula.project(xi - h)) / 2e-6
                    for h in 1e-6 * np.eye(n)
                ]
            ),
            abs=1e-5,
        )


def test_duality_of_random_formulas() -> None:
    """⟨ξ, v⟩ ≤ γ(ξ) R(v), with equality for the v to which ξ belongs; nearest points are in K, and
    no other point is nearer."""
    rng = np.random.default_rng(5)
    for _ in range(5):
        n = int(rng.integers(2, 4))
        psi = SupportFormula(dense_steps.formula_text(rng, n), dimension=n)
        for _ in range(4):
            xi, *others = rng.normal(size=(20, n)) * 2.0
            gauge = psi.gauge(xi)
            for v in others:
                assert xi @ v <= gauge * psi.support(v) * (1.0 + 1e-12)
            v = rng.normal(size=n)
            exposed = psi.exposed(v)
            assert exposed @ v == pytest.approx(psi.support(v), rel=1e-13)
            assert psi.gauge(exposed) == pytest.approx(1.0, rel=1e-12)
            M = spd(rng, n)
            y = psi.project(xi, 0.0, M)
            for w in others:
                assert (xi - y) @ M @ (psi.exposed(w) - y) <= 1e-11


def test_steps_of_random_formulas() -> None:
    seeds = range(dense_steps.KINDS.index("formula"), 8 * 8, len(dense_steps.KINDS))
    assert max(dense_steps.step(seed).residual for seed in seeds) <= 1e-11


def test_an_exact_play() -> None:
    """One component: ρ⁺ and ρ⁻ are Ψ(s, ±1)."""
    formula = SupportFormula("(1 + cos(2*pi*s)/2)*max(v1, 0) - 0.5*min(v1, 0)")
    known = WeightedL1(["1 + cos(2*pi*s)/2"], [0.5])
    ends = []
    for psi in (formula, known):
        assert psi.thresholds is not None
        play = ss.play("5*t - t**2", psi.thresholds, (0.0, 5.0), initial=0.0, epsilon=0.3)
        assert play.certificate.ok
        ends.append(float(play.position(np.array([5.0]))[0]))
    assert ends[0] == pytest.approx(ends[1], abs=1e-13)


SNAKE = """
name = "snake"
A = [[2, -1], [-1, 2]]
load = ["0.3*sin(t)", "0.2*t*sin(2*t)"]
epsilon = 0.5
span = [0, 2]

parameters.mu_f = {default = 0.11}
parameters.mu_b = {default = 0.14}
functions."rho(s)" = "1 + cos(2*pi*s)/4"

[dissipation]
kind = "formula"
formula = "rho(s)*sqrt((mu_f*max(v1, 0) - mu_b*min(v1, 0))**2 + (0.2*v2)**2)"
"""


def test_model_files(tmp_path: Path) -> None:
    path = tmp_path / "snake.toml"
    path.write_text(SNAKE, encoding="utf-8")
    model = ss.load_evolution(path)
    psi = model.potential
    assert isinstance(psi, SupportFormula)
    assert psi.convex.proved
    assert psi.support([1.0, 0.0]) == pytest.approx(0.11 * 1.25)
    assert psi.support([-1.0, 0.0], 0.5) == pytest.approx(0.14 * 0.75)
    again = tmp_path / "again.toml"
    again.write_text(model.to_toml(), encoding="utf-8")
    assert ss.load_evolution(again) == model
    rougher = model.configure({"mu_f": 0.22}).potential
    assert rougher.support([1.0, 0.0]) == pytest.approx(0.22 * 1.25)
    history = ss.evolve(model.problem, steps=20)
    assert history.certificate["KKT residual"].value < 1e-11
    history.save(tmp_path / "snake.nc")
    stored = ss.open(tmp_path / "snake.nc")
    assert np.array_equal(stored.final, history.final)
    assert stored.certificate.notes == history.certificate.notes


def test_errors_in_model_files(tmp_path: Path) -> None:
    path = tmp_path / "snake.toml"
    for old, new, message in (
        ("(0.2*v2)**2)", "(0.2*v2)**2)**2", r"dissipation\.formula: .*degree 2"),
        ("0.2*v2", "0.2*w", r"dissipation\.formula: unknown name 'w'"),
        ("mu_f", "v1", r"parameters\.v1: 'v1' is a component of the motion"),
        ('kind = "formula"', 'kind = "formula"\ndimension = 1', r"component v2, but n = 1"),
    ):
        path.write_text(SNAKE.replace(old, new), encoding="utf-8")
        with pytest.raises(DeclarationError, match=message):
            ss.load_evolution(path)


BAD = {
    "degree": ("v1**2 + v2**2", {}, r"^formula: it is homogeneous of degree 2"),
    "concave": ("min(abs(v1), abs(v2))", {}, r"^formula: it is not convex: Psi\(u \+ w\)"),
    "negative": ("abs(v1) - abs(v2)", {}, r"^formula: .*nonnegative"),
    "name": ("abs(v1) + mu*abs(v2)", {}, r"^formula: unknown name 'mu'"),
    "nothing": ("", {}, r"^formula: "),
    "no component": ("0", {}, r"^formula: it contains no component"),
    "no number": ("mu*abs(v1)", {"parameters": {"mu": float("nan")}}, r"^parameters\.mu: "),
    "taken": ("abs(v1)", {"parameters": {"v1": 1.0}}, r"^parameters\.v1: "),
    "dimension": ("abs(v1)", {"dimension": -1}, r"^dimension: -1 is not a dimension"),
    "period": ("(1 + s)*abs(v1)", {}, r"^formula: it differs between the phases"),
    "many": ("abs(v99)", {}, r"^formula: it has 99 components"),
    "kind": (["abs(v1)"], {}, r"^formula: "),
    "undefined": ("sqrt(v1*v2)", {}, r"^formula: it has no finite value"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input(case: str) -> None:
    text, more, message = BAD[case]
    with pytest.raises(DeclarationError, match=message):
        SupportFormula(text, **more)


def test_what_is_not_proved_is_said(tmp_path: Path) -> None:
    """Convex, but neither by rules nor by bounds: the curvature is just 0 in two directions."""
    psi = SupportFormula("(0.1*v1**2 + 0.2*v2**2)/sqrt(v1**2 + v2**2)")
    assert not psi.convex.proved
    assert "convex as sampled in 720 directions" in psi.doubt
    assert "not proved" in psi._repr_html_()
    problem = ss.Evolution(np.eye(2), ["3*sin(t)", "2*t"], psi, [0.0, 0.0], span=(0.0, 2.0))
    for posed in (problem, problem.averaged()):
        history = ss.evolve(posed, steps=4)
        assert f"dissipation {psi.convex.evidence}" in history.certificate.notes
        assert np.allclose(history.dataset["residual"], 0.0, atol=1e-11)
    history.save(tmp_path / "doubt.nc")
    assert psi.doubt in ss.open(tmp_path / "doubt.nc").certificate.notes


def test_between_phases_nothing_is_missed() -> None:
    """A dip of the phase that is narrower than what is sampled is in the average."""
    dip = "(1 - 0.5*exp(-((s - 0.7632)/2e-4)**2))"
    psi = FormulaSets(SupportFormula(f"{dip}*abs(v1) + sqrt(v1**2 + 4*v2**2)").convex)
    low = np.linspace(0.0, 1.0, 65)[:-1]
    stretches = psi.over(low, low + 1.0 / 64.0)
    force = np.array([1.99, 0.0])
    rows = np.broadcast_to(force, (64, 2))
    out = stretches.outside(rows, rows, np.zeros((64, 2)), 0.0)[2]
    assert out[int(0.7632 * 64)] >= 0.49  # there it lies outside by half
    assert psi.excess(force, 0.5) < 0.0


def test_pictures_and_pages() -> None:
    psi = SupportFormula("abs(v1) + sqrt(v1**2 + (2*v2)**2) + 0.3*v2")
    page = psi._repr_html_()
    assert "SupportFormula" in page
    assert "<img" in page or "data:image" in page
