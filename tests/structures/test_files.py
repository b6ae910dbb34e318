"""Structures in files: matrices in files of their own, and arrays with results, without loss."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

import stickslip as ss
from bodies import chain, clamped, random_body
from stickslip.model.system_file import dumps, loads

MASS, STIFFNESS = chain(4)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the matrices of a chain in every kind of file."""
    damping = 0.1 * MASS
    scipy.io.mmwrite(tmp_path / "M.mtx", sp.coo_array(MASS), symmetry="symmetric", precision=17)
    scipy.io.mmwrite(tmp_path / "K.mtx", STIFFNESS, precision=17)
    sp.save_npz(tmp_path / "K.npz", sp.csr_array(STIFFNESS))
    np.save(tmp_path / "M.npy", MASS)
    np.savez(tmp_path / "all.npz", M=MASS, K=STIFFNESS, C=damping)
    scipy.io.savemat(tmp_path / "all.mat", {"M": sp.csc_array(MASS), "K": STIFFNESS, "C": damping})
    np.save(tmp_path / "objects.npy", np.array([{}], dtype=object))
    (tmp_path / "bad.mtx").write_text("no matrix")
    return tmp_path


def read(folder: Path, lines: str) -> ss.Structure:
    path = folder / "model.toml"
    path.write_text(f'name = "chain"\n\n[structures.u]\n{lines}\n')
    found = ss.load(path).structures["u"]
    assert isinstance(found, ss.Structure)
    return found


@pytest.mark.parametrize(
    "lines",
    [
        'mass = "M.mtx"\nstiffness = "K.npz"',
        'mass = "M.npy"\nstiffness = "K.mtx"',
        'mass = "all.npz:M"\nstiffness = "all.mat:K"\ndamping = "all.npz:C"',
        'mass = "all.mat:M"\nstiffness = "all.npz:K"\ndamping = "all.mat:C"',
    ],
)
def test_matrices_of_files(folder: Path, lines: str) -> None:
    damping = 0.1 * MASS if "damping" in lines else None
    rest = 'names = {tip = 3}\nunit = "m"'
    found = read(folder, f"{lines}\n{rest}")
    known = ss.Structure(MASS, STIFFNESS, damping, {"tip": 3}, unit="m")
    np.testing.assert_allclose(found.frequencies, known.frequencies, rtol=1e-14)
    np.testing.assert_allclose(found.modal_damping, known.modal_damping, rtol=1e-14)
    assert (found.index("tip"), found.unit) == (3, "m")


def test_rules_and_reductions_in_files(folder: Path) -> None:
    files = 'mass = "M.mtx"\nstiffness = "K.npz"\n'
    whole = ss.Structure(MASS, STIFFNESS)
    assert read(folder, f"{files}damping = {{ratios = 0.02}}").damping == ss.ModalDamping(0.02)
    rule = read(folder, f"{files}damping = {{alpha = 0.1, beta = 0}}").damping
    assert rule == ss.ProportionalDamping(0.1, 0.0)
    small = read(folder, f"{files}keep = [3]\nmodes = 1")
    np.testing.assert_allclose(small.frequencies, whole.reduced([3], 1).frequencies, rtol=1e-13)
    modal = read(folder, f'{files}modes = 2\nmethod = "modal"\nnames = ["a", "b", "c", "tip"]')
    np.testing.assert_allclose(modal.frequencies, whole.frequencies[:2], rtol=1e-13)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ('mass = "M.mtx"', r"structures.u.stiffness: this key is missing"),
        ('mass = "M.mtx"\nstiffness = "X.mtx"', r"u.stiffness: no such file: 'X.mtx'"),
        ('mass = "M.mtx"\nstiffness = "K.op4"', r"unknown file format 'K.op4'"),
        ('mass = "M.mtx"\nstiffness = "bad.mtx"', r"'bad.mtx' cannot be read"),
        ('mass = "M.mtx"\nstiffness = "objects.npy"', r"'objects.npy' cannot be read"),
        (
            'mass = "M.mtx"\nstiffness = "all.npz"',
            r"the file has several arrays. Name one of M, K, C",
        ),
        ('mass = "M.mtx"\nstiffness = "all.npz:X"', r"the file has no array 'X'"),
        ('mass = "M.mtx"\nstiffness = 3', r"expected the name of a file"),
        ('mass = "M.mtx"\nstiffness = "K.npz"\ndamping = 0.1', r"not a matrix or a damping rule"),
        ('mass = "M.mtx"\nstiffness = "K.npz"\ndamping = {ratio = 1}', r"not a matrix or"),
        ('mass = "M.mtx"\nstiffness = "K.npz"\nkeeps = [1]', r"u.keeps: unknown key. Did you"),
        ('mass = "M.mtx"\nstiffness = "K.npz"\nkeep = 3', r"keep: expected a list"),
        (
            'mass = "M.mtx"\nstiffness = "K.npz"\nkeep = [9]',
            r"structures.u.keep: 9: no such degree of freedom",
        ),
        ('mass = "M.mtx"\nstiffness = "K.npz"\nunit = 3', r"structures.u.unit: expected a string"),
        ('packed = "zzz"', r"structures.u.packed: the packed arrays are damaged"),
        ('packed = "UEsDBBQ="', r"the packed arrays are damaged"),
        ("packed = 3", r"the packed arrays are damaged"),
    ],
)
def test_what_is_wrong_in_a_file_is_said(folder: Path, lines: str, said: str) -> None:
    with pytest.raises(ss.DeclarationError, match=said):
        read(folder, lines)


def bodies() -> dict[str, ss.Structure]:
    rng = np.random.default_rng(3)
    mass, stiffness, damping = random_body(rng, 5)
    sparse = [sp.csr_array(matrix) for matrix in clamped(20)]
    whole = ss.Structure(sparse[0], sparse[1], ss.ModalDamping([0.01, 0.02]))
    return {
        "full": ss.Structure(mass, stiffness, damping, [f"n{i}" for i in range(5)], unit="mm"),
        "sparse": ss.Structure(sp.csr_array(MASS), sp.csr_array(STIFFNESS), sp.csr_array(MASS)),
        "by a rule": ss.Structure(MASS, STIFFNESS, ss.ProportionalDamping(0.1, 1e-7)),
        "with equal modes": ss.Structure(np.eye(4), np.eye(4)),
        "reduced": whole.reduced([3, 38], 4),
        "reduced to all": whole.reduced([3, 38], 400),
        "of modes": whole.reduced([], 3, method="modal"),
    }


@pytest.mark.parametrize("kind", bodies())
def test_structures_are_stored_without_loss(kind: str) -> None:
    body = bodies()[kind]
    system = ss.System("s", structures={"u": body}, forces={"u[1]": "sin(t)"})
    again = loads(dumps(system))
    assert again == system
    assert dumps(again) == dumps(system)
    found: Any = again.structures["u"]
    for name in ("mass", "stiffness", "basis", "modes", "frequencies"):
        one, other = getattr(found, name), getattr(body, name)
        if sp.issparse(other):
            assert sp.issparse(one)
            one, other = one.toarray(), other.toarray()
        assert np.array_equal(one, other), name
    assert repr(found.left_out) == repr(body.left_out)
    assert again.plain == system.plain


def test_results_hold_their_structures(tmp_path: Path) -> None:
    """What the modes are called, and which they are where frequencies coincide, is stored."""
    body = ss.Structure(np.eye(3), np.diag([1.0, 1.0, 2.0]), names={"tip": 2})
    modes = np.array(body.modes)
    system = ss.System(
        "three",
        structures={"u": body},
        forces={"u[0]": "cos(t)"},
        contacts={"rub": ss.Contact("d_u[0] + d_u[1] - d_u[tip]", 0.2)},
        initial={"u[1]": 1.0},
    )
    motion = ss.simulate(system, (0.0, 10.0))
    motion.save(tmp_path / "motion.nc")
    again = ss.open(tmp_path / "motion.nc")
    assert again.system == system
    assert np.array_equal(again.system.structures["u"].modes, modes)
    for name in ("u[tip]", "u[1]", "d_u[0]", "u_mode_2"):
        assert np.array_equal(again[name], motion[name])
    assert again.certificate.ok
    with pytest.raises(ss.DeclarationError, match="unknown quantity"):
        _ = again["u[3]"]
