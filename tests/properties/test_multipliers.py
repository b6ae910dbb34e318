"""Multipliers are those of the return map: variational equations and saltation against finite
differences.

The laws are tested on random members of families that are compiled once
(:mod:`properties.families`), all drives with the period 2π, so that the return map is the motion
over one period.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from properties.families import Drawn, draw, linear_family
from stickslip import System, simulate
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.variational import variation
from stickslip.orbits.return_map.mode_sequence import nearest_change
from stickslip.orbits.return_map.shooting import parameter_values
from stickslip.orbits.return_map.stations import make_station

Array = NDArray[np.float64]

PERIOD = 2 * np.pi
FAMILIES = [("inertial", 2, 1), ("inertial", 2, 2), ("viscous", 2, 2), ("rate-independent", 2, 2)]
EACH = 25
FAR = 1e-3  # from another sequence: differences are taken within one


def member(kind: str, size: int, contacts: int, seed: int) -> tuple[System, Drawn]:
    """A random system all of whose drives have the period 2π."""
    system = linear_family(kind, size, contacts)
    rng = np.random.default_rng([FAMILIES.index((kind, size, contacts)), seed])
    drawn = draw(
        rng, size, contacts, omega=np.ones(size), alpha=np.ones(contacts), beta=np.ones(contacts)
    )
    if kind == "rate-independent":
        # The start has to be inside the stable set; and of a contact that always sticks the return
        # map forgets nothing.
        at_rest = np.linalg.solve(drawn.K, drawn.load([0.0])[0])
        return system, replace(drawn, x=at_rest, s=drawn.s * [1.0, rng.uniform(1.0, 5.0)])
    # With masses the rocking has to die out before long.
    return system, replace(drawn, C=2.0 * drawn.C)


def settled(system: System, drawn: Drawn, phase: float) -> Trajectory | None:
    """One period of the motion after some others, from some phase on; None if a contact that has
    slid no longer does.

    Such a contact has come to rest where it just touches its threshold (shakedown), and nothing can
    be differentiated.
    """
    values = drawn.parameters(system)
    start = (3 + phase) * PERIOD
    before = simulate(system, (0.0, start), initial=drawn.initial(system), parameters=values)
    motion = simulate(system, (start, start + PERIOD), initial=before.final, parameters=values)
    assert motion.outcome.ok
    ever, now = (np.any(part.knots.mode != 0, axis=0) for part in (before, motion))
    return motion if np.array_equal(ever, now) else None


def returned(motion: Trajectory, state: Array) -> Array:
    """The return map."""
    start = dict(zip(motion.system.declaration.state, map(float, state), strict=True))
    return simulate(
        motion.system, motion.t_span, initial=start, parameters=motion.parameters
    ).knots.state[-1]


def differences(motion: Trajectory, directions: Array) -> Array:
    """Derivatives of the return map along some directions."""
    y = motion.knots.state[0]
    h = 1e-5 * directions.T
    return np.column_stack([(returned(motion, y + d) - returned(motion, y - d)) / 2e-5 for d in h])


@pytest.mark.parametrize(("kind", "size", "contacts"), FAMILIES)
def test_return_map(kind: str, size: int, contacts: int) -> None:
    """One hundred random systems, 25 of each family."""
    compared = 0
    golden = (np.sqrt(5) - 1) / 2
    for seed in range(EACH + 15):
        motion = settled(*member(kind, size, contacts, seed), golden * seed % 1)
        if motion is None:
            continue
        p = parameter_values(motion.problem)
        k = motion.knots
        pieces = Pieces(motion.problem.compiled.equations)
        piece = pieces(k.mode[0], k.region[0])
        directions = make_station(
            0.0, piece, float(k.time[0]), k.state[0], p, np.ones(k.state.shape[1])
        ).basis
        if directions.shape[1] == 0 or nearest_change(motion, pieces) < FAR:
            continue  # where both contacts of a rate-independent system slide nothing is free
        found = variation(motion, pieces, directions)
        assert found.differentiable
        expected = differences(motion, directions)
        scale = 1.0 + np.max(np.abs(expected))
        assert np.max(np.abs(found.matrix - expected)) < 1e-6 * scale, (kind, seed)
        # The return map keeps the constraints, so its multipliers are those of the block along the
        # directions.
        M = directions.T @ found.matrix
        D = directions.T @ expected
        assert np.sort(np.abs(np.linalg.eigvals(M))) == pytest.approx(
            np.sort(np.abs(np.linalg.eigvals(D))), abs=1e-5 * scale**0.5
        )
        compared += 1
        if compared == EACH:
            break
    assert compared == EACH


@pytest.mark.parametrize(("kind", "size", "contacts"), FAMILIES[:3])
def test_cycles(kind: str, size: int, contacts: int) -> None:
    """A cycle closes, is certified, and perturbations of it grow as its largest multiplier says."""
    for seed in range(4):
        system, drawn = member(kind, size, contacts, seed)
        cycle = find_cycle(system, drawn.initial(system), parameters=drawn.parameters(system))
        assert cycle.trajectory.certificate.ok
        assert cycle.trivial == 0
        assert cycle.period / PERIOD == pytest.approx(round(cycle.period / PERIOD), rel=1e-12)
        last = simulate(
            system,
            (cycle.time, cycle.time + 12 * cycle.period),
            initial=cycle.trajectory.final,
            parameters=cycle.parameters,
        ).final
        moved = np.array([last[name] - cycle.state[name] for name in cycle.state])
        growth = max(1.0, float(np.max(np.abs(cycle.multipliers)))) ** 12
        assert np.max(np.abs(moved)) < 1e-8 * growth
