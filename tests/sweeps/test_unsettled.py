"""What is said of motions of a map that have not settled: irregular, slow, or out of budget."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from figures.boxes import hatched
from stickslip import Outcome
from stickslip.figures.drawing.cells import HATCHES
from stickslip.figures.sweep import plot_sweep
from stickslip.machine_code.emulated import Emulated
from stickslip.orbits.settling.engine import exponents
from stickslip.sweeps import basin as basins
from stickslip.sweeps.work import device
from stickslip.sweeps.work.chunk import measure_chunk

DUFFING = ss.System(
    "Duffing",
    parameters={"F": ss.Parameter(0.5), "c": ss.Parameter(0.3), "mu": ss.Parameter(0.02)},
    coordinates={"x": ss.Inertial()},
    kinetic="d_x**2/2",
    potential="x**4/4 - x**2/2 - F*cos(1.2*t)*x",
    viscous="c/2*d_x**2",
    contacts={"pad": ss.Contact("d_x", "mu")},
    initial={"x": 0.1, "d_x": 0.2},
    span=(0, 100),
)
TORUS = ss.System(
    "torus",
    parameters={"omega": ss.Parameter(0.7), "c": ss.Parameter(0.0)},
    coordinates={"x": ss.Inertial()},
    kinetic="d_x**2/2",
    potential="x**2/2 + x**4/4 - 0.1*cos(omega*t)*x",
    viscous="c/2*d_x**2",
    initial={"x": 0.5},
    span=(0, 20),
)
UNSETTLED = (Outcome.IRREGULAR, Outcome.SLOW, Outcome.NOT_SETTLED)


def outcomes(found: dict[str, np.ndarray]) -> list[Outcome]:
    return [Outcome.from_code(int(code)) for code in found["outcome"]]


def test_neighbours_that_part_are_irregular() -> None:
    """As the exponent says that was asked for, whether it was or not."""
    given = {"F": np.array([0.2, 0.5, 0.49])}
    found = measure_chunk(DUFFING, {}, given, ("amplitude",), ss.Settings())
    regular, *irregular = outcomes(found)
    assert regular is Outcome.PERIODIC
    assert irregular == [Outcome.IRREGULAR] * 2
    assert np.all(np.isfinite(found["amplitude"])) and np.all(found["lacking"][1:] > 0)
    asked = measure_chunk(DUFFING, {}, given, ("amplitude", "lyapunov"), ss.Settings())
    assert outcomes(asked) == outcomes(found)
    assert np.all(asked["lyapunov"][1:] > 0.05)
    np.testing.assert_array_equal(asked["amplitude"], found["amplitude"])


def test_what_comes_closer_to_a_cycle_is_slow() -> None:
    """A motion whose time is up while it still nears its cycle; with more time it has settled."""
    given = {"F": np.linspace(0.05, 0.15, 8), "mu": np.zeros(8)}
    short = measure_chunk(DUFFING, {}, given, ("amplitude",), ss.Settings(max_time=60.0))
    long = measure_chunk(DUFFING, {}, given, ("amplitude",), ss.Settings())
    assert set(outcomes(long)) == {Outcome.PERIODIC}
    late = [outcome for outcome in outcomes(short) if outcome is not Outcome.PERIODIC]
    assert len(late) > 3 and set(late) <= {Outcome.SLOW, Outcome.NOT_SETTLED}
    assert late.count(Outcome.SLOW) >= 0.75 * len(late)


def test_what_dies_down_is_slow() -> None:
    """Close to the force from which on a string sounds."""
    bow = ss.catalogue.bowed_string()
    p = bow.values
    damping = 4.0 * np.pi * p["f"] * p["zeta"] * p["m"]
    least = damping * (p["v_0"] + p["V"]) ** 2 / ((p["mu_s"] - p["mu_d"]) * p["v_0"])
    given = {"F": least * np.array([0.9, 0.99, 1.01, 1.5])}
    found = outcomes(measure_chunk(bow, {}, given, ("amplitude",), ss.Settings(max_time=3.0)))
    assert found[0] in (Outcome.STEADY, Outcome.SLOW)
    assert found[1] is Outcome.SLOW


def test_what_turns_on_a_torus_is_neither() -> None:
    x = np.linspace(0.1, 0.5, 12)
    given = {"omega": np.full(12, 0.43)}
    found = outcomes(measure_chunk(TORUS, {"x": x}, given, ("amplitude",), ss.Settings()))
    assert found.count(Outcome.NOT_SETTLED) >= 11 and Outcome.IRREGULAR not in found


def test_a_gpu_says_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STICKSLIP_EMULATE_GPU", "1")
    made = Emulated()
    monkeypatch.setattr(device, "_emulated", lambda: made)
    over = {"F": [0.06, 0.1, 0.5]}
    settings = ss.Settings(max_time=60.0, tolerance=1e-2)
    here, there = (
        ss.sweep(DUFFING, over, ["amplitude"], settings=settings, device=where)
        for where in ("cpu", "gpu")
    )
    assert here["outcome"].values.tolist() == there["outcome"].values.tolist()
    assert {Outcome.from_code(int(c)) for c in here["outcome"]} & {*UNSETTLED}


def test_it_takes_no_longer_than_the_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neighbours are followed for as long as the motion was, at most."""
    lasted = list[float]()
    true = exponents.grow_all

    def counted(e, twin, m, rules, saved, bench, found):
        lasted.extend((m.real[m.numbers[:, 0] == 2, 1]).tolist())
        true(e, twin, m, rules, saved, bench, found)

    monkeypatch.setattr(exponents, "grow_all", counted)
    settings = ss.Settings(max_time=500.0)
    measure_chunk(DUFFING, {}, {"F": np.array([0.5])}, ("amplitude",), settings)
    assert len(lasted) == 1
    assert 2 * exponents.TURNS * lasted[0] <= 510.0


@pytest.fixture(scope="module")
def regimes() -> ss.Map:
    over = {"F": "0.1:0.6:11", "mu": "0:0.1:7"}
    return ss.sweep(DUFFING, over, ["period", "amplitude"], settings=ss.Settings(max_time=300.0))


def test_a_map_counts_and_draws_them(regimes: ss.Map) -> None:
    codes = regimes["outcome"].values
    irregular = codes == Outcome.IRREGULAR.code
    assert np.any(irregular)
    rows = {name.strip(): text for name, text in regimes.rows()}
    assert rows["irregular"] == str(np.count_nonzero(irregular))
    figure = regimes.plot()
    cells = [part for axes in figure.axes[:2] for part in hatched(axes) if part[0] == "x"]
    assert len(cells) == 4  # a dark line on a white one, in two maps
    for _, corners in cells:
        assert area(corners) == pytest.approx(area_of(regimes, irregular))
    said = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"not converged: irregular", "no value: irregular"} <= said
    colours = regimes.plot("outcome").axes[1]
    assert "irregular" in [text.get_text() for text in colours.get_yticklabels()]


def area(corners: np.ndarray) -> float:
    """Of rectangles."""
    sides = np.max(corners, axis=1) - np.min(corners, axis=1)
    return float(np.sum(np.prod(sides, axis=1)))


def area_of(found: ss.Map, where: np.ndarray) -> float:
    """Of so many equal cells."""
    steps = [float(np.diff(found[str(d)].values[:2])[0]) for d in found["outcome"].dims]
    return float(np.prod(steps)) * np.count_nonzero(where)


def test_maps_that_know_of_no_classes_are_drawn(regimes: ss.Map) -> None:
    """Of an older store whose points are not classed; of one that was begun by an older version and
    is gone on with, the attributes do not list all codes."""
    data = regimes.dataset.copy(deep=True)
    classed = np.isin(data["outcome"].values, [kind.code for kind in UNSETTLED])
    data["outcome"].values[classed] = Outcome.NOT_SETTLED.code
    known = [kind for kind in Outcome if kind not in (Outcome.IRREGULAR, Outcome.SLOW)]
    old = {
        "flag_values": [-1, -2, *(kind.code for kind in known)],
        "flag_meanings": " ".join(
            ["not_computed", "interpolated"]
            + ["not_settled" if k.code == 12 else k.label.replace(" ", "_") for k in known]
        ),
    }
    data["outcome"].attrs.update(old)
    figure = plot_sweep(data)
    said = {text.get_text() for text in figure.legends[0].get_texts()}
    assert "no value: not settled" in said and not any("irregular" in text for text in said)
    data["outcome"].values[:] = regimes["outcome"].values
    assert any("irregular" in t.get_text() for t in plot_sweep(data).legends[0].get_texts())


def test_lines_mark_them() -> None:
    found = ss.sweep(DUFFING, {"F": "0.1:0.6:15"}, ["amplitude"], settings=ss.Settings())
    (axes,) = found.plot().axes
    markers = {str(line.get_marker()): len(np.asarray(line.get_xdata())) for line in axes.lines}
    codes = found["outcome"].values
    assert markers["X"] == np.count_nonzero(codes == Outcome.IRREGULAR.code) > 0


def test_what_has_not_settled_is_classed_as_in_maps() -> None:
    """Irregular, slow or out of budget, in the same colours and hatching."""
    over = {"x": "-1.5:1.5:7", "d_x": "-1.0:1.0:5"}
    labels = {
        Outcome.IRREGULAR: basins.PARTING,
        Outcome.SLOW: basins.SLOWLY,
        Outcome.NOT_SETTLED: basins.ON_ITS_WAY,
    }
    seen = set[Outcome]()
    for system, settings in (
        (DUFFING, ss.Settings(max_time=300.0)),
        (DUFFING.with_parameters(F=0.1, mu=0.0), ss.Settings(max_time=60.0)),
        (TORUS.with_parameters(omega=0.43), ss.Settings()),
    ):
        found = ss.basin(system, over, settings=settings)
        outcome = ss.sweep(system, over, ["amplitude:x"], settings=settings)["outcome"].values
        for kind, label in labels.items():
            here = outcome == kind.code
            np.testing.assert_array_equal(found["attractor"].values == label, here)
            if np.any(here):
                seen.add(kind)
                words = found["attractor"].attrs["flag_meanings"].split()
                at = found["attractor"].attrs["flag_values"].tolist().index(label)
                assert words[at] == kind.label.replace(" ", "_")
                drawn = found.plot()
                shown = {text.get_text() for text in drawn.legends[0].get_texts()}
                assert f"not converged: {kind.label}" in shown
                assert HATCHES[kind] in {letter for letter, _ in hatched(drawn.axes[0])}
    assert seen == {*labels}
