"""Values that are computed once per object, and cached with it.

A cache whose keys are objects and whose values know these keeps both for ever, also if it refers to
its keys weakly. Here an object has the cache itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

T = TypeVar("T")
_MISSING: Any = object()


class _Kept(dict[str, dict[Any, Any]]):
    """Cached values of an object, by kind and by their other arguments; copies of the object have
    an empty cache."""

    def __reduce__(self) -> tuple[type[_Kept], tuple[()]]:
        return _Kept, ()


def kept(owner: object, kind: str) -> dict[Any, Any]:
    """Values cached with an object so far.

    Parameters
    ----------
    kind : str
        What it is.
    """
    found: _Kept = owner.__dict__.setdefault("_kept", _Kept())
    return found.setdefault(kind, {})


def made_once(
    owner: object, kind: str, make: Callable[[], T], key: Any = None, most: int | None = None
) -> T:
    """A value computed from an object, now or earlier.

    Parameters
    ----------
    kind : str
        What it is.
    key : object
        What else it depends on.
    most : int, optional
        How many to keep, where the keys are numbers that may take any value.
    """
    known = kept(owner, kind)
    found = known.get(key, _MISSING)
    if found is _MISSING:
        found = make()
        if most is not None and len(known) >= most:
            known.clear()  # also entries that another thread has just added and uses
        known[key] = found
    return found


class cached_property(Generic[T]):
    """A property that is worked out once, as that of :mod:`functools`.

    Before Python 3.12 that one has a lock for all objects of a class: two threads that need
    properties of each other's objects would wait for ever. Here both may work out the same.
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        self.function = function
        self.__doc__ = function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, instance: None, owner: type | None = None) -> cached_property[T]: ...

    @overload
    def __get__(self, instance: object, owner: type | None = None) -> T: ...

    def __get__(self, instance: object, owner: type | None = None) -> cached_property[T] | T:
        if instance is None:
            return self
        known = instance.__dict__
        value = known[self.name] = self.function(instance)
        return value
