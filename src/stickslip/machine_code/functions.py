"""Compiled functions that Python calls."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.kept import cached_property
from stickslip.translator import Compiled

if TYPE_CHECKING:
    from stickslip.machine_code.words import Prepared

AS_PYTHON = bool(os.environ.get("STICKSLIP_AS_PYTHON"))
"""Whether compiled functions run as Python, to be followed with a debugger."""


class Entry(Compiled):
    """A function of the engine that Python calls, compiled ahead of time.

    Its arguments are numbers, arrays in C order, functions of a system, and tuples of these, as
    annotated. It returns nothing or one number.
    """

    def __call__(self, *arguments: Any) -> Any:
        if AS_PYTHON:
            with np.errstate(all="ignore"):  # compiled code does not warn, either
                return self.python(*arguments)
        return self.prepared(*arguments)

    @cached_property
    def prepared(self) -> Prepared:
        """The function in memory."""
        from stickslip.machine_code.shelf import prepare

        return prepare(self)

    __name__: str


class Kernel(Compiled):
    """A function of the engine that the machine code of systems calls.

    Its arguments are numbers and arrays, as annotated. It must not ask how many rows an array has.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function, brief=True)

    __name__: str


def entry_point(*, relaxed: Sequence[str] = ()) -> Callable[[Callable[..., Any]], Entry]:
    """Decorator of a compiled function that Python calls; see :class:`Entry`."""
    return lambda function: Entry(function, relaxed)
