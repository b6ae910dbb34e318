"""Functions of the language, and their definitions in assembly."""

from __future__ import annotations

import ast
from typing import Any, NamedTuple

from stickslip.translator import Compiled
from stickslip.translator.values import (
    NAMED,
    NONE,
    Scalar,
    Type,
)

_ANNOTATED: dict[Any, Scalar] = {kind.__name__: x for kind, x in NAMED.items()} | {None: NONE}


def annotated_type(annotation: ast.expr | None) -> Scalar | None:
    """The scalar type that an annotation names, or None."""
    named = getattr(annotation, "id", None) or getattr(annotation, "value", "")
    return _ANNOTATED.get(named)


class Definition(NamedTuple):
    """A function in the assembly.

    Attributes
    ----------
    function : Compiled
        What it was made of.
    kind : str
        LLVM's type of the result, with the calling convention.
    parameters : list of (str, str)
        LLVM's types with what is known of them, and names.
    called : set of str
        Names of what it calls.
    arguments, result : types
        What it takes and returns, if it is called by functions of the language.
    """

    function: Compiled
    name: str
    kind: str
    parameters: list[tuple[str, str]]
    body: str
    called: set[str]
    arguments: tuple[Type, ...] = ()
    result: Type = NONE

    def text(self, linkage: str, note: str = "") -> str:
        """The definition."""
        given = ", ".join(f"{kind} {name}" for kind, name in self.parameters)
        note = " alwaysinline" if self.function.inline else note
        note += " optsize" * self.function.brief
        head = f'define {f"{linkage} {self.kind}".strip()} @"{self.name}"({given}) #0{note}'
        return f"{head} {{\n{self.body}}}\n"

    @property
    def declaration(self) -> str:
        """Declaration of the function for other modules."""
        kinds = ", ".join(kind for kind, _ in self.parameters)
        return f'declare {self.kind} @"{self.name}"({kinds}) #0'

    @property
    def file(self) -> str:
        """The source."""
        return self.function.python.__code__.co_filename
