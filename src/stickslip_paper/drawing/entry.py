"""A figure of the paper: its number, caption, and plot function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure


@dataclass(frozen=True)
class FigureEntry:
    """One figure.

    Attributes
    ----------
    key : str
        Its number in [M], such as ``"4.4"``, or a word if [M] does not have it.
    caption : str
        Plain text, with equation numbers and the values of the parameters.
    draw : callable
        Creates the figure.
    """

    key: str
    title: str
    caption: str
    draw: Callable[[], Figure]
