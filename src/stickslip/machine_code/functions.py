"""Compiled functions, and numba only where it is needed.

numba takes longer to import than most motions take, and minutes to compile the engine. So a
function of the engine is known to it only when another one that is being compiled calls it; and
what Python calls, an :class:`Entry`, is machine code that was made when the package was built
(:mod:`stickslip.machine_code.shelf`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip.machine_code.tables import Prepared


class Compiled:
    """A function that numba compiles when it is called, or when a compiled function calls it.

    Attributes
    ----------
    py_func : callable
        As it stands in the source.
    targetoptions : dict
        Options of :func:`numba.njit`. numba asks by this name whether to inline a function.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self.targetoptions = options

    @cached_property
    def dispatcher(self) -> Any:
        """What numba makes of the function."""
        from stickslip.machine_code.caching import njit

        return njit(**self.targetoptions)(self.py_func)

    @cached_property
    def inside(self) -> Any:
        """The same for other compiled functions alone, which takes half as long."""
        from stickslip.machine_code.by_numba import Inside
        from stickslip.machine_code.caching import njit

        options = {**self.targetoptions, "cache": False, "pipeline_class": Inside}
        return njit(**options)(self.py_func)

    @property
    def _numba_type_(self) -> Any:
        """What numba takes the function for where another one calls it."""
        return self.inside._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)


class Intrinsic:
    """An instruction of LLVM's that compiled functions call.

    Parameters
    ----------
    make : callable
        Makes what numba calls an intrinsic, when numba asks for it.
    """

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make

    @cached_property
    def _made(self) -> Any:
        """What numba knows only as long as somebody holds it."""
        return self._make()

    @cached_property
    def _numba_type_(self) -> Any:
        from numba.core.registry import cpu_target

        context: Any = cpu_target.typing_context
        made = self._made
        context.refresh()
        return context.resolve_value_type(made)

    def __call__(self, *arguments: Any) -> Any:
        """Compiled functions alone do that.

        Raises
        ------
        TypeError
        """
        raise TypeError("an intrinsic is called by compiled functions alone")


class Entry(Compiled):
    """A function of the engine that Python calls: compiled ahead of time for the kinds of its
    arguments.

    They are numbers, arrays in C order, functions of a system, and tuples of these. It returns
    nothing or one number, and allocates nothing. An index that is not a constant alone must not be
    negative.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function, options)
        self._prepared: list[Prepared] = []

    @property
    def result(self) -> str:
        """What it returns: ``None``, ``int``, ``float`` or ``bool``."""
        said = self.py_func.__annotations__["return"]
        return said if isinstance(said, str) else getattr(said, "__name__", str(said))

    def __call__(self, *arguments: Any) -> Any:
        for prepared in self._prepared:
            tables = prepared.tables(arguments)
            if tables is not None:
                return prepared.run(*tables)
        from stickslip.machine_code.shelf import prepare

        prepared = prepare(self, arguments)
        tables = prepared.tables(arguments)
        if tables is None:
            raise TypeError(f"{self.__name__} cannot take its arguments: {arguments!r}")
        self._prepared.append(prepared)
        return prepared.run(*tables)

    __name__: str


def njit(**options: Any) -> Callable[[Callable[..., Any]], Compiled]:
    """Decorator of a function that compiled functions call, with options of :func:`numba.njit`."""
    return lambda function: Compiled(function, options)


def entry_point(**options: Any) -> Callable[[Callable[..., Any]], Entry]:
    """Decorator of a function of the engine that Python calls, with options of
    :func:`numba.njit`."""
    return lambda function: Entry(function, options)
