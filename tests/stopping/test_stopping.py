"""Computations that last: limits of wall-clock time, and Ctrl-C while a compiled loop runs."""

from __future__ import annotations

import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from signals import control_c
from stickslip.errors import DeclarationError, TimeLimitError
from stickslip.results import Completion
from stickslip.stopping.scopes import TimeUp, check_stop, scope, watching
from stickslip.symbolic import expressions as ex

# Two drives without a common period: the motion goes on for ever, and settles on nothing but
# without the second one.
ENDLESS = ss.System(
    "endless",
    parameters={"omega": ss.Parameter(0.5), "Q": ss.Parameter(0.5)},
    coordinates={"x": ss.Inertial(force="cos(omega*t) + Q*cos(sqrt(2)*omega*t)")},
    kinetic="d_x**2/2",
    potential="x**2/2",
    contacts={"ground": ss.Contact("d_x", "0.6")},
    span=(0.0, 100.0),
)
FOR_EVER = (0.0, 1e9)
PATIENT = ss.Settings(max_time=1e9, max_cycles=10**9, max_events=10**12)
MANY = 10**12  # events
# Nothing ever happens, but a guard that feels several frequencies has to be watched.
QUIET = ss.System(
    "quiet",
    coordinates={"x": ss.Inertial(force="0.1*cos(t) + 0.05*cos(1.4142135*t)"), "y": ss.Inertial()},
    kinetic="d_x**2/2 + d_y**2/2",
    potential="x**2 + (x - y)**2/2",
    viscous="0.01*d_x**2/2",
    contacts={"floor": ss.Contact("d_y", "10 - 1e-12*t")},
    span=(0.0, 60.0),
)


@pytest.fixture(autouse=True, scope="module")
def _compiled() -> None:
    for system in (ENDLESS, QUIET):
        assert ss.simulate(system, (0.0, 10.0)).audit.residuals.max() < 1e-9


def is_sound(motion: ss.Trajectory) -> bool:
    """Whether a motion that was ended obeys all laws up to there."""
    return bool(np.all(motion.audit.residuals < 1e-9) and not np.any(motion.audit.open))


# -- limits of time --------------------------------------------------------------------------------


@pytest.mark.parametrize("system", [ENDLESS, QUIET])
@pytest.mark.parametrize("flow", ["auto", "taylor"])
def test_a_motion_is_what_it_is_up_to_its_limit(system: ss.System, flow: Any) -> None:
    began = time.monotonic()
    given: dict[str, Any] = {"max_events": MANY, "flow": flow}
    found = ss.simulate(system, (0.0, 1e12), time_limit=0.2, **given)
    assert time.monotonic() - began < 2.2
    assert found.outcome is ss.Outcome.TIME_UP and not found.outcome.ok
    assert found.certificate.outcome == "time limit reached"
    count = min(len(found.knots.clock) - 1, 5000)
    part = ss.simulate(system, (0.0, float(found.knots.time[count])), **given)
    names = ("clock", "state", "mode", "region", "cause")
    for name in names:  # the last knot of the part is cut off by its end
        whole, own = (getattr(motion.knots, name)[:count] for motion in (found, part))
        np.testing.assert_array_equal(whole[: count - 1], own[: count - 1])
    assert len(part.knots.clock) == count + 1
    if system is ENDLESS:
        begin = float(found.knots.time[-1])
        last = ss.simulate(system, (begin, begin + 1.0), initial=found.final)
        assert last.outcome.ok  # it can be gone on with


def test_a_limit_that_is_not_reached_changes_no_bit() -> None:
    toy = ss.catalogue.rocking_toy()
    one, other = (ss.simulate(toy, time_limit=limit) for limit in (None, 1e4))
    np.testing.assert_array_equal(one.knots.state, other.knots.state)
    over = {"P": "0.8:1.4:5", "delta": "log:0.02:0.3:5"}
    maps = [ss.sweep(toy, over, ["speed", "lyapunov"], time_limit=x) for x in (None, 1e4)]
    for name in map(str, maps[0].dataset.data_vars):
        assert maps[0][name].values.tobytes() == maps[1][name].values.tobytes()
    cycles = [ss.find_cycle(toy, time_limit=limit) for limit in (None, 1e4)]
    assert cycles[0].period == cycles[1].period
    ends = [ss.simulate_many(toy, parameters={"P": [0.8, 1.0]}, time_limit=x) for x in (None, 1e4)]
    assert ends[0].dataset.equals(ends[1].dataset)


def test_many_motions_end_where_they_are() -> None:
    began = time.monotonic()
    omega = np.linspace(0.4, 0.6, 40)
    found = ss.simulate_many(
        ENDLESS, FOR_EVER, parameters={"omega": omega}, max_events=MANY, time_limit=0.3, workers=2
    )
    assert time.monotonic() - began < 2.3
    assert found.outcome is Completion.TIME_UP
    reached = found["time"].values
    assert np.all(found["outcome"].values == ss.Outcome.TIME_UP.code)
    assert 0.0 < np.max(reached) < 1e9
    # Those that were begun are where they are, and those that were not are where they start.
    for i in [int(np.argmax(reached)), *np.flatnonzero(reached == 0.0)[:1]]:
        state = found["final_x"].values[i]
        assert state == 0.0 if reached[i] == 0.0 else state != 0.0


def test_a_point_that_takes_too_long_stops_no_other(tmp_path: Path) -> None:
    over = {"Q": [0.0, 0.4, 0.5]}
    store = tmp_path / "map.zarr"
    began = time.monotonic()
    found = ss.sweep(ENDLESS, over, ["amplitude"], store, settings=PATIENT, time_limit=0.2)
    assert time.monotonic() - began < 4.0
    late = ss.Outcome.TIME_UP.code
    assert found["outcome"].values.tolist() == [ss.Outcome.PERIODIC.code, late, late]
    assert np.isnan(found["amplitude"].values[1:]).all()
    assert found.outcome is Completion.TIME_UP and "2 of them reached" in found.message
    assert found.lacking == {"result": 2}
    assert ss.open(store).outcome is Completion.TIME_UP
    # They are tried again when the map is taken up again, and they alone.
    seen: list[int] = []
    again = ss.sweep(
        ENDLESS,
        over,
        ["amplitude"],
        store,
        settings=PATIENT,
        time_limit=0.1,
        progress=lambda state: seen.append(state.new),
    )
    assert again["outcome"].values.tolist() == found["outcome"].values.tolist()
    assert max(seen) == 2


def test_measuring_again_is_part_of_the_time_of_a_point(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is measured in the motion of a period once more ends with the limit, too, and the point
    is tried again."""
    given: list[Any] = []
    whole = ss.simulate

    def slow(system: ss.System, span: Any, **more: Any) -> ss.Trajectory:
        given.append(scope().limit)
        scope().late[0] = 1  # as the watchman does when the time is up
        return whole(system, span, **more)

    monkeypatch.setattr("stickslip.motion.simulate.simulate", slow)
    system = ss.catalogue.forced_oscillator()
    over = {"omega": [0.4, 0.5]}
    found = ss.sweep(system, over, ["harmonic:x", "amplitude"], time_limit=60.0, workers=1)
    assert given == [60.0, 60.0]
    assert found["outcome"].values.tolist() == [ss.Outcome.TIME_UP.code] * 2
    assert np.isnan(found["harmonic:x"].values).all() and np.isnan(found["amplitude"].values).all()
    assert found.outcome is Completion.TIME_UP


def test_auditing_a_motion_under_a_record_is_part_of_its_time() -> None:
    """The audit takes several times as long as the motion; with the limit, neither goes on."""
    t = np.linspace(0.0, 1500.0, 150_001)
    noise = np.random.default_rng(0).standard_normal(len(t))
    block = ss.catalogue.sliding_base(a=ss.Samples(t, noise))
    ss.sweep(block, {"mu": [0.1]}, ["shift"], span=(0.0, 1.0))
    began = time.process_time()
    found = ss.sweep(block, {"mu": [0.1, 0.2]}, ["shift"], time_limit=0.5, workers=1)
    assert time.process_time() - began < 6.0
    assert found["outcome"].values.tolist() == [ss.Outcome.TIME_UP.code] * 2
    assert np.isnan(found["shift"].values).all()


def chain(blocks: int) -> ss.System:
    """Blocks with rate-and-state friction, coupled and pulled for 63 years."""
    pair = ss.catalogue.two_block_rate_and_state()
    names = ("D_c", "mu_0", "v_0", "sigma", "eta", "V")
    number = range(blocks)
    drag = "sigma*friction(d_x_{0}, theta_{0}, 0.01, 0.0{1}) + eta*d_x_{0}"
    return ss.System(
        "chain",
        parameters={name: pair.parameters[name] for name in names},
        functions=pair.functions,
        drives=pair.drives,
        coordinates={f"x_{i}": ss.Viscous(drag=drag.format(i, 15 + i % 4)) for i in number},
        internal={f"theta_{i}": ss.Internal(f"evolution(d_x_{i}*theta_{i}/D_c)") for i in number},
        potential=" + ".join(
            [f"5e6*(pull + sigma*mu_0/1e7 - x_{i})**2" for i in number]
            + [f"2.5e6*(x_{i} - x_{i + 1})**2" for i in number[1:-1]]
        ),
        initial={f"theta_{i}": 4e6 + 1e5 * i**2 for i in number},
        span=(0.0, 2e9),
    )


def test_a_long_chain_ends_with_its_limit_wherever_it_is() -> None:
    """2e9 s of a rate-and-state chain, which take minutes: a motion, many, a map, a basin, a
    cycle."""
    system = chain(12)
    ss.simulate(system, (0.0, 1.0))
    asked: dict[str, Callable[[], Any]] = {
        "motion": lambda: ss.simulate(system, time_limit=0.5),
        "many": lambda: ss.simulate_many(system, parameters={"V": [1e-9, 2e-9]}, time_limit=0.5),
        "map": lambda: ss.sweep(system, {"V": [1e-9]}, ["mean:x_0", "period"], time_limit=0.5),
        "basin": lambda: ss.basin(system, {"x_0": "0:1:2"}, time_limit=0.5),
    }
    for name, call in asked.items():
        began = time.monotonic()
        found = call()
        assert time.monotonic() - began < 12.0, name
        if name != "basin":  # which counts them as stopped
            assert found.outcome.label == "time limit reached", name
    began = time.monotonic()
    with pytest.raises(TimeLimitError):
        ss.find_cycle(system, time_limit=0.5)
    assert time.monotonic() - began < 12.0


def test_a_line_of_points_goes_on_from_before_the_one_that_takes_too_long() -> None:
    found = ss.sweep(
        ENDLESS, {"Q": [0.0, 0.5]}, ["amplitude"], settings=PATIENT, carry="Q", time_limit=0.2
    )
    periodic, late = ss.Outcome.PERIODIC.code, ss.Outcome.TIME_UP.code
    assert found["outcome"].values.tolist() == [periodic, late]
    np.testing.assert_array_equal(found["carried_x"].values[1], found["carried_x"].values[0])


def test_states_that_take_too_long_have_stopped() -> None:
    over = {"x": "-1.0:1.0:2", "d_x": "0.0:1.0:2"}
    found = ss.basin(ENDLESS, over, settings=PATIENT, time_limit=0.05)
    assert np.all(found["attractor"].values == -1)


def test_a_cycle_that_takes_too_long() -> None:
    system = replace(ss.catalogue.forced_oscillator(), span=(0.0, 1e9))
    began = time.monotonic()
    with pytest.raises(TimeLimitError, match=r"time limit of 0\.2 s.* Increase time_limit"):
        ss.find_cycle(system, time_limit=0.2)
    assert time.monotonic() - began < 2.2


def test_a_branch_is_kept_up_to_its_limit() -> None:
    cycle = ss.find_cycle(ss.catalogue.rocking_toy())
    short = ss.StepControl(first=1e-4, largest=1e-4)
    found = ss.continue_cycle(cycle, "P", (0.6, 1.4), steps=short, time_limit=1.0)
    assert found.outcome is Completion.TIME_UP and "the time limit was reached" in found.ended
    assert found.points.sizes["point"] > 3 and found.certificate.ok
    with pytest.raises(TimeLimitError):
        ss.continue_cycle(cycle, "P", (0.6, 1.4), time_limit=1e-6)


def test_a_branch_of_equilibria_is_kept_up_to_its_limit() -> None:
    short = ss.StepControl(first=1e-6, largest=1e-6)
    belt = ss.catalogue.belt_stribeck()
    found = ss.continue_equilibrium(belt, "V", (0.01, 3.0), steps=short, time_limit=0.5)
    assert found.outcome is Completion.TIME_UP and found.points.sizes["point"] > 3


def test_a_response_is_kept_up_to_its_limit(tmp_path: Path) -> None:
    system = ss.catalogue.forced_oscillator()
    found = ss.frequency_response(system, "omega", (0.3, 2.0), points=2000, time_limit=1.0)
    assert found.outcome is Completion.TIME_UP
    assert np.any(np.isfinite(found["swept_amplitude"].values))
    found.save(tmp_path / "response.nc")
    assert ss.open(tmp_path / "response.nc").outcome is Completion.TIME_UP
    with pytest.raises(TimeLimitError):
        ss.frequency_response(system, "omega", (0.3, 2.0), time_limit=1e-6)


BAD = [0, -1.0, float("nan"), float("inf"), True]


@pytest.mark.parametrize("limit", BAD)
def test_no_duration(limit: Any) -> None:
    toy = ss.catalogue.rocking_toy()
    cycle = ss.find_cycle(toy)
    calls: list[Callable[[], Any]] = [
        lambda: ss.simulate(toy, time_limit=limit),
        lambda: ss.simulate_many(toy, time_limit=limit),
        lambda: ss.find_cycle(toy, time_limit=limit),
        lambda: ss.continue_cycle(cycle, "P", (0.8, 1.2), time_limit=limit),
        lambda: ss.sweep(toy, {"P": [1.0]}, ["speed"], time_limit=limit),
        lambda: ss.basin(toy, {"psi": "0:1:2", "d_psi": "0:1:2"}, time_limit=limit),
        lambda: ss.frequency_response(
            ss.catalogue.forced_oscillator(), "omega", (0.5, 1.0), time_limit=limit
        ),
        lambda: ss.continue_equilibrium(
            ss.catalogue.belt_stribeck(), "V", (0.1, 1.0), time_limit=limit
        ),
    ]
    for call in calls:
        with pytest.raises(DeclarationError, match=r"time_limit"):
            call()


def test_a_gpu_has_no_clock_for_each_motion() -> None:
    with pytest.raises(DeclarationError, match="time_limit: a GPU computes all motions"):
        ss.sweep(ENDLESS, {"Q": [1.0]}, ["amplitude"], device="gpu", time_limit=1.0)


# -- Ctrl-C ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("system", [ENDLESS, QUIET])
def test_control_c_keeps_a_sound_motion(system: ss.System) -> None:
    """However often it comes while a compiled loop runs, no step is lost."""
    for delay in (0.1, 0.15, 0.2):
        with control_c(delay) as sent:
            found = ss.simulate(system, (0.0, 1e12), max_events=MANY)
        assert time.monotonic() - sent[0] < 2.0
        assert found.outcome is ss.Outcome.INTERRUPTED
        begin = max(len(found.knots.clock) - 5000, 0)
        if system is ENDLESS:
            assert is_sound(last_part(found, begin))


def last_part(motion: ss.Trajectory, begin: int) -> ss.Trajectory:
    """A motion from a knot on."""
    from stickslip.motion.record.knots import Knots

    k = motion.knots
    parts = (part[begin:] for part in (k.clock, k.state, k.mode, k.region, k.cause))
    knots = Knots(*parts, origin=k.origin)
    span = float(knots.time[0]), float(knots.time[-1])
    return ss.Trajectory(motion.problem, span, knots, motion.outcome)


def test_control_c_is_heard_in_an_audit() -> None:
    motion = ss.simulate(QUIET, (0.0, 1e12), time_limit=0.3)
    with control_c(0.2) as sent, pytest.raises(KeyboardInterrupt):
        motion.audit  # noqa: B018
    assert time.monotonic() - sent[0] < 2.0


def test_control_c_is_heard_by_many_motions() -> None:
    omega = np.linspace(0.4, 0.6, 40)
    with control_c(0.3) as sent:
        found = ss.simulate_many(ENDLESS, FOR_EVER, parameters={"omega": omega}, max_events=MANY)
    assert time.monotonic() - sent[0] < 2.0
    assert found.outcome.interrupted
    assert np.all(found["outcome"].values == ss.Outcome.INTERRUPTED.code)


def test_control_c_is_heard_in_the_search_for_a_cycle() -> None:
    system = replace(ss.catalogue.forced_oscillator(), span=(0.0, 1e9))
    with control_c(0.3) as sent, pytest.raises(KeyboardInterrupt):
        ss.find_cycle(system)
    assert time.monotonic() - sent[0] < 2.0


def test_control_c_is_heard_in_a_play() -> None:
    with control_c(0.3) as sent, pytest.raises(KeyboardInterrupt):
        ss.play("5*sin(t)", "1 + cos(2*pi*s)/2", (0.0, 1e6), initial=0.0, epsilon=1e-3)
    assert time.monotonic() - sent[0] < 2.0


def test_control_c_is_heard_in_averages() -> None:
    turning = ss.Ellipsoid(
        [["2 + cos(2*pi*s)", "sin(2*pi*s)/5"], ["sin(2*pi*s)/5", "1.5 + sin(2*pi*s)"]]
    )
    with control_c(0.3) as sent, pytest.raises(KeyboardInterrupt):
        while True:
            turning.average(1e-10).optimal_motion([1.0, 0.3])
    assert time.monotonic() - sent[0] < 2.0


def test_control_c_keeps_the_best_of_a_fit() -> None:
    motion = ss.simulate(ss.catalogue.belt_stribeck(), (0.0, 30.0))
    t = np.linspace(0.0, 30.0, 300)
    data = {"time": t, "x": np.array([motion.at(float(at))["x"] for at in t])}
    free = {"F_s": (0.3, 3.0), "F_c": (0.05, 1.0), "v_s": (0.05, 2.0)}
    asked = ss.catalogue.belt_stribeck(), data, free, {"x": "x"}
    ss.fit(*asked, starts=1)  # everything is imported
    with control_c(0.5) as sent:
        found = ss.fit(*asked, starts=1000)
    assert time.monotonic() - sent[0] < 2.0
    assert not found.complete
    assert set(found.estimate) == set(free)


def test_control_c_ends_a_whole_response() -> None:
    """And not only the motion, or the line, that is computed when it comes."""
    with control_c(1.0) as sent:
        found = ss.frequency_response(
            ss.catalogue.forced_oscillator(), "omega", (0.3, 2.0), points=500
        )
    assert time.monotonic() - sent[0] < 2.0
    assert found.outcome.interrupted
    assert np.any(np.isfinite(found["swept_amplitude"].values))


def test_a_handler_that_lets_it_go_on_changes_no_bit() -> None:
    heard: list[int] = []

    def handler(number: int, frame: FrameType | None) -> None:
        heard.append(number)

    toy = replace(ss.catalogue.rocking_toy(), span=(0.0, 3e5))
    expected = ss.simulate(toy, max_events=MANY)
    before = signal.signal(signal.SIGINT, handler)
    try:
        with control_c(0.05), control_c(0.1), control_c(0.15):
            found = ss.simulate(toy, max_events=MANY)
    finally:
        signal.signal(signal.SIGINT, before)
    assert found.outcome is expected.outcome
    np.testing.assert_array_equal(found.knots.state[-1], expected.knots.state[-1])
    assert heard == [signal.SIGINT] * len(heard)


def test_who_else_listens_to_signals_still_does() -> None:
    ours, theirs = socket.socketpair()
    theirs.setblocking(False)
    ours.settimeout(5.0)
    before = signal.set_wakeup_fd(theirs.fileno())
    try:
        with control_c(0.1):
            ss.simulate(ENDLESS, FOR_EVER, max_events=MANY)
        assert ours.recv(10) == bytes([signal.SIGINT])
        assert signal.set_wakeup_fd(theirs.fileno()) == theirs.fileno()
    finally:
        signal.set_wakeup_fd(before)
        ours.close()
        theirs.close()


# -- scopes ----------------------------------------------------------------------------------------


def test_the_limit_of_the_outer_scope_ends_the_inner_one() -> None:
    with watching(0.1) as outer, pytest.raises(TimeUp) as up:
        ss.simulate(ENDLESS, FOR_EVER, max_events=MANY, time_limit=100.0)
    assert outer.ends(up.value)
    with watching(0.5) as outer:
        ss.simulate(ENDLESS, (0.0, 10.0), time_limit=100.0)  # which takes nothing of it away
        with pytest.raises(TimeUp) as up:
            ss.simulate(ENDLESS, FOR_EVER, max_events=MANY)
        assert outer.ends(up.value)
    with watching(100.0):
        found = ss.simulate(ENDLESS, FOR_EVER, max_events=MANY, time_limit=0.1)
    assert found.outcome is ss.Outcome.TIME_UP
    assert not check_stop()


def test_limits_in_threads_know_nothing_of_each_other() -> None:
    taken: dict[float, float] = {}

    def work(limit: float) -> None:
        began = time.monotonic()
        ss.simulate(ENDLESS, FOR_EVER, max_events=MANY, time_limit=limit)
        taken[limit] = time.monotonic() - began

    threads = [threading.Thread(target=work, args=[limit]) for limit in (0.2, 0.6, 0.4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    assert all(limit <= taken[limit] < limit + 2.0 for limit in (0.2, 0.6, 0.4))


# -- threads ---------------------------------------------------------------------------------------


def test_equal_expressions_are_one_object_whoever_makes_them() -> None:
    """Workers of a map read the same model at the same time."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        for trial in range(200):
            names = [f"name_{trial}_{j}" for j in range(50)]
            gate = threading.Barrier(2)
            made: list[list[ex.Expr]] = []

            def make(names: list[str] = names, gate: threading.Barrier = gate) -> None:
                gate.wait()
                made.append([ex.sym(name) * 2.0 + ex.sym(names[0]) for name in names])  # noqa: B023

            threads = [threading.Thread(target=make) for _ in range(2)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            assert all(one is other for one, other in zip(*made, strict=True))
    finally:
        sys.setswitchinterval(before)


@pytest.mark.skipif(not hasattr(time, "pthread_getcpuclockid"), reason="no clock of a thread")
def test_a_budget_of_processor_time() -> None:
    """Time that others have does not count: a limit of each point of a map is fair on a busy
    machine."""
    with watching(0.2, processor=True) as own:
        time.sleep(0.5)
        assert not check_stop()
        begin = time.thread_time()
        with pytest.raises(TimeUp) as up:
            while time.thread_time() < begin + 5.0:
                check_stop()
        assert own.ends(up.value)
        assert 0.15 < time.thread_time() - begin < 2.0
