"""Narrow shapes: how a formula writes them, and what they are, free of overflow and good for
complex arguments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Shape:
    """A function of (s − place)/width as a formula and as a function."""

    name: str
    formula: str
    at: Callable[[Any], Any]

    def text(self, s: str, place: str = "p", width: str = "w") -> str:
        """The formula in the variable s with the names of the place and the width."""
        return self.formula.format(u=f"(({s} - {place})/{width})")


def _gauss(u: Any) -> Any:
    return np.exp(-u * u)


def _sech2(u: Any) -> Any:
    e = np.exp(-2 * (u if np.real(u) >= 0 else -u))
    return 4 * e / (1 + e) ** 2


def _lorentz(u: Any) -> Any:
    return 1 / (1 + u * u)


def _logistic(u: Any) -> Any:
    return 1 / (1 + np.exp(-u)) if np.real(u) >= 0 else np.exp(u) / (1 + np.exp(u))


def _tanh(u: Any) -> Any:
    return _logistic(2 * u)


def _atan(u: Any) -> Any:
    return 0.5 + np.arctan(u) / np.pi


def _root(u: Any) -> Any:
    return (1 + u / np.sqrt(1 + u * u)) / 2


BUMPS = (
    Shape("gauss", "exp(-{u}**2)", _gauss),
    Shape("sech2", "1/cosh({u})**2", _sech2),
    Shape("lorentz", "1/(1 + {u}**2)", _lorentz),
)
STEPS = (
    Shape("tanh", "(1 + tanh({u}))/2", _tanh),
    Shape("logistic", "1/(1 + exp(-{u}))", _logistic),
    Shape("atan", "(1/2 + atan({u})/pi)", _atan),
    Shape("root", "(1 + {u}/sqrt(1 + {u}**2))/2", _root),
)
