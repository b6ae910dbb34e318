"""Registered plots of a kind of result, by the name in ``result.plot(name)``."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

from stickslip.errors import DeclarationError

if TYPE_CHECKING:
    from stickslip.results import Result

_Draw = TypeVar("_Draw", bound=Callable[..., Any])

_drawn: dict[type, dict[str, Callable[..., Any]]] = {}


def register(kind: type[Result]) -> Callable[[_Draw], _Draw]:
    """Register a function as a plot of results of a kind.

    Parameters
    ----------
    kind : type
        Such as :class:`stickslip.Trajectory`; ``stickslip.results.Result`` means every kind.

    Returns
    -------
    function
        A decorator of functions ``(result, ax=None)`` that return a Figure (that of `ax`, if it is
        given); ``result.plot(name)`` then draws by the function of that name.

    Raises
    ------
    DeclarationError
        If another function has the name.
    """

    def add(function: _Draw) -> _Draw:
        name = function.__name__
        own = _drawn.setdefault(kind, {})
        # A module that is run again registers its functions again.
        if name in own and own[name].__module__ != function.__module__:
            raise DeclarationError(
                f"figure '{name}'",
                f"already registered by {own[name].__module__}",
                "Choose another name",
            )
        own[name] = function
        return function

    return add


def registered(kind: type, name: str) -> Callable[..., Any] | None:
    """The plot function of a name for results of a kind, if there is one."""
    for base in kind.__mro__:
        if name in _drawn.get(base, {}):
            return _drawn[base][name]
    return None
