"""The format of model files: TOML, read and written for data classes, with errors that name the
key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields, is_dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Generic, TypeVar

from stickslip.errors import DeclarationError, short, suggestion
from stickslip.model.formats.expected import entry_key, wrong_kind

MAX_BYTES = 300_000  # tomllib reads some 300 kB in a second
_MOST_OF_FILE = 200_000_000
_PACKED = re.compile(r'packed = "[A-Za-z0-9+/=]*"')  # packed samples, which are read in one step
_LONG_LINE = 150

# The time that tomllib takes grows with the square of the number of parts of a key.
_DEEP_KEY = re.compile(r"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){12}""")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+\Z")
_PLAIN_TEXT = re.compile(r"[A-Za-z0-9+/= ]*\Z")
_ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}


_EXAMPLES = {
    "default": "default = 1.0",
    "law": 'law = "1 - alpha"',
    "direction": 'direction = "d_x"',
    "threshold": 'threshold = "mu*m*g"',
    "when": 'when = "x - 1"',
    "to": 'to = {d_x = "-d_x"}',
    "formula": 'formula = "P > rho"',
    "A": "A = [[2, 0], [0, 1]]",
    "load": 'load = ["sin(t)", "2*t"]',
    "dissipation": 'dissipation = {kind = "weighted l1", weights = ["2 + cos(2*pi*s)", "1"]}',
    "weights": 'weights = ["2 + cos(2*pi*s)", "1"]',
    "radii": 'radii = ["2 + cos(2*pi*s)"]',
    "shape": "shape = [[4, 0], [0, 1]]",
}
"""How keys that are missing would be written."""
K = TypeVar("K")
_M = TypeVar("_M")


@dataclass(frozen=True)
class Language(Generic[_M]):
    """The model files of one kind of model, a class of data.

    Attributes
    ----------
    groups : tuple of str
        Fields before which a file has an empty line.
    sections : mapping of str to callable
        How each entry of a section is read: (value, key, folder) -> object. Other fields are taken
        as they stand in the file.
    others : mapping of str to (str, str)
        Keys that give away a file of another kind, with what it declares and what opens it.
    """

    model: type[_M]
    groups: tuple[str, ...]
    sections: Mapping[str, Callable[[Any, str, Path], Any]]
    others: Mapping[str, tuple[str, str]]

    def load(self, path: str | PathLike[str]) -> _M:
        """The model that a file declares.

        Raises
        ------
        DeclarationError
            If the file cannot be read or anything in it is wrong; the message names the file, the
            key, the reason and the remedy.
        """
        return self.loads(read_text(path), str(path), Path(path).parent)

    def loads(self, text: str, where: str = "model", folder: Path = Path()) -> _M:
        """The model that the text of a file declares; `where` names the text in messages, other
        files are relative to the folder.

        Raises
        ------
        DeclarationError
            If anything in it is wrong.
        """
        with said_of(where):
            table = parse(text)
            for key, (reason, remedy) in self.others.items():
                if key in table:
                    raise DeclarationError(key, reason, remedy)
            given = known_keys(self.model, table, "")
            for section, read in self.sections.items():
                if section in given:
                    given[section] = {
                        name: read(value, entry_key(section, name), folder)
                        for name, value in mapping(given[section], section).items()
                    }
            return self.model(**given)

    def dumps(self, model: _M) -> str:
        """The model as the text of a file; :meth:`loads` gives it back, equal.

        What has its default value is left out, except the default of a parameter.
        """
        return as_toml(model, self.groups)

    def save(self, model: _M, path: str | PathLike[str]) -> None:
        """Write a model as a file.

        Raises
        ------
        DeclarationError
            If the file cannot be written.
        """
        try:
            Path(path).write_bytes(self.dumps(model).encode())
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "its strings are not valid Unicode"
            raise DeclarationError(
                str(path), f"the file cannot be written ({reason})", "Choose another place"
            ) from None


def read_text(path: str | PathLike[str]) -> str:
    """The text of a model file.

    Raises
    ------
    DeclarationError
        If it cannot be read.
    """
    where = str(path)
    try:
        with Path(path).open("rb") as file:
            data = file.read(_MOST_OF_FILE + 1)
    except FileNotFoundError:
        raise DeclarationError(where, "no such file", "Check the path") from None
    except IsADirectoryError:
        raise DeclarationError(where, "it is a directory", "Give a .toml file in it") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise DeclarationError(
            where, f"the file cannot be read ({reason})", "Check the path and the permissions"
        ) from None
    if len(data) > _MOST_OF_FILE:
        raise DeclarationError(
            where, f"the file has more than {_MOST_OF_FILE:,} bytes", "Is it a model file?"
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise DeclarationError(
            where, f"the file is not UTF-8 text (line {line})", "Save it as UTF-8"
        ) from None
    if len(_PACKED.sub("", text)) > MAX_BYTES:
        raise DeclarationError(
            where, f"the file has more than {MAX_BYTES:,} bytes", "Is it a model file?"
        )
    return text


@contextmanager
def said_of(where: str) -> Iterator[None]:
    """Name the text in the errors of a block."""
    try:
        yield
    except DeclarationError as error:
        full = f"{where}: {error.where}" if error.where else where
        raise DeclarationError(full, error.reason, error.remedy) from None


def parse(text: str) -> dict[str, Any]:
    """The tables of a text.

    Raises
    ------
    DeclarationError
        If it is not valid TOML, or too long.
    """
    if len(_PACKED.sub("", text)) > MAX_BYTES:
        raise DeclarationError(
            "", f"the text has more than {MAX_BYTES:,} characters", "Is it a model file?"
        )
    deep = _DEEP_KEY.search(text)
    if deep:
        line = text.count("\n", 0, deep.start()) + 1
        raise DeclarationError(
            "", f"a key has too many parts (line {line})", "Use at most three parts"
        )
    try:
        # With a final newline, every position in the text is in some line.
        return tomllib.loads(text + "\n")
    except tomllib.TOMLDecodeError as error:
        raise DeclarationError("", *_toml_error(str(error), text)) from None
    except RecursionError:
        raise DeclarationError(
            "", "not valid: tables or lists are nested too deeply", "Remove the brackets"
        ) from None
    except ValueError:
        raise DeclarationError("", "not valid TOML: invalid number or date", "Correct it") from None


def _toml_error(message: str, text: str) -> tuple[str, str]:
    """Reason, with the line, and remedy."""
    cause, _, place = message.partition(" (at ")
    line = re.match(r"line (\d+)", place)
    quoted = (
        f": {short(text.splitlines()[int(line[1]) - 1])}"
        if line and text.count("\n") >= int(line[1]) - 1
        else ""
    )
    remedy = "Put strings and formulas in quotes, and write one 'key = value' per line"
    if "overwrite" in message or "declare" in message or "mutate" in message:
        remedy = "A key may occur once; remove or rename one of them"
    end = place.rstrip(")") or "the end of the file"
    return f"not valid TOML: {short(cause)} at {end}{quoted}", remedy


def entry(cls: Any, value: Any, where: str, folder: Path = Path()) -> Any:
    """An object of a class of data from the table of its fields."""
    return cls(**known_keys(cls, mapping(value, where), where))


def mapping(value: Any, where: str) -> dict[str, Any]:
    """The value, if it is a table."""
    if not isinstance(value, dict):
        raise wrong_kind(value, "table", where)
    return value


def known_keys(cls: Any, table: dict[str, Any], where: str) -> dict[str, Any]:
    """The table, if it has the fields of the class."""
    known = {
        entry.name: entry.default is MISSING and entry.default_factory is MISSING
        for entry in fields(cls)
        if entry.init
    }
    for key in table:
        if key not in known:
            raise DeclarationError(_join(where, key), "unknown key", suggestion(key, known))
    for key, required in known.items():
        if required and key not in table:
            example = f'name = "{cls.__name__.lower()}"' if key == "name" else ""
            raise missing(where, key, example)
    return dict(table)


def _join(where: str, key: str) -> str:
    key = key if _BARE_KEY.match(key) else f"'{short(key)}'"
    return f"{where}.{key}" if where else key


def named_kind(table: dict[str, Any], kinds: Mapping[str, type[K]], where: str) -> type[K]:
    """The class that the ``kind`` of a table names, which is taken out of it."""
    key = f"{where}.kind"
    known = ", ".join(f'"{kind}"' for kind in kinds)
    if "kind" not in table:
        raise DeclarationError(key, "the kind is missing", f"Give one of {known}")
    kind = table.pop("kind")
    if not isinstance(kind, str):
        raise wrong_kind(kind, "str", key)
    if kind not in kinds:
        reason = f"unknown kind '{short(kind)}'"
        raise DeclarationError(key, reason, suggestion(kind, kinds, '"'))
    return kinds[kind]


def missing(where: str, key: str, example: str = "") -> DeclarationError:
    """The error for a key that has to be there."""
    example = example or _EXAMPLES.get(key, f'{key} = "..."')
    return DeclarationError(_join(where, key), "this key is missing", f"Add it, as in: {example}")


def as_toml(data: Any, groups: Sequence[str]) -> str:
    """Data as TOML, field by field, without those that have their defaults.

    An empty line stands before each of `groups`. The first field is always written.
    """
    lines: list[str] = []
    for i, entry in enumerate(fields(data)):
        value = getattr(data, entry.name)
        new = list(_lines(entry.name, value)) if i == 0 or not _is_default(entry, value) else []
        if lines and new and entry.name in groups:
            lines.append("")
        lines += new
    return "\n".join(lines) + "\n"


def _is_default(entry: Any, value: Any) -> bool:
    default = entry.default if entry.default_factory is MISSING else entry.default_factory()
    # 1, 1.0 and "1" are written differently: only the exact form of the default is omitted.
    return type(value) is type(default) and repr(value) == repr(default)


def _lines(key: str, value: Any) -> Iterator[str]:
    """Lines `key = value`; a mapping of names to entries has one line for each."""
    if not isinstance(value, Mapping) or key in ("translation", "initial"):
        yield f"{key} = {text_of(value)}"
        return
    for name, item in value.items():
        path = f"{key}.{_key(name)}"
        line = f"{path} = {text_of(item)}"
        if len(line) > _LONG_LINE and is_dataclass(item) and not hasattr(item, "plain"):
            yield from (f"{path}.{field} = {text_of(part)}" for field, part in _parts(item))
        else:
            yield line


def _parts(item: Any) -> Iterator[tuple[str, Any]]:
    """Fields of an entry that differ from their defaults."""
    kind = getattr(type(item), "kind", None)
    if kind is not None:
        yield "kind", kind
    for entry in fields(item):
        value = getattr(item, entry.name)
        if entry.default is MISSING or not _is_default(entry, value):
            yield entry.name, value


def text_of(value: Any) -> str:
    """A value in TOML syntax."""
    match value:
        case str():
            return _text(value)
        case bool():
            return "true" if value else "false"
        case tuple() | list():
            return f"[{', '.join(map(text_of, value))}]"
        case Mapping():
            return (
                "{"
                + ", ".join(f"{_key(name)} = {text_of(item)}" for name, item in value.items())
                + "}"
            )
        case int():
            return str(int(value))
    if hasattr(value, "plain"):
        return text_of(value.plain())
    if hasattr(value, "__float__"):
        return repr(float(value))
    return "{" + ", ".join(f"{name} = {text_of(part)}" for name, part in _parts(value)) + "}"


def _key(name: str) -> str:
    return name if _BARE_KEY.match(name) else _text(name)


def _text(text: str) -> str:
    if _PLAIN_TEXT.match(text):  # one match for the entire text: packed samples are long
        return f'"{text}"'
    if "\\" in text and not re.search(r"['\x00-\x08\x0a-\x1f\x7f]", text):
        return f"'{text}'"
    plain = "".join(_ESCAPES.get(c, c) for c in text)
    return (
        '"'
        + re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]", lambda m: f"\\u{ord(m[0]):04x}", plain)
        + '"'
    )
