"""First variations by eigenvalues: what steps as short as the fastest mode give, at once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import stickslip as ss
from stickslip.arrays import Array
from stickslip.motion.between.flights import states_in_flights
from stickslip.motion.problem import pose
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.fields import variational
from stickslip.orbits.fields.engine.collocation import NODES
from stickslip.orbits.fields.engine.modal import put_moments
from stickslip.orbits.fields.engine.tables import DECOMPOSED, DEFECTIVE, STAGES, make_spectra
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.spectra import decompose_piece
from stickslip.orbits.fields.variational import variation
from stickslip.orbits.return_map.following import follow_state


class Space:
    """What of the work space the moments need."""

    moments = np.zeros((STAGES, 1), complex)
    later = np.zeros((STAGES, 1), complex)
    legendre = np.zeros(STAGES + 1, complex)


@pytest.mark.parametrize("z", [0.0, -1e-3, 3j, -4 + 7j, -11.9, 13j, -5 + 12j, -40.0, 200j, 3.0])
def test_moments(z: complex) -> None:
    """∫₀¹ exp(z(1 − x)) ℓ(x) dx and ∫₀¹ (1 − x) exp(z(1 − x)) ℓ(x) dx by adaptive quadrature."""
    space: Any = Space()
    put_moments(complex(z), space, 0)

    def lagrange(g: int, x: float) -> float:
        others = np.delete(NODES, g)
        return float(np.prod((x - others) / (NODES[g] - others)))

    def integral(f: Callable[[float], complex]) -> complex:
        real = quad(lambda x: complex(f(x)).real, 0.0, 1.0, limit=400, epsabs=1e-13)[0]
        imag = quad(lambda x: complex(f(x)).imag, 0.0, 1.0, limit=400, epsabs=1e-13)[0]
        return complex(real, imag)

    for g in (0, 3, STAGES - 1):
        plain = integral(lambda x, g=g: np.exp(z * (1.0 - x)) * lagrange(g, x))
        late = integral(lambda x, g=g: (1.0 - x) * np.exp(z * (1.0 - x)) * lagrange(g, x))
        assert abs(space.moments[g, 0] - plain) < 2e-12
        assert abs(space.later[g, 0] - late) < 2e-12


def stiff(contact: str) -> ss.System:
    """The cantilever, whose fastest mode has a thousand times the frequency of its lowest, with its
    damper or with a contact at the same place."""
    beam = ss.catalogue.cantilever(omega=105.0)
    if contact == "damper":
        return beam
    rubs = {"rub": ss.Contact("d_u[rub]", "F_c")}
    kept = {name: p for name, p in beam.parameters.items() if name != "k_d"}
    return replace(beam, contacts=rubs, parameters=kept, facts={})


@cache
def followed(contact: str) -> Trajectory:
    """Three periods, from a state in which the contact slips."""
    problem = pose(stiff(contact), {})
    period = 2.0 * math.pi / 105.0
    before = follow_state(problem, 0.0, 2 * period, problem.initial_state({}))
    k = before.knots
    i = int(np.flatnonzero((k.mode[:-1, 0] != 0) & (np.diff(k.time) > 0.0))[-1])
    begin = 0.5 * float(k.time[i] + k.time[i + 1])
    (state,) = before.states_at(np.array([begin]), np.array([i]))
    return follow_state(problem, begin, begin + 3 * period, state)


@pytest.mark.parametrize("contact", ["damper", "rub"])
def test_states_within_flights(contact: str) -> None:
    """By closed forms they are those of steps as short as the fastest mode, in whatever order they
    are asked for."""
    motion = followed(contact)
    k = motion.knots
    index = np.repeat(np.arange(len(k.time) - 1), 5)
    part = np.tile([0.7, 0.0, 0.31, 1.0, 0.02], len(k.time) - 1)
    clock = k.clock[index] + part * np.diff(k.clock)[index]
    found = motion.dense_output.states(clock, index)
    out = np.empty_like(found)
    assert np.any(states_in_flights(motion.problem, k, index, clock, out))
    n = len(found[0]) // 2
    for own in (slice(n), slice(n, 2 * n)):
        steps = motion.dense_output.states_by_steps(clock, index)[:, own]
        assert np.max(np.abs(found[:, own] - steps)) <= 1e-10 * np.max(np.abs(steps))


def by_parts(motion: Trajectory, pieces: Pieces, monkeypatch: pytest.MonkeyPatch) -> Array:
    """The same variation in steps as short as the fastest mode asks for."""
    prepared = variational._prepared
    with monkeypatch.context() as patch:
        patch.setattr(
            variational,
            "_prepared",
            lambda motion, pieces, ways, *_: prepared(motion, pieces, ways, 0),
        )
        return variation(motion, pieces).matrix


@pytest.mark.parametrize(
    ("contact", "free"),
    [
        ("damper", ()),
        ("damper", ("omega", "F")),
        ("damper", ("k_d",)),
        ("damper", ("k_d", "F_c")),
        ("rub", ("omega",)),
        ("rub", ("F_c",)),
    ],
)
def test_steps_by_eigenvalues(
    contact: str, free: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = followed(contact)
    assert len(motion.knots.time) < 200  # of steps there would be thousands
    pieces = Pieces(motion.problem.compiled.equations, *free)
    found = variation(motion, pieces).matrix
    assert (
        DECOMPOSED in pieces.listed.spectra.state and DEFECTIVE not in pieces.listed.spectra.state
    )
    expected = by_parts(motion, pieces, monkeypatch)
    n = motion.knots.state.shape[1]
    size = np.max(np.abs(expected[:n]), axis=0)
    size[:n] = np.maximum(size[:n], 1.0)  # as large as it was in the beginning
    worst = np.max(np.abs(found - expected)[:n] / size)
    assert worst <= 1e-9


def floating(k: float) -> ss.System:
    """Two masses with a stiff spring between them that nothing holds: a place and its velocity have
    one eigenvector. One of them rubs lightly."""
    return ss.System(
        "floating",
        parameters={"F": ss.Parameter(1.0), "k": ss.Parameter(k)},
        coordinates={"x": ss.Inertial(), "y": ss.Inertial(force="F*cos(t)")},
        kinetic="d_x**2/2 + d_y**2/2",
        potential="k/2*(x - y)**2",
        contacts={"rub": ss.Contact("d_x", 1e-3)},
    )


@pytest.mark.parametrize("k", [1e4, 1e8, 1e10])
def test_eigenvectors_that_are_missing(k: float) -> None:
    problem = pose(floating(k), {})
    start = problem.initial_state({"d_x": 0.3, "d_y": 0.3})
    motion = follow_state(problem, 0.0, 0.5, start)
    centre = 0.5 * (motion.knots.state[-1, 0] + motion.knots.state[-1, 1])
    fallen = 0.5 * (1.0 - math.cos(0.5)) - 0.25 * 1e-3 * 0.25
    assert centre == pytest.approx(0.3 * 0.5 + fallen, rel=1e-10)
    found = variation(motion, Pieces(problem.compiled.equations, "F")).matrix
    # Both places move on with the velocity of the centre.
    assert found[:2, 2:4].sum(axis=1) == pytest.approx(0.5, abs=1e-6)
    spectra = make_spectra(1, 4, 0)
    spectra.matrix[0, :2, 2:] = np.eye(2)
    spectra.matrix[0, 2:, :2] = k * np.array([[-1.0, 1.0], [1.0, -1.0]])
    rates = np.array([False, False, True, True])
    equations = problem.compiled.equations
    decompose_piece(equations, spectra, 0, rates, np.zeros((0, 4)))
    assert spectra.state[0] == DEFECTIVE
    # A force that holds the centre makes up for it: its velocity is zero all the time.
    spectra.rate[0] = math.sqrt(2.0 * k)
    spectra.matrix[0, 2:, :2] = k * np.array([[-1.0, 1.0], [1.0, -1.0]])
    decompose_piece(equations, spectra, 0, rates, np.array([[0.0, 0.0, 1.0, 1.0]]))
    assert spectra.state[0] == DECOMPOSED


def chain_with_damper(kind: str) -> ss.System:
    """Twelve masses with a damper behind a spring, by coordinates or as a structure."""
    n = 12
    mass, stiffness = np.diag(1.0 + 0.1 * np.arange(n)), 2.0 * np.eye(n)
    stiffness -= np.eye(n, k=1) + np.eye(n, k=-1)
    names = {x: ss.Parameter(v) for x, v in {"F": 0.3, "omega": 0.1, "F_c": 0.01}.items()}
    if kind == "structure":
        body = ss.Structure(mass, stiffness, 0.02 * stiffness, names={"rub": 6, "tip": 11})
        return ss.System(
            "chain",
            parameters=names,
            structures={"u": body},
            forces={"u[tip]": "F*cos(omega*t)"},
            contacts={"damper": ss.laws.jenkins("d_u[rub]", F_c="F_c", k=0.5)},
        )
    q = [f"q{i}" for i in range(n)]

    def form(matrix: Any, rate: str) -> str:
        terms = np.argwhere(matrix).tolist()
        return " + ".join(
            f"({float(matrix[i, j])!r})/2*{rate}{q[i]}*{rate}{q[j]}" for i, j in terms
        )

    return ss.System(
        "chain",
        parameters=names,
        coordinates={x: ss.Inertial(force="F*cos(omega*t)" if x == q[-1] else 0.0) for x in q},
        kinetic=form(mass, "d_"),
        potential=form(stiffness, ""),
        viscous=form(0.02 * stiffness, "d_"),
        contacts={"damper": ss.laws.jenkins("d_q6", F_c="F_c", k=0.5)},
    )


@pytest.mark.parametrize("kind", ["structure", "coordinates"])
@pytest.mark.parametrize("free", ["omega", "F_c", "F"])
def test_steps_of_a_piece_are_taken_as_one(
    kind: str, free: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same as step by step, by eigenvalues and by collocation; in between nothing is known."""
    motion = ss.simulate(chain_with_damper(kind), (0.0, 200.0))
    equations = motion.problem.compiled.equations
    whole = variation(motion, Pieces(equations, free))
    ends = variation(motion, Pieces(equations, free), between=False)
    unsound: Any = lambda _, spectra, w, *more: spectra.state.__setitem__(w, DEFECTIVE)  # noqa: E731
    monkeypatch.setattr(variational, "decompose_piece", unsound)
    slow = variation(motion, Pieces(equations, free))
    size = np.max(np.abs(slow.after), axis=(1, 2), keepdims=True)
    assert np.max(np.abs(whole.after - slow.after) / size) < 1e-11
    known = np.asarray(~np.isnan(ends.after).any(axis=(1, 2)))
    assert 2 < np.count_nonzero(known) < 0.5 * len(known) and known[-1]
    begins = np.flatnonzero(np.diff(ends.piece)) + 1
    assert np.all(known[begins])
    assert np.max((np.abs(ends.after - slow.after) / size)[known]) < 1e-11
    np.testing.assert_allclose(ends.late, slow.late, rtol=1e-8, atol=1e-10)
