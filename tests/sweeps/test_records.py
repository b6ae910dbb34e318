"""Maps over records: held against Newmark's closed form, single motions, and counts by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

import stickslip as ss
from stickslip.errors import DeclarationError, StickslipError
from stickslip.figures.records import plot_records
from stickslip.sweeps.fragility import lognormal_fit

BLOCK = ss.catalogue.sliding_base()
G = 9.81
ARIAS = 0.1  # s, between the samples of what is made up


def pulse(height: float, length: float, rest: float) -> ss.Samples:
    """A base that is pushed once (and a block that slides back on it)."""
    times = [0.0, 1.0, 1.0 + length, 1.0 + length + rest]
    return ss.Samples(times, [0.0, -height, 0.0, 0.0], kind="hold")


def newmark(height: Any, length: Any, mu: Any) -> Any:
    """The slip by a rectangular pulse (Newmark 1965): (AT)²/(2N) (1 − N/A) where A > N."""
    held = mu * G
    slides = (height * length) ** 2 / (2.0 * held) * (1.0 - held / height)
    return np.where(height > held, slides, 0.0)


def made_up(seed: int, count: int = 60) -> ss.Samples:
    """A record of noise under an envelope."""
    rng = np.random.default_rng(seed)
    t = ARIAS * np.arange(count + int(rng.integers(0, 20)))
    envelope = (t / 2.0) ** 2 * np.exp(2.0 - t)
    return ss.Samples(t, 2.0 * envelope * rng.standard_normal(len(t)))


QUAKES = {f"quake {seed}": made_up(seed) for seed in range(5)}
SCALES = [0.5, 1.0, 2.0, 4.0]


@settings(max_examples=10, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0.5, 3.0), st.floats(0.1, 0.8)), min_size=1, max_size=4, unique=True
    ),
    st.lists(st.floats(0.5, 8.0), min_size=1, max_size=3, unique=True),
    st.lists(st.floats(0.05, 0.4), min_size=1, max_size=3, unique=True),
)
def test_newmarks_block(
    pulses: list[tuple[float, float]], scales: list[float], frictions: list[float]
) -> None:
    """Every record, scale and friction, whatever their number: rectangular pulses."""
    scales, frictions = sorted(scales), sorted(frictions)
    records = {f"{a} m/s², {T} s": pulse(a, T, 60.0) for a, T in pulses}
    over = {"record": ss.Records(records), "scale": scales, "mu": frictions}
    found = ss.sweep(BLOCK, over, ["shift", "duration"])
    height, length = np.array(pulses).T[:, :, None, None]
    scaled = height * np.array(scales)[:, None]
    expected = newmark(scaled, length, np.array(frictions))
    np.testing.assert_allclose(found["shift"].values, expected, rtol=1e-9, atol=1e-11)
    duration = np.broadcast_to(61.0 + length, expected.shape)
    np.testing.assert_allclose(found["duration"].values, duration, rtol=1e-12)
    assert found["record"].values.tolist() == list(records)
    assert found.certificate.ok and found.outcome.ok


@pytest.fixture(scope="module")
def shaken() -> ss.Map:
    over = {"record": ss.Records(QUAKES), "scale": SCALES, "mu": [0.1, 0.2]}
    return ss.sweep(BLOCK, over, ["slip = max(high:x, -low:x)", "shift"])


def test_points_are_single_motions(shaken: ss.Map) -> None:
    """A scaled record moves the block as a record of the scaled values does."""
    for name, samples in QUAKES.items():
        for scale in SCALES[::2]:
            scaled = ss.Samples(samples.times, scale * samples.values)
            alone = ss.simulate(BLOCK.configure({"a": scaled}), parameters={"mu": 0.1})
            there = shaken.dataset.sel(record=name, scale=scale, mu=0.1)
            assert float(there["shift"]) == pytest.approx(alone.final["x"], rel=1e-8, abs=1e-10)
    assert shaken.system.parameters["scale"].default == 1.0
    assert np.all(shaken.dataset["lacking"].values == 0)


def test_who_computes_does_not_matter(shaken: ss.Map) -> None:
    over = {"record": ss.Records(QUAKES), "scale": SCALES, "mu": [0.1, 0.2]}
    found = ss.sweep(BLOCK, over, ["shift"], scheduler="processes", workers=2)
    np.testing.assert_array_equal(found["shift"].values, shaken["shift"].values)


def test_a_store_goes_on_and_grows(tmp_path: Path, shaken: ss.Map) -> None:
    names = list(QUAKES)
    first = {name: QUAKES[name] for name in names[1:3]}
    store = tmp_path / "map.zarr"
    rest: dict[str, Any] = {"scale": SCALES, "mu": [0.1, 0.2]}
    measures = ["slip = max(high:x, -low:x)", "shift"]
    asked: list[int] = []

    def computed(records: Any, **more: Any) -> ss.Map:
        over = {"record": ss.Records(records), **rest}
        asked.clear()
        return ss.sweep(
            BLOCK, over, measures, store, progress=lambda state: asked.append(state.new), **more
        )

    computed(first)
    assert asked[-1] == 16
    computed(first)
    assert asked[-1] == 0
    changed = {**first, names[1]: made_up(77)}
    with pytest.raises(StickslipError, match="over other values of record"):
        computed(changed)
    with pytest.raises(StickslipError, match="quake 1 of the stored map is not among"):
        computed(changed, extend=True)
    with pytest.raises(StickslipError, match="over another time span"):
        computed(first, span=(0.0, 3.0))
    whole = computed(QUAKES, extend=True)
    assert asked[-1] == 24 and whole["record"].values.tolist() == names
    for name in ("shift", "slip"):
        np.testing.assert_array_equal(whole[name].values, shaken[name].values)
    again = ss.open(store)
    assert again["record"].values.tolist() == names and again.measures == whole.measures
    again.save(tmp_path / "map.nc")
    read: Any = ss.open(tmp_path / "map.nc")
    there, here = (some.fragility("slip", 0.1).summary().data for some in (read, whole))
    np.testing.assert_equal(there, here)


def test_several_components() -> None:
    """Both components of a floor: those of a record belong together."""
    floor = ss.catalogue.isolated_floor()
    parts = {f"quake {i}": {"a_x": made_up(2 * i), "a_y": made_up(2 * i + 1)} for i in range(2)}
    found = ss.sweep(floor, {"record": ss.Records(parts), "scale": [1.0, 3.0]}, ["shift:y"])
    for name, own in parts.items():
        both = {d: ss.Samples(s.times, 3.0 * s.values) for d, s in own.items()}
        end = min(s.span[1] for s in own.values())
        alone = ss.simulate(floor.configure(both), (0.0, end)).final["y"]
        there = float(found.dataset.sel(record=name, scale=3.0)["shift:y"])
        assert there == pytest.approx(alone, rel=1e-7, abs=1e-9)


def test_the_span_of_all_motions() -> None:
    """By default each lasts as long as its record; what a span leaves out is said."""
    over = {"record": ss.Records(QUAKES), "mu": [0.1]}
    found = ss.sweep(BLOCK, over, ["duration"])
    ends = [samples.span[1] for samples in QUAKES.values()]
    np.testing.assert_allclose(found["duration"].values[:, 0], ends, rtol=1e-12)
    assert found.warnings == []
    declared = ss.sweep(ss.System(**{**vars_of(BLOCK), "span": (0.0, 1.0)}), over, ["duration"])
    np.testing.assert_array_equal(declared["duration"].values, found["duration"].values)
    cut = ss.sweep(BLOCK, over, ["duration"], span=(0.0, 5.0))
    assert np.all(cut["duration"].values == 5.0)
    (said,) = cut.warnings
    longest = max(ends)
    assert said.startswith("5 of 5 records are longer than the motions, from 0 s to 5 s: 'quake ")
    assert said.endswith(f"runs to {longest:.9g} s") and said in cut.certificate.verdict
    with pytest.raises(DeclarationError, match=r"records.quake .: the samples cover 0 \.\.\. "):
        ss.sweep(BLOCK, over, ["duration"], span=(0.0, 7.55))


def vars_of(system: ss.System) -> dict[str, Any]:
    """What a system is declared by."""
    names = ("name", "parameters", "functions", "drives", "coordinates", "kinetic", "contacts")
    return {name: getattr(system, name) for name in (*names, "translation", "time_unit")}


def test_records_that_repeat_settle() -> None:
    """What is measured is what the motion settles on, as under any periodic drive."""
    waves = {
        f"{T} s": ss.Samples([0.0, T / 4, 3 * T / 4, T], [0.0, 3.0, -3.0, 0.0], periodic=True)
        for T in (1.0, 2.0)
    }
    over = {"wave": ss.Records(waves), "scale,mu": "0.5,1,2; 0.1,0.1,0.2"}
    found = ss.sweep(BLOCK, over, ["period"])
    assert found["period"].dims == ("wave", "scale_mu")
    np.testing.assert_allclose(found["period"].values[:, 1:], [[1.0] * 2, [2.0] * 2], rtol=1e-9)
    alone = BLOCK.configure({"a": waves["2.0 s"]})
    assert found.system.span == (0, 10) == alone.span


# -- fragility -------------------------------------------------------------------------------------


def test_shares_are_counted(shaken: ss.Map) -> None:
    found = shaken.fragility("slip", 0.05)
    values = shaken["slip"].values
    np.testing.assert_array_equal(found["share"].values, np.mean(values > 0.05, axis=0))
    assert np.all(found["records"].values == len(QUAKES))
    assert np.all(found["low"].values <= found["share"].values)
    assert np.all(found["high"].values >= found["share"].values)
    # By hand: 95 % of 2 of 5 (Wilson 1927).
    at = np.argwhere(found["share"].values == 0.4)
    for place in map(tuple, at):
        assert found["low"].values[place] == pytest.approx(0.1176, abs=1e-4)
        assert found["high"].values[place] == pytest.approx(0.7693, abs=1e-4)
    assert found.certificate.ok and found.limit == "slip > 0.05 m"
    assert set(found.table) == {"scale", "mu", "share", "low", "high", "records"}


@given(
    st.floats(0.2, 5.0), st.floats(0.15, 1.0), st.integers(0, 1000), st.sampled_from([0.01, 1.0])
)
@settings(max_examples=40, deadline=None)
def test_the_fit_is_the_most_likely_one(
    median: float, dispersion: float, seed: int, unit: float
) -> None:
    """No other median and dispersion makes the counts more likely, whatever the unit."""
    rng = np.random.default_rng(seed)
    x = unit * median * np.exp(np.linspace(-2.0, 2.0, 12) * dispersion)
    n = np.full(len(x), 60)
    k = rng.binomial(n, norm.cdf(np.log(x / (unit * median)) / dispersion))
    found = lognormal_fit(x, k, n)
    if not np.isfinite(found[0]):
        assert np.min(x[k > 0], initial=np.inf) >= np.max(x[k < n], initial=-np.inf)
        return

    def likely(theta: float, beta: float) -> float:
        u = np.log(x / theta) / beta
        return float(np.sum(k * norm.logcdf(u) + (n - k) * norm.logsf(u)))

    best = likely(*found)
    for factor in (0.99, 1.01):
        assert best >= likely(factor * found[0], found[1])
        assert best >= likely(found[0], factor * found[1])
    assert found[0] == pytest.approx(unit * median, rel=6.0 * dispersion / np.sqrt(60.0))


@pytest.mark.parametrize("k", [[0, 0, 0], [9, 9, 9], [0, 0, 9], [0, 4, 9], [9, 4, 0]])
def test_counts_that_determine_no_fit(k: list[int]) -> None:
    x, n = np.array([1.0, 2.0, 3.0]), np.full(3, 9)
    assert np.all(np.isnan(lognormal_fit(x, np.array(k), n)))


def test_what_has_no_value_is_left_out_and_said() -> None:
    """A measure of the user's that fails is no record that holds."""
    broken = next(iter(QUAKES))

    def slip(motion: ss.Trajectory) -> float:
        samples: Any = motion.system.drives["a_recorded"]
        return float("nan") if samples == QUAKES[broken] else 1.0

    over = {"record": ss.Records(QUAKES), "scale": SCALES}
    found = ss.sweep(BLOCK, over, [slip]).fragility("slip", 0.5)
    assert np.all(found["share"].values == 1.0) and np.all(found["records"].values == 4)
    assert found.certificate["motions without a value"].value == len(SCALES)
    assert not found.certificate.ok


def test_what_is_asked_of_a_fragility(shaken: ss.Map) -> None:
    plain = ss.sweep(BLOCK, {"mu": [0.1, 0.2]}, ["shift"])
    asked: list[tuple[Callable[[], Any], str]] = [
        (lambda: plain.fragility("shift", 0.1), "the map has no axis of records"),
        (lambda: shaken.fragility("slop", 0.1), "has no measure 'slop'. Did you mean 'slip'"),
        (lambda: shaken.fragility("slip", np.inf), "inf is not a number"),
        (lambda: shaken.fragility("slip", 0.1, over="S"), "unknown axis 'S'. Known here: scale"),
    ]
    for call, words in asked:
        with pytest.raises(DeclarationError, match=words):
            call()
    assert shaken.fragility("slip", 0.1, over="mu").along == "mu"


def test_pictures(shaken: ss.Map) -> None:
    """A curve for each friction; a line for each record and one for their median."""
    figure = shaken.fragility("slip", 0.05).plot()
    (axes,) = figure.axes
    assert axes.get_xlabel() == "scale of the records"
    assert len(axes.containers) == 2
    lines = shaken.plot("slip").axes[0].lines
    assert len(lines) == 2 * (len(QUAKES) + 1)
    alone = ss.Map(shaken.dataset.isel(scale=0, mu=0))
    ticks = alone.plot("slip").axes[0].get_yticklabels()
    assert sorted(tick.get_text() for tick in ticks) == list(QUAKES)
    hollow = shaken.dataset.copy(deep=True)
    hollow["lacking"].values[1, 2, 0] = 1
    legend = plot_records(hollow, ["slip"]).axes[0].get_legend()
    assert legend is not None
    assert "not certified" in [text.get_text() for text in legend.get_texts()]


# -- reading ---------------------------------------------------------------------------------------

AT2 = """PEER NGA STRONG MOTION DATABASE RECORD
Somewhere, 1/1/2000, A STATION, 090
ACCELERATION TIME SERIES IN UNITS OF G
{heading}
 .0000000E+00  .1000000E+00 -.2000000E+00  .3000000E+00  .5000000E-01
-.1000000E+00  .0000000E+00
"""
HEADINGS = ("NPTS=   7, DT= .0050 SEC", "7    0.0050    NPTS, DT", "NPTS=7,DT=5.0D-3 SEC,")
VALUES = np.array([0.0, 0.1, -0.2, 0.3, 0.05, -0.1, 0.0])


@pytest.mark.parametrize("heading", HEADINGS)
def test_files_of_peer(tmp_path: Path, heading: str) -> None:
    file = tmp_path / "RSN1.AT2"
    file.write_text(AT2.format(heading=heading))
    samples = ss.Samples.read(file)
    np.testing.assert_allclose(samples.times, 0.005 * np.arange(7))
    np.testing.assert_array_equal(samples.values, VALUES)
    (tmp_path / "RSN1.csv").write_text("t,a\n0,1\n1,2\n")
    (tmp_path / "notes.md").write_text("nothing")
    records = ss.Records.read(tmp_path, factor=G)
    assert list(records) == ["RSN1.AT2", "RSN1.csv"]
    np.testing.assert_allclose(records["RSN1.AT2"][""].values, G * VALUES)
    only = ss.Records.read(tmp_path, pattern="*.AT2", peak=2.0)
    assert list(only) == ["RSN1"]
    np.testing.assert_allclose(np.max(np.abs(only["RSN1"][""].values)), 2.0)
    assert BLOCK.configure({"a": samples}).span == (0.0, pytest.approx(0.03))


def test_components_are_columns(tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text("t,a_x,a_y\n0,1,5\n1,2,6\n")
    records = ss.Records.read(tmp_path, ["a_x", "a_y"], peak=1.0)
    assert records["one"]["a_x"].values.tolist() == [1.0 / 6.0, 2.0 * (1.0 / 6.0)]
    assert records["one"]["a_y"].values.tolist() == [5.0 * (1.0 / 6.0), 1.0]


EVEN = "\n".join(f"{0.01 * i:.2f},{i % 3}" for i in range(100) if not 50 < i < 70)
BAD = {
    "empty.csv": ("", "empty.csv: the file is empty"),
    "names.csv": ("t,a\n", "0 times and 0 values"),
    "nan.csv": ("t,a\n0,1\n1,nan\n", "line 3, column 'a': nan is not a number"),
    "cell.csv": ("t,a\n0,1\n1,\n", "line 3, column 'a': the value is missing"),
    "order.csv": ("t,a\n0,1\n2,1\n1,1\n", "line 4, column 't': the time 1 comes after 2"),
    "gap.csv": (f"t,a\n{EVEN}\n", "but there is no sample between 0.5 and 0.7. Fill the gap"),
    "columns.csv": ("t,x,y\n0,1,2\n", "it is ambiguous which column has the values"),
    "empty.AT2": ("\n", "the file is empty"),
    "short.AT2": (AT2.format(heading=HEADINGS[0])[:-20], "the file has 6 values, but NPTS is 7"),
    "heading.AT2": (AT2.format(heading="nothing"), "line 4: the number of samples"),
    "words.AT2": (AT2.format(heading=HEADINGS[0]) + "end", "line 7: 'end' is not a number"),
    "nan.AT2": (AT2.format(heading=HEADINGS[0]) + "nan", "line 7: nan is not a number"),
    "step.AT2": (AT2.format(heading="NPTS= 7, DT= 0.0"), "line 4: 7 samples with a time step of 0"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_wrong_with_a_file_is_named(tmp_path: Path, name: str) -> None:
    text, words = BAD[name]
    (tmp_path / name).write_text(text)
    with pytest.raises(DeclarationError) as failed:
        ss.Records.read(tmp_path)
    assert words in str(failed.value) and name in str(failed.value)


def test_gaps_that_are_allowed(tmp_path: Path) -> None:
    (tmp_path / "gap.csv").write_text(BAD["gap.csv"][0])
    assert len(ss.Records.read(tmp_path, gaps=True)["gap"][""].times) == 81
    (tmp_path / "gap.csv").write_text("t,a\n0,0\n1,1\n1.1,0\n9,0\n")  # of no even steps
    assert len(ss.Records.read(tmp_path)) == 1


def test_what_are_no_records(tmp_path: Path) -> None:
    one, other = made_up(1), made_up(2)
    wave = ss.Samples([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], periodic=True)
    (tmp_path / "a.md").write_text("x")
    asked: list[tuple[Callable[[], Any], str]] = [
        (lambda: ss.Records({}), "records: no records were given"),
        (lambda: ss.Records({"a": "a.csv"}), "records.a: expected Samples, got str"),
        (lambda: ss.Records({"a": one, "b": made_up(1)}), "records.b: it is identical to 'a'"),
        (lambda: ss.Records({"a": one, "b": {"a_x": other}}), "it drives a_x, but 'a' drives the"),
        (lambda: ss.Records({"a": one, "b": wave}), "some records are periodic, and some end"),
        (lambda: ss.Records.read(tmp_path), "the folder has no records. Files of records end"),
        (lambda: ss.Records.read(tmp_path, pattern="*.csv"), "none of its 1 files matches"),
        (lambda: ss.Records.read(tmp_path / "b"), "no such folder"),
        (lambda: ss.Records.read(tmp_path / "a.md"), "not a folder"),
        (lambda: ss.Records.read(tmp_path, factor=0.0), "factor: 0.0 is not a nonzero number"),
        (lambda: ss.Records.read(tmp_path, peak=-1.0), "peak: -1.0 is not a positive number"),
        (lambda: ss.Records.read(tmp_path, peak=1.0, factor=2.0), "peak: both a factor and a peak"),
    ]
    for call, words in asked:
        with pytest.raises(DeclarationError) as failed:
            call()
        assert words in str(failed.value)


def test_what_is_no_map_over_records() -> None:
    records = ss.Records(QUAKES)
    floor = ss.catalogue.isolated_floor()
    finely: Any = {"adaptive": ss.Adaptive(("shift",))}
    asked: list[tuple[Callable[[], Any], str]] = [
        (lambda: ss.sweep(floor, {"r": records}, ["shift"]), "has 2 drives, and the recorded one"),
        (
            lambda: ss.sweep(BLOCK, {"r": ss.Records({"q": {"b": made_up(1)}})}, ["shift"]),
            "records.b: unknown drive of sliding_base",
        ),
        (
            lambda: ss.sweep(BLOCK, {"mu": records}, ["shift"]),
            "over.mu: the name is already used",
        ),
        (lambda: ss.sweep(BLOCK, {"r": records, "q": records}, ["shift"]), "r and q are records"),
        (
            lambda: ss.sweep(BLOCK, {"r": records, "mu": [1]}, ["shift"], carry="mu"),
            "cannot be carried",
        ),
        (
            lambda: ss.sweep(BLOCK, {"r": records, "mu": [1, 2]}, ["shift"], **finely),
            "the values of r are not ordered",
        ),
        (lambda: ss.sweep(BLOCK, {"r": records}, ["period"]), "end, so no motion settles"),
        (
            lambda: ss.basin(BLOCK, {"x": records, "d_x": "0:1:2"}),
            "the name is already used",
        ),
    ]
    for call, words in asked:
        with pytest.raises(DeclarationError) as failed:
            call()
        assert words in str(failed.value)


def test_each_motion_has_its_limit_of_time() -> None:
    over = {"record": ss.Records(QUAKES), "scale": SCALES}
    found = ss.sweep(BLOCK, over, ["shift"], time_limit=1e-6)
    codes = set(found["outcome"].values.ravel().tolist())
    assert ss.Outcome.TIME_UP.code in codes
    assert not found.outcome.ok and not found.fragility("shift", 0.1).certificate.ok
