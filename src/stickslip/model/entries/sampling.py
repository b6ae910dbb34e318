"""Equidistant sampling times, and the coincidence of several of them.

Two sets of times o + kT meet where the ratio of their periods is p/q and the difference of their
offsets is a multiple of the greatest common divisor T₀ of the periods. Then both are parts of one
set with the period T₀, so that what is sampled at the same time is computed at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from typing import NamedTuple

_LARGEST = 1000  # largest denominator of a ratio of periods
_RATIO = 1e-12  # relative error of a ratio that is regarded as rational
_FINEST = 64  # smallest ratio of the common period to the shortest one


class Sampling(NamedTuple):
    """Variables that are sampled at the times offset + k·period.

    Attributes
    ----------
    names : tuple of str
        Who asked for it.
    offset, period : str
        Formulas of parameters.
    to : mapping of str to str
        New values by variable.
    """

    label: str
    names: tuple[str, ...]
    offset: str
    period: str
    to: Mapping[str, str]

    @property
    def since(self) -> str:
        """Periods since the first sample."""
        return f"(t - ({self.offset}))/({self.period})"


def at_once(samplings: Sequence[Sampling], number: Callable[[str], float | None]) -> list[Sampling]:
    """The same with one for all whose times meet.

    Parameters
    ----------
    number : callable
        Value of a formula of parameters, if it does not depend on them.
    """
    left = list(samplings)
    found: list[Sampling] = []
    while left:
        group = [left.pop(0)]
        met = True
        while met:
            more = [s for s in left if any(_meet(s, g, number) for g in group)]
            left = [s for s in left if s not in more]
            group += more
            met = bool(more)
        found += _joined(group, number)
    return found


def _fraction(text: str, number: Callable[[str], float | None]) -> Fraction | None:
    """A ratio as a fraction of small numbers; None if it is none, or depends on parameters."""
    value = number(text)
    if value is None or not abs(value) < _LARGEST:
        return None
    near = Fraction(value).limit_denominator(_LARGEST)
    return near if abs(float(near) - value) <= _RATIO * max(abs(value), 1.0) else None


def _common(a: Fraction, b: Fraction) -> Fraction:
    """Greatest common divisor."""
    return Fraction(math.gcd(a.numerator * b.denominator, b.numerator * a.denominator)) / (
        a.denominator * b.denominator
    )


def _meet(one: Sampling, other: Sampling, number: Callable[[str], float | None]) -> bool:
    """Whether two of their times are the same."""
    ratio = _fraction(f"({other.period})/({one.period})", number)
    apart = _fraction(f"(({other.offset}) - ({one.offset}))/({one.period})", number)
    if ratio is None or apart is None or not ratio > 0:
        return False
    return (apart / _common(Fraction(1), ratio)).denominator == 1


def _joined(group: list[Sampling], number: Callable[[str], float | None]) -> list[Sampling]:
    """Replace samplings that share a period by one; unchanged if the common period is too short."""
    first = group[0]
    if len(group) == 1:
        return group
    ratios = [_fraction(f"({s.period})/({first.period})", number) for s in group]
    periods = [ratio for ratio in ratios if ratio is not None]
    shortest = reduce(_common, periods)
    if min(periods) > _FINEST * shortest:
        return group
    to: dict[str, str] = {}
    for sampling, period in zip(group, periods, strict=True):
        every = int(period / shortest)
        # Between its own times nothing changes: these are where a cosine is 1.
        least = math.cos(math.pi / every) if every > 2 else 0.0
        for name, value in sampling.to.items():
            own = f"piecewise(cos(2*pi*{sampling.since}) > {least!r}, {value}, {name})"
            to[name] = value if every == 1 else own
    names = tuple(dict.fromkeys(name for s in group for name in s.names))
    label = ", ".join(s.label for s in group)
    times = periods[0] / shortest
    return [Sampling(label, names, first.offset, f"({first.period})/{int(times)}", to)]
