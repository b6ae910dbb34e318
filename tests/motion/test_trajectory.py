"""What a result gives: values at any time, data with units, events, certificate, and a file that
keeps all of it."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

import stickslip as ss
from oracles import coulomb_oscillator
from stickslip import (
    DeclarationError,
    Outcome,
    StickslipError,
    Trajectory,
    catalogue,
    simulate,
)
from systems import VARIABLE, dashpot, distance, oscillator, play

VALUES = {"mu": 0.5, "omega": 0.5}  # the forced Coulomb oscillator of the references
MOTIONS = {
    "oscillator": lambda: simulate(oscillator(), (0.0, 14.0), parameters=VALUES),
    "slider": lambda: simulate(catalogue.spring_slider(), (0.0, 20.0)),
    "toy": lambda: simulate(catalogue.rocking_toy(), (0.0, 30.0)),
    "kinks": lambda: simulate(catalogue.scaled_slider_limit(), (0.0, 20.0)),
    "ended early": lambda: simulate(
        play(VARIABLE),
        (0.0, 5.0),
        initial={},
        parameters={"F": 1.5, "jump": -0.9, "phi": -math.pi / 2},
    ),
}


@pytest.fixture
def motion() -> Trajectory:
    return MOTIONS["oscillator"]()


# --- Values at any time ---------------------------------------------------------------------------


def test_at_a_time_gives_numbers(motion: Trajectory) -> None:
    values = motion.at(1)
    contact = {"friction", "threshold_plus", "threshold_minus", "slip_speed", "mode"}
    energies = {"energy", "dissipated_energy", "supplied_energy"}
    assert set(values) == {"x", "d_x", "dd_x"} | {f"{name}_ground" for name in contact} | energies
    assert all(type(value) in (float, int) for value in values.values())


@pytest.mark.parametrize("shape", [(0,), (1,), (7,), (2, 3)])
def test_at_times_gives_arrays(motion: Trajectory, shape: tuple[int, ...]) -> None:
    times = np.random.default_rng(1).uniform(0, 14, shape)
    values = motion.at(times)
    assert {value.shape for value in values.values()} == {shape}
    for t, x in zip(times.ravel(), values["x"].ravel(), strict=True):
        assert motion.at(t)["x"] == x
    assert motion.at(times.tolist())["x"].tolist() == values["x"].tolist()


def test_at_is_exact_between_the_knots(motion: Trajectory) -> None:
    t = np.random.default_rng(2).uniform(0, 14, 300)
    x, v = coulomb_oscillator.state(t, coulomb_oscillator.phases(14.0, **VALUES))
    assert distance(motion.at(t)["x"], x) < 1e-12
    assert distance(motion.at(t)["d_x"], v) < 1e-12
    assert len(motion.knots.time) < 50


def test_at_does_not_depend_on_the_other_times(motion: Trajectory) -> None:
    t = np.random.default_rng(3).permutation(np.linspace(0, 14, 57))
    assert motion.at(t)["energy"].tolist() == [motion.at(s)["energy"] for s in t]


@pytest.mark.parametrize("make", [dashpot, play])
def test_at_has_two_limits_where_a_rate_jumps(make: object) -> None:
    # The threshold rises at t = 1 and stops the slip at once.
    values = {"F": 1.5, "phi": -math.pi / 2, "jump": 0.5}
    motion = simulate(make(VARIABLE), (0.0, 1.5), parameters=values)  # type: ignore[operator]
    (jump,) = motion.events.loc[motion.events["to"] == "stick", "time"]
    left, right = motion.at(jump, side="left"), motion.at(jump, side="right")
    assert left["d_x"] > 0.1
    assert right["d_x"] == 0.0
    assert (left["mode_ground"], right["mode_ground"]) == (1, 0)
    assert (left["threshold_plus_ground"], right["threshold_plus_ground"]) == pytest.approx(
        (1.0, 1.5)
    )
    assert left["x"] == pytest.approx(right["x"], abs=1e-15)
    assert motion.at(jump) == right
    assert motion.at(np.nextafter(jump, 0))["d_x"] == pytest.approx(left["d_x"], abs=1e-14)


def test_at_the_ends(motion: Trajectory) -> None:
    assert motion.at(0.0, side="left")["x"] == motion.at(0.0, side="right")["x"] == 0.0
    assert motion.at(14.0)["x"] == motion.final["x"]


@pytest.mark.parametrize("t", [-1e-9, 14.000001, math.nan, [3.0, 15.0]])
def test_at_refuses_other_times(motion: Trajectory, t: Any) -> None:
    with pytest.raises(DeclarationError, match=re.escape("Use 0 <= t <= 14")):
        motion.at(t)


def test_at_refuses_other_sides(motion: Trajectory) -> None:
    with pytest.raises(DeclarationError, match="Use 'left' or 'right'"):
        motion.at(1.0, side="middle")


# --- Data, events ---------------------------------------------------------------------------------


def test_dataset_has_units_and_names(motion: Trajectory) -> None:
    data = motion.dataset
    assert set(data.dims) == {"time"}
    assert {"units", "long_name"} <= set(data["time"].attrs)
    for name in map(str, data.data_vars):
        assert data[name].attrs["long_name"], name
        assert "units" in data[name].attrs or name.startswith("mode_"), name
    assert data["x"].attrs == {"units": "m", "long_name": "position"}
    assert data["d_x"].attrs["units"] == "m/s"
    assert data["friction_ground"].attrs["units"] == "N"
    assert data.attrs["outcome"] == "finished"


def test_dataset_of_modes(motion: Trajectory) -> None:
    mode = motion.dataset["mode_ground"]
    assert mode.dtype == np.int8
    assert mode.attrs["flag_values"].tolist() == [-1, 0, 1]
    assert mode.attrs["flag_meanings"].split() == ["slip-", "stick", "slip+"]
    assert set(np.unique(mode)) == {-1, 0, 1}
    v = motion.dataset["d_x"].to_numpy()
    inside = np.abs(v) > 1e-9
    assert np.array_equal(np.sign(v[inside]), mode.to_numpy()[inside])


def test_dataset_holds_knots_and_a_grid(motion: Trajectory) -> None:
    times = motion.dataset["time"].to_numpy()
    assert np.all(np.diff(times) > 0)
    assert set(motion.knots.time) <= set(times)
    assert np.diff(times).max() < 0.02
    values = motion.at(times)
    for name in map(str, motion.dataset.data_vars):
        assert np.array_equal(motion.dataset[name], values[name]), name


@pytest.mark.parametrize("name", MOTIONS)
def test_energy_balance_in_the_dataset(name: str) -> None:
    data = MOTIONS[name]().dataset
    energy, dissipated, supplied = (
        data[f"{kind}energy"].to_numpy() for kind in ("", "dissipated_", "supplied_")
    )
    assert np.ptp(energy + dissipated - supplied) <= 1e-11 * max(1.0, np.abs(energy).max())
    assert np.all(np.diff(dissipated) >= -1e-12)


def test_events_are_a_table(motion: Trajectory) -> None:
    events = motion.events
    assert list(events.columns) == ["time", "contact", "from", "to", "x", "d_x"]
    assert events["time"].tolist() == pytest.approx(
        coulomb_oscillator.switch_times(14.0, **VALUES), abs=1e-12
    )
    assert events["contact"].unique().tolist() == ["ground"]
    assert events["from"].tolist()[1:] == events["to"].tolist()[:-1]
    for event in events.to_dict("records"):
        at = motion.at(event["time"])
        assert (at["x"], at["d_x"]) == (event["x"], event["d_x"])
    assert motion.n_switches == len(events) == 6


def test_events_name_contacts_and_kinks() -> None:
    # Contacts of several kinds are sorted by the engine; each keeps its name.
    toy = MOTIONS["toy"]()
    moved = toy.events[toy.events["to"] == "slip+"]
    for time, contact in zip(moved["time"], moved["contact"], strict=True):
        rate = {"right leg": "d_x_R", "left leg": "d_x_L"}[contact]
        assert toy.at(time + 1e-6)[rate] > 0
    slider = MOTIONS["kinks"]()
    assert set(slider.events["contact"]) == {"beta = 0"}
    assert set(slider.events["to"]) == {"above", "below"}
    assert len(slider.events) == slider.n_kinks
    assert distance(slider.events["beta"], 0.0) < 1e-10


def test_events_of_a_motion_without_any() -> None:
    motion = simulate(oscillator(), (0.0, 1.0), parameters={"mu": 2.0})
    assert len(motion.events) == motion.n_switches == 0
    assert list(motion.events.columns) == ["time", "contact", "from", "to", "x", "d_x"]


def test_summary_in_one_line(motion: Trajectory) -> None:
    assert repr(motion) == "<Trajectory of oscillator: t = 0 ... 14, 6 switches, finished>"


def test_conditions_that_fail_are_warnings() -> None:
    motion = simulate(catalogue.belt_block(), (0.0, 1.0), parameters={"F_k": 1.0})
    assert len(motion.warnings) == 1
    assert motion.warnings[0].startswith("F_s > F_k fails: ")
    assert MOTIONS["toy"]().warnings == []


@pytest.mark.parametrize("k", [-1.0, 0.0, 1.0])
def test_conditions_at_equality(k: float) -> None:
    """A strict one fails there, another does not; what is undefined fails, and says so."""
    asked = {"k > 0": k > 0, "k >= 0": k >= 0, "k < 0": k < 0, "k <= 0": k <= 0}
    asked |= {"sqrt(k) >= 0": k >= 0, "piecewise(k < 0, 1, 2) > max(k, 1.5)": k >= 0}
    system = ss.System(
        "conditions",
        parameters={"k": ss.Parameter(k)},
        internal={"a": ss.Internal("0")},
        conditions={f"c{i}": ss.Condition(text, "no") for i, text in enumerate(asked)},
    )
    warnings = simulate(system, (0.0, 1.0)).warnings
    undefined = " fails: undefined for these parameters"
    assert warnings == [
        text + (undefined if k < 0 and "sqrt" in text else " fails: no")
        for text, holds in asked.items()
        if not holds
    ]
    assert str(system.equations()).count("FAILS") == len(warnings)


# --- Certificate ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MOTIONS)
def test_certificate(name: str) -> None:
    motion = MOTIONS[name]()
    certificate = motion.certificate
    assert certificate.lawful, certificate.verdict
    assert certificate.ok == motion.outcome.ok
    assert max(residual.value for residual in certificate.residuals) < 1e-9
    assert certificate.to_dict()["ok"] is certificate.ok


def test_certificate_is_relative() -> None:
    # The same motion in other units of length and force.
    for scale in (1e-6, 1e6):
        values = {"mu": 0.5 * scale, "omega": 0.5, "F": scale}
        assert simulate(oscillator(), (0.0, 14.0), parameters=values).certificate.ok


def test_certificate_where_all_knots_are_turning_points() -> None:
    # One flight from rest to (almost) rest: the velocity is large in between only.
    motion = simulate(catalogue.rocking_toy(), (0.0, 600.0), initial={"psi": 0.1, "x_R": 0.0})
    assert motion.n_switches == 0
    assert motion.certificate.ok, motion.certificate.verdict
    until = simulate(catalogue.rocking_oscillator(delta=0.05), (0.0, 60.0), initial={"psi": 0.2})
    assert until.certificate.ok, until.certificate.verdict


@pytest.mark.parametrize("excess", [1e-11, 1e-12, 1e-13])
@pytest.mark.parametrize("make", [oscillator, dashpot, play])
def test_certificate_of_a_motion_that_is_hardly_one(make: object, excess: float) -> None:
    # A slip under an excess of 1e-13 over the threshold 1: its rate is known to three digits.
    values = {"mu": 1.0, "F": 1.0 + excess, "phi": -1.3, "k": float(make is play)}
    motion = simulate(make(), (0.0, 2.0), parameters=values)  # type: ignore[operator]
    assert motion.n_switches == 2
    assert motion.certificate.ok, motion.certificate.verdict


# --- Files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MOTIONS)
def test_file_keeps_everything(name: str, tmp_path: Path) -> None:
    motion = MOTIONS[name]()
    motion.save(tmp_path / "motion.nc")
    again = Trajectory.open(tmp_path / "motion.nc")
    for part in ("time", "state", "mode", "region", "cause"):
        stored, computed = getattr(again.knots, part), getattr(motion.knots, part)
        assert stored.dtype == computed.dtype
        assert stored.tobytes() == computed.tobytes(), part
    assert again.system == motion.system
    assert again.parameters == motion.parameters
    assert again.outcome is motion.outcome
    assert (again.t_span, again.rtol, again.wall_time) == (
        motion.t_span,
        motion.rtol,
        motion.wall_time,
    )
    assert again.dataset.identical(motion.dataset)
    assert again.events.equals(motion.events)
    assert again.certificate == motion.certificate
    t = np.linspace(motion.knots.time[0], motion.knots.time[-1], 77)
    ours, theirs = motion.at(t), again.at(t)
    assert all(ours[key].tobytes() == theirs[key].tobytes() for key in ours)


def test_file_saved_again_is_the_same(motion: Trajectory, tmp_path: Path) -> None:
    first, second = tmp_path / "first.nc", tmp_path / "second.nc"
    motion.save(first)
    Trajectory.open(first).save(second)
    assert Trajectory.open(second).dataset.identical(motion.dataset)
    motion.save(second)  # replaces
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first.nc", "second.nc"]


def test_file_is_read_by_others(motion: Trajectory, tmp_path: Path) -> None:
    motion.save(tmp_path / "motion.nc")
    with netCDF4.Dataset(tmp_path / "motion.nc") as file:
        assert file.variables["x"].units == "m"
        assert file.variables["x"][:].tolist() == motion.dataset["x"].values.tolist()


def tampered(
    motion: Trajectory, path: Path, variable: str, index: object, change: float
) -> Trajectory:
    """The motion as read from a file in which one number has been changed."""
    motion.save(path)
    with netCDF4.Dataset(path, "r+") as file:
        file.variables[variable][index] += change
    with pytest.raises(StickslipError, match=f"damaged: {variable}"):
        Trajectory.open(path)
    return unchecked(path)


def remove_checksums(path: Path) -> None:
    with netCDF4.Dataset(path, "r+") as file:
        file.delncattr("stickslip_checksums")
        file.delncattr("stickslip_layout")


def unchecked(path: Path) -> Trajectory:
    """The motion in a file of which somebody has removed the checksums."""
    remove_checksums(path)
    with pytest.warns(match="without checksums"):
        return Trajectory.open(path)


@pytest.mark.parametrize(("variable", "index", "change"), [
    ("knot_state", (5, 0), 1e-6),
    ("knot_state", (5, 1), 1e-6),
    ("knot_time", 5, 1e-6),
    ("knot_mode", (-2, 0), 1),
    ("knot_state", (-1, 0), 1e-6),
])  # fmt: skip
def test_tampered_file_fails(
    motion: Trajectory, tmp_path: Path, variable: str, index: object, change: float
) -> None:
    assert motion.certificate.ok
    certificate = tampered(motion, tmp_path / "motion.nc", variable, index, change).certificate
    assert not certificate.ok
    assert certificate.verdict.startswith("not certified")
    assert certificate.to_dict()["ok"] is False


def test_other_parameters_in_a_file_fail(motion: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "motion.nc"
    motion.save(path)
    with netCDF4.Dataset(path, "r+") as file:
        file.stickslip_parameters = file.stickslip_parameters.replace('"mu": 0.5', '"mu": 0.50001')
    with pytest.raises(StickslipError, match="damaged: stickslip_parameters"):
        Trajectory.open(path)
    assert not unchecked(path).certificate.ok


def test_file_without_numbers_left_fails(motion: Trajectory, tmp_path: Path) -> None:
    certificate = tampered(
        motion, tmp_path / "motion.nc", "knot_state", (5, 0), math.nan
    ).certificate
    assert not certificate.ok


def test_open_what_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(StickslipError, match=r"nothing\.nc: no such file"):
        Trajectory.open(tmp_path / "nothing.nc")
    with pytest.raises(StickslipError, match="not a file"):
        Trajectory.open(tmp_path)


@pytest.mark.parametrize("content", [b"", b"no netCDF", b"\x89HDF\r\n\x1a\n"])
def test_open_another_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.nc"
    path.write_bytes(content)
    with pytest.raises(StickslipError, match="not a trajectory stored by stickslip"):
        Trajectory.open(path)


def test_open_another_netcdf_file(tmp_path: Path) -> None:
    path = tmp_path / "other.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("time", 3)
    with pytest.raises(StickslipError, match="not a trajectory stored by stickslip"):
        Trajectory.open(path)


@pytest.mark.parametrize(
    "attribute", ["stickslip_system", "stickslip_parameters", "stickslip_settings"]
)
def test_open_a_damaged_file(motion: Trajectory, tmp_path: Path, attribute: str) -> None:
    path = tmp_path / "motion.nc"
    motion.save(path)
    with netCDF4.Dataset(path, "r+") as file:
        setattr(file, attribute, "{}")
    with pytest.raises(StickslipError, match=rf"motion\.nc: damaged: {attribute}"):
        Trajectory.open(path)
    with pytest.raises(StickslipError, match=r"motion\.nc|parameter"):
        unchecked(path)


def test_open_another_format(motion: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "motion.nc"
    motion.save(path)
    with netCDF4.Dataset(path, "r+") as file:
        file.stickslip_format = 999
    remove_checksums(path)
    with pytest.raises(StickslipError, match="written in format 999"):
        Trajectory.open(path)


def test_save_where_it_cannot_be(motion: Trajectory, tmp_path: Path) -> None:
    with pytest.raises(StickslipError, match="cannot be written"):
        motion.save(tmp_path / "no folder" / "motion.nc")
    assert list(tmp_path.iterdir()) == []


def test_outcome_is_kept(tmp_path: Path) -> None:
    motion = MOTIONS["ended early"]()
    assert motion.outcome is Outcome.NO_BOUNDED_RATE
    motion.save(tmp_path / "motion.nc")
    assert Trajectory.open(tmp_path / "motion.nc").message == motion.message


@pytest.mark.parametrize("name", ["spring_slider", "puck", "rocking_toy", "block_chain", "coin"])
def test_motions_do_not_depend_on_those_before_them(name: str) -> None:
    """Motions of a system share work space: after others, with other numbers and tolerances, they
    are bit by bit those of the same system declared anew."""
    used, new = (getattr(ss.catalogue, name)() for _ in range(2))
    first, *_ = used.values
    assert ss.simulate(used, rtol=1e-6).certificate.residuals
    other_numbers = {first: 1.07 * used.values[first]}
    assert ss.simulate(used, parameters=other_numbers).certificate.residuals
    one, other = ss.simulate(used), ss.simulate(new)
    for part in ("clock", "state", "mode", "region"):
        np.testing.assert_array_equal(getattr(one.knots, part), getattr(other.knots, part))
    assert one.certificate == other.certificate


def test_numbers_are_checked_whatever_was_computed_before() -> None:
    system = ss.catalogue.belt_block()
    ss.simulate(system, (0, 1), parameters={"k": 1.0})
    wrong: Any
    for wrong in (True, "1.0", -1.0, math.nan, None):
        with pytest.raises(ss.DeclarationError, match="k"):
            ss.simulate(system, (0, 1), parameters={"k": wrong})
