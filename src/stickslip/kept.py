"""What is made of an object once, and goes with it.

A cache whose keys are objects and whose values know these keeps both for ever, also if it refers to
its keys weakly. Here an object has the cache itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


class _Kept(dict[str, dict[Any, Any]]):
    """What has been made of an object, by kind and by what else it depends on; copies of the object
    begin with nothing."""

    def __reduce__(self) -> tuple[type[_Kept], tuple[()]]:
        return _Kept, ()


def kept(owner: object, kind: str) -> dict[Any, Any]:
    """What has been made of an object so far.

    Parameters
    ----------
    owner : object
    kind : str
        What it is.
    """
    found: _Kept = owner.__dict__.setdefault("_kept", _Kept())
    return found.setdefault(kind, {})


def made_once(
    owner: object, kind: str, make: Callable[[], T], key: Any = None, most: int | None = None
) -> T:
    """What is made of an object, now or earlier.

    Parameters
    ----------
    owner : object
    kind : str
        What it is.
    make : function
    key : object
        What else it depends on.
    most : int, optional
        How many to keep, where the keys are numbers that may take any value.
    """
    known = kept(owner, kind)
    if key not in known:
        if len(known) == most:
            known.clear()
        known[key] = make()
    return known[key]
