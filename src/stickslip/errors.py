"""Errors of declarations and arguments, and their messages."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import get_close_matches
from importlib.util import find_spec
from itertools import islice

_MOST = 60  # names in a message
_CLOSE = 5  # names that are tried as the closest one


class StickslipError(Exception):
    """Base class of the errors raised by this library."""


class DeclarationError(StickslipError, ValueError):
    """A declaration, a formula or an argument is wrong.

    Parameters
    ----------
    where : str
        The key of the declaration, such as ``contacts.'right leg'.threshold``.
    reason : str
        What is wrong with it.
    remedy : str, optional
        A remedy.
    """

    def __init__(self, where: str, reason: str, remedy: str = "") -> None:
        # Text of the user's file is reduced to one line on the terminal.
        self.where: str = printable(where)
        self.reason: str = printable(reason)
        self.remedy: str = printable(remedy)
        text = f"{self.where}: {self.reason}" if where else self.reason
        super().__init__(f"{text}. {self.remedy}" if remedy else text)


class ConvergenceError(StickslipError, RuntimeError):
    """An iteration did not reach its tolerance; the message reports the accuracy reached.

    Parameters
    ----------
    where : str
        The quantity that was to be computed.
    reached : str
        What was reached.
    remedy : str, optional
        A remedy.
    """

    def __init__(self, where: str, reached: str, remedy: str = "") -> None:
        self.where = where
        self.reached = reached
        self.remedy = remedy
        super().__init__(f"{where}: {reached}. {remedy}" if remedy else f"{where}: {reached}")


class TimeLimitError(ConvergenceError):
    """The limit of wall-clock time was reached before there was a result."""


class MissingPackageError(StickslipError, ImportError):
    """A package that an extra of the installation brings is not there."""


def need(package: str, extra: str) -> None:
    """Raise an error if an optional package is not installed.

    Parameters
    ----------
    package : str
        What is imported.
    extra : str
        The extra of the installation that brings it.

    Raises
    ------
    MissingPackageError
        If it is not installed.
    """
    if find_spec(package) is None:
        raise MissingPackageError(
            f"{package} is required but not installed. Install it with: pip install "
            f'"stickslip[{extra}]"'
        )


def printable(text: str) -> str:
    """The text with a space for every character that cannot be printed."""
    return "".join(c if c.isprintable() else " " for c in text)


def short(text: str) -> str:
    """The beginning of a text that is too long for a message."""
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."


Check = Callable[[str], object]
"""Raises :class:`DeclarationError` for a name that is refused."""
_accepted: ContextVar[Check | None] = ContextVar("door", default=None)
_trying: ContextVar[bool] = ContextVar("trying", default=False)


@contextmanager
def listing(accepts: Check) -> Generator[None]:
    """Restrict the names listed in messages to those that an argument accepts; the outermost
    argument counts.

    Parameters
    ----------
    accepts : callable
        The check of the argument, of a name alone.
    """
    before = _accepted.set(_accepted.get() or accepts)
    try:
        yield
    finally:
        _accepted.reset(before)


def suggestion(
    name: str, known: Iterable[str], quote: str = "'", accepts: Check | None = None
) -> str:
    """The remedy for an unknown name: the closest one that is known, or all of them.

    Parameters
    ----------
    accepts : callable, optional
        The check of a name. Names that it refuses are not listed; within :func:`listing` that of
        the argument counts.
    """
    names = list(dict.fromkeys(known))
    check = None if accepts is None else _accepted.get() or accepts
    if check is not None and _trying.get():
        return ""  # the message for a candidate name is not shown

    def accepted(name: str) -> bool:
        return check is None or _is_accepted(check, name)

    close = next(filter(accepted, get_close_matches(name, names, _CLOSE)), None)
    if close is not None:
        return f"Did you mean {quote}{close}{quote}?"
    # The number of names that are tried is limited by the number shown.
    half = _MOST // 2
    first = list(islice(filter(accepted, names), half))
    others = names[names.index(first[-1]) + 1 :] if len(first) == half else []
    last = list(islice(filter(accepted, reversed(others)), half))[::-1]
    cut = others and len(last) == half and others.index(last[0]) > 0
    return f"Known here: {', '.join([*first, *(['...'] if cut else []), *last]) or 'none'}"


def _is_accepted(check: Check, name: str) -> bool:
    before = _trying.set(True)
    try:
        check(name)
    except DeclarationError:
        return False
    finally:
        _trying.reset(before)
    return True


def some(names: list[str], most: int = _MOST) -> str:
    """Names for a message, the first and the last ones if they are many."""
    shown = names if len(names) <= most else [*names[: most // 2], "...", *names[-most // 2 :]]
    return ", ".join(shown)
