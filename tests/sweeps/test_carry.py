"""Maps that carry the state: against an integrator that does the same by hand, in the same bits
whoever computes them, and after any interruption."""

from __future__ import annotations

import os
import signal
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.errors import DeclarationError, StickslipError
from stickslip.figures.sweep import plot_sweep
from stickslip.sweeps.sweep import Progress
from systems import parameters


def duffing(mu: float = 0.1) -> ss.System:
    """A hardening spring, dry and viscous friction, and a force."""
    return ss.System(
        "hardening",
        parameters={
            "omega": ss.Parameter(1.0, "rad/s", "frequency"),
            "F": ss.Parameter(0.3, "N"),
            "mu": ss.Parameter(mu, "N"),
        },
        coordinates={"x": ss.Inertial(force="F*cos(omega*t) - 0.05*d_x", unit="m")},
        kinetic="d_x**2/2",
        potential="x**2/2 + x**4/4",
        contacts={"ground": ss.Contact("d_x", "mu", unit="N")},
        span=(0.0, 100.0),
        time_unit="s",
    )


OSCILLATOR = duffing()
PERIODIC = ss.Outcome.PERIODIC.code
OVER = {"omega": "0.9:2:45", "F": [0.2, 0.25, 0.3]}


def equal(a: xr.Dataset, b: xr.Dataset) -> bool:
    """Bit by bit."""
    return all(a[n].values.tobytes() == b[n].values.tobytes() for n in [*b.data_vars, *b.coords])


def test_hysteresis_as_an_integrator_finds_it() -> None:
    """Up and down through the jumps of a Duffing oscillator without dry friction, at the same phase
    of the force: scipy's integrator does it period by period."""
    smooth = ss.System(
        "smooth",
        parameters=parameters(omega=1.0),
        coordinates={"x": ss.Inertial(force="0.3*cos(omega*t) - 0.1*d_x")},
        kinetic="d_x**2/2",
        potential="x**2/2 + x**4/4",
        span=(0.0, 100.0),
    )
    values = [1.2, 1.5, 1.9]
    found = ss.sweep(smooth, {"omega": values}, ["high:x"], carry="omega both")

    def field(t: float, y: Any, omega: float) -> list[float]:
        return [y[1], 0.3 * np.cos(omega * t) - 0.1 * y[1] - y[0] - y[0] ** 3]

    y = np.zeros(2)
    expected = list[float]()
    for omega in [*values, *values[::-1]]:
        period = 2.0 * np.pi / omega
        way = {"args": (omega,), "rtol": 1e-10, "atol": 1e-12, "method": "DOP853"}
        y = solve_ivp(field, (0.0, 90 * period), y, **way).y[:, -1]
        last = solve_ivp(field, (0.0, period), y, dense_output=True, **way)
        x = last.sol(np.linspace(0.0, period, 4001))[0]
        expected.append(float(np.max(x)))
    high = np.concatenate([found["high:x"].values[:, 0], found["high:x"].values[::-1, 1]])
    assert np.max(np.abs(high - expected)) < 1e-5
    assert expected[1] > expected[4] + 1.0  # there is a jump between the two ways


def test_up_and_down_with_dry_friction() -> None:
    found = ss.sweep(OSCILLATOR, OVER, ["amplitude"], carry="omega both")
    assert found.certificate.ok
    up, down = (found["amplitude"].sel(direction=way).values for way in (1, -1))
    alone = ss.sweep(OSCILLATOR, OVER, ["amplitude"])["amplitude"].values
    # Wherever both agree there is one motion only, and a motion of its own finds it, too.
    one = np.abs(up - down) < 1e-7
    assert np.max(np.abs(up - alone)[one]) < 1e-7
    assert np.all(up[~one] > down[~one] + 0.1)
    assert 0 < np.count_nonzero(~one) < one.size
    # What ends up on one of both is what a motion of its own would have found by chance.
    assert np.all(np.minimum(np.abs(up - alone), np.abs(down - alone)) < 1e-7)
    assert "carried along" in str(found.summary())
    assert found.carried == "omega up and down"
    assert found.measures == ["amplitude"]


def test_a_pulled_block_is_not_thrown() -> None:
    """The load Vt does not jump when V changes: the frame goes back to where time begins, and the
    cycle of a block that is pulled is the one that theory has (Popov 2010, chapter 12)."""
    block = ss.System(
        "pulled",
        parameters=parameters(V=0.1),
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="(x - V*t)**2/2",
        contacts={"ground": ss.Contact("d_x", "1", kinetic="0.5")},
        span=(0.0, 100.0),
    )
    found = ss.sweep(block, {"V": "0.05:0.5:10"}, ["period"], carry="V").dataset
    V = found["V"].values
    # it slips until it is as fast as the ground again, in the frame of the pull
    slip = 2.0 * (np.pi - np.arctan(0.5 / V))
    stick = 2.0 * 0.5 / V
    assert np.max(np.abs(found["period"].values / (slip + stick) - 1.0)) < 1e-9
    assert np.all(found["carried_time"].values == 0.0)
    assert np.max(np.abs(found["carried_x"].values)) < 1.0 + 1e-9


def test_bits_do_not_depend_on_who_computes_them(tmp_path: Path) -> None:
    want = ss.sweep(OSCILLATOR, OVER, ["amplitude"], carry="omega", workers=1).dataset
    ways: list[dict[str, Any]] = [{"workers": 3}, {"scheduler": "processes", "workers": 2}]
    for way in ways:
        assert equal(ss.sweep(OSCILLATOR, OVER, ["amplitude"], carry="omega", **way).dataset, want)
    for F in (0.2, 0.3):  # lines know nothing of each other
        one = ss.sweep(OSCILLATOR, {**OVER, "F": [F]}, ["amplitude"], carry="omega").dataset
        assert equal(one.drop_attrs(), want.sel(F=[F]).drop_attrs())


def test_an_interrupted_line_goes_on(tmp_path: Path) -> None:
    over = {"omega": "0.9:2:120", "F": [0.2, 0.3]}

    def interrupt(state: Progress) -> None:
        if state.new > 0:
            os.kill(os.getpid(), signal.SIGINT)

    store = tmp_path / "map.zarr"
    way: dict[str, Any] = {"carry": "omega both", "workers": 1}
    part = ss.sweep(OSCILLATOR, over, ["amplitude"], store, progress=interrupt, **way)
    assert part.outcome.interrupted
    done = part.computed
    assert 0 < done < 480
    new = list[int]()
    whole = ss.sweep(
        OSCILLATOR, over, ["amplitude"], store, progress=lambda p: new.append(p.new), **way
    )
    assert new[-1] == 480 - done
    assert equal(whole.dataset, ss.sweep(OSCILLATOR, over, ["amplitude"], **way).dataset)
    assert ss.open(store).carried == "omega up and down"
    for file in sorted((store / "amplitude" / "c").rglob("*"))[-3:]:
        if file.is_file():
            file.write_bytes(b"broken")
    with pytest.raises(StickslipError, match="damaged"):
        ss.sweep(OSCILLATOR, over, ["amplitude"], store, **way)
    again = ss.sweep(OSCILLATOR, over, ["amplitude"], store, repair=True, **way)
    assert equal(again.dataset, whole.dataset)


def test_extending(tmp_path: Path) -> None:
    store = tmp_path / "map.zarr"
    first = {"omega": [1.0, 1.2, 1.4], "F": [0.2, 0.3]}
    ss.sweep(OSCILLATOR, first, ["amplitude"], store, carry="omega")
    more = {"omega": [1.0, 1.2, 1.4, 1.5, 1.6], "F": [0.2, 0.25, 0.3]}
    longer = ss.sweep(OSCILLATOR, more, ["amplitude"], store, carry="omega", extend=True)
    assert equal(longer.dataset, ss.sweep(OSCILLATOR, more, ["amplitude"], carry="omega").dataset)
    between = {**more, "omega": [1.0, 1.1, 1.2, 1.4, 1.5, 1.6]}
    with pytest.raises(StickslipError, match="do not follow the stored ones"):
        ss.sweep(OSCILLATOR, between, ["amplitude"], store, carry="omega", extend=True)
    with pytest.raises(StickslipError, match="carried differently"):
        ss.sweep(OSCILLATOR, more, ["amplitude"], store)


def test_directions() -> None:
    """Values are taken as they are given, or by size; parameters that are tied move together."""

    def swept(values: list[float], carry: str) -> list[float]:
        return ss.sweep(OSCILLATOR, {"omega": values}, ["amplitude"], carry=carry)[
            "amplitude"
        ].values.tolist()

    rising = np.linspace(0.9, 2.0, 12).tolist()
    falling = rising[::-1]
    up, down = swept(rising, "omega"), swept(falling, "omega")
    assert swept(rising, "omega down") == swept(falling, "omega down")[::-1] == down[::-1]
    assert swept(falling, "omega up") == up[::-1] != down
    tied = {"omega,F": [rising, [0.3] * 12]}
    found = ss.sweep(OSCILLATOR, tied, ["amplitude"], carry="omega,F up")
    assert found["amplitude"].values.tolist() == up


def test_what_cannot_move_hands_nothing_on() -> None:
    """Where friction cannot hold the start there is no motion, and the next point begins anew; from
    there on it is moved to where it is held."""
    toy = ss.catalogue.rocking_toy()
    found = ss.sweep(toy, {"P": [5.0, 4.0, 1.2, 1.25]}, ["speed"], carry="P").dataset
    assert found["outcome"].values.tolist() == [ss.Outcome.OUTSIDE.code] * 2 + [PERIODIC] * 2
    assert np.array_equal(np.isnan(found["carried_x_R"]), [True, True, False, False])


def test_a_motion_that_cannot_begin_hands_on_what_it_was_given() -> None:
    toy = ss.catalogue.rocking_toy()
    found = ss.sweep(toy, {"P": [1.2, 5.0, 1.25]}, ["speed"], carry="P").dataset
    outside = ss.Outcome.OUTSIDE.code
    assert found["outcome"].values.tolist() == [PERIODIC, outside, PERIODIC]
    assert found["carried_x_R"].values[1] == found["carried_x_R"].values[0]


def test_the_frame_of_what_does_not_repeat() -> None:
    """A plate that is shaken and pulled, and that has not settled, is taken back all the same."""
    plate = ss.catalogue.plate_compactor()
    short = ss.Settings(max_time=3.3)
    found = ss.sweep(plate, {"V": "0.05:0.1:4"}, ["speed:x"], settings=short, carry="V").dataset
    assert np.any(found["outcome"].values == ss.Outcome.NOT_SETTLED.code)
    assert np.all(found["carried_time"].values < 2.0 * np.pi / 60.0)
    assert np.all(np.abs(found["carried_x"].values) < 0.12)


def reach(motion: ss.Trajectory) -> float:
    """How far it was at the start."""
    return float(motion.at(motion.t_span[0])["x"])


def test_functions_and_formulas_see_the_motion_that_was_carried() -> None:
    found = ss.sweep(
        OSCILLATOR, {"omega": [1.0, 1.2, 1.4]}, [reach, "began = x", "amplitude"], carry="omega"
    ).dataset
    assert found["reach"].values[0] == 0.0
    assert np.array_equal(found["reach"].values[1:], found["carried_x"].values[:-1])
    assert np.array_equal(found["began"].values, found["reach"].values)


@pytest.mark.parametrize(
    ("over", "carry", "said"),
    [
        ({"omega": [1.0, 2.0]}, "F", "'F' is not an axis of the map"),
        ({"omega": [1.0, 2.0]}, "", "is not an axis of the map"),
        ({"omega": [1.0, 2.0]}, "omega sideways", "unknown direction 'sideways'"),
        ({"x": [1.0, 2.0]}, "x", "x is an initial value"),
        ({"omega": "random:4; 1:2"}, "omega", "sample, which is not ordered"),
        ({"omega": [1.0, 3.0, 2.0]}, "omega up", "are not monotone"),
    ],
)
def test_refused(over: dict[str, Any], carry: str, said: str) -> None:
    with pytest.raises(DeclarationError, match=said):
        ss.sweep(OSCILLATOR, over, ["amplitude"], carry=carry)


def test_refused_with_others() -> None:
    over = {"omega": "1:2:9"}
    with pytest.raises(DeclarationError, match="adaptive map omits points"):
        ss.sweep(OSCILLATOR, over, ["amplitude"], carry="omega", adaptive=ss.Adaptive())
    with pytest.raises(DeclarationError, match="carried_it"):
        ss.sweep(OSCILLATOR, over, ["carried_it = period"])


def test_lines_of_short_axes() -> None:
    """A line for each value of a short axis, up and down in other dashes; a legend with units."""
    over = {"omega": "0.9:2:12", "F": [0.2, 0.3]}
    found = ss.sweep(OSCILLATOR, over, ["amplitude"], carry="omega both")
    (axes,) = found.plot("amplitude").axes
    lines = [line for line in axes.get_lines() if len(np.asarray(line.get_xdata())) == 12]
    assert len(lines) == 4
    for (i, k), line in zip(np.ndindex(2, 2), lines, strict=True):
        drawn = np.asarray(line.get_ydata())
        assert np.array_equal(drawn, found["amplitude"].values[:, i, k])
    assert len({line.get_color() for line in lines}) == 2
    assert len({line.get_linestyle() for line in lines}) == 2
    legend = axes.get_legend()
    assert legend is not None
    texts = [text.get_text() for text in legend.texts]
    assert texts == ["$F$ = 0.2 N", "$F$ = 0.3 N", "up", "down"]
    assert "carried along" in str(axes.figure.get_suptitle())


def test_which_maps_are_lines() -> None:
    """A map needs more than six values of both axes; outcomes stay areas."""
    for count, lined in ((6, True), (7, False)):
        forces = np.linspace(0.2, 0.3, count)
        data = ss.sweep(OSCILLATOR, {"F": forces, "omega": "1.6:2:8"}, ["amplitude"]).dataset
        axes = plot_sweep(data, ["amplitude"]).axes[0]
        assert (len(axes.get_lines()) > 0) is lined
        assert len(plot_sweep(data, ["outcome"]).axes[0].get_lines()) == 0
        for one, other in pairwise(axes.get_lines()[:count]):
            assert one.get_color() != other.get_color()
