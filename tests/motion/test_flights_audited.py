"""Long flights are audited as a whole: what that says is what pieces say, and no fault passes."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import stickslip as ss
from stickslip.arrays import Array
from stickslip.equations.native.systems import compile_system
from stickslip.kept import kept
from stickslip.motion.affine.forms import ClosedForms
from stickslip.motion.audit.accounts import Accounts, make_accounts
from stickslip.motion.audit.flights.arrays import make_flight_audit
from stickslip.motion.audit.flights.whole import WHOLE, WITHOUT_EXTREMES, audit_motion
from stickslip.motion.audit.step_balance import audit_steps
from stickslip.motion.problem import pose
from stickslip.motion.record.audited import audited
from stickslip.motion.record.knots import Knots
from stickslip.motion.steps.arrays import Record
from stickslip.motion.trajectory import Trajectory

SPAN = (0.0, 0.12)


class Followed(NamedTuple):
    """What an audit says, how many steps it checked as a whole, and without extremes."""

    accounts: Accounts
    whole: int
    lost: int


def beam() -> ss.System:
    return ss.catalogue.cantilever()


def driven_twice() -> ss.System:
    """A stiff chain with dry contacts, two frequencies, and a load that grows."""
    n = 8
    stiffness = 1e4 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    body = ss.Structure(np.diag(np.geomspace(1.0, 1e-6, n)), stiffness, ss.ModalDamping(0.02))
    return ss.System(
        name="driven_twice",
        structures={"u": body},
        forces={"u[0]": "30*cos(40*t) + 20*t", "u[4]": "3*sin(150*t + 1)"},
        contacts={"rub": ss.Contact("d_u[2]", 5.0), "two": ss.Contact("d_u[5] - d_u[3]", 2.0)},
    )


SYSTEMS = {"beam": beam, "driven twice": driven_twice}


@cache
def motion(name: str) -> ss.Trajectory:
    return ss.simulate(SYSTEMS[name](), SPAN)


def halves(knots: Knots) -> tuple[Record, Record]:
    starts, ends = (
        Record(*(part[own] for part in knots.record)) for own in (slice(None, -1), slice(1, None))
    )
    return starts, ends


def as_a_whole(m: ss.Trajectory, knots: Knots, forms: ClosedForms | None = None) -> Followed:
    p = m.problem
    accounts = make_accounts(len(knots.time) - 1, p.rows)
    forms = p.closed_forms if forms is None else forms
    flights = make_flight_audit(forms, p.shared_flight, p.rows, p.has_quadratic_powers)
    audit_motion(
        p.machine, p.flow(retracing=True), flights, m.dense_output.seen, *halves(knots), accounts
    )
    return Followed(accounts, int(flights.checked[WHOLE]), int(flights.checked[WITHOUT_EXTREMES]))


def piece_by_piece(m: ss.Trajectory, knots: Knots) -> Accounts:
    p = m.problem
    accounts = make_accounts(len(knots.time) - 1, p.rows)
    flow = p.flow(retracing=True)
    audit_steps(p.machine, flow, m.dense_output.seen, *halves(knots), True, accounts)
    return accounts


@pytest.mark.parametrize("name", SYSTEMS)
def test_both_say_the_same(name: str) -> None:
    m = motion(name)
    assert m.certificate.ok
    found, wanted = as_a_whole(m, m.knots), piece_by_piece(m, m.knots)
    assert found.whole > 0.5 * np.count_nonzero(np.diff(m.knots.time)) and not found.lost
    work = wanted.steps.work
    np.testing.assert_allclose(found.accounts.steps.work, work, rtol=0, atol=1e-11 * work.max())
    for what in ("stick", "work", "peak", "impulse", "total"):
        one, other = getattr(found.accounts.sums, what), getattr(wanted.sums, what)
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * np.abs(other).max())
    np.testing.assert_array_equal(found.accounts.sums.switches, wanted.sums.switches)
    low, high = found.accounts.sums.low, found.accounts.sums.high
    size = np.maximum(-wanted.sums.low, wanted.sums.high)
    assert np.all(low >= wanted.sums.low - 1e-10 * size)
    assert np.all(high <= wanted.sums.high + 1e-10 * size)
    audit = m.audit
    np.testing.assert_array_equal(audit.sums.low, wanted.sums.low)
    known = audit.known
    np.testing.assert_allclose(low[known], wanted.sums.low[known], rtol=1e-9)
    np.testing.assert_allclose(high[known], wanted.sums.high[known], rtol=1e-9)


def stuck() -> ss.System:
    """Two masses, one of them stiff, that a contact holds together: a load turns thousands of times
    while nothing slips."""
    return ss.System(
        name="stuck",
        structures={"u": ss.Structure(np.eye(2), np.diag([1.0, 1e4]), ss.ModalDamping(0.01))},
        forces={"u[0]": "cos(20*t)"},
        contacts={"rub": ss.Contact("d_u[0] + d_u[1]", "s")},
        parameters={"s": 10.0},
        span=(0.0, 2000.0),
    )


@pytest.mark.parametrize("part", [0.9, 0.5])
def test_what_is_doubted_is_added_up_once(part: float) -> None:
    """With a lower threshold the flight obeys the equations, but the law only at first. What
    was added up of it until then is taken back."""
    system = replace(stuck(), forces={"u[0]": "cos(20*t) + t"}, span=(0.0, 8.0))
    m = ss.simulate(system)
    assert as_a_whole(m, m.knots).whole == 1
    lower = pose(system, {"s": part * float(m.audit.sums.peak[0])})
    motion = Trajectory(lower, m.t_span, m.knots, m.outcome)
    found = as_a_whole(motion, m.knots, m.problem.closed_forms)
    wanted = piece_by_piece(motion, m.knots)
    assert found.whole == 0
    for what in ("work", "impulse"):
        one, other = getattr(found.accounts.sums, what), getattr(wanted.sums, what)
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-15)


def test_a_long_flight_under_a_load_is_one() -> None:
    """It is no reason to follow the flight at the pace of its fastest mode, 200,000 pieces, neither
    in the audit nor between the knots, nor when it comes from a file."""
    m = ss.simulate(stuck())
    assert len(m.knots.clock) < 10
    assert as_a_whole(m, m.knots).whole >= 1
    assert m.certificate.ok


def test_values_in_a_long_flight_are_those_of_the_closed_form(tmp_path: Path) -> None:
    """Once what is fast has decayed, all is a wave: u[0] = −u[1] = Re z exp(20it)."""
    m = ss.simulate(stuck())
    m.save(tmp_path / "stuck.nc")
    stored = ss.open(tmp_path / "stuck.nc")
    stiffness, damping = (1.0 + 1e4) / 2.0, (0.02 + 2.0) / 2.0
    z = 0.5 / (stiffness - 20.0**2 + 20j * damping)
    t = np.linspace(100.0, 2000.0, 1234)
    wave = z * np.exp(20j * t)
    for one in (m, stored):
        assert one.certificate.ok
        at = one.at(t)
        np.testing.assert_allclose(at["u[0]"], wave.real, rtol=0, atol=1e-12 * abs(z))
        np.testing.assert_allclose(at["d_u[0]"], (20j * wave).real, rtol=0, atol=2e-11 * abs(z))
        # of the load, in whole turns: what is dissipated, |20 z|² · damping, as no energy is left
        turns = 2.0 * np.pi / 20.0 * np.array([400.0, 500.0])
        fed = np.diff(one.at(turns)["supplied_energy"])[0]
        lost = np.diff(one.at(turns)["dissipated_energy"])[0]
        mean = abs(20.0 * z) ** 2 * damping * np.diff(turns)[0]
        np.testing.assert_allclose([fed, lost], mean, rtol=1e-9)


def changed(of: str, change: Callable[[Array], None]) -> Callable[[ClosedForms], ClosedForms]:
    """Closed forms, of which one table is changed in all modes."""

    def made(forms: ClosedForms) -> ClosedForms:
        table = getattr(forms, of).copy()
        change(table)
        return forms._replace(**{of: table})

    return made


def slowest(forms: ClosedForms) -> int:
    size = np.abs(forms.exponent[0, : forms.counts[0, 0]])
    return int(np.argmin(np.where(size > 0.0, size, np.inf)))


def scale(*where: int | slice, by: complex) -> Callable[[Array], None]:
    def change(table: Array) -> None:
        table[where] *= by

    return change


EVERY = slice(None)
FAULTS: dict[str, Callable[[int], Callable[[ClosedForms], ClosedForms]]] = {
    "amplitude": lambda _: changed("R", scale(EVERY, by=1.0 + 1e-6)),
    "shape": lambda _: changed("a", scale(EVERY, slice(-15, None, 2), by=1.0 + 1e-6)),
    "phase": lambda _: changed("R", scale(EVERY, by=complex(1.0, 1e-6))),
    "frequency": lambda j: changed("exponent", scale(EVERY, j, by=1.0 + 1e-6)),
    "rate": lambda j: changed("exponent", scale(EVERY, j, by=complex(1.0, 1e-6))),
    "missing mode": lambda j: changed("a", scale(EVERY, EVERY, j, by=0.0)),
    "missing amplitude": lambda j: changed("R", scale(EVERY, j, by=0.0)),
    "load": lambda j: changed("b", scale(EVERY, EVERY, by=1.0 + 1e-6)),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", SYSTEMS)
def test_no_wrong_candidate_is_taken(name: str, fault: str) -> None:
    """What closed forms say is believed nowhere: with wrong ones, pieces decide, and say that the
    motion is right."""
    m = motion(name)
    wrong = FAULTS[fault](slowest(m.problem.closed_forms))(m.problem.closed_forms)
    found = as_a_whole(m, m.knots, wrong)
    assert found.whole == 0
    wanted = piece_by_piece(m, m.knots)
    np.testing.assert_array_equal(found.accounts.steps.work, wanted.steps.work)
    np.testing.assert_array_equal(found.accounts.tally.law, wanted.tally.law)
    np.testing.assert_array_equal(found.accounts.tally.state, wanted.tally.state)


@pytest.mark.parametrize("name", SYSTEMS)
def test_closed_forms_that_mislead_the_motion_are_found(name: str) -> None:
    """A motion that follows wrong closed forms is not certified."""
    for fault, of in FAULTS.items():
        m = ss.simulate(SYSTEMS[name](), SPAN)
        forms = m.problem.closed_forms
        wrong = of(slowest(forms))(forms)
        tau = 0.7 * float(np.max(np.diff(m.knots.clock)))
        i = int(np.argmax(np.diff(m.knots.clock)))
        vars(m.problem)["closed_forms"] = wrong
        state = m.dense_output.states(np.array([m.knots.clock[i] + tau]), np.array([i]))[0]
        cut = two_knots(m.knots, i, tau, state)
        found = residuals(m, cut)
        assert np.max(found) > 1e-9, fault


def two_knots(knots: Knots, i: int, tau: float, state: Array) -> Knots:
    """The step from a knot, that ends at another time in a state."""
    begin = slice(i, i + 2)
    parts = {x: getattr(knots, x)[begin].copy() for x in ("clock", "state", "mode", "region")}
    parts["clock"][1] = parts["clock"][0] + tau
    parts["state"][1] = state
    parts["mode"][1], parts["region"][1] = parts["mode"][0], parts["region"][0]
    return Knots(**parts, cause=np.full(2, -1, np.int64), origin=knots.origin)


def residuals(m: ss.Trajectory, knots: Knots) -> Array:
    layout = m.problem.compiled.layout.rows
    other = copy(m)
    vars(other)["knots"] = knots
    energy = other.dense_output.rows(knots.clock, np.arange(2))[:, layout]
    return audited(m.problem, knots, m.dense_output.seen, energy).residuals


@pytest.mark.parametrize("name", SYSTEMS)
def test_wrong_ends_are_found(name: str) -> None:
    """Each component of the state where a flight ends, changed by a part in a million of the size
    of its kind; and the right state at another time."""
    m = motion(name)
    i = int(np.argmax(np.diff(m.knots.clock)))
    h = float(np.diff(m.knots.clock)[i])
    tau = 0.7 * h
    state = m.dense_output.states(m.knots.clock[i : i + 1] + tau, np.array([i]))[0]
    assert np.max(residuals(m, two_knots(m.knots, i, tau, state))) < 1e-10
    n = len(state) // 2
    sizes = np.abs(m.knots.state).max(axis=0)
    for r in range(len(state)):
        kind = slice(0, n) if r < n else slice(n, None)
        wrong = state.copy()
        wrong[r] += 1e-6 * sizes[kind].max()
        assert np.max(residuals(m, two_knots(m.knots, i, tau, wrong))) > 1e-9, r
    late = two_knots(m.knots, i, tau * (1.0 + 1e-6), state)
    assert np.max(residuals(m, late)) > 1e-9


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_late_switch_is_found(name: str) -> None:
    """A flight that goes on where the law ends it."""
    m = motion(name)
    found = 0
    steps = np.flatnonzero(np.diff(m.knots.clock) > 0.0)[:-1]
    for i in steps.tolist():
        h = float(m.knots.clock[i + 1] - m.knots.clock[i])
        tau = h * (1.0 + 1e-3)
        state = m.dense_output.states(m.knots.clock[i : i + 1] + tau, np.array([i]))[0]
        if math.isnan(float(state.sum())):
            continue
        found += int(np.max(residuals(m, two_knots(m.knots, i, tau, state))) > 1e-9)
    assert found == len(steps)


def test_states_in_flights_that_begin_at_another_time() -> None:
    """Times do not begin with zero: states within long flights are those of Taylor steps."""
    m = ss.simulate(beam(), (1.0, 1.1))
    steps = np.flatnonzero(np.diff(m.knots.clock) > 0.0)
    middles = 0.5 * (m.knots.clock[steps] + m.knots.clock[steps + 1])
    found, wanted = (
        m.dense_output.states(middles, steps),
        m.dense_output.states_by_steps(middles, steps),
    )
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())


def test_kept_evaluations_change_no_bit() -> None:
    """Audits after those of other loads, thresholds and springs, and audits of new systems."""
    n = 9
    K = 1e4 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))

    def chain() -> ss.System:
        body = ss.Structure(np.diag(np.geomspace(1.0, 1e-6, n)), K, ss.ModalDamping(0.02))
        return ss.System(
            name="chain",
            parameters={"omega": 40.0, "F": 30.0, "F_c": 0.5, "k": 500.0},
            structures={"u": body},
            forces={"u[0]": "F*cos(omega*t)"},
            contacts={"rub": ss.laws.jenkins("d_u[2]", F_c="F_c", k="k")},
        )

    shared = chain()
    every = [(40.0, 30.0, 0.5, 500.0), (41.0, 20.0, 0.5, 500.0), (41.0, 20.0, 0.4, 500.0)]
    for values in [*every, (41.0, 20.0, 0.4, 600.0), every[0]]:
        parameters = dict(zip(shared.parameters, values, strict=True))
        one, other = (
            ss.simulate(system, SPAN, parameters=parameters).audit for system in (shared, chain())
        )
        np.testing.assert_array_equal(one.residuals, other.residuals)
        np.testing.assert_array_equal(one.dissipated, other.dissipated)
    known = kept(compile_system(shared), "evaluations")
    assert len({constants for _, constants in known}) == 2  # of two springs
