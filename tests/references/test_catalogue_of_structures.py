"""The structures of the catalogue, against closed forms and printed frequencies."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stickslip as ss


def test_a_cantilever_has_the_frequencies_of_nlvib() -> None:
    facts = ss.catalogue.cantilever().declaration.facts
    free, fixed = (float(repr(facts[name])) for name in ("omega_free", "omega_fixed"))
    assert free == pytest.approx(123.34, abs=5e-3)
    assert fixed == pytest.approx(248.97, abs=5e-3)


def test_a_cantilever_whose_damper_sticks_answers_as_a_linear_beam() -> None:
    system = ss.catalogue.cantilever(F=20.0)
    body = system.structures["u"]
    assert isinstance(body, ss.Structure)
    (rub, tip), shapes = body.indices.values(), body.modes
    omega, k_d = system.values["omega"], system.values["k_d"]
    stiff = np.diag(body.squares - omega**2 + 1j * omega * body.modal_damping)
    stiff += k_d * np.outer(shapes[rub], shapes[rub])
    expected = abs(shapes[tip] @ np.linalg.solve(stiff, 20.0 * shapes[tip]))
    cycle = ss.find_cycle(system)
    assert cycle.certificate.ok
    times = cycle.trajectory.knots.time[0] + np.linspace(0.0, cycle.period, 400)
    seen = [cycle.trajectory.at(t)["u[tip]"] for t in times]
    assert np.max(np.abs(seen)) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("order", range(3))
@pytest.mark.parametrize("n", [3, 4, 5])
def test_modes_that_symmetry_keeps_at_rest_are_no_false_alarm(n: int, order: int) -> None:
    """Their motion is rounding of that of others."""
    motion = ss.simulate(ss.catalogue.bladed_disk(n, order, mistuning=0.0), (0.0, 0.1))
    assert motion.outcome.ok
    assert motion.certificate.ok, motion.certificate.verdict


@pytest.mark.parametrize("order", range(3))
def test_a_tuned_ring_answers_with_a_wave(order: int) -> None:
    """As long as dampers stick: disc and blade of a sector, with the phase of their neighbours."""
    n, F = 5, 0.01
    system = ss.catalogue.bladed_disk(n, order, mistuning=0.0, F=F)
    p: dict[str, Any] = system.values
    turn = 2.0 * (1.0 - np.cos(2.0 * np.pi * order / n))
    stiff = np.array([[4e6 + 4.3e5 + 1e6 * turn, -4.3e5], [-4.3e5, 4.3e5]])
    mass = np.diag([1.0, 0.3])
    squares, shapes = np.linalg.eigh(stiff / np.sqrt(np.outer(np.diag(mass), np.diag(mass))))
    shapes = shapes / np.sqrt(np.diag(mass))[:, None]
    gains = np.diag(squares - p["omega"] ** 2 + 2j * 0.002 * np.sqrt(squares) * p["omega"])
    gains = gains + p["k_d"] * turn * np.outer(shapes[1], shapes[1])
    blade = shapes[1] @ np.linalg.solve(gains, F * shapes[1])
    cycle = ss.find_cycle(system)
    assert cycle.certificate.ok
    begin = float(cycle.trajectory.knots.time[0])
    for i in range(n):
        phase = p["omega"] * begin - 2.0 * np.pi * order * i / n
        expected = (blade * np.exp(1j * phase)).real
        seen = cycle.trajectory.at(begin)[f"u[blade_{i + 1}]"]
        assert seen == pytest.approx(expected, abs=1e-9 * abs(blade))


def test_mistuned_blades_have_a_certified_cycle() -> None:
    cycle = ss.find_cycle(ss.catalogue.bladed_disk())
    assert cycle.certificate.ok
    assert cycle.period == pytest.approx(2.0 * np.pi / 1190.0)
    assert {c for c in cycle.trajectory.events["contact"]} == {f"damper {i}" for i in range(1, 5)}


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("cantilever", {"n": 6}),
        ("cantilever", {"n": 8.5}),
        ("bladed_disk", {"n": 2}),
        ("bladed_disk", {"order": 4}),
        ("bladed_disk", {"mistuning": -0.1}),
        ("bladed_disk", {"mistuning": float("nan")}),
    ],
)
def test_wrong_sizes_are_refused(name: str, given: dict[str, float]) -> None:
    with pytest.raises(ss.DeclarationError, match="Give "):
        ss.catalogue.get(name, **given)


@pytest.mark.parametrize("mode", [1, 4, 10, 16])
def test_a_mode_that_is_off_by_little_is_seen(mode: int) -> None:
    """By 10⁻⁸ of the largest one, at one knot: all modes are measured by the largest."""
    motion = ss.simulate(ss.catalogue.cantilever(), (0.0, 0.05))
    assert motion.certificate.ok
    states = motion.knots.state.copy()
    place = mode - 1
    states[len(states) // 2, place] += 1e-8 * np.max(np.abs(states[:, :16]))
    off = replace(motion.knots, state=states)
    tampered = ss.Trajectory(motion.problem, motion.t_span, off, motion.outcome)
    assert not tampered.certificate.ok


def test_structures_of_the_catalogue_swing_freely() -> None:
    beam = ss.catalogue.cantilever(8)
    found = ss.backbone(beam, (1e-4, 2e-2), of="u[tip]", points=4, parameters={"F": 0.0})
    assert found.certificate.ok and found["slips"].values.tolist() == [0, 0, 1, 1]
    disk = ss.catalogue.bladed_disk(3)
    decay = ss.ring_down(disk, (0.0, 0.02), initial={"u_mode_1": 1e-4}, parameters={"F": 0.0})
    assert decay.certificate.ok and len(decay) > 2
