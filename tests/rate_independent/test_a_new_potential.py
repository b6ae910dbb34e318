"""A dissipation potential of one's own: one class, and everything else follows.

This is the example that CONTRIBUTING.md points to. The largest of the components rubs, Ψ(s, v) =
r(s) maxᵢ |vᵢ|, so that K(s) is the cross-polytope {Σ|ξᵢ| ≤ r(s)}; a ball that is not centred, Ψ(s,
v) = r|v| + ⟨c(s), v⟩, says no more than it has to.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

import stickslip as ss
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.figures.dissipation import plot_average
from stickslip.rate_independent.averaging.semi_infinite import Intersection
from stickslip.rate_independent.dissipation import Average, Dissipation, Polytope
from stickslip.rate_independent.evolution.evolution_file import EVOLUTIONS
from stickslip.rate_independent.sets.projections import nearest_in_metric
from stickslip.rate_independent.sets.thresholds import nonnegative, read_weights
from stickslip.rate_independent.signals.reading import read_phase
from stickslip.rate_independent.signals.signal import Signal

CORNERS = np.vstack([np.eye(2), -np.eye(2)])


@dataclass(frozen=True, eq=False)
class LargestComponent(Dissipation, kind="largest component"):
    """Ψ(s, v) = r(s) maxᵢ |vᵢ|."""

    radius: Any
    size: int = 2
    r: Signal = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "r", read_weights(self.radius, "radius"))

    @property
    def dimension(self) -> int:
        return self.size

    @property
    def depends_on_phase(self) -> bool:
        return self.r.varies

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        return float(nonnegative(self.r, s)[0] * np.abs(self.vector(v, "v")).max())

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        v = self.vector(v, "v")
        xi = np.zeros(self.size)
        i = int(np.abs(v).argmax())
        xi[i] = np.sign(v[i]) * nonnegative(self.r, s)[0]
        return xi

    def average(self, tolerance: float = 1e-8) -> Average:
        return Intersection(self, tolerance)


@dataclass(frozen=True, eq=False)
class MovingBall(Dissipation):
    """Ψ(s, v) = r|v| + ⟨c(s), v⟩: K(s) is a ball around c(s), |c(s)| ≤ r."""

    radius: float
    centre: Any
    c: Signal = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "c", read_phase(self.centre, "centre"))

    @property
    def dimension(self) -> int:
        return self.c.shape[0]

    @property
    def depends_on_phase(self) -> bool:
        return self.c.varies

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        v = self.vector(v, "v")
        return float(self.radius * np.linalg.norm(v) + self.c.at(s) @ v)

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        v = self.vector(v, "v")
        return self.c.at(s) + self.radius * v / (np.linalg.norm(v) or 1.0)

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        # What is known of a set makes it fast: without this, it is found from exposed points.
        xi, M = self.vector(xi, "xi"), self.metric(metric)
        if M is not None:
            return nearest_in_metric(lambda x: self.projection(x, s), xi, M)
        away = xi - self.c.at(s)
        return self.c.at(s) + away * min(1.0, self.radius / (np.linalg.norm(away) or 1.0))

    def average(self, tolerance: float = 1e-8) -> Average:
        return Intersection(self, tolerance)


SHAKEN = "1 + 0.5*cos(2*pi*s)"


def problem(dissipation: Dissipation, **given: Any) -> ss.Evolution:
    A = np.array([[2.0, 0.5], [0.5, 1.0]])
    return ss.Evolution(A, ["2*sin(3*t)", "t"], dissipation, np.zeros(2), **given)


def test_it_evolves_like_the_same_set_given_otherwise() -> None:
    corners = [[f"({x:g})*({SHAKEN})" for x in row] for row in CORNERS]
    known = Polytope(vertices=corners)
    given = {"epsilon": 0.5, "span": (0, 1)}
    found, expected = (
        ss.evolve(problem(psi, **given), steps=60) for psi in (LargestComponent(SHAKEN), known)
    )
    np.testing.assert_allclose(found.z, expected.z, atol=1e-7)
    assert np.abs(np.diff(found.z, axis=0)).max() > 0.0
    assert found.certificate["stability"].ok and found.certificate["KKT residual"].ok
    assert "as sampled" in found.certificate.notes[0]


def test_its_evolution_is_certified() -> None:
    history = ss.evolve(problem(LargestComponent("1"), span=(0, 1)))
    assert history.certificate.ok, history.certificate


def test_it_is_averaged() -> None:
    average = LargestComponent(SHAKEN).average()
    np.testing.assert_allclose(average.support([3.0, -2.0]), 0.5 * 3.0, rtol=1e-7)
    motion = average.optimal_motion([3.0, -2.0])
    np.testing.assert_allclose(motion.phases, 0.5, atol=1e-3)
    assert abs(motion.gap) < 1e-7
    assert average.coverage.startswith("as sampled")


def test_a_ball_that_moves_is_averaged_and_evolves() -> None:
    ball = MovingBall(1.0, ["0.5*cos(2*pi*s)", 0.0])
    # What the balls around −1/2 and 1/2 have in common, a lens, holds against V as they do at one
    # of its corners.
    assert ball.average().support([0.0, 1.0]) == pytest.approx(np.sqrt(0.75), abs=1e-7)
    assert ball.average().support([1.0, 0.0]) == pytest.approx(0.5, abs=1e-7)
    history = ss.evolve(problem(ball, epsilon=0.5, span=(0, 1)), steps=40)
    assert history.certificate["stability"].ok


def test_its_stable_sets_and_costs_are_drawn() -> None:
    potential = LargestComponent(SHAKEN)
    figure = plot_average(potential, potential.average())
    assert len(figure.axes) >= 2


def test_model_files_know_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from typer.testing import CliRunner

    from stickslip.cli.app import app

    text = (
        'name = "mine"\n'
        "A = [[2, 0.5], [0.5, 1]]\n"
        'load = ["2*sin(3*t)", "t"]\n'
        'dissipation = {kind = "largest component", radius = "1"}\n'
    )
    model = EVOLUTIONS.loads(text)
    assert isinstance(model.potential, LargestComponent)
    assert EVOLUTIONS.loads(model.to_toml()) == model
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(text, encoding="utf-8")
    runner = CliRunner()
    result = runner.invoke(app, ["evolve", "mine.toml", "--json"], catch_exceptions=False)
    assert result.exit_code == 0 and json.loads(result.stdout)["certified"]
    result = runner.invoke(app, ["average", "mine.toml", "--json"], catch_exceptions=False)
    assert "by cone programs" in json.loads(result.stdout)["method"]
    with pytest.raises(DeclarationError, match=r"dissipation\.radios: unknown key\. Did you mean"):
        EVOLUTIONS.loads(text.replace("radius", "radios"))
    with pytest.raises(DeclarationError, match=r"dissipation\.radius.*negative"):
        EVOLUTIONS.loads(text.replace('"1"', '"-1"'))
