"""Connected components of linear problems, and inverses that know nothing of each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from stickslip import Contact, Inertial, System, Viscous, catalogue
from stickslip.equations.coupling import Component, components
from stickslip.errors import DeclarationError
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.problem import pose
from stickslip.motion.steps.contacts import own_inverse

PAIRS = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), max_size=12)
DIRECTIONS = st.lists(st.lists(st.integers(0, 9), min_size=1, max_size=3), max_size=6)


@given(PAIRS, DIRECTIONS)
def test_components_are_those_of_the_graph(
    entries: list[tuple[int, int]], directions: list[list[int]]
) -> None:
    edges = [*entries, *((i, 10 + c) for c, moved in enumerate(directions) for i in moved)]
    size = 10 + len(directions)
    rows, columns = np.array(edges, dtype=int).reshape(-1, 2).T
    count, label = connected_components(
        coo_array((np.ones(len(rows)), (rows, columns)), shape=(size, size)), directed=False
    )
    found = components(10, entries, 5, directions)
    assert len(found) == count
    assert [part.coordinates[0] for part in found] == sorted(p.coordinates[0] for p in found)
    for part in found:
        members = {*part.coordinates, *(10 + c - 5 for c in part.contacts)}
        assert members == set(np.flatnonzero(label == label[part.coordinates[0]]).tolist())


def test_blocks_on_springs_are_apart() -> None:
    d = pose(catalogue.block_chain(N=4)).compiled.layout.coupled
    assert d["Rq"] == [Component([i], [i]) for i in range(4)]
    assert d["Rz"] == []


def two_kinds() -> System:
    """Masses coupled in pairs, a contact between two of them, and dashpots that couple others."""
    names = ["a", "b", "c", "d"]
    return System(
        name="two kinds",
        coordinates={x: Inertial() for x in names} | {z: Viscous() for z in ("y", "z", "w")},
        kinetic="(d_a**2 + d_b**2 + 3*d_c**2 + d_d**2)/2 + d_a*d_c/2",
        viscous="(d_y**2 + 2*d_z**2 + d_w**2)/2 + d_y*d_w/3",
        contacts={
            "w": Contact("d_w", threshold=0.3),
            "b": Contact("d_b - d_d", threshold=0.2),
            "c": Contact("2*d_c", threshold=0.2),
            "a": Contact("d_a", threshold=0.1),
        },
    )


@pytest.mark.parametrize("mode", [(0, 0, 0, 0), (1, 0, 0, 0), (0, -1, 2, 0), (0, 0, 1, 1)])
def test_inverses_are_those_of_the_whole(mode: tuple[int, ...]) -> None:
    problem = pose(two_kinds())
    rows, flow = problem.rows, problem.flow()
    # inertial contacts first, in the order of their declaration: b, c, a; then w
    M = np.array([[1, 0, 0.5, 0], [0, 1, 0, 0], [0.5, 0, 3, 0], [0, 0, 0, 1.0]])
    C = np.array([[1, 0, 1 / 3], [0, 2, 0], [1 / 3, 0, 1.0]])
    J = np.array([[0, 1, 0, -1], [0, 0, 2, 0], [1, 0, 0, 0.0]])
    I = np.array([[0, 0, 1.0]])  # noqa: E741
    # another mode first: what has not changed is kept
    assert resolve(rows, problem.constants, flow.space, np.array([1, 1, 0, 1]))
    assert resolve(rows, problem.constants, flow.space, np.array(mode))
    for matrix, directions, first, inverse, names in (
        (M, J, 0, flow.space.Rq, "Rq"),
        (C, I, 3, flow.space.Rz, "Rz"),
    ):
        n, m = len(matrix), len(directions)
        whole = np.block([[matrix, -directions.T], [directions, np.zeros((m, m))]])
        for c in range(m):
            if mode[first + c] != 0:
                whole[n + c] = np.eye(n + m)[n + c]
        expected = np.linalg.inv(whole)
        seat = 0
        for part in problem.compiled.layout.coupled[names]:
            own = [*part.coordinates, *(n + c - first for c in part.contacts)]
            got = inverse[seat : seat + len(own), : len(own)]
            np.testing.assert_allclose(got, expected[np.ix_(own, own)], rtol=1e-13, atol=1e-15)
            others = [i for i in range(n + m) if i not in own]
            assert np.all(expected[np.ix_(own, others)] == 0.0)
            seat += len(own)
        for c in range(m):
            here = own_inverse(rows, flow.space, first + c)
            assert here == pytest.approx(expected[n + c, n + c], rel=1e-13)


def test_what_masses_couple_is_limited() -> None:
    names = [f"x_{i}" for i in range(201)]
    total = " + ".join(f"d_{x}" for x in names)
    system = System(
        name="one frame",
        coordinates={x: Inertial() for x in names},
        kinetic=f"({' + '.join(f'd_{x}**2' for x in names)})/2",
        contacts={"all": Contact(total, threshold=1.0)},
    )
    with pytest.raises(DeclarationError, match="couple 201 coordinates directly"):
        pose(system).rows  # noqa: B018
