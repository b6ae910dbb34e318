"""A translator of a small part of Python to LLVM assembly.

A function marked with :func:`compiled` is ordinary Python: called from Python, it runs as it
stands. The translator writes it as LLVM assembly, once for each combination of argument types. It
may contain the following.

* **Values.** ``int`` (64 bits, wraps around), ``float``, ``bool``, ``complex``; NumPy arrays in C
  order; tuples and named tuples of these; functions given by their address. Nothing is allocated.
* **Variables.** A variable has one type. Where it is whole in one place and real in another it is
  real; it cannot be real in one place and complex in another. It has to have a value on every way
  that leads to where it is read.
* **Indices.** All indices of an entry, or the leading ones of a row, and at most one slice ``a:b``
  in the last place. An index must not be negative unless it is a constant.
* **Statements.** Assignments (also to several targets, and augmented), ``if``, ``while``, ``for``
  over ``range`` with a constant step, arrays and tuples, ``break``, ``continue``, ``pass``,
  ``return``.
* **Expressions.** Arithmetic, comparisons (also chained, and ``in`` a tuple), ``and``, ``or``,
  ``not`` of truth values, conditional expressions, attributes of named tuples, ``.shape``,
  ``.real``, ``.imag``, ``.conjugate()``.
* **Calls.** Other compiled functions, named tuples, and what `calls.CALLS` lists: ``len``, ``abs``,
  ``min``, ``max``, conversions, functions of `math`, `cmath` and NumPy for one number, and
  :func:`row_of`.
* **Constants.** Numbers, tuples and arrays of the module, or of a module it imports. Nothing writes
  to such an array, neither where it is named nor in a function that it is handed to.

Parameters of an *entry*, which Python calls, have types from `stickslip.arrays`; types of all
others follow from their calls. ``int``, ``float`` and ``bool`` convert an argument or a result.

No exception is raised: a real division by zero gives an infinity or NaN, as in C, a whole one zero;
``int`` of what is too large gives the nearest there is, of NaN zero. A whole number meets a real
one as a real number, which rounds beyond 2**53. A power with a whole exponent is a product. All
comparisons of a chain are made. Everything else is what Python computes.
"""

from __future__ import annotations

import ctypes
import math
import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import update_wrapper
from typing import Any, TypeVar

_T = TypeVar("_T")
CONTRACTED = ("contract",)
"""A product and a sum may be one instruction."""
RELAXED = ("contract", "nsz", "reassoc")
"""Also, sums may be reordered, as in long dot products; NaN and infinity stay visible."""


BEGAN = time.time_ns()
"""When this process imported the translator."""
READ: dict[str, int] = {}
"""Source files of compiled functions, and the time of their last change, in ns, at their import."""
_last = ("", 0)  # file and line of the function that was compiled last


class Compiled:
    """A function that the translator knows.

    Attributes
    ----------
    python : callable
        The function as it stands in the source.
    relaxed : sequence of str
        LLVM's fast-math flags of its arithmetic.
    inline : bool
        Whether every call of it has to be inlined.
    brief : bool
        Whether its loops have few rounds, so that they are neither unrolled nor made of vectors.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        relaxed: Sequence[str] = (),
        inline: bool = False,
        brief: bool = False,
    ) -> None:
        update_wrapper(self, function)
        note_source(function)
        self.python = function
        self.relaxed = tuple(sorted(relaxed))
        self.inline = inline
        self.brief = brief

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.python(*arguments, **named)

    @property
    def symbol(self) -> str:
        """Its name in machine code."""
        return f"{self.__module__}.{self.__name__}"

    @property
    def place(self) -> str:
        """Source location and name."""
        code = self.python.__code__
        return f"{code.co_filename}:{code.co_firstlineno}: {self.__name__}"

    __name__: str


def note_source(function: Callable[..., Any]) -> None:
    """Note the time of the last change of the file that is being imported, once for each import."""
    global _last
    code = function.__code__
    before, _last = _last, (code.co_filename, code.co_firstlineno)
    if before[0] != _last[0] or before[1] >= _last[1]:
        with suppress(OSError):
            READ[code.co_filename] = os.stat(code.co_filename).st_mtime_ns


def compiled(
    *, relaxed: Sequence[str] = (), inline: bool = False, brief: bool = False
) -> Callable[[Callable[..., Any]], Compiled]:
    """Decorator of a function that compiled functions call; see :class:`Compiled`."""
    return lambda function: Compiled(function, relaxed, inline, brief)


class FunctionAddress(int):
    """The address of a function that was not translated.

    A subclass has a static method ``signature`` whose annotations are the types of its arguments
    and of its result.
    """

    signature: Callable[..., Any]

    def __call__(self, *arguments: Any) -> Any:
        """Compiled functions alone do that.

        Raises
        ------
        TypeError
        """
        raise TypeError(f"{type(self).__name__} is called by compiled functions alone")


def fma(a: float, b: float, c: float) -> float:
    """a·b + c, rounded once."""
    if not (math.isfinite(a) and math.isfinite(b)):
        return a * b + c
    if not math.isfinite(c):
        return c
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    try:
        return float(exact) if exact else a * b + c
    except OverflowError:
        return math.inf if exact > 0 else -math.inf


def row_of(part: _T, i: int) -> _T:
    """A tuple whose arrays, and those of tuples inside, are indexed by i; numbers stay."""
    row: Any = part
    if isinstance(part, tuple):
        parts = [row_of(x, i) for x in part]
        row = type(part)(*parts) if hasattr(part, "_fields") else tuple(parts)
    elif getattr(part, "shape", ()):
        row = row[i]
    return row


def call_address(address: int, x: float) -> float:
    """Value of a function of one number, given by its address."""
    return ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(int(address))(x)
