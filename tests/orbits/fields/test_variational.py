"""First variation along a motion: transition matrices, saltation matrices, and where the derivative
does not exist."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from oracles.variation import collocation, gauss
from oracles.variation import variation as variation_by_numpy
from stickslip import Internal, Parameter, System, Trajectory, catalogue, simulate
from stickslip.motion.problem import Problem, pose
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.variational import Variation, variation
from stickslip.orbits.return_map.following import follow_state
from systems import oscillator, published

DECLARED = {name: published(name).declaration for name in catalogue.names()}
WITH_FIELDS = [
    name
    for name, d in DECLARED.items()
    if not d.resisted
    and not d.jumps
    # where a slip in a plane begins or ends, NumPy has no field: see test_slips.py
    and not any(c.opens or c.plane for c in d.contacts)
]

Array = NDArray[np.float64]


def along(
    system: System,
    span: tuple[float, float],
    initial: Mapping[str, float],
    parameters: Mapping[str, float] | None = None,
    free: tuple[str, ...] = (),
    directions: Array | None = None,
) -> Variation:
    motion = simulate(system, span, initial=initial, parameters=parameters)
    assert motion.outcome.ok
    return variation(motion, Pieces(motion.problem.compiled.equations, *free), directions)


def slope(f: Callable[[float], Array], h: float) -> Array:
    """Derivative at 0 by central differences of fourth order."""
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)


def differences(
    system: System,
    span: tuple[float, float],
    initial: Mapping[str, float],
    parameters: Mapping[str, float],
    free: str,
) -> Array:
    """The same by finite differences of simulations, column by column."""
    names = system.declaration.state
    first = {name: float(initial.get(name, 0.0)) for name in names}

    def end(changes: Mapping[str, float]) -> Array:
        start = {name: value + changes.get(name, 0.0) for name, value in first.items()}
        values = {**parameters, free: system.values[free] + changes.get(free, 0.0)}
        return simulate(
            system, span, initial=start, parameters={**parameters, free: values[free]}
        ).knots.state[-1]

    return np.column_stack([slope(lambda d, c=c: end({c: d}), 1e-4) for c in (*names, free)])


CASES = {
    "viscous contact": (catalogue.spring_slider(V=0.1), (0, 12), {"U": 1.2, "alpha": 1.3}, "V"),
    "static above kinetic": (catalogue.belt_block(), (0, 12), {"x": 0.3, "d_x": -0.2}, "V"),
    "no mass": (catalogue.rocking_toy(), (0, 3), {"psi": -1.67, "x_R": 0.45}, "H_star"),
    "kinks only": (catalogue.scaled_slider(), (0, 6), {"gamma": 0.4}, "b"),
    "flights in closed form": (catalogue.scaled_slider_limit(), (0, 9), {"gamma": 0.4}, "b"),
    "driven": (catalogue.forced_oscillator(), (0, 12), {"x": 0.2, "d_x": 0.3}, "omega"),
    "driven legs": (catalogue.two_leg_crawler(), (0, 9), {}, "omega"),
}


@pytest.mark.parametrize("case", CASES)
def test_finite_differences(case: str) -> None:
    system, span, initial, free = CASES[case]
    found = along(system, span, initial, None, (free,))
    assert found.differentiable
    expected = differences(system, span, initial, {}, free)
    n = len(expected)
    assert np.max(np.abs(found.matrix[:n] - expected)) < 1e-6 * np.max(np.abs(expected))
    # A parameter does not move.
    assert found.matrix[n].tolist() == [*[0.0] * n, 1.0]
    # Without it the first columns are the same.
    assert along(system, span, initial).matrix == pytest.approx(
        found.matrix[:n, :n], rel=1e-10, abs=1e-12
    )


def test_linear_flow_is_the_exponential() -> None:
    """Without friction the contact still switches at every turn, and nothing jumps there."""
    A = np.array([[0.0, 1.0], [-4.0, -0.3]])
    found = along(oscillator(), (0, 20), {"x": 1.0}, {"mu": 0.0, "F": 0.0, "k": 4.0, "c": 0.3})
    assert found.matrix == pytest.approx(expm(20 * A), abs=1e-13)


def test_collocation_of_the_oracle_has_order_16() -> None:
    """Φ' = cos(t) Φ over one step from 0: Φ = exp(sin t)."""
    errors = []
    for h in (2.0, 1.0):
        J = np.cos(h * gauss()[0]).reshape(1, -1, 1, 1)
        errors.append(abs(collocation(J, np.array([h]))[0, 0, 0] - np.exp(np.sin(h))))
    assert errors[1] < 1e-12
    assert errors[0] / errors[1] > 2**14


_ENOUGH = 1500  # steps of a motion: there are systems of ten thousand


@pytest.mark.parametrize("name", WITH_FIELDS)
def test_every_system_of_the_catalogue(name: str) -> None:
    """The compiled pass and that with NumPy: all columns, with a parameter and without."""
    system = published(name)
    begin, end = system.span
    if system.structures:  # their fast modes are resolved
        end = begin + 0.021 * (end - begin)
    motion = simulate(system, (begin, min(end, begin + 12.0)))
    if len(motion.knots.time) > _ENOUGH:
        motion = simulate(system, (begin, float(motion.knots.time[_ENOUGH])))
    equations = motion.problem.compiled.equations
    names = tuple(system.parameters)
    # Of a structure every motion takes NumPy long; all parameters at once have all columns.
    single = () if system.structures else names
    for free in ((), *((p,) for p in single), names):
        found = variation(motion, Pieces(equations, *free))
        expected = variation_by_numpy(motion, Pieces(equations, *free))
        off, size = (
            np.max(np.abs(x), axis=(1, 2)) for x in (found.after - expected.after, expected.after)
        )
        # Rounding errors grow as changes do, and with the number of steps.
        limit = 2e-13 + 1e-16 * len(off)
        assert np.max(off / np.maximum.accumulate(np.maximum(size, 1e-300))) < limit
        assert found.corners == expected.corners
        assert found.grazings == expected.grazings


def test_motions_that_share_work_space_are_what_they_are_alone() -> None:
    """Bit by bit, they, their values between the knots and their variations, whatever was followed
    before."""
    system = catalogue.plate_compactor()
    boxes = {**{name: (v, v) for name, v in system.values.items()}, "m": (50.0, 200.0)}
    pieces = Pieces(pose(system).compiled.equations, "m")
    masses, sliding = (100.0, 120.0, 70.0), np.array([0.0, 1.0])

    def posed(m: float) -> Problem:
        return replace(pose(system, {"m": m}, exact=False), boxes=boxes)

    def numbers(motion: Trajectory) -> list[Array]:
        k = motion.knots
        middle = motion.states_at(0.5 * (k.time[:-1] + k.time[1:]), np.arange(len(k.time) - 1))
        return [k.clock, k.state, middle, variation(motion, pieces).after]

    together = posed(masses[0])
    motions = [follow_state(together.at("m", m), 0.0, 0.05, sliding) for m in masses]
    for m, motion in zip(masses, motions, strict=True):
        alone = numbers(follow_state(posed(m), 0.0, 0.05, sliding))
        for found, expected in zip(numbers(motion), alone, strict=True):
            assert found.tobytes() == expected.tobytes()


def test_stick_forgets() -> None:
    """Where a contact begins to stick one direction is lost: the saltation matrix has rank 1
    there."""
    found = along(oscillator(), (0, 4), {"x": 1.2}, {"mu": 0.5, "F": 0.0}).matrix
    # x″ + x = 0.5 from rest at 1.2: half a swing to −0.2, where |x| ≤ μ holds it.
    assert np.linalg.matrix_rank(found) == 1
    assert found[:, 0] == pytest.approx([-1.0, 0.0], abs=1e-12)


def surfaces() -> System:
    """Two surfaces, x = p and y = 1: z' is 0 before the first, 5 between, 1 beyond both."""
    laws = {"x": "v", "v": "-g", "y": "1", "z": "piecewise(x < p, 0, piecewise(y < 1, 5, 1))"}
    return System(
        name="surfaces",
        parameters={"p": Parameter(1.0), "g": Parameter(0.0)},
        internal={name: Internal(law) for name, law in laws.items()},
    )


def test_event_times_shift_with_a_parameter() -> None:
    """The events come at t = (p − x)/v and 1 − y, so z(2) = 5(1 − y − (p − x)/v) + 1 + y."""
    found = along(surfaces(), (0, 2), {"x": 0.3, "v": 2.0, "y": 0.1, "z": 0.0}, None, ("p",)).matrix
    assert found[3] == pytest.approx([5 / 2, 5 * 0.7 / 4, -4.0, 1.0, -5 / 2], abs=1e-12)


def test_corner() -> None:
    """Neighbours meet the surfaces in another order: at their intersection there is no
    derivative."""
    start = {"x": 0.0, "v": 1.0, "y": 0.0, "z": 0.0}
    met = along(surfaces(), (0, 2), start)
    assert met.corners == pytest.approx((1.0,))
    assert not met.differentiable
    # Neighbours that meet both together do so as one: x and y move alike, and z(2) = 1 + y.
    alike = along(surfaces(), (0, 2), start, directions=np.array([[1.0], [0.0], [1.0], [0.0]]))
    assert alike.differentiable
    assert alike.matrix[3] == pytest.approx([1.0], abs=1e-12)


def test_grazing_is_reported() -> None:
    """x = t − t²/2 + ε exceeds the surface x = 1/2 by next to nothing: no division by a rate of
    nearly 0."""
    values = {"g": 1.0, "p": 0.5}
    touching = along(surfaces(), (0, 2), {"x": 1e-13, "v": 1.0, "y": -9.0, "z": 0.0}, values)
    assert touching.grazings == pytest.approx((1.0, 1.0), abs=1e-6)
    assert np.max(np.abs(touching.matrix)) == pytest.approx(2.0, rel=1e-15)
    over = along(surfaces(), (0, 2), {"x": 0.02, "v": 1.0, "y": -9.0, "z": 0.0}, values)
    assert over.differentiable
    # z(2) = 5·2√(2ε): its derivative is 10/√(2ε).
    assert over.matrix[3, 0] == pytest.approx(10 / np.sqrt(2 * 0.02), rel=1e-9)


def test_corner_of_the_toy() -> None:
    """A leg that rests exactly at its threshold as ψ passes −ψ*: pushed apart it slides there,
    pushed together not."""
    touching = along(catalogue.rocking_toy(), (0, 2), {"psi": -1.67, "x_R": 0.5})
    assert len(touching.corners) == 1
    # The motion itself never pushes the leg: along ψ and ψ' the derivative exists.
    kept = along(
        catalogue.rocking_toy(), (0, 2), {"psi": -1.67, "x_R": 0.5}, directions=np.eye(4)[:, :2]
    )
    assert kept.differentiable
