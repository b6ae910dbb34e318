"""A case: a system as the library gets it, and its mechanics as the reference gets them."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np

from stickslip import Contact, Inertial, Internal, Parameter, RateIndependent, System, Viscous

from .references.mechanics import Array, Mechanics

Rng = np.random.Generator


@dataclass(frozen=True)
class Case:
    """One random motion.

    The reference runs in natural units from t = 0; the library's numbers may be scaled.

    Attributes
    ----------
    system, parameters, initial
        What the library gets.
    duration : float
        Length of the span in natural units.
    mechanics : Mechanics
        What the reference gets. None: only `expected` is compared.
    expected : (str, float), optional
        Label of the outcome and the time, where a closed form knows that the motion ends there.
    units : mapping of str to float
        Library's numbers of one natural unit, for names of the state; "time" and "force" as well,
        and "slip" for how much larger relative velocities are than rates.
    origin : float
        Library's time at the start.
    friction : bool
        Whether the forces and modes of the contacts are unique, so that they can be compared.
    noise : float
        What rounding of the library's input alone does to the states, relative to their sizes.
    """

    system: System
    parameters: Mapping[str, float]
    initial: Mapping[str, float]
    duration: float
    mechanics: Mechanics | None
    expected: tuple[str, float] | None = None
    units: Mapping[str, float] = field(default_factory=dict)
    origin: float = 0.0
    friction: bool = True
    noise: float = 0.0
    atol: float = 1e-12
    family: str = ""
    seed: int = 0

    @property
    def names(self) -> list[str]:
        """Names of the state in the order (x, v, a)."""
        kinds = self.system.coordinates
        ordered = [
            n
            for kind in (Inertial, Viscous, RateIndependent)
            for n, c in kinds.items()
            if isinstance(c, kind)
        ]
        rates = [f"d_{n}" for n, c in kinds.items() if isinstance(c, Inertial)]
        return [*ordered, *rates, *self.system.internal]

    @property
    def start(self) -> Array:
        """The initial state in natural units."""
        return np.array([self.initial.get(n, 0.0) / self.units.get(n, 1.0) for n in self.names])

    @property
    def span(self) -> tuple[float, float]:
        """The library's span."""
        return self.origin, self.origin + self.duration * self.units.get("time", 1.0)

    def source(self) -> str:
        """A script that repeats the library's part."""
        options = "" if self.atol == 1e-12 else f", atol={self.atol:g}"
        return (
            f"system = {declaration(self.system)}\n"
            f"motion = ss.simulate(system, {self.span}, initial={_plain(self.initial)}, "
            f"parameters={_plain(self.parameters)}{options})"
        )


def _plain(numbers: Mapping[str, float]) -> dict[str, float]:
    return {name: float(value) for name, value in numbers.items()}


def declaration(item: Any) -> str:
    """Source text of a declaration without what is default."""
    if isinstance(item, Mapping):
        return "{" + ", ".join(f"{k!r}: {declaration(v)}" for k, v in item.items()) + "}"
    if not isinstance(
        item, (System, Contact, Inertial, Internal, Parameter, RateIndependent, Viscous)
    ):
        return repr(item)
    given = []
    for entry in fields(item):
        value = getattr(item, entry.name)
        plain = entry.default_factory() if callable(entry.default_factory) else entry.default
        if value != plain:
            given.append(f"{entry.name}={declaration(value)}")
    return f"ss.{type(item).__name__}({', '.join(given)})"


C = TypeVar("C", bound=Case)


@dataclass(frozen=True)
class Scaled:
    """One random motion of a shape: what its families know of units, and what the library gets.

    The reference runs in natural units from t = 0; the library's numbers may be scaled.

    Attributes
    ----------
    shape
        What the system consists of.
    numbers : dict
        In natural units.
    start : dict of str to float
        Initial state, in natural units.
    duration : float
    length, time, force : float
        The library's numbers of natural units.
    origin : float
        The library's time at the start.
    """

    shape: Any
    numbers: dict[str, float]
    start: Mapping[str, float]
    duration: float
    length: float = 1.0
    time: float = 1.0
    force: float = 1.0
    origin: float = 0.0
    family: str = ""
    seed: int = 0

    @property
    def system(self) -> System:
        """What the library gets."""
        raise NotImplementedError

    def unit(self, name: str) -> float:
        """The library's number of one natural unit, of a coordinate or a rate."""
        raise NotImplementedError

    def unit_of_number(self, name: str) -> float:
        """The library's number of one natural unit, of a number."""
        raise NotImplementedError

    @property
    def names(self) -> list[str]:
        """Names of the state."""
        return [*self.shape.names, *(f"d_{x}" for x in self.shape.names)]

    @property
    def parameters(self) -> dict[str, float]:
        """What the library gets."""
        return {n: float(v) * self.unit_of_number(n) for n, v in self.numbers.items()}

    @property
    def initial(self) -> dict[str, float]:
        """What the library gets."""
        return {n: float(v) * self.unit(n) for n, v in self.start.items()}

    @property
    def span(self) -> tuple[float, float]:
        """What the library gets."""
        return self.origin, self.origin + self.duration * self.time

    def source(self) -> str:
        """A script that repeats the library's part."""
        return (
            f"system = {declaration(self.system)}\n"
            f"motion = ss.simulate(system, {self.span}, initial={self.initial}, "
            f"parameters={self.parameters})"
        )


class Families(dict[str, Callable[[Rng], C]]):
    """Families by their names: functions that make a case of random numbers."""

    def add(self, make: Callable[[Rng], C]) -> Callable[[Rng], C]:
        """Register a family under the name of its function."""
        self[make.__name__.replace("_", " ")] = make
        return make

    def draw(self, name: str, seed: int) -> C:
        """The case of a family with a seed: the same on every machine."""
        rng = np.random.default_rng([zlib.crc32(name.encode()), seed])
        return replace(self[name](rng), family=name, seed=seed)


FAMILIES: Families[Case] = Families()
family, draw = FAMILIES.add, FAMILIES.draw


# -- words of the families -------------------------------------------------------------------------


def given(**numbers: float) -> dict[str, Parameter]:
    """Parameters with defaults."""
    return {name: Parameter(value) for name, value in numbers.items()}


def pick(rng: Rng, options: Any) -> Any:
    """One of several."""
    return options[rng.integers(len(options))]


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
