"""Which kinds of cases there are. A kind is a module with

* ``FAMILIES``: names of its families, in a fixed order;
* ``draw(family, seed)``: the case of a family with a seed, the same on every machine;
* ``cases(seed, count)``: cases of all families in turn;
* ``judge(case)``: its :class:`~adversarial.verdict.Verdict`;
* ``reproduction(case)``: a script that repeats what the library did.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol, TypeVar

from .verdict import Verdict

# Kinds in the order of the report, with their share of --count.
SHARES = {
    "motions": 1.0,
    "impacts": 0.25,
    "planes": 0.25,
    "points": 0.25,
    "dissipations": 0.25,
    "accelerations": 0.5,
    "samples": 0.025,
    "cycles": 0.1,
    "branches": 0.025,
    "maps": 0.1,
    "averages": 0.1,
    "evolutions": 0.1,
    "equilibrium_sets": 0.025,
    "equilibrium_branches": 0.025,
    "formulas": 0.25,
    "stored": 0.1,
    "structures": 0.05,
}


Case = TypeVar("Case")


class Kind(Protocol):
    """What a module of cases offers."""

    FAMILIES: Iterable[str]

    def draw(self, family: str, seed: int) -> Any: ...

    def judge(self, case: Any) -> Verdict: ...

    def reproduction(self, case: Any) -> str: ...


def kinds() -> list[str]:
    """Names of the kinds that are there."""
    return [name for name in SHARES if find_spec(f"{__package__}.kinds.{name}") is not None]


def kind(name: str) -> Kind:
    """The module of a kind."""
    return import_module(f"{__package__}.kinds.{name}")  # type: ignore[return-value]


def in_turn(
    families: Iterable[str], draw: Callable[[str, int], Case], seed: int, count: int
) -> Iterator[Case]:
    """Cases of all families in turn."""
    names = list(families)
    for i in range(count):
        yield draw(names[i % len(names)], seed + i // len(names))
