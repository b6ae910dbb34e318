"""Model files: a :class:`~stickslip.system.System` as TOML and back, key by key, without loss.

The keys are the fields of the classes in :mod:`stickslip.system`, in their order; a coordinate also has its ``kind``.
One line declares one thing, with dotted keys (``parameters.P = {default = 1.0, unit = "N"}``), since TOML would not
let the energy stand after a table ``[coordinates]``. Tables are read all the same.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any

from stickslip.errors import DeclarationError, short
from stickslip.shape import entry_key, wrong_kind
from stickslip.system import Condition, Contact, Inertial, Internal, Parameter, RateIndependent, System, Viscous

MAX_BYTES = 300_000  # tomllib reads some 300 kB in a second
LONG_LINE = 150

KINDS = {kind.kind: kind for kind in (Inertial, Viscous, RateIndependent)}
ENTRIES = {"parameters": Parameter, "internal": Internal, "contacts": Contact, "conditions": Condition}
GROUPS = ("name", "parameters", "functions", "coordinates", "contacts", "translation", "conditions")
"""Fields of a system before which a file has an empty line."""

# The time that tomllib needs grows with the square of the number of parts of a key.
DEEP_KEY = re.compile(r"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){12}""")
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+\Z")
ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def load(path: str | PathLike[str]) -> System:
    """The system that a model file declares.

    Raises
    ------
    DeclarationError
        If the file cannot be read or anything in it is wrong; the message names the file, the key, the reason and
        the remedy.
    """
    where = str(path)
    try:
        with Path(path).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise DeclarationError(where, "there is no such file", "Check the path") from None
    except IsADirectoryError:
        raise DeclarationError(where, "this is a directory", "Name a .toml file in it") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise DeclarationError(where, f"the file cannot be read ({reason})", "Check the path and its rights") from None
    if len(data) > MAX_BYTES:
        raise DeclarationError(where, f"the file has more than {MAX_BYTES:,} bytes", "Is it a model file?")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise DeclarationError(where, f"the file is not UTF-8 text (line {line})", "Save it as UTF-8") from None
    return loads(text, where)


def loads(text: str, where: str = "model") -> System:
    """The system that the text of a model file declares.

    Parameters
    ----------
    text : str
        TOML.
    where : str
        Name of the text in messages.

    Raises
    ------
    DeclarationError
        If anything in it is wrong.
    """
    if len(text) > MAX_BYTES:
        raise DeclarationError(where, f"the text has more than {MAX_BYTES:,} characters", "Is it a model file?")
    try:
        return _system(_table(text))
    except DeclarationError as error:
        full = f"{where}: {error.where}" if error.where else where
        raise DeclarationError(full, error.reason, error.remedy) from None


def _table(text: str) -> dict[str, Any]:
    deep = DEEP_KEY.search(text)
    if deep:
        line = text.count("\n", 0, deep.start()) + 1
        raise DeclarationError("", f"a key has too many parts (at line {line})", "Keys have at most three parts")
    try:
        # With an end of line at the end, every place in the text is in some line.
        return tomllib.loads(text + "\n")
    except tomllib.TOMLDecodeError as error:
        raise DeclarationError("", *_toml_error(str(error), text)) from None
    except RecursionError:
        raise DeclarationError("", "not valid: tables or lists are nested too deeply", "Remove the brackets") from None
    except ValueError:
        raise DeclarationError("", "not valid TOML: a number or a date that does not exist", "Correct it") from None


def _toml_error(message: str, text: str) -> tuple[str, str]:
    """Reason, with the line, and remedy."""
    cause, _, place = message.partition(" (at ")
    line = re.match(r"line (\d+)", place)
    quoted = f": {short(text.splitlines()[int(line[1]) - 1])}" if line and text.count("\n") >= int(line[1]) - 1 else ""
    remedy = "Put texts and formulas in quotes, and one 'key = value' on a line"
    if "overwrite" in message or "declare" in message or "mutate" in message:
        remedy = "Each key stands once; remove or rename one of the two"
    return f"not valid TOML: {short(cause)} at {place.rstrip(')') or 'its end'}{quoted}", remedy


def _system(table: dict[str, Any]) -> System:
    given = _known_keys(System, table, "")
    for section, entry in ENTRIES.items():
        if section in given:
            given[section] = {
                name: _entry(entry, value, entry_key(section, name))
                for name, value in _mapping(given[section], section).items()
            }
    if "coordinates" in given:
        given["coordinates"] = {
            name: _coordinate(value, entry_key("coordinates", name))
            for name, value in _mapping(given["coordinates"], "coordinates").items()
        }
    return System(**given)


def _coordinate(value: Any, where: str) -> Any:
    table = dict(_mapping(value, where))
    kinds = ", ".join(f'"{kind}"' for kind in KINDS)
    if "kind" not in table:
        raise DeclarationError(f"{where}.kind", "the kind of the coordinate is missing", f"Give one of {kinds}")
    kind = table.pop("kind")
    if not isinstance(kind, str):
        raise wrong_kind(kind, "str", f"{where}.kind")
    if kind not in KINDS:
        close = get_close_matches(kind, KINDS, 1)
        raise DeclarationError(
            f"{where}.kind",
            f"there is no kind '{short(kind)}'",
            f'Did you mean "{close[0]}"?' if close else f"Give one of {kinds}",
        )
    return _entry(KINDS[kind], table, where)


def _entry(cls: Any, value: Any, where: str) -> Any:
    return cls(**_known_keys(cls, _mapping(value, where), where))


def _mapping(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise wrong_kind(value, "table", where)
    return value


def _known_keys(cls: Any, table: dict[str, Any], where: str) -> dict[str, Any]:
    """The table, if it has the fields of the class."""
    known = {entry.name: entry.default is MISSING and entry.default_factory is MISSING for entry in fields(cls)}
    for key in table:
        if key not in known:
            close = get_close_matches(key, known, 1)
            raise DeclarationError(
                _join(where, key),
                "unknown key",
                f"Did you mean '{close[0]}'?" if close else f"Known here: {', '.join(known)}",
            )
    for key, required in known.items():
        if required and key not in table:
            raise DeclarationError(_join(where, key), "this key is missing", f"Add it, as in: {_example(cls, key)}")
    return dict(table)


def _join(where: str, key: str) -> str:
    key = key if BARE_KEY.match(key) else f"'{short(key)}'"
    return f"{where}.{key}" if where else key


def _example(cls: Any, key: str) -> str:
    examples = {
        "default": "default = 1.0",
        "law": 'law = "1 - alpha"',
        "direction": 'direction = "d_x"',
        "threshold": 'threshold = "mu*m*g"',
        "formula": 'formula = "P > rho"',
    }
    return examples.get(key, f'{key} = "{cls.__name__.lower()}"')


def save(system: System, path: str | PathLike[str]) -> None:
    """Write a system as a model file.

    Raises
    ------
    DeclarationError
        If the file cannot be written.
    """
    try:
        Path(path).write_bytes(dumps(system).encode())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "its texts are not valid Unicode"
        raise DeclarationError(str(path), f"the file cannot be written ({reason})", "Choose another place") from None


def dumps(system: System) -> str:
    """The system as the text of a model file; :func:`loads` gives it back, equal.

    What has its default value is left out, except the default of a parameter.
    """
    lines = []
    for entry in fields(System):
        value = getattr(system, entry.name)
        written = list(_lines(entry.name, value)) if entry.name == "name" or not _is_default(entry, value) else []
        if lines and written and entry.name in GROUPS:
            lines.append("")
        lines += written
    return "\n".join(lines) + "\n"


def _is_default(entry: Any, value: Any) -> bool:
    default = entry.default if entry.default_factory is MISSING else entry.default_factory()
    return repr(value) == repr(default)  # 1, 1.0 and "1" are different things to say


def _lines(key: str, value: Any) -> Iterator[str]:
    """Lines `key = value`; a mapping of names to entries has one line for each."""
    if not isinstance(value, Mapping) or key in ("translation", "initial"):
        yield f"{key} = {_value(value)}"
        return
    for name, item in value.items():
        path = f"{key}.{_key(name)}"
        line = f"{path} = {_value(item)}"
        if len(line) > LONG_LINE and not isinstance(item, str):
            yield from (f"{path}.{field} = {_value(part)}" for field, part in _parts(item))
        else:
            yield line


def _parts(item: Any) -> Iterator[tuple[str, Any]]:
    """Fields of an entry that differ from their defaults."""
    if isinstance(item, tuple(KINDS.values())):
        yield "kind", item.kind
    for entry in fields(item):
        value = getattr(item, entry.name)
        if entry.default is MISSING or not _is_default(entry, value):
            yield entry.name, value


def _value(value: Any) -> str:
    match value:
        case str():
            return _text(value)
        case tuple():
            return f"[{', '.join(map(_value, value))}]"
        case Mapping():
            return "{" + ", ".join(f"{_key(name)} = {_value(item)}" for name, item in value.items()) + "}"
        case int():
            return str(int(value))
    if hasattr(value, "__float__"):
        return repr(float(value))
    return "{" + ", ".join(f"{name} = {_value(part)}" for name, part in _parts(value)) + "}"


def _key(name: str) -> str:
    return name if BARE_KEY.match(name) else _text(name)


def _text(text: str) -> str:
    if "\\" in text and not re.search(r"['\x00-\x08\x0a-\x1f\x7f]", text):
        return f"'{text}'"
    plain = "".join(ESCAPES.get(c, c) for c in text)
    return '"' + re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]", lambda m: f"\\u{ord(m[0]):04x}", plain) + '"'
