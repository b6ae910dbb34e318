"""Bodies on points: a few random motions against smoothed friction, and that against closed
forms. The long run is ``python -m tests.adversarial --only points``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adversarial.families.points import FAMILIES, Carried, Point, Shape
from adversarial.kinds import points
from adversarial.kinds.points import draw
from adversarial.references.smoothed import LAWS, limit, smoothed
from adversarial.verdict import AGREED, NO_REFERENCE, REFUSED, WRONG

CHOSEN = [
    ("thrown body", 0),
    ("regular body", 0),
    ("points on a line", 0),
    ("points that hold more at rest", 0),
    ("points that slip more easily when fast", 0),
    ("body on a table", 0),
    ("thresholds in time", 0),
    ("off centre", 0),
    ("points and lines", 10),
    ("slow loads", 0),
    ("on three legs", 1),
    ("on three legs", 3),
    ("on three legs", 9),
    ("units", 0),
    # All begin to slip a little late, by what rest is proved to.
    ("points on a line", 7),
    ("points on a line", 46),
    ("points that slip more easily when fast", 13),
    ("shaken body", 23),
    ("ellipses", 27),
    ("off centre", 23),
    ("points and lines", 50),
    ("units", 6),
    # What rests turns.
    ("points on a line", 35),
    ("body on a table", 7),
    ("body on a body", 26),
]


@pytest.mark.parametrize(("family", "seed"), CHOSEN)
def test_motion(family: str, seed: int) -> None:
    case = draw(family, seed)
    verdict = points.judge(case)
    assert verdict.kind == AGREED, f"{verdict}\n{case.source()}"


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        ("points on a line", 14),
        ("points on a line", 35),
        ("body on a table", 2),
        ("body on a table", 7),
        ("thresholds in time", 14),
        ("thresholds in time", 33),
        ("body on a body", 8),
        ("body on a body", 11),
        ("body on a body", 26),
        ("body on a body", 36),
    ],
)
def test_what_rests_while_it_turns(family: str, seed: int) -> None:
    """Directions turn, forces are not unique, and the least are too large; what then begins to slip
    moves on a body that turns. Motions end, are certified, and obey the law."""
    case = draw(family, seed)
    found = points.simulated(case)
    assert not isinstance(found, str), found
    assert found.outcome.ok, f"{found.message}\n{case.source()}"
    assert found.certificate.ok, f"{found.certificate.verdict}\n{case.source()}"
    assert points.lawless(case, found)[0] == ""


def test_families() -> None:
    for name, make in FAMILIES.items():
        assert make.__doc__
        one, same, other = draw(name, 3), draw(name, 3), draw(name, 4)
        assert one == same
        assert one.numbers != other.numbers
        assert "ss.simulate(" in points.reproduction(one)
    assert [c.family for c in points.cases(0, len(FAMILIES))] == list(FAMILIES)


def test_a_wrong_motion_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = draw("thrown body", 0)
    simulated = points.simulated

    def stronger(by: float) -> None:
        numbers = {**case.numbers, "s0": case.numbers["s0"] * by}
        monkeypatch.setattr(points, "simulated", lambda c: simulated(replace(c, numbers=numbers)))

    stronger(1 + 1e-5)
    assert points.judge(case).kind == WRONG
    stronger(1 + 1e-13)
    assert points.judge(case).kind == AGREED
    stronger(np.nan)
    assert points.judge(case).kind == REFUSED


@pytest.mark.parametrize(
    ("family", "seed", "time"),
    [("units", 26, 3.8), ("pressed points", 21, 0.2)],
    ids=["passes close to rest", "all break their thresholds"],
)
def test_static_friction_has_no_part_in_what_slips(family: str, seed: int, time: float) -> None:
    """A point passes with 7e-9 of the natural speed, and more force than kinetic friction holds.
    And of three points that break their thresholds at the start one could go on to rest."""
    case = draw(family, seed)
    found = points.simulated(case)
    assert not isinstance(found, str)
    kinetic = replace(LAWS[0], left=np.zeros_like)
    board, start = case.board(), points.started(case)
    expected = smoothed(board, start, np.array([time]), kinetic, 1e-10)[0]
    sampled = found.at(time * case.time)
    got = [float(np.asarray(sampled[x])) / case.unit(x) for x in case.names]
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize(("family", "seed"), [("pressed points", 21), ("units", 26)])
def test_what_static_friction_alone_stops_is_not_judged(family: str, seed: int) -> None:
    verdict = points.judge(draw(family, seed))
    assert verdict.kind == NO_REFERENCE
    assert verdict.numbers["doubt"] == np.inf


# -- the reference ---------------------------------------------------------------------------------


def body(places: list[complex], **given: float) -> Carried:
    """A body of unit mass and moment of inertia 1/3, on points that hold 1 together."""
    n = {f"{w}{i}": 0.0 for w in ("F", "G", "om", "ph", "K", "C") for i in range(3)}
    for k, z in enumerate(places):
        n |= {f"px{k}": z.real, f"py{k}": z.imag, f"s{k}": 1.0 / len(places)}
    shape = Shape((Point(),) * len(places))
    return Carried(shape, n | {"m0": 1.0, "I0": 1.0 / 3.0} | given, {}, 2.0)


@pytest.mark.parametrize("count", [1, 2, 4])
def test_the_reference_knows_a_body_that_does_not_turn(count: int) -> None:
    """It stops after v²/2s."""
    places = [complex(np.exp(2j * np.pi * k / count)) for k in range(count)]
    case = body(places if count > 1 else [0j])
    found = limit(case.board(), np.array([0.0, 0.0, 0.0, 0.6, 0.8, 0.0]), np.array([2.0]))
    np.testing.assert_allclose(found.states[0, :3], [0.3, 0.4, 0.0], rtol=0, atol=1e-9)
    assert np.max(found.doubt) < 1e-7


def test_the_reference_knows_a_rod_that_turns() -> None:
    """About its middle, with the moment 1 against it: ω² I/2."""
    case = body([1 + 0j, -1 + 0j])
    found = limit(case.board(), np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), np.array([1.0]))
    np.testing.assert_allclose(found.states[0, :3], [0.0, 0.0, 1.0 / 6.0], rtol=0, atol=1e-9)


def test_the_reference_knows_a_rod_that_rests() -> None:
    """Under a side force that is almost what is held, and a moment."""
    case = body([1 + 0j, -1 + 0j], G1=0.9, G2=0.05)
    found = limit(case.board(), np.zeros(6), np.array([2.0]))
    assert np.max(np.abs(found.states)) < 1e-7


@pytest.mark.parametrize(
    ("load", "aside", "sure"),
    [(0.5, 2e-5, True), (0.8, 0.0, True), (0.8, 2e-5, False)],
    ids=["held", "straight into rest", "beside it"],
)
def test_the_reference_doubts_a_point_that_passes_close_to_rest(
    load: float, aside: float, sure: bool
) -> None:
    """Kinetic friction holds 0.6: against a load of 0.8 a point comes to rest only where it goes
    straight there; beside that, in a distance of the order of 1e-8."""
    case = body([0j], G0=load, d0=0.6)
    case = replace(case, shape=Shape((Point(law="drop"),)))
    start = np.array([0.0, 0.0, 0.0, -0.5, aside, 0.0])
    doubt = np.max(limit(case.board(), start, np.array([0.3, 1.0])).doubt, axis=1)
    assert doubt[0] < 1e-7
    assert doubt[1] < 1e-7 if sure else doubt[1] == np.inf
