"""Derivatives of cycles, beside differences of cycles that are closed again."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss

CASES = {
    "belt_stribeck": "V",
    "forced_oscillator": "omega",
    "plate_compactor": "m",
    "woodpecker": "e_1",
}


@pytest.mark.parametrize("name", CASES)
def test_differences(name: str) -> None:
    """Period, speed and amplitudes; what is shifted along has no place of its own."""
    system = getattr(ss.catalogue, name)()
    p = CASES[name]
    cycle = ss.find_cycle(system)
    found = cycle.sensitivity([p]).sel(parameter=p)
    value = system.values[p]
    h = 1e-4 * value

    def measured(x: float) -> np.ndarray:
        moved = ss.find_cycle(system, start=cycle, parameters={p: x})
        ends = np.array(list(moved.extrema.values()))
        return np.array([moved.period, moved.speed, *(0.5 * (ends[:, 1] - ends[:, 0]))])

    rough, fine = ((measured(value + d) - measured(value - d)) / (2.0 * d) for d in (h, 0.5 * h))
    expected = (4.0 * fine - rough) / 3.0
    got = np.array([float(found["period"]), float(found["speed"]), *found["amplitude"].values])
    assert got == pytest.approx(expected, rel=1e-7, abs=1e-8 * np.max(np.abs(expected)))


def test_linear_oscillator() -> None:
    """Below its threshold nothing moves; above all of it: a forced oscillator without friction has
    the multipliers exp((−c/2 ± √(c²/4 − 1))T), T = 2π/ω."""
    system = ss.System(
        name="forced",
        parameters={"omega": ss.Parameter(1.7), "c": ss.Parameter(0.3)},
        coordinates={"x": ss.Inertial(force="cos(omega*t)")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        viscous="c/2*d_x**2",
        initial={"x": 1.0},
    )
    cycle = ss.find_cycle(system)
    found = cycle.sensitivity(["c", "omega"])
    T = 2 * np.pi / 1.7
    by_T = -2 * np.pi / 1.7**2
    assert found["period"].values == pytest.approx([0.0, by_T], abs=1e-12)
    root = np.sqrt(complex(0.3**2 / 4 - 1.0))
    by_c = np.array([T * (-0.5 + s * 0.3 / (4 * root)) for s in (1, -1)])
    z = np.array([np.exp((-0.15 + s * root) * T) for s in (1, -1)])
    expected = by_c * z
    got = found["multiplier"].sel(parameter="c").values
    order = [int(np.argmin(np.abs(cycle.multipliers - one))) for one in z]
    assert got[order] == pytest.approx(expected, abs=1e-8)
    # x = cos(ωt − φ)/√((1 − ω²)² + c²ω²)
    w, c = 1.7, 0.3
    size = (1 - w**2) ** 2 + c**2 * w**2
    by = [-(c * w**2) / size**1.5, -(-2 * w * (1 - w**2) + c**2 * w) / size**1.5]
    assert found["amplitude"].sel(component="x").values == pytest.approx(by, abs=1e-10)


def test_bad_input() -> None:
    cycle = ss.find_cycle(ss.catalogue.belt_stribeck())
    with pytest.raises(ss.DeclarationError, match="unknown parameter"):
        cycle.sensitivity(["nothing"])
