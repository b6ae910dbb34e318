"""The base class of results: data, outcome, certificate, plot, file.

A kind of result describes itself (:class:`Described`); everything that follows is here: the summary
of the command line and of ``summary.json``, the display in a notebook, files, and pictures of
quantities.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self, cast

from stickslip import page, storage
from stickslip.arguments import validated
from stickslip.certificates import Certificate, Residual
from stickslip.errors import DeclarationError, short, suggestion

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.model.system import System

_SHOWN = 12  # largest number of rows or values on a page; the data contain all


class Ended(Enum):
    """Outcome of a computation: a code for files, a label, and a message with explanation and
    remedy.

    The base of the outcomes of all kinds of results, each of which names its own.
    """

    def __init__(self, code: int, label: str, message: str) -> None:
        self.code = code
        self.label = label
        self.message = message

    @property
    def ok(self) -> bool:
        """Whether all that was asked for was computed."""
        return self.code == 0

    @property
    def interrupted(self) -> bool:
        """Whether a user stopped it."""
        return self.name == "INTERRUPTED"

    @classmethod
    def from_code(cls, code: int) -> Self:
        """The outcome with a number."""
        for outcome in cls:
            if outcome.code == code:
                return outcome
        raise ValueError(f"{code} is not the code of an outcome")


class Completion(Ended):
    """Outcome of a computation that consists of many, such as a map or a branch."""

    FINISHED = (0, "finished", "The computation is complete")
    INTERRUPTED = (1, "interrupted", "Stopped by the user; the results so far are kept")
    STOPPED_EARLY = (
        2,
        "stopped early",
        "A part could not be computed; the parts before it are kept",
    )
    NOTHING_FOUND = (3, "nothing found", "Nothing was found in the region searched")
    TIME_UP = (
        4,
        "time limit reached",
        "The limit of wall-clock time was reached; the results so far are kept. Increase "
        "time_limit to continue",
    )


@dataclass(frozen=True)
class Summary:
    """Summary of a result, as text and as data.

    Attributes
    ----------
    title : str
    rows : tuple of (str, str)
        Labels and texts.
    data : dict
        Plain data, the content of ``summary.json``.
    good : bool
        Whether the computation is complete and certified.
    """

    title: str
    rows: tuple[tuple[str, str], ...]
    data: dict[str, Any]
    good: bool

    def __str__(self) -> str:
        width = max((len(name) for name, _ in self.rows), default=0)
        return "\n".join([self.title, *(f"{name:<{width}}   {text}" for name, text in self.rows)])

    __repr__ = __str__

    def to_json(self) -> str:
        """The data as JSON; numbers that are not finite become null."""
        return json.dumps(storage.plain(self.data), indent=2, ensure_ascii=False)

    def _repr_html_(self) -> str:
        rows = (
            (page.Html(escape(name).replace("  ", "&emsp;")), _in_lines(text))
            for name, text in self.rows
        )
        return page.whole(page.headline(self.title), page.tabled(rows))


class Described(Protocol):
    """The interface of results."""

    @property
    def title(self) -> str:
        """Title of the result."""
        ...

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values of the parameters."""
        ...

    @property
    def dataset(self) -> xarray.Dataset:
        """All numbers, with units."""
        ...

    @property
    def outcome(self) -> Ended:
        """Outcome of the computation."""
        ...

    @property
    def message(self) -> str:
        """Description of the outcome."""
        ...

    @property
    def certificate(self) -> Certificate:
        """Residuals with their limits, and the verdict."""
        ...

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        ...

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        ...

    def overview(self, ax: Axes | None = None) -> Figure:
        """Its picture."""
        ...


@dataclass(frozen=True)
class Part:
    """Conversion of one or several fields of a result to and from a file.

    Attributes
    ----------
    write : callable
        Of the value: a text, or data for JSON.
    read : callable
        Of that as a text, and of the name of the file for messages: the value.
    fields : tuple of str
        The fields that are written together, as a list; empty if the part has the name of its
        only field.
    """

    write: Callable[[Any], Any]
    read: Callable[[str, str], Any]
    fields: tuple[str, ...] = ()

    def of(self, field: str) -> Part:
        """The same for a field of another name than the part."""
        return Part(lambda own: self.write(own[0]), lambda *text: [self.read(*text)], (field,))

    def written(self, name: str, result: Result) -> Any:
        """Content of the part of a result with this name, as written to a file."""
        values = [getattr(result, field) for field in self.fields]
        return self.write(values if self.fields else getattr(result, name))

    def fields_of(self, name: str, text: str, where: str) -> dict[str, Any]:
        """Fields of a result from the stored content of the part with this name."""
        value = self.read(text, where)
        return dict(zip(self.fields, value, strict=True)) if self.fields else {name: value}


def together(*fields: str) -> Part:
    """Several fields in one list."""
    return Part(list, lambda text, where: json.loads(text), fields)


class Result:
    """Base class of all results; ``result["x"]`` is a variable of the dataset.

    Attributes
    ----------
    KIND, FORMAT
        Name of the kind and number of the format in files.
    PARTS
        What a file contains besides the dataset: by name, how the fields are written and read.
    """

    KIND: ClassVar[str]
    FORMAT: ClassVar[int] = 1
    PARTS: ClassVar[Mapping[str, Part]] = {}

    @property
    def title(self) -> str:
        """Title of the system."""
        system: System = cast(Any, self).system
        return system.title or system.name

    @property
    def along(self) -> str:
        """Dimension of the dataset along which quantities are plotted and tabulated."""
        return "time"

    @property
    def _said(self) -> Described:
        """The result itself, typed by the interface of all kinds."""
        return cast(Described, self)

    @validated
    def __getitem__(self, name: str) -> xarray.DataArray:
        """A variable of the dataset, with its unit, or any unknown of a structure, such as
        ``u[17]``.

        Raises
        ------
        DeclarationError
            If no quantity has this name.
        """
        data = self._said.dataset
        if name in data.variables:
            return data[name]
        system: System | None = getattr(self, "system", None)
        row = {} if system is None else system.unknown(str(name))
        if row and row.keys() <= set(data.variables):
            first, *others = (weight * data[mode] for mode, weight in row.items())
            found = sum(others, first).rename(str(name))
            return found.assign_attrs(data[next(iter(row))].attrs, long_name=str(name))
        known = suggestion(str(name), self._ipython_key_completions_())
        raise DeclarationError(self.KIND, f"unknown quantity '{short(str(name))}'", known)

    def _ipython_key_completions_(self) -> list[str]:
        return [str(name) for name in self._said.dataset.variables]

    @property
    def table(self) -> pandas.DataFrame:
        """The dataset as a table: a variable with two dimensions fills several columns."""
        return flat(self._said.dataset, self.along)

    def summary(self) -> Summary:
        """Outcome, key numbers and certificate.

        It prints as a short table; ``.data`` is the content of ``summary.json``.
        """
        from stickslip import __version__

        said = self._said
        outcome = said.outcome
        certificate = said.certificate
        data = {
            "program": "stickslip",
            "version": __version__,
            "result": self.KIND,
            "title": said.title,
            "outcome": outcome.label,
            "message": said.message,
            "complete": outcome.ok,
            "certified": certificate.ok,
            "parameters": dict(said.parameters),
            **said.facts(),
            "certificate": certificate.to_dict(),
        }
        ended = ("outcome", outcome.label if outcome.ok else said.message)
        rows = (ended, *said.rows(), *certificate_rows(certificate))
        return Summary(said.title, rows, data, outcome.ok and certificate.ok)

    @validated
    def plot(self, *quantities: str, ax: Axes | None = None) -> Figure:
        """Plot the result.

        Parameters
        ----------
        *quantities : str
            Variables of the dataset, one panel each; by default an overview. Or the name of a
            registered plot (:func:`stickslip.figures.register`).
        ax : matplotlib.axes.Axes, optional
            Existing axes to draw into, all quantities together.

        Returns
        -------
        matplotlib.figure.Figure
            That of `ax`, if it is given; no window is opened.

        Raises
        ------
        DeclarationError
            If there is no such quantity.
        """
        if not quantities:
            return self._said.overview(ax)
        from stickslip.figures.drawing.quantities import plot_quantities
        from stickslip.figures.drawing.registry import registered

        if len(quantities) == 1 and (draw := registered(type(self), quantities[0])) is not None:
            return draw(self, ax=ax)
        data = self._said.dataset
        system: System | None = getattr(self, "system", None)
        if system is not None:  # unknowns of structures
            asked = (name for name in quantities if name not in data.variables)
            data = data.assign({name: self[name] for name in asked if system.unknown(name)})
        return plot_quantities(data, quantities, self.along, ax)

    @validated
    def save(self, path: str | Path) -> None:
        """Write a netCDF-4 file that :func:`stickslip.open` reads back exactly.

        Raises
        ------
        StickslipError
            If the file cannot be written; an existing file is replaced only by a complete one.
        """
        data, parts = self.stored()
        storage.write(path, data, self.KIND, self.FORMAT, **parts)

    @classmethod
    @validated
    def open(cls, path: str | Path) -> Self:
        """Read a stored result of this kind; nothing is recomputed until needed.

        Raises
        ------
        StickslipError
            If the file does not exist, contains no result of this kind, or has an unsupported
            format.
        """
        with storage.reading(path, cls.KIND, cls.FORMAT) as (data, parts):
            return cls.restored(data, parts, str(path))

    def _repr_html_(self) -> str:
        system: System | None = getattr(self, "system", None)
        declared = {} if system is None else system.parameters
        values = page.parameters(self._said.parameters, declared)
        summary = page.Html(self.summary()._repr_html_())
        return page.whole(page.drawn(self.plot), summary, page.folded("parameters", values))

    def stored(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """Data and other parts of a file."""
        parts = {name: part.written(name, self) for name, part in self.PARTS.items()}
        return self._said.dataset, parts

    def minimal_parts(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """The stored parts from which the result can be restored: by default all."""
        return self.stored()

    def __reduce__(self) -> tuple[Any, ...]:
        # A result is pickled as it is stored, without compiled functions and work space.
        data, parts = self.minimal_parts()
        return _remade, (type(self), data, storage.as_texts(parts))

    @classmethod
    def restored(cls, data: xarray.Dataset, parts: Mapping[str, str], where: str) -> Self:
        """Restore a result from the data and the other parts of a file, as text. A field that files
        of older versions do not contain has its default."""
        values = cls.fields_of(data)
        for name, part in cls.PARTS.items():
            if name in parts:
                values |= part.fields_of(name, parts[name], where)
        return cls(**values)

    @classmethod
    def fields_of(cls, data: xarray.Dataset) -> dict[str, Any]:
        """The fields whose values are the data of a file."""
        return {"dataset": data}


def _remade(kind: type[Result], data: xarray.Dataset, parts: Mapping[str, str]) -> Result:
    """A result from another process."""
    return kind.restored(data, parts, "a pickled result")


def flat(data: xarray.Dataset, along: str) -> pandas.DataFrame:
    """The variables over a dimension as columns; one with a second dimension fills several."""
    import pandas as pd

    columns: dict[str, Any] = {}
    for name in [*data.coords, *data.data_vars]:
        variable = data[name]
        if along not in variable.dims:
            continue
        values = variable.transpose(along, ...).values
        rest = values.reshape(len(values), math.prod(values.shape[1:]))
        many = variable.ndim > 1
        labels = [f"{name}_{i + 1}" for i in range(rest.shape[1])] if many else [str(name)]
        columns |= dict(zip(labels, rest.T, strict=True))
    return pd.DataFrame(columns)


def certificate_rows(certificate: Certificate) -> list[tuple[str, str]]:
    """The verdict, and every residual with its limit."""
    rows = [("certificate", certificate.verdict)]
    for residual in certificate.residuals:
        if residual.counts:
            rows.append((f"  {residual.name}", f"{residual.value:g}"))
            continue
        value = f"{residual.value:.1e}" if math.isfinite(residual.value) else "not finite"
        side = "least" if residual.least else "most"
        bound = f", at {side} {residual.limit:.0e}" if residual.judged else ""
        note = f" {residual.note}" if residual.note else ""
        rows.append((f"  {residual.name}", f"{value}{bound}{note}"))
    return rows


def listed(items: Sequence[str], most: int = _SHOWN) -> str:
    """The first few of many, and how many there are."""
    more = f", ... ({len(items)} in all)" if len(items) > most else ""
    return ", ".join(items[:most]) + more


def shortened(rows: list[tuple[str, str]], most: int = _SHOWN) -> list[tuple[str, str]]:
    """The first few rows of many, and how many there are."""
    more = [("  ...", f"({len(rows)} in all)")] if len(rows) > most else []
    return rows[:most] + more


def restored_certificate(entry: Mapping[str, Any]) -> Certificate:
    """A stored certificate, with tuples for lists."""
    residuals = restored_residuals(entry["residuals"])
    spans = tuple((start, end) for start, end in entry["unverified"])
    return Certificate(residuals, entry["outcome"], spans, tuple(entry["notes"]))


def restored_residuals(entries: Iterable[Mapping[str, Any]]) -> tuple[Residual, ...]:
    """Residuals as they were stored: JSON has null for a value that is not a number, and for an
    infinite limit."""
    return tuple(
        Residual(
            **{
                **entry,
                "value": math.nan if entry["value"] is None else entry["value"],
                "limit": math.inf if entry["limit"] is None else entry["limit"],
            }
        )
        for entry in entries
    )


TEXT = Part(str, lambda text, where: text)
PLAIN = Part(lambda value: value, lambda text, where: json.loads(text))
ITEMS = Part(list, lambda text, where: tuple(json.loads(text)))
COMPLETION = Part(lambda end: end.code, lambda text, where: Completion.from_code(int(text)))
CERTIFICATE = Part(asdict, lambda text, where: restored_certificate(json.loads(text)))


def _in_lines(text: str) -> page.Html:
    """A text of several lines."""
    return page.Html("<br>".join(map(escape, text.splitlines())))
