"""The play operator on arrays: z_k = min(max(z_{k−1}, L_k), U_k), in one compiled pass.

Each sample waits for the one before, and a processor that waits is slower than its memory. But z ↦
min(max(z, L), U) is a clamp, and compositions of clamps are clamps: two samples are made one first,
which needs no state, so that only every other sample has to wait.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array, Matrix, Vector, plain_array
from stickslip.errors import DeclarationError
from stickslip.machine_code.functions import entry_point
from stickslip.translator import compiled


@compiled(inline=True)
def _clamped(y: float, low: float, high: float) -> float:
    # Two selections without a branch: where loads are noisy, a branch would be guessed wrong most
    # of the time.
    y = low if y < low else y
    return high if y > high else y


@entry_point()
def clamp_samples(L: Vector, U: Vector, y: float, z: Vector) -> int:
    """Write the states to z (shapes (n,)), starting from y; return how many pairs of samples have
    no L <= U."""
    wrong = 0
    for k in range(0, len(L) - 1, 2):
        low = L[k]
        high = U[k]
        next_low = L[k + 1]
        next_high = U[k + 1]
        z[k] = _clamped(y, low, high)
        y = _clamped(y, _clamped(low, next_low, next_high), _clamped(high, next_low, next_high))
        z[k + 1] = y
        wrong += int(not low <= high or not next_low <= next_high)
    if len(L) % 2 == 1:
        last = len(L) - 1
        z[last] = _clamped(y, L[last], U[last])
        wrong += int(not L[last] <= U[last])
    return wrong


def clamp(lower: ArrayLike, upper: ArrayLike, initial: float, out: Array | None = None) -> Array:
    """The play operator between two moving bounds: z_k = min(max(z_{k−1}, L_k), U_k).

    Exact for the continuous motion, if the bounds L = ℓ − ρ⁺ and U = ℓ + ρ⁻ are monotone between
    samples.

    Parameters
    ----------
    lower, upper : array, shape (n,)
        L and U at the samples, L <= U.
    initial : float
        z before the first sample.
    out : array, shape (n,), optional
        Where to write; contiguous, aligned and writeable float64.

    Returns
    -------
    array, shape (n,)
        z at the samples.

    Raises
    ------
    DeclarationError
        If sizes do not fit, or a sample is NaN or has L > U (its index is named).
    """
    L, U = (samples(given, where) for given, where in ((lower, "lower"), (upper, "upper")))
    if len(L) != len(U):
        raise DeclarationError(
            "upper",
            f"it has {len(U)} samples, but 'lower' has {len(L)}",
            "Give the same number of both",
        )
    if not np.isfinite(initial):
        raise DeclarationError(
            "initial", f"{initial} is not a finite number", "Give a finite number"
        )
    z = np.empty_like(L) if out is None else out
    if z.shape != L.shape or z.dtype != np.float64 or not z.flags.carray:
        raise DeclarationError(
            "out",
            f"its shape is {z.shape} and its type {z.dtype}",
            f"Give a contiguous, writeable float64 array of shape {L.shape}",
        )
    if clamp_samples(L, U, float(initial), z):
        k = int(np.argmax(~(L <= U)))
        if np.isnan(L[k]) or np.isnan(U[k]):
            raise DeclarationError(
                "lower" if np.isnan(L[k]) else "upper", f"sample {k} is NaN", "Give numbers"
            )
        raise DeclarationError(
            "lower",
            f"at sample {k} it is {L[k]:g}, which exceeds the upper bound {U[k]:g}",
            "Give lower <= upper",
        )
    return z


@entry_point(relaxed=("nsz", "reassoc"))
def _weighted_sum(load: Vector, r: Vector, w: Vector, z: Vector, out: Vector) -> None:
    """Σ wᵢ zᵢ at every sample, for many plays under one load.

    Parameters
    ----------
    load : array, shape (n,)
    r, w, z : array, shape (m,)
        Radii, weights, and positions before the first sample, which become those at the last.
    out : array, shape (n,)
        Written.
    """
    for k in range(len(load)):
        x = load[k]
        total = 0.0
        for i in range(len(r)):
            y = _clamped(z[i], x - r[i], x + r[i])
            z[i] = y
            total += w[i] * y
        out[k] = total


@entry_point()
def _each(load: Vector, r: Vector, z: Vector, out: Matrix) -> None:
    """The plays: row k of `out` contains their positions at sample k."""
    for k in range(len(load)):
        x = load[k]
        for i in range(len(r)):
            y = _clamped(z[i], x - r[i], x + r[i])
            z[i] = y
            out[k, i] = y


def plays(load: ArrayLike, radii: ArrayLike, initial: ArrayLike = 0.0) -> Array:
    """Many plays with constant thresholds under one load: z_i between ℓ − r_i and ℓ + r_i.

    Parameters
    ----------
    load : array, shape (n,)
        Samples of ℓ in order; only the sequence of turning points matters.
    radii : array, shape (m,)
        Thresholds r_i >= 0.
    initial : float or array of shape (m,)
        Positions before the first sample.

    Returns
    -------
    array, shape (n, m)

    Raises
    ------
    DeclarationError
        If a number is not finite (its index is reported), a radius is negative, or shapes do not
        match.
    """
    samples_, r, z = _bank(load, radii, initial)
    out = np.empty((len(samples_), len(r)))
    _each(samples_, r, z, out)
    return out


@validated
def prandtl_ishlinskii(
    load: ArrayLike, radii: ArrayLike, weights: ArrayLike, *, initial: ArrayLike = 0.0
) -> Array:
    """Evaluate the Prandtl–Ishlinskii operator Σ w_i z_i, a weighted sum of plays, without storing
    the plays.

    Parameters
    ----------
    load : array, shape (n,)
        Samples of ℓ in order; only the sequence of turning points matters.
    radii : array, shape (m,)
        Thresholds r_i >= 0 of the plays z_i, which stay between ℓ − r_i and ℓ + r_i.
    weights : array, shape (m,)
        w_i, of any sign.
    initial : float or array of shape (m,)
        Positions before the first sample.

    Returns
    -------
    array, shape (n,)

    Raises
    ------
    DeclarationError
        If a number is not finite (its index is reported), a radius is negative, or shapes do not
        match.

    Examples
    --------
    >>> import stickslip as ss
    >>> ss.prandtl_ishlinskii([0, 3, -3], radii=[1, 2], weights=[0.5, 0.5]).tolist()
    [0.0, 1.5, -1.5]

    References
    ----------
    P. Krejčí, *Hysteresis, Convexity and Dissipation in Hyperbolic Equations*, Gakkōtosho (1996).
    """
    samples_, r, z = _bank(load, radii, initial)
    w = samples(weights, "weights", finite=True)
    if len(w) != len(r):
        raise DeclarationError(
            "weights",
            f"{len(w)} were given, but there are {len(r)} radii",
            "Give one weight per radius",
        )
    out = np.empty(len(samples_))
    _weighted_sum(samples_, r, w, z, out)
    return out


def _bank(load: ArrayLike, radii: ArrayLike, initial: ArrayLike) -> tuple[Array, Array, Array]:
    """The checked load and radii, and the positions as a new array."""
    load, r = samples(load, "load", finite=True), samples(radii, "radii", finite=True)
    if np.any(r < 0.0):
        i = int(np.argmax(r < 0.0))
        raise DeclarationError("radii", f"entry {i} is negative ({r[i]:g})", "Give thresholds >= 0")
    z = samples(np.atleast_1d(initial), "initial", finite=True)
    if len(z) not in (1, len(r)):
        raise DeclarationError(
            "initial",
            f"{len(z)} were given, but there are {len(r)} radii",
            "Give one number, or one per radius",
        )
    return load, r, np.array(np.broadcast_to(z, r.shape))


def samples(given: Any, where: str, finite: bool = False) -> Array:
    """The numbers as an array of shape (n,) for compiled functions.

    Raises
    ------
    DeclarationError
        If they are not numbers, or (if checked) one is not finite; the message gives its index.
    """
    try:
        values = plain_array(given)
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(
            where,
            f"a {type(given).__name__} is not an array of numbers",
            "Give numbers",
        ) from None
    if np.ndim(given) != 1:
        raise DeclarationError(
            where, f"the array has {np.ndim(given)} dimensions", "Give an array of shape (n,)"
        )
    if finite and not np.isfinite(values).all():
        k = int(np.argmin(np.isfinite(values)))
        raise DeclarationError(where, f"sample {k} is {values[k]}", "Give finite numbers")
    return values
