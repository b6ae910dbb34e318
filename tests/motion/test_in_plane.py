"""What is said of contacts in a plane: by the name that was declared, once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.model.quantities import quantity
from stickslip.model.system_file import loads
from stickslip.motion.problem import pose
from stickslip.motion.steps.starting import secular_root

NAMES = ["puck", "turntable", "conveyor", "isolated_floor", "planar_jenkins", "tractrix"]


def test_events_and_switches_have_one_row_a_contact() -> None:
    motion = ss.simulate(ss.catalogue.turntable(), (0, 3))
    assert motion.events["contact"].unique().tolist() == ["disc"]
    assert motion.events["from"].tolist()[:2] == ["stick", "slip"]
    assert motion.events["to"].tolist()[:2] == ["slip", "stick"]
    assert motion.n_switches == len(motion.events) == 4


def test_the_dataset_has_components_of_vectors_and_one_mode() -> None:
    motion = ss.simulate(ss.catalogue.turntable(), (0, 3))
    own = {name for name in motion.dataset if "disc" in str(name)}
    vectors = ("friction", "slip_speed", "threshold")
    assert own == {f"{what}_disc_{i}" for what in vectors for i in (1, 2)} | {"mode_disc"}
    mode = motion["mode_disc"]
    assert mode.attrs["flag_values"].tolist() == [0, 1]
    assert mode.attrs["flag_meanings"] == "stick slip"
    force = np.hypot(motion["friction_disc_1"], motion["friction_disc_2"])
    assert np.all(force <= 0.3 * 0.1 * 9.81 * (1 + 1e-12))
    assert np.asarray(force)[np.asarray(mode) == 1] == pytest.approx(0.2 * 0.1 * 9.81)


def test_units_and_meanings() -> None:
    system = ss.catalogue.puck()
    assert quantity(system, "friction_table_2") == {
        "units": "N",
        "long_name": "friction force of table, component 2",
    }
    assert quantity(system, "slip_speed_table_1")["units"] == "m/s"
    assert quantity(system, "threshold_table_1")["long_name"].startswith("semi-axis of the forces")
    with pytest.raises(KeyError):
        quantity(system, "threshold_plus_table_1")


def test_half_axes_are_those_of_the_ellipse() -> None:
    system = ss.System(
        name="rolled",
        parameters={"a": ss.Parameter(0.5)},
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts={"table": ss.Contact(("d_x", "d_y"), 3.0, axes=(1, "a"))},
        initial={"d_x": 1.0, "d_y": 1.0},
        span=(0, 1),
    )
    last = ss.simulate(system).at(0.5)
    assert (last["threshold_table_1"], last["threshold_table_2"]) == pytest.approx((3.0, 1.5))


@pytest.mark.parametrize("name", NAMES)
def test_model_files_lose_nothing(name: str) -> None:
    system = ss.catalogue.get(name)
    assert loads(system.to_toml()) == system


def test_axes_and_surfaces_in_a_model_file() -> None:
    contact = ss.Contact(
        ("d_x + d_y", "d_y"), "1 + x**2", ("a*y", -0.1), kinetic="exp(-speed)", axes=("a", 2)
    )
    system = ss.System(
        name="all",
        parameters={"a": ss.Parameter(0.3)},
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts={"table": contact},
    )
    again = loads(system.to_toml())
    assert again == system
    assert again.contacts["table"] == contact


def test_a_motion_is_read_as_it_was_stored(tmp_path: Path) -> None:
    motion = ss.simulate(ss.catalogue.conveyor())
    motion.save(tmp_path / "motion.nc")
    again = ss.open(tmp_path / "motion.nc")
    assert isinstance(again, ss.Trajectory)
    assert again.events.equals(motion.events)
    assert again.dataset.identical(motion.dataset)
    assert again.certificate.ok


def test_a_slip_is_as_long_as_the_way_between_the_surfaces() -> None:
    """Of a block on a turntable against the velocity of the disc below it, by quadrature."""
    motion = ss.simulate(ss.catalogue.turntable(), (0, 3))
    events = motion.event_catalogue()
    assert events["first"].values.tolist() == ["disc", "disc"]
    for start, duration, size in zip(
        *(events[name].values for name in ("start", "duration", "size")), strict=True
    ):
        nodes, weights = np.polynomial.legendre.leggauss(40)
        # The velocity has a corner at the start, and no power series at the end.
        times = start + duration * (1 - (0.5 - 0.5 * nodes) ** 3)
        weights = weights * 1.5 * (0.5 - 0.5 * nodes) ** 2 * duration
        seen = motion.at(times)
        way = [np.sum(weights * seen[f"slip_speed_disc_{i}"]) for i in (1, 2)]
        assert size == pytest.approx(np.hypot(*way), rel=1e-8)
    assert events["contacts"].values.tolist() == [1, 1]


# -- what the audit sees ---------------------------------------------------------------------------


@pytest.mark.parametrize("unit", [1.0, 2.0**-40, 2.0**40])
def test_a_stick_beyond_its_threshold_is_seen_in_any_unit_of_force(unit: float) -> None:
    """The force of the block is 1, so that it may rest at a threshold of 1.2, but not of 0.99."""
    block = ss.System(
        "pulled",
        parameters={"s": ss.Parameter(1.2 * unit)},
        coordinates={
            "x": ss.Inertial(force=f"{unit!r}*cos(t)"),
            "y": ss.Inertial(force=f"{unit!r}*sin(t)"),
        },
        kinetic=f"{unit!r}*(d_x**2 + d_y**2)/2",
        contacts={"table": ss.Contact(("d_x", "d_y"), "s")},
        span=(0.0, 5.0),
    )
    rest = ss.simulate(block)
    assert rest.certificate.ok and rest.n_switches == 0
    problem = pose(block, {"s": 0.99 * unit})
    beyond = ss.Trajectory(problem, rest.t_span, rest.knots, rest.outcome).certificate
    assert not beyond.ok
    # (|λ|² − s²)/s, beside s
    assert beyond["friction law"].value == pytest.approx(1 / 0.99**2 - 1, rel=1e-6)


def test_what_lifts_off_is_called_open() -> None:
    """In events, and in what the numbers of a mode stand for."""
    system = ss.System(
        "lifted",
        coordinates={
            "x": ss.Inertial(force="1.5"),
            "z": ss.Inertial(),
            "y": ss.Inertial(force="t/2 - 4"),
        },
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2",
        contacts={"foot": ss.Unilateral("y", ("d_x", "d_z"), 0.4)},
        span=(0, 10),
    )
    motion = ss.simulate(system)
    assert motion.events["to"].tolist() == ["slip", "open"]
    said = motion.dataset["mode_foot"].attrs
    names = dict(zip(said["flag_values"].tolist(), said["flag_meanings"].split(), strict=True))
    assert names[int(motion.dataset["mode_foot"][-1])] == "open"


# -- what it reaches -------------------------------------------------------------------------------


def test_its_rounding_reaches_what_masses_and_contacts_couple_to_it_alone() -> None:
    """A pressed puck, a block that its mass is coupled to, and a block on a spring."""
    system = ss.System(
        "three bodies",
        coordinates={x: ss.Inertial() for x in ("x", "y", "z", "a", "b")},
        kinetic="(d_x**2 + d_y**2 + d_z**2 + d_a**2 + d_b**2)/2 + d_y*d_a/4",
        potential="(x - b)**2/2 + z",
        contacts={
            "table": ss.Unilateral("z", ("d_x", "d_y"), mu=0.3),
            "rail": ss.Contact("d_a", 0.2),
            "far": ss.Contact("d_b", 0.2),
            "stop": ss.Unilateral("b + 5"),
        },
    )
    problem = pose(system)
    rows = problem.rows
    names = [c.name for c in problem.compiled.equations.contacts]
    reached = {name for name, beside in zip(names, rows.beside, strict=True) if beside}
    assert {name for name in names if "table" in name or name == "rail"} == reached
    inertial = problem.compiled.equations.declaration.inertial
    kept = {x for x, made in zip(inertial, rows.made, strict=False) if made >= 0}
    assert kept == {"x", "y", "z", "a"}
    watched = {x for x, row in zip(names, rows.gaps, strict=True) if row >= 0}
    gaps = {int(rows.gaps[names.index(x)]): x for x in watched}
    made = {
        gaps[row] for row, m in zip(rows.watched, rows.made, strict=True) if row in gaps and m >= 0
    }
    assert made == watched & reached != watched


@pytest.mark.parametrize("seed", range(3))
def test_values_in_a_slip_that_begins_with_no_acceleration(seed: int) -> None:
    """A rod on three points, pushed harder and harder: values between the knots are those of
    motions that end there, and the audit finds nothing."""
    rng = np.random.default_rng(seed)
    push, across = rng.uniform(0.2, 0.5, 2)
    points = rng.uniform(-1.0, 1.0, 3)
    system = ss.System(
        "rod",
        coordinates={
            "x": ss.Inertial(force=f"{push}*t"),
            "y": ss.Inertial(force=f"{across}*t"),
            "a": ss.Inertial(force="0.1*sin(t)"),
        },
        kinetic="(d_x**2 + d_y**2 + d_a**2/3)/2",
        contacts={
            f"p{i}": ss.Contact((f"d_x - d_a*{r}*sin(a)", f"d_y + d_a*{r}*cos(a)"), 0.3)
            for i, r in enumerate(points)
        },
        span=(0, 4),
    )
    motion = ss.simulate(system)
    assert motion.certificate
    onset = float(motion.events["time"].iloc[0])
    for t in onset + np.array([1e-4, 1e-2, 0.05, 0.3]):
        end, between = ss.simulate(system, (0, float(t))).final, motion.at(t)
        for name in ("x", "y", "a", "d_x", "d_y", "d_a"):
            assert between[name] == pytest.approx(end[name], rel=1e-9, abs=1e-15), name


@pytest.mark.parametrize("kind", ["full", "rank one", "along an axis", "none"])
@pytest.mark.parametrize("seed", range(8))
def test_directions_of_slips_that_begin_solve_their_equation(kind: str, seed: int) -> None:
    """(ρ + D) n = w with |n| = 1 and ρ > 0 has one solution, in half axes of any ratio."""
    rng = np.random.default_rng(seed)
    wide = float(10.0 ** rng.uniform(-4.0, 4.0))
    F = rng.normal(size=(2, 2))
    n = rng.normal(size=2)
    if kind == "rank one":
        F[1] = 0.0
    elif kind == "along an axis":
        F = np.diag(np.diag(F))
        n[seed % 2] = 0.0
    elif kind == "none":
        F *= 0.0
    F = F @ np.diag([1.0, wide])
    D = F.T @ F
    n = F[0] if kind == "rank one" else n
    n /= np.linalg.norm(n)
    rho = float(10.0 ** rng.uniform(-3.0, 1.0))
    w = rho * n + D @ n
    solve: Any = secular_root.python
    *found, least = solve(D[0, 0], D[0, 1], D[1, 1], *w, wide)
    size = float(np.linalg.norm(w) + np.linalg.norm(D))
    np.testing.assert_allclose((least * np.eye(2) + D) @ found, w, atol=1e-13 * size)
    assert np.linalg.norm(found) == pytest.approx(1.0, abs=1e-14)
    assert least == pytest.approx(rho, abs=1e-13 * size)
    if kind == "along an axis":
        assert found[seed % 2] == 0.0


@pytest.mark.parametrize("side", [(1.0, 0.0), (0.0, 1.0), (0.6, 0.8)])
def test_below_the_threshold_nothing_begins(side: tuple[float, float]) -> None:
    for a, c in ((0.02, 44.0), (44.0, 0.02), (3.0, 3.0), (1.0, 0.0), (0.0, 1.0)):
        w = 0.7 * a * side[0], 0.7 * c * side[1]
        solve: Any = secular_root.python
        found = solve(a, 0.0, c, *w, 1.0)
        assert np.all(np.isfinite(found))
        assert found[2] <= 0.0
