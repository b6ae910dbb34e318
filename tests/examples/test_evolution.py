"""The examples of rate-independent evolution: each is imported, and says what it promises."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name.replace("-", "_"), EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_play_follows_its_limit() -> None:
    # ε times the largest speed of the load
    assert example("play-moving-threshold").distance < 0.1 * 5.0


def test_prandtl_ishlinskii() -> None:
    assert example("prandtl-ishlinskii").error < 1e-12


def test_two_components_move_at_different_phases() -> None:
    found = example("two-phases")
    for v in ([3.0, -4.0], [0.0, 1.0], [-0.1, 7.0]):
        assert found.average.support(v) == pytest.approx(np.abs(v).sum(), rel=1e-12)
    assert found.resolved.certificate.ok and found.averaged.certificate.ok
    assert found.first_near_0 > 0.95 and found.second_near_half > 0.95
    # The end of the span is a moment at which the first component moves freely: there the two
    # motions agree.
    assert found.resolved.z[-1, 0] == pytest.approx(found.averaged.z[-1, 0], abs=1e-12)


def test_the_rotating_ellipse_is_a_disc_on_average() -> None:
    found = example("rotating-ellipse")
    assert found.error < 1e-8
    assert found.gap < 1e-8
    assert found.waits < 1e-6


def test_the_plate_compactor_needs_the_least_friction_only() -> None:
    found = example("plate-compactor")
    for F in (0.0, 300.0, 900.0, 1100.0):
        assert found.averaged_law(F) == pytest.approx(0.6 * max(981.0 - F, 0.0), abs=1e-9)
    for F, force in found.exact.items():
        # Without inertia: above the law by at most what the spring winds up in one period.
        law = found.averaged_law(F)
        wound = found.STIFFNESS * found.SPEEDS[-1] * found.PERIOD
        assert law < force < law + wound
        # With inertia: above that, far below rest friction, and the less the slower the pull.
        faster = float(found.resolved(F, 2 * found.SPEEDS[-1]).mean())
        assert force < found.slowest[F] < faster < 0.6 * 981.0


def test_the_wave_over_the_membrane_tends_to_its_average() -> None:
    found = example("membrane")
    few, more, many = found.distances.values()
    assert few > 1.8 * more and more > 1.8 * many and many < 0.06
    disc = found.membrane(3, periods=4)
    assert disc.problem.n == 113
    np.testing.assert_allclose(
        disc.problem.dissipation.average().bounds()[1], 0.1 * disc.area, rtol=1e-12
    )
