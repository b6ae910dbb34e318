"""Translations need not be declared: maps find them in the formulas, as cycles do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.equations.derive import derive
from stickslip.errors import ConvergenceError
from stickslip.orbits.settling.lattice import translations

DECLARED = (
    "ramp_walker",
    "rocking_toy",
    "rocking_toy_inertial",
    "stick_slip_actuator",
    "two_leg_crawler",
    "woodpecker",
)


def found(system: ss.System) -> np.ndarray:
    """Directions beside the declared one, shape (directions, states)."""
    equations = derive(system.plain.declaration)
    names = system.declaration.state
    declared = np.array([float(system.plain.translation.get(x, 0.0)) for x in names])
    return translations(equations, declared)[1:]


@pytest.mark.parametrize("name", DECLARED)
def test_declared_or_not(name: str) -> None:
    system = getattr(ss.catalogue, name)()
    assert len(found(system)) == 0
    ((x, weight), *_) = system.translation.items()
    own = replace(system, translation={})
    assert found(own)[0][system.declaration.state.index(x)] == weight
    (p, value), *_ = system.values.items()
    one, other = (
        ss.sweep(s, {p: [value, 1.01 * value]}, ["period", f"speed:{x}", "stick_fraction"])
        for s in (system, own)
    )
    assert other.certificate.ok
    for key, column in one.dataset.items():
        np.testing.assert_allclose(other[str(key)].values, column.values, rtol=1e-9, atol=1e-12)


def shaken(drive: Any, **more: Any) -> ss.System:
    return ss.System(
        "shaken",
        parameters={"F": ss.Parameter(36.0)},
        drives={"w": drive},
        coordinates={"z": ss.Inertial(force="-9.81")},
        kinetic="d_z**2/2",
        contacts={"pad": ss.Contact("d_z", "F", "w", kinetic="5/6*F")},
        span=(0.0, 1.0),
        **more,
    )


@pytest.mark.parametrize("seed", range(12))
def test_a_block_that_drifts(seed: int) -> None:
    """Under samples and under formulas: the map's cycle is that of `find_cycle`."""
    rng = np.random.default_rng(seed)
    times = np.append(0.0, np.sort(rng.uniform(0.1, 0.9, 3)))
    values = 0.2 * rng.uniform(-1.0, 1.0, 4)
    drive: Any = ss.Samples(
        0.02 * np.append(times, 1.0), np.append(values, values[0]), periodic=True
    )
    if seed % 2:
        a, b = (float(v) for v in rng.uniform(0.05, 0.2, 2))
        drive = f"{a}*sin(100*pi*t) + {b}*cos(200*pi*t)"
    system = shaken(drive)
    mapped = ss.sweep(system, {"F": [30.0, 40.0]}, ["speed:z", "period", "stick_fraction"])
    assert mapped.certificate.ok and np.all(mapped["outcome"] == ss.Outcome.PERIODIC.code)
    for F, speed, period in zip(
        mapped["F"].values, mapped["speed:z"].values, mapped["period"].values, strict=True
    ):
        cycle = ss.find_cycle(system, parameters={"F": float(F)})
        assert period == pytest.approx(cycle.period, rel=1e-9)
        assert speed == pytest.approx(cycle.drift / cycle.period, rel=1e-8, abs=1e-12)


def test_which_formulas_show() -> None:
    """A spring between two leaves them a common translation, whatever its stiffness; a wall, a
    lattice, and a jump that puts a coordinate somewhere leave none."""

    def pair(potential: str, **more: Any) -> ss.System:
        return ss.System(
            "pair",
            parameters={"k": ss.Parameter(2.0), "l": ss.Parameter(3.0)},
            coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
            internal={"walked": ss.Internal("d_x**2")},
            kinetic="(d_x**2 + d_y**2)/2",
            potential=potential,
            contacts={"a": ss.Contact("d_x", 0.1), "b": ss.Contact("d_y - d_x", 0.1)},
            **more,
        )

    counter = [0.0, 0.0, 0.0, 0.0, 1.0]
    names = ["x", "y", "d_x", "d_y", "walked"]
    assert list(pair("0").declaration.state) == names
    common = found(pair("k*l*(x - y)**2/2 + k*sin(x - y)"))
    assert sorted(np.abs(row).tolist() for row in common) == [counter, [1.0, 1.0, 0.0, 0.0, 0.0]]
    assert len(found(pair("0"))) == 3
    assert found(pair("k*x**2/2 + l*y**4")).tolist() == [counter]
    assert found(pair("k*(x - y)**2/2 + sin(x)")).tolist() == [counter]
    assert found(pair("k*(x - l*y)**2/2")).tolist() == [counter]  # not for every l
    jump = {"back": ss.Jump("x - 1", {"walked": "0", "d_x": "-d_x"})}
    assert found(pair("k*x**2 + y**2", jumps=jump)).tolist() == []
    assert found(pair("k*(x - y)**2", jumps={"on": ss.Jump("walked - 1", {"y": "y/2"})})).size == 0


def test_what_moves_on_evenly_does_not_rest() -> None:
    carried = ss.System(
        "carried",
        coordinates={f"x{i}": ss.Inertial() for i in range(3)},
        kinetic="(d_x0**2 + d_x1**2 + d_x2**2)/2",
        potential="(x0 + x1 + x2)**2",
        contacts={
            f"c{i}": ss.Contact(f"d_x{i}", 1.0, speed, kinetic="0.4 + 0.6*exp(-speed)")
            for i, speed in enumerate((-1.0, 0.5, 0.5))
        },
    )
    with pytest.raises(ConvergenceError, match=r"becomes steady.*x0 at speed -1, x1 at.* 0\.5"):
        ss.find_cycle(carried)
    free = replace(carried, contacts={})
    with pytest.raises(ConvergenceError, match="form a continuous family, apart from translations"):
        ss.find_cycle(free, {"x0": 0.4, "d_x1": 0.3})


def test_half_a_cell_along_both_axes() -> None:
    """cos(2πx)·cos(2πy) is the same half a cell further along both: what repeats with that, has
    settled in a map as it has for a cycle."""
    tip = ss.System(
        "tip on a square lattice",
        parameters={"V": ss.Parameter(0.1), "q": ss.Parameter(0.0)},
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="-cos(2*pi*x)*cos(2*pi*y)/10 + ((x - V*t)**2 + (y - V*t*q)**2)/2",
        viscous="(d_x**2 + d_y**2)/2",
        span=(0.0, 200.0),
    )
    slopes = [0.0, 0.2, 1.0 / 3.0, 0.5, 1.0]
    found = ss.sweep(tip, {"V": [0.02, 2.0], "q": slopes}, ["period"])
    assert found.certificate.ok
    for V in (0.02, 2.0):
        for q in slopes:
            cycle = ss.find_cycle(tip, parameters={"V": V, "q": q})
            period = float(found["period"].sel(V=V, q=q))
            assert period == pytest.approx(cycle.period, rel=1e-12)
