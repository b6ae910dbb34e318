"""Curves with as few samples as a plot needs, encoded as text: a motion takes a few kilobytes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stickslip.arrays import Array

# The letters of base64: two encode a value between 0 and 4095, three a time.
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
_TABLE = np.frombuffer(LETTERS.encode(), np.uint8)
_VALUE, _TIME = 2, 3  # number of letters
_FAR = 1e30
_JUMP = 0.1  # fraction of a range between neighbouring samples above which a curve jumps
_SAME = 1e-4  # fraction of a range within which two curves have the same shape


@dataclass
class Shapes:
    """Curves between 0 and 1 over the same times; those that differ by a scale and an offset share
    one shape.

    Attributes
    ----------
    times : array, shape (n,)
        Increasing.
    """

    times: Array
    curves: list[Array] = field(default_factory=list)
    near: list[float] = field(default_factory=list)

    def add(self, values: Array, near: float) -> list[float]:
        """The number of the shape (−1: constant), and the values of its 0 and 1.

        Parameters
        ----------
        values : array, shape (n,)
        near : float
            Tolerance of straight lines between its samples, as a fraction of its range.
        """
        # Infinite values, such as those of a threshold, are outside of any figure.
        values = np.nan_to_num(values, posinf=_FAR, neginf=-_FAR)
        low, high = float(np.min(values)), float(np.max(values))
        if not high - low > 1e-12 * max(abs(low), abs(high)):
            return [-1, short_number(low), short_number(low)]
        curve = (values - low) / (high - low)
        ends = [low, high]
        if curve[0] > 0.5:
            curve, ends = 1.0 - curve, [high, low]
        for number, known in enumerate(self.curves):
            if np.max(np.abs(known - curve)) < _SAME:
                self.near[number] = min(self.near[number], near)
                break
        else:
            number = len(self.curves)
            self.curves.append(curve)
            self.near.append(near)
        return [number, *map(short_number, ends)]

    def packed(self) -> list[list[str]]:
        """Times and values of the samples of each shape, as letters."""
        found = []
        for curve, near in zip(self.curves, self.near, strict=True):
            kept = needed(self.times, curve, near)
            found.append([self.moments(self.times[kept]), letters(curve[kept], _VALUE)])
        return found

    def moments(self, times: Array) -> str:
        """Times as letters."""
        first, last = self.times[0], self.times[-1]
        return letters((times - first) / (last - first), _TIME) if last > first else ""

    def spans(self, ends: Array) -> str:
        """Starts and ends of intervals as letters; intervals within a pixel of each other are
        merged."""
        if not len(ends) or not self.times[-1] > self.times[0]:
            return ""
        pixel = (self.times[-1] - self.times[0]) / 4096.0
        merged: list[list[float]] = []
        for begin, end in ends.reshape(-1, 2).tolist():
            if merged and begin - merged[-1][1] < pixel:
                merged[-1][1] = end
            else:
                merged.append([begin, end])
        return self.moments(np.array(merged).ravel())

    def changes(self, modes: Array) -> list[str]:
        """Times at which modes begin, and these modes, as letters."""
        begins = np.flatnonzero(np.diff(modes, prepend=modes[0] - 1))
        return [self.moments(self.times[begins]), letters_of_modes(modes[begins])]


def short_number(value: float) -> float:
    """A number with the digits that a figure needs."""
    return float(f"{value:.5g}")


def letters(numbers: Array, count: int) -> str:
    """Numbers between 0 and 1 as letters.

    Parameters
    ----------
    numbers : array, shape (n,)
    count : int
        How many letters each takes.
    """
    whole = np.rint(np.clip(numbers, 0.0, 1.0) * (64**count - 1)).astype(np.int64)
    digits = [(whole >> 6 * place) & 63 for place in reversed(range(count))]
    return _TABLE[np.stack(digits, axis=-1)].tobytes().decode()


def letters_of_modes(modes: Array) -> str:
    """Modes, which begin at −1, as letters."""
    return _TABLE[np.clip(modes + 1, 0, 63)].tobytes().decode()


def needed(times: Array, curve: Array, near: float) -> Array:
    """Samples of a curve whose linear interpolation is close to all others.

    Parameters
    ----------
    times : array, shape (n,)
        Increasing.
    curve : array, shape (n,)
    near : float
        How far the others may be from the lines.
    """
    chosen = np.zeros(len(times), bool)
    chosen[[0, -1]] = True
    jumps = np.abs(np.diff(curve)) > _JUMP
    chosen[:-1] |= jumps
    chosen[1:] |= jumps
    number = np.arange(len(times))
    while True:
        index = np.flatnonzero(chosen)
        away = np.abs(curve - np.interp(times, times[index], curve[index]))
        parts = np.flatnonzero(np.maximum.reduceat(away, index[:-1]) > near)
        if len(parts) == 0:
            return index
        # In the middle rather than at an end, so that an oscillation is halved each time.
        part = np.clip(np.searchsorted(index, number, side="right") - 1, 0, len(index) - 2)
        share = (number - index[part]) / (index[part + 1] - index[part])
        away *= share * (1.0 - share)
        for first, last in zip(index[parts], index[parts + 1], strict=True):
            chosen[first + int(np.argmax(away[first:last]))] = True
