"""Catalogues of slip events: one block in closed form, two blocks as the union of what each
does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from typer.testing import CliRunner

import stickslip as ss
from figures.boxes import misread
from stickslip.cli.app import app
from stickslip.errors import DeclarationError
from stickslip.results import Completion

F_S, F_K, V = 1.0, 0.6, 0.1


def on_a_belt(*stiffness: float, speed: str = "V", start: float = 0.0) -> ss.System:
    """Blocks of mass 1 that know nothing of each other, each held by a spring."""
    numbers = range(1, len(stiffness) + 1)
    return ss.System(
        "blocks",
        parameters={"V": ss.Parameter(V, "m/s")},
        coordinates={f"x_{i}": ss.Inertial(unit="m") for i in numbers},
        kinetic=" + ".join(f"d_x_{i}**2/2" for i in numbers),
        potential=" + ".join(f"{k!r}/2*x_{i}**2" for i, k in zip(numbers, stiffness, strict=True)),
        contacts={
            f"block {i}": ss.Contact(f"d_x_{i}", f"{F_S}", speed, kinetic=f"{F_K}") for i in numbers
        },
        initial={f"d_x_{i}": V for i in numbers},
        span=(start, start + 100.0),
        time_unit="s",
    )


def slips(k: float, until: float) -> tuple[np.ndarray, float, float, float]:
    """When a block begins to slip, for how long, how far, and what its spring loses: from F_S/k it
    swings about F_K/k until it is as fast as the belt again, at the mirrored place."""
    omega = np.sqrt(k)
    drop = (F_S - F_K) / k
    duration = 2.0 * (np.pi - np.arctan(drop * omega / V)) / omega
    way = 2.0 * drop + V * duration
    first = F_S / k / V
    starts = np.arange(first, until, duration + 2.0 * drop / V)
    ends = F_S / k, F_S / k - 2.0 * drop
    return starts, duration, way, k / 2.0 * (ends[0] ** 2 - ends[1] ** 2)


@pytest.mark.parametrize("start", [0.0, 1e6])
def test_one_block(start: float) -> None:
    motion = ss.simulate(on_a_belt(1.0, start=start))
    found = motion.event_catalogue()
    starts, duration, way, drop = slips(1.0, 100.0)
    starts = starts[starts + duration < 100.0]
    assert len(found) == len(starts) > 5
    table = found.table
    np.testing.assert_allclose(table["start"] - start, starts, rtol=1e-9, atol=1e-9 + 1e-15 * start)
    np.testing.assert_allclose(table["duration"], duration, rtol=1e-9)
    np.testing.assert_allclose(table["size"], way, rtol=1e-9)
    np.testing.assert_allclose(table["largest_slip"], way, rtol=1e-9)
    np.testing.assert_allclose(table["energy_released"], F_K * way, rtol=1e-9)
    np.testing.assert_allclose(table["energy_drop"], drop, rtol=1e-8)
    rounding = 1e-15 * start
    np.testing.assert_allclose(
        table["interevent"][1:], duration + 2.0 * (F_S - F_K) / V, rtol=1e-9, atol=rounding
    )
    assert np.isnan(table["interevent"][0])
    assert set(table["contacts"]) == {1} and set(table["first"]) == {"block 1"}
    assert found.certificate.ok and found.outcome is Completion.FINISHED
    assert found["size"].attrs["units"] == "m" and found["duration"].attrs["units"] == "s"


def test_two_blocks() -> None:
    """What overlaps in time is one event, of both."""
    stiffness = (1.0, 1.7)
    found = ss.simulate(on_a_belt(*stiffness)).event_catalogue(energy=False).table
    every = sorted(
        (start, start + duration, way, i)
        for i, (starts, duration, way, _) in enumerate(slips(k, 200.0) for k in stiffness)
        for start in starts
    )
    expected = list[list[tuple[float, float, float, int]]]()
    for one in every:
        if expected and one[0] < max(end for _, end, _, _ in expected[-1]):
            expected[-1].append(one)
        else:
            expected.append([one])
    expected = [event for event in expected if max(end for _, end, _, _ in event) < 100.0]
    assert len(found) == len(expected) > 5
    for row, event in zip(found.to_dict("records"), expected, strict=True):
        assert row["start"] == pytest.approx(event[0][0], rel=1e-9)
        end = max(end for _, end, _, _ in event)
        assert row["duration"] == pytest.approx(end - event[0][0], rel=1e-9)
        assert row["size"] == pytest.approx(sum(way for _, _, way, _ in event), rel=1e-9)
        assert row["contacts"] == len({i for *_, i in event})
        assert row["first"] == f"block {event[0][3] + 1}"
        assert np.isnan(row["energy_released"])
    assert {1, 2} <= set(found["contacts"])


def test_a_belt_that_changes_its_speed() -> None:
    """The slip is the integral of the relative velocity."""
    motion = ss.simulate(on_a_belt(1.0, speed="V*(1 + 0.5*sin(2*t))"))
    for row in motion.event_catalogue(energy=False).table.to_dict("records"):

        def speed(t: float) -> float:
            return motion.at(t)["slip_speed_block_1"]

        end = row["start"] + row["duration"]
        way = quad(speed, row["start"], end, epsrel=1e-10, limit=100)[0]
        assert row["size"] == pytest.approx(abs(way), rel=1e-8)


def test_pieces() -> None:
    """A motion that goes on from a stick phase is one catalogue with the first part."""
    system = on_a_belt(1.0, 1.7)
    whole = ss.simulate(system).event_catalogue()
    quiet = float(whole["start"][2]) - 0.1
    first = ss.simulate(system, (0.0, quiet))
    second = ss.simulate(system, (quiet, 100.0), initial=first.final)
    pieces = [first.event_catalogue(), second.event_catalogue()]
    joined = ss.EventCatalogue.joined(pieces)
    assert joined.span == (0.0, 100.0) and joined.certificate.ok
    for name in ("start", "duration", "interevent", "size", "energy_released"):
        np.testing.assert_allclose(joined[name], whole[name], rtol=1e-7, atol=1e-9)
    # Pieces of a number of switches: each goes back to the end of the last event of the one before.
    quiet = float((joined["start"] + joined["duration"])[3])
    first = ss.simulate(system, (0.0, quiet + 3.0)).event_catalogue()
    state = {x: float(v) for x, v in ss.simulate(system, (0.0, quiet)).final.items()}
    second = ss.simulate(system, (quiet, 100.0), initial=state).event_catalogue()
    again = ss.EventCatalogue.joined([first, second])
    assert len(again) == len(whole)
    for wrong, said in ((pieces[::-1], "before the end"), ([], "no catalogue was given")):
        with pytest.raises(DeclarationError, match=said):
            ss.EventCatalogue.joined(wrong)
    other = ss.simulate(system, (200.0, 210.0), parameters={"V": 0.2}).event_catalogue()
    with pytest.raises(DeclarationError, match="different systems"):
        ss.EventCatalogue.joined([pieces[0], other])


def test_nothing_slips(tmp_path: Path) -> None:
    """No event is no error; what has begun before, or goes on at the end, is none."""
    motion = ss.simulate(on_a_belt(1.0), (0.0, 12.0))
    found = motion.event_catalogue()
    assert len(found) == 0 and found.outcome is Completion.NOTHING_FOUND
    assert "no slip begins and ends" in found.message
    assert found.plot().axes
    found.save(tmp_path / "none.nc")
    assert len(ss.open(tmp_path / "none.nc")) == 0
    during = ss.simulate(on_a_belt(1.0), (0.0, 30.0), initial={"d_x_1": 0.0}).event_catalogue()
    assert during["start"].values[0] > 5.0
    free = ss.System("free", coordinates={"x": ss.Inertial()}, kinetic="d_x**2/2")
    with pytest.raises(DeclarationError, match="no dry contacts"):
        ss.simulate(free, (0.0, 1.0)).event_catalogue()


def test_what_is_faster_than_a_rate_is_an_event() -> None:
    """x = cos t, y = 3 sin(t/2): each is an event of its own until they overlap."""
    system = ss.System(
        "two oscillators",
        coordinates={"x": ss.Inertial("m"), "y": ss.Inertial("m")},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="x**2/2 + y**2/8",
        initial={"x": 1.0},
        span=(0, 20),
        time_unit="s",
    )
    motion = ss.simulate(system)
    events = motion.event_catalogue(faster_than=0.5)
    begins = np.pi * (np.arange(6) + 1 / 6)
    np.testing.assert_allclose(events["start"], begins, rtol=1e-13)
    np.testing.assert_allclose(events["duration"], 2 * np.pi / 3, rtol=1e-12)
    np.testing.assert_allclose(events["size"], np.sqrt(3), rtol=1e-12)
    np.testing.assert_allclose(events["largest_rate"], 1.0, rtol=1e-3)
    assert set(events["first"].values) == {"x"} and set(events["contacts"].values) == {1}
    assert events["size"].attrs["units"] == "m" and events["largest_rate"].attrs["units"] == "m/s"
    assert "while a rate is above 0.5 m/s" in str(events.summary())
    both = ss.simulate(system, (0.0, 10.0), initial={"x": 1.0, "d_y": 0.51})
    assert set(both.event_catalogue(faster_than=0.5)["contacts"].values) <= {1, 2}


def test_earthquakes_of_rate_and_state_friction(tmp_path: Path) -> None:
    """The rate is that of the limit where an event begins and ends; stored and read again."""
    motion = ss.simulate(ss.catalogue.rate_and_state_slider())
    events = motion.event_catalogue(faster_than=1e-3)
    assert len(events) == 3 and events.certificate.ok
    ends = events["start"].values + events["duration"].values
    for times in (events["start"].values, ends):
        np.testing.assert_allclose(np.abs(motion.at(times)["d_x"]), 1e-3, rtol=1e-4)
    events.save(tmp_path / "events.nc")
    assert ss.open(tmp_path / "events.nc").dataset.identical(events.dataset)
    for wrong in (0.0, -1.0, np.inf):
        with pytest.raises(DeclarationError, match="faster_than"):
            motion.event_catalogue(faster_than=wrong)


def test_no_crest_is_missed_wherever_steps_begin() -> None:
    """x = cos(t + φ) for twenty phases: extrema may lie between the first two samples of a step."""
    for phase in np.linspace(0.1, 6.1, 20):
        system = ss.System(
            "oscillator",
            coordinates={"x": ss.Inertial()},
            kinetic="d_x**2/2",
            potential="x**2/2",
            initial={"x": np.cos(phase), "d_x": -np.sin(phase)},
            span=(0, 100),
        )
        motion = ss.simulate(system)
        crests = 2 * np.pi * np.arange(1, 17) - phase
        crests = crests[crests < 99.9]
        events = motion.event_catalogue(above={"x": 1.0 - 1e-8})
        middle = events["start"] + 0.5 * events["duration"]
        np.testing.assert_allclose(middle, crests, rtol=0, atol=1e-7)
        np.testing.assert_allclose(events["largest_rate"], 1.0, rtol=1e-12)


def test_a_value_before_a_jump_counts() -> None:
    """The static force at the end of a stick is the largest one."""
    motion = ss.simulate(ss.catalogue.belt_block(), (0.0, 60.0))
    events = motion.event_catalogue(above={"friction_belt_contact": 0.6})
    assert len(events) > 3
    np.testing.assert_allclose(events["largest_rate"], 1.0, rtol=1e-9)


def test_what_is_above_a_level_is_an_event(tmp_path: Path) -> None:
    """x = cos t: the time, the integral and the largest value of each crest above 1/2."""
    system = ss.System(
        "oscillator",
        coordinates={"x": ss.Inertial("m")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        outputs={"pull": ss.Output("2*x", "N", "pull of the spring")},
        initial={"x": 0.0, "d_x": 1.0},
        span=(0, 20),
        time_unit="s",
    )
    motion = ss.simulate(system)  # x = sin t
    for what, factor, unit in (("pull", 2.0, "N*s"), ("x", 1.0, "m*s"), ("x**3", 1.0, "m^3*s")):
        power = 3 if what == "x**3" else 1
        events = motion.event_catalogue(above={what: factor * 0.5**power})
        np.testing.assert_allclose(
            events["start"], np.pi / 6 + 2 * np.pi * np.arange(3), rtol=1e-12
        )
        np.testing.assert_allclose(events["duration"], 2 * np.pi / 3, rtol=1e-12)
        exact = np.sqrt(3) if power == 1 else np.sqrt(3) - np.sqrt(3) / 4
        np.testing.assert_allclose(events["size"], factor * exact, rtol=1e-12)
        np.testing.assert_allclose(events["largest_rate"], factor, rtol=1e-13)
        assert events["size"].attrs["units"] == unit
    # A crest that is above its level between two samples only, and one dip below it.
    for below in (1e-6, 1e-9, 1e-12):
        crests = motion.event_catalogue(above={"x": 1.0 - below})
        half = np.arccos(1.0 - below)
        starts = np.pi / 2 - half + 2 * np.pi * np.arange(3)
        np.testing.assert_allclose(crests["start"], starts, rtol=0, atol=1e-14 / half)
        np.testing.assert_allclose(crests["duration"], 2 * half, rtol=1e-14 / half**2)
        dips = motion.event_catalogue(above={"-x": below - 1.0})
        assert len(dips) == 2  # between the crests, which interrupt it
        np.testing.assert_allclose(dips["start"], starts[:2] + 2 * half, rtol=0, atol=1e-14 / half)
    assert len(motion.event_catalogue(above={"x": 1.0 + 1e-12})) == 0
    # The union of two quantities ends briefly where one falls as the other rises.
    for level in (1e-9, 1e-3, 0.1):
        both = motion.event_catalogue(above={"x": level, "-x": level})
        assert len(both) == 6
        np.testing.assert_allclose(both["start"][1:], np.pi * np.arange(1, 6) + np.arcsin(level))
    # Where a formula is not defined it is not above its level.
    halves = motion.event_catalogue(above={"sqrt(x)": 0.5, "-x": 0.5})
    assert halves["first"].values.tolist() == ["sqrt(x)", "-x"] * 3
    np.testing.assert_allclose(halves["largest_rate"], 1.0, rtol=1e-13)
    events = motion.event_catalogue(above={"pull": 1.0, "d_x": 0.97})
    assert set(events["first"].values) == {"pull", "d_x"} and set(events["contacts"].values) == {1}
    assert "while pull > 1 N or d_x > 0.97 m/s" in str(events.summary())
    events.save(tmp_path / "events.nc")
    assert ss.open(tmp_path / "events.nc").dataset.identical(events.dataset)
    wrongs: list[tuple[dict[str, Any], str]] = [
        ({}, "no quantity"),
        ({"pul": 1.0}, "pull"),
        ({"x": np.nan}, "not a finite number"),
        ({"x": "1"}, "not a finite number"),
    ]
    for wrong, reason in wrongs:
        with pytest.raises(DeclarationError, match=reason):
            motion.event_catalogue(above=wrong)
    with pytest.raises(DeclarationError, match="not both"):
        motion.event_catalogue(above={"x": 0.0}, faster_than=1.0)


def test_exponent_of_the_gutenberg_richter_law() -> None:
    """Of sizes with density ∝ size^(−1 − β), b is 3β/2."""
    events = ss.simulate(on_a_belt(1.0, 1.7, 2.9), (0.0, 500.0)).event_catalogue(energy=False)
    uniform = (np.arange(len(events)) + 0.5) / len(events)
    drawn = events.dataset.assign(size=("event", 2.0 * uniform ** (-1 / 0.6)))
    catalogue = replace(events, dataset=drawn)
    b, error = catalogue.b_value(2.0)
    assert b == pytest.approx(0.9, rel=0.05)
    assert error == pytest.approx(b / np.sqrt(len(events)))
    with pytest.raises(DeclarationError, match="least"):
        catalogue.b_value(1e9)


def test_picture() -> None:
    """Sizes over time and their sum, how many are as large with the law of the b-value, a Poisson
    process beside many times, and the time after an event."""
    few = ss.simulate(on_a_belt(1.0)).event_catalogue(energy=False)
    over_time, sizes, times, total, after = few.plot().axes
    assert len(np.asarray(sizes.get_lines()[0].get_xydata())) == len(few)
    assert len(times.get_lines()) == 1
    assert over_time.get_xlim() == few.span
    steps = total.patches[0].get_data()  # type: ignore[attr-defined]
    np.testing.assert_allclose(np.diff(steps.values), few["size"], rtol=1e-12)
    np.testing.assert_array_equal(steps.edges[1:-1], few["start"])
    points = np.asarray(after.get_lines()[0].get_xydata())
    np.testing.assert_array_equal(points[:, 1], few["interevent"][1:])
    assert misread(few.plot()) == []
    many = ss.simulate(on_a_belt(1.0, 1.7, 2.9), (0.0, 500.0)).event_catalogue(energy=False)
    figure = many.plot()
    assert [len(axes.get_lines()) for axes in figure.axes] == [1, 2, 2, 0, 1]
    assert misread(figure) == []
    none = replace(few, dataset=few.dataset.isel(event=slice(0, 0)))
    (empty,) = none.plot().axes
    assert [text.get_text() for text in empty.texts] == ["no events"]


def test_the_law_in_the_picture_is_that_of_large_events() -> None:
    """Small events are missing, as in every catalogue; the line is that of the others."""
    rng = np.random.default_rng(3)
    events = ss.simulate(on_a_belt(1.0), (0.0, 4000.0)).event_catalogue(energy=False)
    sizes = 2.0 * rng.uniform(size=len(events)) ** (-1 / 0.6)
    sizes[:: len(events) // 40] = rng.uniform(0.01, 2.0, len(sizes[:: len(events) // 40]))
    catalogue = replace(events, dataset=events.dataset.assign(size=events["size"].copy(data=sizes)))
    law = catalogue.plot().axes[1].get_lines()[1]
    x, y = (np.asarray(v, float) for v in law.get_data())
    assert 1.9 < x[0] < 3.0
    assert -1.5 * np.diff(np.log(y)) / np.diff(np.log(x)) == pytest.approx(0.9, rel=0.2)


def test_recurrence() -> None:
    """0 where events are regular; that of exponential times is 1."""
    regular = ss.simulate(on_a_belt(1.0)).event_catalogue(energy=False)
    mean, variation = regular.recurrence()
    assert mean == pytest.approx(float(np.nanmean(regular["interevent"])))
    assert variation == pytest.approx(0.0, abs=1e-8)
    assert ("recurrence", "coefficient of variation") in {
        (name, text[:24]) for name, text in regular.rows()
    }
    with pytest.raises(DeclarationError, match="recurrence"):
        replace(regular, dataset=regular.dataset.isel(event=slice(0, 2))).recurrence()
    times = np.random.default_rng(1).exponential(size=20_000)
    poisson = regular.dataset.isel(event=np.zeros(len(times), int))
    poisson = poisson.assign(interevent=("event", times))
    assert replace(regular, dataset=poisson).recurrence()[1] == pytest.approx(1.0, abs=0.03)


def test_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke
    assert run(app, ["run", "belt_block", "--until", "60"]).exit_code == 0
    listed = run(app, ["events", "out/belt_block/trajectory.nc"])
    assert listed.exit_code == 0, listed.output
    assert "events" in listed.output and "energy released" in listed.output
    folder = tmp_path / "out" / "belt_block-events"
    names = {"catalogue.nc", "catalogue.csv", "summary.json", "overview.png"}
    assert {path.name for path in folder.iterdir()} == names
    assert len(ss.open(folder / "catalogue.nc")) == 8
    fast = run(
        app, ["events", "out/belt_block/trajectory.nc", "--faster-than", "0.31", "--out", "fast"]
    )
    assert fast.exit_code == 0 and "while a rate is above 0.31 m/s" in fast.output
    above = ["--above", "d_x=0.29", "--out", "above"]
    listed = run(app, ["events", "out/belt_block/trajectory.nc", *above])
    assert "while d_x > 0.29" in " ".join(listed.output.split())
    for wrong, reason in (("d_y=1", "unknown quantity"), ("d_x=fast", "not a number")):
        refused = run(app, ["events", "out/belt_block/trajectory.nc", "--above", wrong])
        assert refused.exit_code == 2 and reason in refused.output
    again = run(app, ["events", str(folder / "catalogue.nc")])
    assert again.exit_code == 2 and "not a motion" in again.output
