"""Noise as samples."""

from __future__ import annotations

import numpy as np

from stickslip.arguments import validated
from stickslip.errors import DeclarationError
from stickslip.model.entries.samples import SampleKind, Samples

_MOST = 50_000_000  # samples


@validated
def noise(
    span: tuple[float, float],
    period: float,
    deviation: float = 1.0,
    *,
    seed: int,
    kind: SampleKind = "linear",
) -> Samples:
    """Noise for a drive: independent normal numbers at even times, and samples of them in between.

    It is not white: a motion with dry friction has no meaning under white noise that does not
    depend on how it is discretised. Its spectrum is that of `kind`, flat up to about a quarter of
    1/period, and the motion under it is as exact as under any record. Halve the period, and divide
    the deviation by √2, to see what depends on it.

    Parameters
    ----------
    span : (float, float)
        It covers all of it.
    period : float
        Time between the samples.
    deviation : float
        Standard deviation of the samples.
    seed : int
        Of NumPy's generator: equal seeds give equal noise, on every machine.
    kind : {"linear", "cubic", "hold"}
        What it is between the samples.

    Returns
    -------
    Samples

    Raises
    ------
    DeclarationError
        If an argument is out of range.

    Examples
    --------
    >>> import stickslip as ss
    >>> noise = ss.noise((0.0, 100.0), 0.01, 0.2, seed=1)
    >>> len(noise.times), noise.span
    (10001, (0.0, 100.0))
    """
    start, end = span
    if not (np.isfinite([start, end]).all() and start < end):
        raise DeclarationError("span", f"({start:g}, {end:g}) is empty", "Give (start, end)")
    if not 0.0 < period < np.inf:
        raise DeclarationError("period", f"it is {period:g}", "Give a positive number")
    if not 0.0 <= deviation < np.inf:
        raise DeclarationError("deviation", f"it is {deviation:g}", "Give a number that is not < 0")
    if not seed >= 0:
        raise DeclarationError("seed", f"it is {seed}", "Give a whole number that is not < 0")
    steps = np.ceil((end - start) / period * (1.0 - 1e-12))
    if steps > _MOST:
        reason = f"this makes {steps:.3g} samples (at most {_MOST:,})"
        raise DeclarationError("period", reason, "Give a longer one, or a shorter span")
    times = start + period * np.arange(int(max(steps, 1.0)) + 1)
    values = deviation * np.random.default_rng(seed).standard_normal(len(times))
    return Samples(times, values, kind, where="noise")
