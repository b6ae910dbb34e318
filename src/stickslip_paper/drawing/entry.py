"""What a figure of the paper is: its number, what it shows, and the function that draws it."""

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
        Plain text: what is shown, with equation numbers and the values of the parameters.
    draw : callable
        Makes the figure.
    """

    key: str
    title: str
    caption: str
    draw: Callable[[], Figure]
