"""Kinds of arguments: what numba would call their types, said without numba.

A kind is a word or a tuple of them: ``f``, ``i``, ``b`` for a real number, a whole one, a truth
value; an array's type and its number of axes, ``f8:2``; a function of a system, ``@jets``; a tuple
as (its class, kinds of its parts).
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from stickslip.machine_code.interface import INTERFACE

ArgumentKind = str | tuple[Any, ...]

REAL_NUMBER, WHOLE_NUMBER, TRUTH, ADDRESS = "fib@"
PLAIN = "tuple"
"""The class of a tuple without names."""


class MachineFunction(int):
    """A function of a system in memory, by its address.

    Parameters
    ----------
    address : int
    name : str
        Of the interface; it stands for the types of arguments.
    """

    name: str

    def __new__(cls, address: int, name: str) -> MachineFunction:
        """An address with a name."""
        made = super().__new__(cls, address)
        made.name = name
        return made

    def __call__(self, *arguments: Any) -> Any:
        """What a compiled function does; Python cannot.

        Raises
        ------
        TypeError
        """
        raise TypeError(f"{self.name} is called by compiled functions alone")


def argument_kind(value: Any) -> ArgumentKind:
    """The kind of an argument.

    Raises
    ------
    TypeError
        If compiled functions take no such thing.
    """
    match value:
        case MachineFunction():
            return ADDRESS + value.name
        case bool() | np.bool_():
            return TRUTH
        case int() | np.integer():
            return WHOLE_NUMBER
        case float():
            return REAL_NUMBER
        case np.ndarray():
            return f"{value.dtype.kind}{value.dtype.itemsize}:{value.ndim}"
        case tuple():
            return (class_name(type(value)), *map(argument_kind, value))
        case _:
            raise TypeError(f"compiled functions take no {type(value).__name__}")


def class_name(kind: type) -> str:
    """Where a class of tuples is found."""
    return PLAIN if kind is tuple else f"{kind.__module__}:{kind.__qualname__}"


def class_called(name: str) -> type:
    """The class of tuples of that name."""
    if name == PLAIN:
        return tuple
    module, _, inner = name.partition(":")
    return getattr(importlib.import_module(module), inner)


def words(kind: ArgumentKind) -> Iterator[str]:
    """What a kind is made of, in order, tuples entered."""
    if isinstance(kind, str):
        yield kind
    else:
        for part in kind[1:]:
            yield from words(part)


def axis_count(word: str) -> int:
    """Number of axes of an array, −1 of a number."""
    return int(word[word.index(":") + 1 :]) if ":" in word else -1


def dtype(word: str) -> Any:
    """Type of the entries of an array."""
    return np.dtype(word[: word.index(":")])


def sizes(kind: ArgumentKind) -> tuple[int, int]:
    """How many whole numbers (addresses and lengths among them) and real ones say a value of that
    kind."""
    found = list(words(kind))
    reals = found.count(REAL_NUMBER)
    wholes = sum(1 if ":" not in word else 1 + axis_count(word) for word in found) - reals
    return wholes, reals


def function_type(word: str) -> Any:
    """numba's type of a function of a system."""
    from numba.core import types

    from stickslip.machine_code.interface import signature

    assert word[1:] in INTERFACE
    return types.FunctionType(signature(word[1:]))


def numba_type(word: str) -> Any:
    """The kind of a number, an array or a function of a system, as numba says it."""
    from numba import from_dtype
    from numba.core import types

    if word.startswith(ADDRESS):
        return function_type(word)
    if ":" in word:
        return types.Array(from_dtype(dtype(word)), axis_count(word), "C")
    return {REAL_NUMBER: types.float64, WHOLE_NUMBER: types.int64, TRUTH: types.boolean}[word]
