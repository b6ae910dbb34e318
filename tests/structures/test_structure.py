"""Structures alone: what they refuse, frequencies against closed forms, damping, and reductions."""

from __future__ import annotations

import pickle
import time
from typing import Any

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stickslip as ss
from bodies import beam, chain, clamped, random_body

# What is wrong by its type is given, too.
structure: Any = ss.Structure
modal_damping: Any = ss.ModalDamping
diagonals: Any = sp.diags_array
MASS = np.eye(3)
STIFFNESS = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])


def changed(i: int, j: int, value: float) -> Any:
    matrix = STIFFNESS.copy()
    matrix[i, j] = value
    return matrix


WRONG: dict[str, tuple[Any, str]] = {
    "not symmetric": (lambda: structure(MASS, changed(0, 2, 0.5)), r"\[0, 2\] is 0.5.* is 0\."),
    "not symmetric, by name": (
        lambda: structure(MASS, changed(0, 2, 0.5), names=["a", "b", "c"]),
        r"\[a, c\] is 0.5",
    ),
    "not symmetric, sparse": (
        lambda: structure(sp.csr_array(MASS), sp.csr_array(changed(0, 2, 0.5))),
        r"\[0, 2\] is 0.5, \[2, 0\] is 0\.",
    ),
    "without mass": (lambda: structure(np.diag([1, 0, 1]), STIFFNESS), "of 1 is 0"),
    "singular mass": (lambda: structure(np.ones((3, 3)), STIFFNESS), "not positive definite"),
    "mass of a negative eigenvalue": (
        lambda: structure([[1, 2], [2, 1]], np.eye(2)),
        "smallest of its 2 eigenvalues is -1",
    ),
    "indefinite stiffness": (
        lambda: structure(MASS, STIFFNESS - 2.0 * MASS),
        "indefinite.*smallest of its 3 eigenvalues is -1.80194",
    ),
    "indefinite sparse stiffness": (
        lambda: structure(MASS, sp.csr_array(STIFFNESS - 2.0 * MASS)),
        "indefinite.*smallest of its 3 eigenvalues is -1.80194",
    ),
    "damping that feeds in": (lambda: structure(MASS, STIFFNESS, -MASS), "damping.*indefinite"),
    "complex": (
        lambda: structure(MASS, (1 + 0.1j) * STIFFNESS),
        "stiffness: the matrix is complex",
    ),
    "NaN": (lambda: structure(MASS, changed(1, 1, np.nan)), r"entry \[1, 1\] is nan"),
    "infinite": (
        lambda: structure(sp.csc_array(changed(1, 1, np.inf)), MASS),
        r"\[1, 1\] is inf",
    ),
    "other sizes": (
        lambda: structure(np.eye(2), STIFFNESS),
        r"shape is \(3, 3\).*mass is \(2, 2\)",
    ),
    "other size of damping": (
        lambda: structure(MASS, STIFFNESS, np.eye(2)),
        r"damping: its shape is \(2, 2\)",
    ),
    "not square": (lambda: structure(MASS, STIFFNESS[:2]), "it is 2 x 3, not a square"),
    "ragged": (lambda: structure([[1, 2], [3]], STIFFNESS), "rows have different lengths"),
    "a text": (lambda: structure("M.mtx", STIFFNESS), "mass: its entries are not all numbers"),
    "a number as damping": (lambda: structure(MASS, STIFFNESS, 0.01), "damping: it is a number"),
    "names twice": (
        lambda: structure(MASS, STIFFNESS, None, ["a", "b", "a"]),
        "'a' is given twice",
    ),
    "one unknown, two names": (
        lambda: structure(MASS, STIFFNESS, names={"a": 1, "b": 1}),
        "degree of freedom 1 is already called 'a'",
    ),
    "too few names": (lambda: structure(MASS, STIFFNESS, names=["a"]), "1 names were given for 3"),
    "a name of nothing": (
        lambda: structure(MASS, STIFFNESS, names={"a": 3}),
        "no degree of freedom 3",
    ),
    "no name": (lambda: structure(MASS, STIFFNESS, names={"a b": 1}), "'a b' is not a name"),
    "a keyword": (lambda: structure(MASS, STIFFNESS, names={"in": 1}), "'in' is not a name"),
    "names as one text": (lambda: structure(MASS, STIFFNESS, names="abc"), "a list of names"),
    "names that are a number": (lambda: structure(MASS, STIFFNESS, names=5), "a list of names"),
    "no unit": (lambda: structure(MASS, STIFFNESS, unit=3), "unit: expected a string"),
    "negative ratio": (lambda: modal_damping([0.1, -0.1]), r"ratios\[1\]: -0.1 is negative"),
    "no ratio": (lambda: modal_damping([]), "a list of them"),
    "a ratio that is none": (lambda: modal_damping(""), "'' is not a finite number"),
    "negative beta": (lambda: ss.ProportionalDamping(0.1, -1.0), "beta: -1 is negative"),
    "basis of other size": (
        lambda: structure(MASS, STIFFNESS, basis=np.ones((4, 2))),
        "2 columns, but the mass has 3",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_said(what: str) -> None:
    make, said = WRONG[what]
    with pytest.raises(ss.DeclarationError, match=said):
        make()


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "nothing kept": ({}, "keep: no degrees of freedom are kept"),
    "unknown name": ({"keep": ["tipp"]}, "tipp: no such degree of freedom. Did you mean 'tip'"),
    "unknown index": ({"keep": [3]}, "Use an index from 0 to 2"),
    "twice": ({"keep": ["tip", 2]}, "2: it is listed twice"),
    "neither": ({"keep": [True]}, "not an index or a name"),
    "negative": ({"keep": [0], "modes": -1}, "-1 is negative"),
    "no such method": ({"keep": [0], "method": "guyan"}, "unknown method 'guyan'"),
    "no modes": ({"modes": 0, "method": "modal"}, "no modes and no kept"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_reductions_that_are_refused(what: str) -> None:
    given, said = REFUSED[what]
    body = structure(MASS, STIFFNESS, names={"tip": 2})
    with pytest.raises(ss.DeclarationError, match=said):
        body.reduced(**given)
    with pytest.raises(ss.DeclarationError, match="not a coordinate of this structure"):
        body.reduced(["tip"], 1).reduced([0])


def test_nobody_changes_a_structure() -> None:
    mass = np.eye(2)
    body = structure(mass, np.eye(2))
    mass[0, 0] = 7.0
    assert body.mass[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        body.mass[0, 0] = 7.0
    with pytest.raises(AttributeError):
        body.mass = mass
    assert body == structure(np.eye(2), np.eye(2)) != structure(np.eye(2), 2 * np.eye(2))
    assert len({body, structure(np.eye(2), np.eye(2))}) == 1


def test_a_chain_has_the_frequencies_of_its_formula() -> None:
    n = 12
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    body = structure(sp.eye_array(n), sp.csr_array(stiffness))
    exact = 2.0 * np.sin(np.arange(1, n + 1) * np.pi / (2 * (n + 1)))
    np.testing.assert_allclose(body.frequencies, exact, rtol=1e-13)
    np.testing.assert_allclose(body.modes.T @ body.modes, np.eye(n), atol=1e-13)


def test_the_beam_of_krack_and_gross() -> None:
    """NLvib, example 8: the clamped beam, free and with its fourth node held."""
    mass, stiffness = clamped(8)
    held = [i for i in range(16) if i != 4]
    block = np.ix_(held, held)
    free = structure(mass, stiffness).frequencies[0]
    fixed = structure(mass[block], stiffness[block]).frequencies[0]
    assert (f"{free:.2f}", f"{fixed:.2f}") == ("123.34", "248.97")


def test_rigid_modes_are_counted_and_said() -> None:
    body = structure(*beam(20))
    assert np.count_nonzero(body.frequencies == 0.0) == 2
    exact = (4.730040744862704 / 2.0) ** 2 * np.sqrt(2.3125e6 / 117.45)  # free, free
    assert body.frequencies[2] == pytest.approx(exact, rel=2e-5)
    assert "rigid modes" in str(body.summary())
    assert body.summary().data["rigid_modes"] == 2
    with pytest.raises(ss.DeclarationError, match="has rigid-body motions while the kept"):
        body.reduced(keep=[40])
    assert np.count_nonzero(body.reduced(keep=[40, 41]).frequencies == 0.0) == 2
    sparse = structure(*map(sp.csr_array, beam(300)))
    small = sparse.reduced(modes=6, method="modal")
    assert np.count_nonzero(small.frequencies == 0.0) == 2
    assert small.frequencies[2] == pytest.approx(exact, rel=1e-6)


def test_damping_by_rules_and_matrices() -> None:
    mass, stiffness, damping = random_body(np.random.default_rng(1), 7)
    rule = ss.ProportionalDamping(0.3, 0.02)
    by_rule = structure(mass, stiffness, rule)
    by_matrix = structure(mass, stiffness, 0.3 * mass + 0.02 * stiffness)
    np.testing.assert_allclose(by_rule.modal_damping, 0.3 + 0.02 * by_rule.squares, rtol=1e-14)
    assert by_matrix.modal_damping.ndim == 1  # seen to be proportional
    np.testing.assert_allclose(by_matrix.modal_damping, by_rule.modal_damping, rtol=1e-10)
    coupled = structure(mass, stiffness, damping)
    modes = coupled.modes
    np.testing.assert_allclose(coupled.modal_damping, modes.T @ damping @ modes, atol=1e-13)
    ratios = structure(mass, stiffness, modal_damping([0.5, 0.1]))
    expected = 2.0 * np.array([0.5, *[0.1] * 6]) * ratios.frequencies
    np.testing.assert_allclose(ratios.modal_damping, expected, rtol=1e-14)
    assert np.all(structure(mass, stiffness).modal_damping == 0.0)


@pytest.mark.parametrize("seed", range(40))
def test_whatever_is_proportional_is_seen_and_nothing_else(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mass, stiffness, _ = random_body(rng, int(rng.integers(1, 12)))
    mass, stiffness = (part * 10.0 ** rng.uniform(-6, 6) for part in (mass, stiffness))
    alpha, beta = rng.choice([0.0, 1e-6, 2.3], 2)
    damping = alpha * mass + beta * stiffness
    assert structure(mass, stiffness, damping).modal_damping.ndim == 1
    if len(mass) > 2 and alpha + beta:
        damping[0, 0] *= 1.0 + 1e-9
        assert structure(mass, stiffness, damping).modal_damping.ndim == 2


@pytest.mark.parametrize("n", [3, 12])
@pytest.mark.parametrize("parts", [1, 20])
def test_damping_between_parts_that_nothing_holds(n: int, parts: int) -> None:
    """Rigid modes have none, nor have modes that no dashpot feels: rounding does not make it
    negative."""
    for seed in range(15):
        rng = np.random.default_rng(seed)
        stiffness, damping = np.zeros((2, n, n))
        for i in range(n - 1):
            way = np.eye(n)[i] - np.eye(n)[i + 1]
            stiffness += rng.uniform(0.5, 5.0) * np.outer(way, way)
            damping += (i < parts) * rng.uniform(0.1, 0.3) * np.outer(way, way)
        body = structure(np.diag(rng.uniform(0.5, 2.0, n)), stiffness, damping)
        np.testing.assert_allclose(
            body.modal_damping, body.modes.T @ damping @ body.modes, atol=1e-14
        )
        assert np.all(body.modal_damping[0] == 0.0)
        assert ss.System("free", structures={"u": body}).declaration


@pytest.mark.parametrize("sparse", [False, True])
def test_reductions_of_a_beam_against_all_of_it(sparse: bool) -> None:
    mass, stiffness = clamped(250)  # sparse ones are iterated from 400 unknowns on
    if sparse:
        mass, stiffness = sp.csr_array(mass), sp.csr_array(stiffness)
    n = 500
    full = structure(mass, stiffness, modal_damping(0.01), names={"tip": n - 2, "mid": n // 2})
    small = full.reduced(keep=["tip", "mid"], modes=12)
    assert (small.unknowns, small.coordinates) == (n, 14)
    np.testing.assert_allclose(small.frequencies[:8], full.frequencies[:8], rtol=5e-3)
    assert np.all(small.frequencies[:8] >= full.frequencies[:8] * (1.0 - 1e-5))  # Ritz
    modes = small.modes[:, 0] * np.sign(small.modes[n - 2, 0])
    np.testing.assert_allclose(modes, full.modes[:, 0], atol=1e-4 * np.max(modes))
    # the first fixed mode that is left out, by another solver
    held = np.setdiff1d(np.arange(n), [n - 2, n // 2])
    dense_mass, dense_stiffness = clamped(250)
    block = np.ix_(held, held)
    fixed = sl.eigvalsh(dense_stiffness[block], dense_mass[block], subset_by_index=(0, 13))
    assert small.left_out is not None
    assert small.left_out.frequency == pytest.approx(np.sqrt(fixed[12]), rel=1e-6)
    # a force on a kept unknown moves it as far as it moves that of the whole
    force = np.zeros(n)
    force[n - 2] = 1.0
    exact = np.linalg.solve(dense_stiffness, force)[n - 2]
    row = np.asarray(small.basis)[n - 2]
    found = row @ np.linalg.solve(small.stiffness, row)
    assert found == pytest.approx(exact, rel=1e-5)
    assert small.left_out.static_error == 0.0
    modal = full.reduced(keep=["tip"], modes=5, method="modal")
    assert modal.left_out is not None
    assert modal.left_out.frequency == pytest.approx(full.frequencies[5], rel=1e-5)
    seen = modal.modes[n - 2] ** 2 @ (1.0 / modal.squares)
    assert modal.left_out.static_error == pytest.approx(1.0 - seen / exact, abs=1e-5)
    assert np.isnan(full.reduced(modes=5, method="modal").left_out.static_error)
    assert "first omitted frequency" in str(modal.summary())


def test_all_modes_reduce_nothing() -> None:
    mass, stiffness = chain(6)
    full = structure(mass, stiffness, names={"tip": 5})
    small = full.reduced(keep=["tip"], modes=100)
    np.testing.assert_allclose(small.frequencies, full.frequencies, rtol=1e-12)
    np.testing.assert_allclose(np.abs(small.modes), np.abs(full.modes), atol=1e-12)
    assert small.left_out is not None
    assert small.left_out.frequency == np.inf
    again = small.reduced(keep=[5], modes=2)
    assert again.unknowns == 6
    np.testing.assert_allclose(
        again.frequencies, full.reduced(keep=[5], modes=2).frequencies, rtol=1e-12
    )


def test_modes_that_coincide_are_all_found() -> None:
    """A square membrane: all but the diagonal modes are double."""
    n = 45
    line = diagonals([-np.ones(n - 1), 2.0 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    one = sp.eye_array(n)
    stiffness = sp.csc_array(sp.kron(line, one) + sp.kron(one, line))
    body = structure(sp.eye_array(n * n), stiffness)
    small = body.reduced(modes=20, method="modal")
    squares = 4.0 * np.sin(np.arange(1, n + 1) * np.pi / (2 * (n + 1))) ** 2
    exact = np.sort(np.add.outer(squares, squares).ravel())[:21]
    np.testing.assert_allclose(small.squares, exact[:20], rtol=1e-10)
    assert small.left_out is not None
    assert small.left_out.frequency == pytest.approx(np.sqrt(exact[20]), rel=1e-10)


def test_what_is_too_large_says_how_much_memory_it_takes() -> None:
    n = 200_000
    body = structure(sp.eye_array(n), sp.eye_array(n))
    with pytest.raises(
        ss.DeclarationError, match=r"200,000 degrees of freedom need full.* 1.28 TB"
    ):
        _ = body.frequencies
    with pytest.raises(ss.DeclarationError, match=r"structures.u: all modes.*reduced"):
        ss.System("s", structures={"u": body})
    assert "1.28 TB" in str(body.summary())


def test_a_large_structure_is_reduced_within_seconds() -> None:
    """A strip of 1,250 × 20 nodes, held at both ends; one of 10,000 × 20 takes 20 s."""
    long, wide = 1_250, 20
    lines = [
        diagonals([-np.ones(m - 1), 2.0 * np.ones(m), -np.ones(m - 1)], offsets=[-1, 0, 1])
        for m in (long, wide)
    ]
    across = lines[1].tolil()
    across[0, 0] = across[-1, -1] = 1.0  # free edges
    stiffness = sp.kron(lines[0], sp.eye_array(wide)) + sp.kron(sp.eye_array(long), across)
    began = time.process_time()
    body = structure(sp.eye_array(long * wide), stiffness, modal_damping(0.01))
    small = body.reduced(keep=[long * wide // 2, 10], modes=38)
    assert time.process_time() - began < 20.0
    assert small.coordinates == 40
    exact = 2.0 * np.sin(np.arange(1, 4) * np.pi / (2 * (long + 1)))
    np.testing.assert_allclose(small.frequencies[:3], exact, rtol=1e-3)


def test_results_show_what_has_a_name_or_was_kept() -> None:
    mass, stiffness = chain(60)
    names = [f"n{i}" for i in range(60)]
    assert structure(mass, stiffness, names={"tip": 59}).shown == ("tip",)
    assert structure(mass, stiffness).shown == ()
    whole = structure(mass, stiffness, names=names)
    assert whole.shown == ()
    assert whole.reduced(keep=[3, 7], modes=2).shown == ("n3", "n7")
    assert structure(mass, stiffness).reduced(keep=np.array([7]), modes=2).shown == (7,)
    assert structure(*chain(2)).shown == (0, 1)


def test_a_structure_goes_to_another_process_with_its_modes() -> None:
    body = structure(np.eye(4), np.eye(4), modal_damping(0.1), names={"a": 1})
    modes = body.modes  # any rotation of these would do
    again = pickle.loads(pickle.dumps(body))
    assert again == body
    assert np.array_equal(again.modes, modes)
    assert repr(body) == f"<Structure {body.digest}: 4 degrees of freedom, 1 named>"
