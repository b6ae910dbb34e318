"""Requests of a page: a computation, and the system with its settings.

All of it comes from outside, so it is checked here, once, before anything is done with it.
"""

from __future__ import annotations

import base64
import json
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any
from urllib.parse import parse_qsl, unquote

from stickslip.errors import DeclarationError, short
from stickslip.explorer.asking.limits import MOST_LEVELS, MOST_MESSAGE, MOST_NAMES, MOST_TEXT

GIVEN = "given"  # the model that was named when the explorer was opened
FIRST_MODEL = "rocking_toy"  # the one that is shown if none is named


@dataclass(frozen=True)
class PageSetting:
    """A system with the settings of a page.

    Attributes
    ----------
    model : str
        A name of the catalogue, or empty if there is a text.
    toml : str
        The text of a model file.
    values : mapping of str to float or str
        Parameters, and free functions as formulas, that differ from those of the model.
    initial : mapping of str to float
        Initial values that differ.
    until : float, optional
        End of the time span.
    """

    model: str = ""
    toml: str = ""
    values: Mapping[str, float | str] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)
    until: float | None = None


@dataclass(frozen=True)
class Request:
    """One question of a page.

    Attributes
    ----------
    serial : int
        Its number; an answer has the same.
    lane : str
        A newer question of the same lane replaces an older one.
    what : str
        Kind of the request.
    options : mapping of str to anything
        Options of the request, checked by its handler.
    """

    serial: int
    lane: str
    what: str
    setting: PageSetting
    options: Mapping[str, Any] = field(default_factory=dict)

    def about(self, toml: str) -> Request:
        """The same question about the text of a model file."""
        return replace(self, setting=replace(self.setting, model="", toml=toml))

    def number(self, name: str, default: float) -> float:
        """An option that is a number."""
        return real_number(self.options.get(name, default), name)

    def text(self, name: str, default: str = "") -> str:
        """An option that is a text."""
        return _text(self.options.get(name, default), name)


def read_request(text: str) -> Request:
    """Read a question of a page.

    Raises
    ------
    DeclarationError
        If it is none.
    """
    if len(text) > MOST_MESSAGE:
        raise DeclarationError(
            "message", f"the request has {len(text):,} characters", "Send a smaller request"
        )
    try:
        table = json.loads(text)
        if "\\u" in text:
            json.dumps(table, ensure_ascii=False).encode()  # unpaired surrogates cannot be sent
        if _is_deep(table):
            raise ValueError
        said = _table(table, "message")
        about = _table(said.get("setting", {}), "setting")
        serial, lane, what = said["serial"], said["lane"], said["what"]
    except (ValueError, KeyError, RecursionError):
        raise DeclarationError("message", "the request cannot be read", "Reload the page") from None
    if isinstance(serial, bool) or not isinstance(serial, int) or not 0 <= serial < 2**53:
        raise DeclarationError("message", "the request has no number", "Reload the page")
    return Request(
        serial,
        _text(lane, "lane", 40),
        _text(what, "what", 40),
        _setting(about),
        _table(said.get("options", {}), "options"),
    )


def _is_deep(table: Any) -> bool:
    """Return whether lists and tables are nested more deeply than in any valid question."""
    level = [[table]]
    for _ in range(MOST_LEVELS):
        inside = [x for parts in level for x in parts if isinstance(x, dict | list)]
        level = [x.values() if isinstance(x, dict) else x for x in inside]
    return bool(level)


def read_state(text: str) -> PageSetting:
    """The state of the system in a URL, ``belt_block?V=0.45&x@=0.1&until=60``; entries for the page
    alone (panels, packed models) are ignored."""
    model, _, query = text.partition("?")
    values: dict[str, float | str] = {}
    initial: dict[str, float] = {}
    until = None
    for name, value in parse_qsl(query):
        number = _typed(value)
        if name == "until":
            until = number
        elif name.endswith("@") and number is not None:
            initial[name[:-1]] = number
        elif name[:1] not in ("", ".", "~") and name not in ("toml", "evolution"):
            values[name] = value if number is None else number
    return PageSetting(unquote(model) or FIRST_MODEL, "", values, initial, until)


def packed_text(text: str) -> str:
    """A text for a URL: deflated, in characters that need no quoting."""
    deflate = zlib.compressobj(wbits=-zlib.MAX_WBITS)
    data = deflate.compress(text.encode()) + deflate.flush()
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()


def _typed(text: str) -> float | None:
    """A number in a typical notation, such as 0.5 or 1/3."""
    above, _, below = text.partition("/")
    try:
        number = float(above) / (float(below) if below else 1.0)
    except (ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) else None


def real_number(value: object, where: str) -> float:
    """A number that is one.

    Raises
    ------
    DeclarationError
        If it is none.
    """
    good = isinstance(value, int | float) and not isinstance(value, bool)
    try:
        number = float(value) if good else math.nan  # type: ignore[arg-type]
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise DeclarationError(
            where, f"'{short(str(value))}' is not a number", "Enter a number, like 0.5"
        )
    return number


def _setting(table: Mapping[str, Any]) -> PageSetting:
    values: dict[str, float | str] = {}
    for name, value in _entries(table, "values").items():
        text = isinstance(value, str)
        values[name] = _text(value, name, 4000) if text else real_number(value, name)
    initial = {name: real_number(v, name) for name, v in _entries(table, "initial").items()}
    until = table.get("until")
    if until is not None:
        until = real_number(until, "until")
    model = _text(table.get("model", ""), "model", 80)
    return PageSetting(model, _text(table.get("toml", ""), "model file"), values, initial, until)


def _entries(table: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = _table(table.get(name, {}), name)
    if len(found) > MOST_NAMES:
        raise DeclarationError(name, f"{len(found)} were given", f"Give at most {MOST_NAMES}")
    return found


def _table(value: object, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise DeclarationError(where, "not a table", "Reload the page")
    return value


def _text(value: object, where: str, most: int = MOST_TEXT) -> str:
    if not isinstance(value, str):
        raise DeclarationError(where, f"'{short(str(value))}' is not a string", "Give a string")
    if len(value) > most:
        raise DeclarationError(
            where, f"the text has {len(value):,} characters", f"Use at most {most:,}"
        )
    return value
