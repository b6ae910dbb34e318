"""Plots of results. Each result has a method ``plot()``; this module contains plots that compare
several results, and parts that can be drawn into existing axes. :func:`register` adds a
user-defined plot.

>>> import stickslip as ss
>>> threshold = "1 + cos(2*pi*s)/2"
>>> resolved = ss.play("5*t - t**2", threshold, (0, 5), initial=0.0, epsilon=0.1)
>>> averaged = ss.play("5*t - t**2", 0.5, (0, 5), initial=0.0)
>>> figure = ss.figures.plot_limit(resolved, averaged)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from stickslip.errors import need

if TYPE_CHECKING:
    from stickslip.figures.dissipation import (
        costs_over_phase,
        plot_average,
        plot_path,
        stable_sets,
    )
    from stickslip.figures.drawing.registry import register
    from stickslip.figures.in_plane import force_in_plane, path_in_plane
    from stickslip.figures.play import plot_limit, plot_loops

__all__ = [
    "costs_over_phase",
    "force_in_plane",
    "path_in_plane",
    "plot_average",
    "plot_limit",
    "plot_loops",
    "plot_path",
    "register",
    "stable_sets",
]

need("matplotlib", "plots")

_HOMES = {
    **dict.fromkeys(
        ["costs_over_phase", "plot_average", "plot_path", "stable_sets"], "dissipation"
    ),
    **dict.fromkeys(["force_in_plane", "path_in_plane"], "in_plane"),
    **dict.fromkeys(["plot_limit", "plot_loops"], "play"),
    "register": "drawing.registry",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'stickslip.figures' has no attribute '{name}'")
    return getattr(import_module(f"stickslip.figures.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
