"""Where motions may start, and what is said where they may not."""

from __future__ import annotations

import math
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss

ANGLE = 0.15


def wire(friction: float = 0.2) -> ss.System:
    """A bead on a straight wire, pressed down by a spring: friction does not change its normal
    force, so that there is an acceleration in every state."""
    return ss.System(
        "wire",
        parameters={"mu": ss.Parameter(friction), "slope": ss.Parameter(math.tan(ANGLE))},
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="5*y**2 + 50*y - 3*x",
        contacts={
            "face": ss.Bilateral(
                "y - x*slope", f"{math.cos(ANGLE)}*d_x + {math.sin(ANGLE)}*d_y", mu="mu"
            )
        },
        span=(0.0, 1.0),
    )


@pytest.mark.parametrize("seed", range(8))
def test_a_constraint_that_is_missed_by_rounding(seed: int) -> None:
    """A start that is typed with ten digits is put onto the constraint; one that misses by more is
    told by how much."""
    rng = np.random.default_rng(seed)
    x = float(rng.uniform(0.05, 5.0)) * 10.0 ** rng.integers(-6, 6)
    y = x * math.tan(ANGLE)
    for off in (0.0, *(10.0 ** rng.uniform(-16.0, -10.5, 4) * rng.choice([-1.0, 1.0], 4))):
        motion = ss.simulate(wire(), initial={"x": x, "y": y + off * y})
        assert motion.outcome.ok, motion.message
        assert motion.certificate.ok
        assert abs(motion["y"][0] - motion["x"][0] * math.tan(ANGLE)) <= 4e-16 * y
        assert motion["y"][0] == pytest.approx(y, rel=2 * abs(off) + 1e-15)
    for off in (-1e-3, 1e-6, 1e-8):
        with pytest.raises(ss.DeclarationError, match=r"face.*violated by") as told:
            ss.simulate(wire(), initial={"x": x, "y": y + off * y})
        said = float(str(told.value).partition("violated by ")[2].split()[0])
        assert said == pytest.approx(abs(off * y), rel=1e-4)


@pytest.mark.parametrize("height", [-0.1, -1e-6, -1e-9])
def test_an_overlap_is_no_paradox(height: float) -> None:
    ball = ss.catalogue.bouncing_ball()
    with pytest.raises(ss.DeclarationError, match=rf"gap: the gap is {height:g} .* overlap"):
        ss.simulate(ball, initial={"y": height})
    many = ss.simulate_many(ball, initial={"y": [0.5, height]})
    assert [o.label for o in many.counts if not o.ok] == ["no admissible mode"]


def test_an_overlap_by_rounding_is_none() -> None:
    motion = ss.simulate(ss.catalogue.bouncing_ball(), initial={"y": -1e-16})
    assert motion.outcome.ok and motion.certificate.ok


@pytest.mark.parametrize("far", [False, True])
def test_an_unstable_start_is_told_with_a_contact_far_away(far: bool) -> None:
    wall = {"wall": ss.Unilateral("x + 50")} if far else {}
    system = ss.System(
        "slider beside a wall",
        coordinates={"x": ss.Inertial(), "p": ss.RateIndependent()},
        kinetic="d_x**2/2",
        potential="(p - x)**2/2 + x**2/2 + p**2/2",
        contacts={"pad": ss.Contact("d_p", 0.5), **wall},
        initial={"x": 1.0},
        span=(0.0, 1.0),
    )
    with pytest.raises(
        ss.DeclarationError, match=r"initial\.p: .* exceeds its threshold 0\.5 by 0\.5"
    ):
        ss.simulate(system)


def test_a_refused_start_names_the_nearest_consistent_state() -> None:
    """A start off its constraint by more than rounding is refused, by how much, and the state that
    the message offers instead is accepted."""
    system = ss.System(
        "wedge",
        coordinates={"x": ss.Inertial("m"), "y": ss.Inertial("m")},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="500*y**2 + 50*y",
        contacts={"face": ss.Bilateral("y - 0.2*x", "d_x + 0.2*d_y", mu=0.2)},
        span=(0, 1),
    )
    with pytest.raises(ss.DeclarationError) as caught:
        ss.simulate(system, initial={"x": 0.5, "y": 0.1 - 1e-4})
    assert "violated by 0.0001" in str(caught.value)
    offered = dict(re.findall(r"([xy]) = (\S+?)(?:,|$)", str(caught.value)))
    start = {name: float(value) for name, value in offered.items()}
    assert math.hypot(start["x"] - 0.5, start["y"] - 0.1) < 1.01e-4
    assert ss.simulate(system, initial=start).certificate.ok


IN_PLANE = {"direction": ("d_x", "d_y")}
ONE_SIDED = {
    "forward": ("piecewise(d_y > 0, sqrt(d_y), 0)", IN_PLANE),
    "backward": ("piecewise(d_y < 0, sqrt(-d_y), 0)", IN_PLANE),
    "overflow": ("piecewise(d_y > 0, exp(-9e3*d_y), 0)", IN_PLANE),
    "disc": ("0", {"direction": ("d_x", "d_y", "d_a"), "dissipation": "disc(v1, v2, v3)"}),
    "ring": ("0", {"direction": ("d_x", "d_y", "d_a"), "dissipation": "ring(v1, v2, v3)"}),
}


@pytest.mark.parametrize("beside", ["", "d_x + 0.1*d_y", "d_a + 0.1*d_x"])
@pytest.mark.parametrize("kind", ONE_SIDED)
def test_what_moves_starts_as_given(kind: str, beside: str) -> None:
    """A formula may have no value on the side of its kink that is tried first: what moves does not
    rest for that."""
    force, rub = ONE_SIDED[kind]
    line = {"line": ss.Contact(beside, 0.2)} if beside else {}
    system = ss.System(
        "thrown",
        coordinates={"x": ss.Inertial(force=force), "y": ss.Inertial(), "a": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2 + d_a**2)/2",
        contacts={"rub": ss.Contact(threshold=0.3, **rub), **line},
        span=(0.0, 0.3),
    )
    rng = np.random.default_rng(0)
    for _ in range(6):
        x, y, a = rng.choice([-1.0, 1.0], 3) * rng.uniform(0.2, 1.5, 3)
        rates = {"d_x": float(x), "d_y": float(y), "d_a": float(a)}
        motion = ss.simulate(system, initial=rates)
        assert motion.outcome.ok and motion.certificate.ok
        assert {name: motion[name][0] for name in rates} == rates


@pytest.mark.parametrize("name", ["forced_oscillator", "belt_block", "bouncing_ball", "coin"])
@pytest.mark.parametrize("by", [1e-3, 1e-6, None])
def test_the_certificate_compares_the_start(
    name: str, by: float | None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A motion that begins elsewhere than asked obeys every law, and is not certified, nor is it
    when it has been stored."""
    loop = import_module("stickslip.motion.simulate")
    honest = loop.run_loop

    def moved(problem: Any, start: float, end: float, y: Any, *rest: Any) -> Any:
        elsewhere = np.zeros_like(y) if by is None else y * (1.0 + by) + by
        return honest(problem, start, end, elsewhere, *rest)

    system = ss.catalogue.get(name)
    rates = {rate: 0.7 for rate in system.declaration.state if rate.startswith("d_")}
    at = {"initial": rates, "t_span": (0.0, 1.0)}
    assert ss.simulate(system, **at).certificate.ok
    monkeypatch.setattr(loop, "run_loop", moved)
    motion = ss.simulate(system, **at)
    wrong = motion.certificate
    assert not wrong.ok and "initial state" in wrong.verdict
    assert wrong["initial state"].value > (by or 1.0) / 10.0
    assert max(r.value for r in wrong.residuals if r.name != "initial state") < 1e-9
    motion.save(tmp_path / "wrong.nc")
    assert ss.open(tmp_path / "wrong.nc").certificate.verdict == wrong.verdict
