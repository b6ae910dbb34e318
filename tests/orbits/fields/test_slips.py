"""Derivatives of motions with a contact in a plane, through both ends of a slip, against complex
steps of an integrator that shares nothing with the library."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss
from adversarial.references.sliding import Bodies, Pad, motion
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.variational import variation

TINY = 1e-30
NAMES = ("x", "y", "d_x", "d_y")


def block(kinetic: float | None = None) -> ss.System:
    """A unit mass on a table, on springs, under a constant force."""
    return ss.System(
        name="block",
        parameters={"c": ss.Parameter(0.4), "f": ss.Parameter(0.3), "g": ss.Parameter(0.0)},
        coordinates={"x": ss.Inertial(force="f"), "y": ss.Inertial(force="g")},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="c/2*(x**2 + y**2)",
        contacts={"table": ss.Contact(("d_x", "d_y"), 1.0, kinetic=kinetic)},
    )


def reference(c: Any, f: Any, g: Any, start: list[Any], end: float, kinetic: float) -> np.ndarray:
    """The last state."""

    def push(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.array([f, g]) + 0 * q - c * q

    def held(t: np.ndarray, q: np.ndarray) -> np.ndarray:
        return 1.0 + 0 * t

    def sliding(t: np.ndarray, q: np.ndarray, speed: np.ndarray) -> np.ndarray:
        return kinetic + 0 * t

    pad = Pad(np.eye(2), held) if kinetic == 1.0 else Pad(np.eye(2), held, sliding)
    return motion(Bodies(np.eye(2), push, [pad]), start, [end], end).states[0]


@pytest.mark.parametrize(
    ("forces", "start", "end"),
    [
        ({"f": 0.3, "g": 0.0}, [0.2, -0.1, 1.0, 0.5], 3.0),  # a slip that ends
        ({"f": 0.3, "g": 0.0}, [0.2, -0.1, 1.0, 0.5], 0.8),  # on the way
        ({"f": 1.2, "g": 0.5}, [0.1, 0.3, 0.0, 0.0], 6.0),  # one that begins at once, and ends
    ],
    ids=["ends", "on the way", "begins"],
)
def test_derivatives_are_those_of_complex_steps(
    forces: dict[str, float], start: list[float], end: float
) -> None:
    system = block()
    given = {"c": 0.4, **forces}
    found = ss.simulate(
        system, (0.0, end), parameters=given, initial=dict(zip(NAMES, start, strict=True))
    )
    assert found.certificate.ok
    pieces = Pieces(found.problem.compiled.equations, "c", "f", "g")
    change = variation(found, pieces).matrix
    for column, name in enumerate((*NAMES, "c", "f", "g")):
        if name.startswith("d_") and start[2:] == [0.0, 0.0]:
            continue  # what is at rest would begin elsewhere
        first: list[Any] = [*start]
        numbers: dict[str, Any] = dict(given)
        if column < 4:
            first[column] += 1j * TINY
        else:
            numbers[name] += 1j * TINY
        found_there = reference(**numbers, start=first, end=end, kinetic=1.0)
        expected = np.imag(found_there) / TINY
        np.testing.assert_allclose(change[:4, column], expected, rtol=0, atol=1e-9)


def test_both_velocities_are_forgotten() -> None:
    """Two zeros for each stick."""
    found = ss.simulate(
        block(), (0.0, 3.0), initial=dict(zip(NAMES, [0.2, -0.1, 1.0, 0.5], strict=True))
    )
    change = variation(found, Pieces(found.problem.compiled.equations)).matrix
    assert np.linalg.matrix_rank(change, tol=1e-12) == 2
    np.testing.assert_array_equal(change[2:], 0.0)


def test_there_is_no_derivative_through_a_reversal() -> None:
    """Along a line a slip goes back through u = 0: neighbours pass by on one side or the other."""
    system = ss.System(
        name="line",
        coordinates={"x": ss.Inertial(force="2*cos(1.9*t + 0.4)"), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="(x**2 + y**2)/2",
        contacts={"table": ss.Contact(("d_x", "d_y"), 0.5)},
    )
    found = ss.simulate(system, (0.0, 6.0))
    change = variation(found, Pieces(found.problem.compiled.equations))
    assert not change.differentiable
