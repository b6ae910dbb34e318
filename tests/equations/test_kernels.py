"""What the machine code of systems calls: bit for bit what its Python says, and an inverse."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from stickslip.arrays import Array
from stickslip.equations.codegen.series import invert
from stickslip.equations.native import (
    kernels,
    systems,  # noqa: F401  it says where kernels are found
)
from stickslip.equations.native.arithmetic import Arithmetic
from stickslip.machine_code import shelf
from stickslip.machine_code.functions import Kernel
from stickslip.machine_code.objects import addresses
from stickslip.translator.assembly import POINTER, REAL, WHOLE, Register
from stickslip.translator.values import ArrayType, entry_types

KERNELS = {name: x for name, x in vars(kernels).items() if isinstance(x, Kernel)}
NUMBERS = {POINTER: ctypes.c_void_p, WHOLE: ctypes.c_int64, REAL: ctypes.c_double}
reals = st.floats(-1e3, 1e3) | st.sampled_from([0.0, -0.0, 1e90, 5e-324, float("inf")])


@cache
def _function(kernel: Kernel) -> Any:
    """A function that calls a kernel, as those of systems do."""
    types, result = entry_types(kernel)
    kinds = list[str]()
    for type_ in types:
        is_array = isinstance(type_, ArrayType)
        kinds += [POINTER, *[WHOLE] * (type_.axes - 1)] if is_array else [type_.llvm]
    arguments = [Register(f"%x{i}", kind) for i, kind in enumerate(kinds)]
    f = Arithmetic(f"call_{kernel.__name__}", arguments, result.llvm)
    f.end(f"ret {f.kernel(kernel, *arguments).typed}")
    text = "\n".join([*f.declared.values(), f.definition()])
    kind = ctypes.CFUNCTYPE(NUMBERS[result.llvm], *(NUMBERS[x] for x in kinds))
    return kind(addresses(text, [f.name])[0])


def compiled(kernel: Kernel, *given: Any) -> float:
    """What the machine code says."""
    plain = list[Any]()
    for x in given:
        if isinstance(x, np.ndarray):
            plain += [x.ctypes.data, *(side // 8 for side in x.strides[:-1])]
        else:
            plain.append(x)
    return _function(kernel)(*plain)


def same(a: Any, b: Any) -> bool:
    """Whether numbers have the same bits, but for those of NaN."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    bits = a.view(np.int64) == b.view(np.int64)
    return bool(np.all(bits | (np.isnan(a) & np.isnan(b))))


def test_all_are_in_the_engine() -> None:
    assert len(KERNELS) == 9
    assert all(shelf.engine().address(k.symbol) for k in KERNELS.values())


@settings(deadline=None, max_examples=300)
@given(st.lists(reals, min_size=8, max_size=8), st.lists(reals, min_size=8, max_size=8), st.data())
def test_sums(a: list[float], b: list[float], data: st.DataObject) -> None:
    x, y = np.array(a), np.array(b)
    k = data.draw(st.integers(0, 7))
    low, high = data.draw(st.integers(0, k + 1)), data.draw(st.integers(0, k + 1))
    orders = x, y, k, low, high
    p, n = data.draw(reals), data.draw(st.integers(0, 8))
    with np.errstate(all="ignore"):
        for kernel in (kernels.cauchy, kernels.chained):
            assert same(compiled(kernel, *orders), kernel(*orders))
        assert same(compiled(kernels.powered, *orders, p), kernels.powered(*orders, p))
        assert same(compiled(kernels.reached, x, y, n), kernels.reached(x, y, n))
        W = np.outer(y, [1.0, 2.0, 3.0])[:, 1:]
        assert same(compiled(kernels.applied, x, W, n), kernels.applied(x, W, n))
        rows = np.array([3, 0, 7, 1, 6, 2, 5, 4])
        summed = x, rows, W, n
        assert same(compiled(kernels.summed_moduli, *summed), kernels.summed_moduli(*summed))


def problem(n: int, kind: str) -> Array:
    """A matrix with one row more, and columns more, than are asked about."""
    A = np.random.default_rng(n).normal(size=(n + 1, n + 2))
    if kind == "scaled":
        A *= 10.0 ** np.arange(n + 1)[:, None] * 10.0 ** -np.arange(n + 2)
    elif kind == "definite":
        A[:n, :n] = A[:n, :n] @ A[:n, :n].T + np.eye(n)
    elif kind == "singular":
        A[0] = A[n - 1] if n > 1 else 0.0
    elif kind == "sparse":
        A[np.abs(A) < 0.7] = 0.0
    elif kind == "undefined":
        A[n // 2, n // 3] = np.nan
    return A


KINDS = ("any", "scaled", "definite", "singular", "sparse", "undefined")


@pytest.mark.parametrize("kind", KINDS)
def test_elimination(kind: str) -> None:
    for n in (1, 2, 3, 5, 8, 13):
        for kernel in (kernels.inverted, kernels.is_definite):
            (A, R), (B, S) = ((problem(n, kind), np.zeros((n + 2, n + 1))) for _ in range(2))
            with np.errstate(all="ignore"):
                assert compiled(kernel, A, n, R) == kernel(B, n, S)
            assert same(A, B)
            assert same(R, S)


@pytest.mark.parametrize("kind", KINDS)
def test_an_inverse_is_one(kind: str) -> None:
    """Rounded once or twice: as exact as NumPy's."""
    for n in (1, 2, 3, 8, 21, 40):
        given = problem(n, kind)
        wanted = kind not in ("singular", "undefined")
        R = np.zeros((n, n))
        found = compiled(kernels.inverted, given.copy(), n, R)
        if kind != "sparse":
            assert found == wanted
        if found:
            A = given[:n, :n]
            error = np.abs(R @ A - np.eye(n)).max()
            assert error <= 1e-13 * n * np.abs(R @ np.diag(np.abs(A).max(1))).max()


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_definite_matrices(n: int) -> None:
    rng = np.random.default_rng(n)
    V = np.linalg.qr(rng.normal(size=(n, n)))[0]
    for least in (1.0, 1e-6, 0.0, -1e-6, -1.0):
        A = np.zeros((n, n))
        A[:] = V @ np.diag(np.append(np.linspace(1.0, 3.0, n - 1), least)) @ V.T
        assert compiled(kernels.is_definite, A, n, np.zeros((n, n))) == (least > 0.0)


def test_the_engine_inverts_as_it_did() -> None:
    """Its products are rounded before they are subtracted."""
    n = 6
    A, R = problem(n, "any"), np.zeros((n, n))
    B, S = A.copy(), np.zeros((n, n))
    assert invert(A, n, R)
    assert kernels.inverted(B, n, S)
    assert not same(R, S)
    np.testing.assert_allclose(R, S, rtol=1e-11)


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(1, 8))
def test_shared_forces_are_the_least(seed: int, n: int, m: int) -> None:
    """Directions that depend on each other: what moves is unique, and forces are those with the
    least Σ λ²/s²; the same bits as in Python."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(n, n))
    M = B @ B.T + np.eye(n)
    J = rng.normal(size=(m, rng.integers(1, n + 1)))
    J = J @ rng.normal(size=(J.shape[1], n))
    s = rng.uniform(0.5, 2.0, m)
    A = np.zeros((n + m + 3, n + m))
    A[:n, :n], A[:n, n : n + m], A[n : n + m, :n] = M, -J.T, J
    A[n : n + m, n:] = -np.diag(s**2)
    found, R = A.copy(), np.zeros((n + m, n + m))
    assert compiled(kernels.shared, found, n + m, R) == 1
    other = np.zeros_like(R)
    assert kernels.shared.python(A.copy(), n + m, other) == 1
    assert same(R, other)
    f, g = rng.normal(size=n), J @ rng.normal(size=n)
    x = R @ np.concatenate([f, g])
    delassus = (J * s[:, None]) @ np.linalg.solve(M, (J * s[:, None]).T)
    # Where the rank is a question of tolerance, the pseudoinverse decides otherwise than pivots do.
    parts = np.linalg.eigvalsh(delassus) / np.linalg.norm(delassus, 2)
    assume(not np.any((parts > 1e-13) & (parts < 1e-8)))
    right = s * (g - J @ np.linalg.solve(M, f))
    least = s * (np.linalg.pinv(delassus, rcond=1e-10, hermitian=True) @ right)
    size = 1e-6 * (1.0 + np.abs(least).max())
    assert np.allclose(x[n:], least, atol=size)
    assert np.allclose(x[:n], np.linalg.solve(M, f + J.T @ least), atol=size)
