"""Systems from the literature, each declared in a separate file.

>>> import stickslip as ss
>>> ss.catalogue.names()[:3]
['belt_block', 'bladed_disk', 'block_chain']
>>> ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05, V=0.1).name
'spring_slider'

Each file declares a function of the same name, by which it is found; there is no list to maintain.
"""

from __future__ import annotations

import ast
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType
from typing import TYPE_CHECKING, Any

from stickslip.arguments import validated
from stickslip.errors import DeclarationError, short, suggestion

if TYPE_CHECKING:
    from collections.abc import Callable

    from stickslip.model.system import System


def names() -> list[str]:
    """Names of all systems."""
    return sorted(
        module.name for module in iter_modules(__path__) if not module.name.startswith("_")
    )


@validated
def get(name: str, **given: Any) -> System:
    """Return a system by name.

    Parameters
    ----------
    name : str
        One of :func:`names`.
    **given : float or str
        Parameters as numbers, free functions as formulas.

    Raises
    ------
    DeclarationError
        If there is no such system, or a given value is not accepted.
    """
    known = names()
    if name not in known:
        raise DeclarationError(
            "catalogue",
            f"unknown system '{short(name)}'",
            suggestion(name.replace("-", "_"), known),
        )
    return __getattr__(name)(**given)


def about(name: str) -> tuple[str, str]:
    """Title and source of a system, read from its file without declaring the system, which could
    require the assembly of a structure."""
    text = Path(__path__[0], f"{name}.py").read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            given = {k.arg: k.value for k in node.keywords}
            told = [given.get(key) for key in ("title", "source")]
            texts = [part.value for part in told if isinstance(part, ast.Constant)]
            if node.func.id == "System" and len(texts) == 2:
                return str(texts[0]), str(texts[1])
    system = get(name)  # its title is not a literal
    return system.title, system.source


def __getattr__(name: str) -> Callable[..., System]:
    if name.startswith("_") or name not in names():
        raise AttributeError(
            f"the catalogue has no system '{name}'; available: {', '.join(names())}"
        )
    return getattr(import_module(f"{__name__}.{name}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *names()})


class _Catalogue(ModuleType):
    """Module type whose attributes are the functions of systems: the import of the module
    ``catalogue.rocking_toy`` would otherwise bind the module to this name."""

    def __setattr__(self, name: str, value: Any) -> None:
        if isinstance(value, ModuleType) and value.__name__ == f"{__name__}.{name}":
            value = getattr(value, name, value)
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Catalogue
