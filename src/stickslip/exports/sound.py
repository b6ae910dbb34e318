"""Vibrations as sound."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.exports.tables import even_times, write_file
from stickslip.motion.trajectory import Trajectory
from stickslip.numerics.levels import COMPUTED_ZERO

_LOUDEST = 0.9  # fraction of full scale: resampling in players overshoots
_FULL_SCALE = 2**15 - 1
_HIGHEST_RATE = 768_000  # samples per second


def sound_of(motion: Trajectory, quantity: str, rate: int, seconds: float) -> Array:
    """Values of a quantity of a motion at equidistant times, `rate` per second.

    Raises
    ------
    DeclarationError
        If the quantity is unknown, or a number is not positive.
    """
    if not 1 <= rate <= _HIGHEST_RATE:
        raise DeclarationError(
            "rate", f"{rate} is out of range", f"Give 1 to {_HIGHEST_RATE} samples"
        )
    if not 0.0 < seconds < np.inf:
        raise DeclarationError(
            "seconds", f"{seconds:g} is not a positive number", "Give a positive number"
        )
    known = [str(name) for name in motion.dataset.data_vars]
    if quantity not in known:
        reason = f"unknown quantity '{short(quantity)}'"
        raise DeclarationError(motion.KIND, reason, suggestion(quantity, known))
    return motion.at(even_times(motion, 1.0 / (rate * seconds), "rate"))[quantity]


def write_wav(values: Array, rate: int, path: str | Path) -> None:
    """Write a vibration as sound of 16 bits, without its mean and scaled to full amplitude.

    Raises
    ------
    DeclarationError
        If it does not vary.
    StickslipError
        If the file cannot be written.
    """
    from scipy.io import wavfile

    swing = values - np.mean(values)
    loudest = float(np.max(np.abs(swing)))
    if not loudest > COMPUTED_ZERO * float(np.max(np.abs(values))):
        raise DeclarationError("quantity", "the quantity is constant, so the sound would be silent")
    sound = np.round(swing * (_LOUDEST * _FULL_SCALE / loudest)).astype(np.int16)
    write_file(path, lambda place: wavfile.write(place, rate, sound))
