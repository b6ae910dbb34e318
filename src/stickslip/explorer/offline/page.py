"""An exported page: one file with motions and sliders, which makes no network requests."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

from stickslip import catalogue, palette, storage
from stickslip.display.symbols import unicode_symbol, unicode_unit
from stickslip.display.system_page import equations_page, name_in_html
from stickslip.errors import DeclarationError, StickslipError
from stickslip.explorer.offline.plan import Plan, read_plan
from stickslip.explorer.offline.points import Stored, stored_motions
from stickslip.explorer.work.export import file_named
from stickslip.model.quantities import quantity
from stickslip.model.system import System
from stickslip.progress import Show, reporting

_FILES = Path(__file__).parents[1] / "page"
# In the order of their dependences.
_SCRIPTS = ("offline", "mechanism", "offline-figures", "offline-controls")
_STYLES = ("common", "offline")
_MOST_TEXT = 60_000  # characters of a model file in a page


@dataclass(frozen=True)
class Exported:
    """Contents of an exported page.

    Attributes
    ----------
    path : Path
        The file.
    motions, cycles : int
        How many are stored.
    certified, certified_cycles : int
        How many of these are certified.
    missing : int
        Points without a motion.
    size : int
        In bytes.
    """

    path: Path
    motions: int
    certified: int
    cycles: int
    certified_cycles: int
    missing: int
    size: int

    @property
    def ok(self) -> bool:
        """Whether every motion and every cycle is certified."""
        return self.certified == self.motions and self.certified_cycles == self.cycles

    def describe(self) -> str:
        """Description in one line."""
        said = [f"{self.path}: {_counted(self.motions, self.certified, 'motion')}"]
        if self.cycles:
            said.append(_counted(self.cycles, self.certified_cycles, "cycle"))
        if self.missing:
            said.append(f"{self.missing} point{'s'[: self.missing - 1]} without a motion")
        return "; ".join([*said, f"{self.size / 1e6:.2f} MB"])


def _counted(count: int, certified: int, what: str) -> str:
    said = "certified" if count == certified == 1 else "all certified"
    return f"{count} {what}{'' if count == 1 else 's'}, " + (
        said if count == certified else f"{certified} certified"
    )


def export_page(
    system: System,
    path: str | Path,
    over: Mapping[str, Any] | Sequence[str] | None = None,
    *,
    where: str = "path",
    progress: Show | None = None,
) -> Exported:
    """Compute the motions of a system over some of its parameters, and write a page with them.

    Parameters
    ----------
    over : mapping or sequence of str, optional
        See :func:`stickslip.explorer.offline.plan.read_plan`.
    where : str
        What the path is called in messages.

    Raises
    ------
    DeclarationError
        If the path or the values are wrong.
    StickslipError
        If the file cannot be written; an existing file is replaced only by a complete one.
    """
    path = _checked(path, where)
    plan = read_plan(system, over)
    with reporting(progress, f"motions of {system.name}") as show:
        stored = stored_motions(system, plan, show)
    if not any("motion" in record for record in stored.records):
        raise StickslipError(f"no motion could be computed: {stored.records[0]['refused']}")
    text = page_text(system, plan, stored)
    with storage.replacing(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")
    (certified, motions), (certified_cycles, cycles) = map(stored.certified, ("motion", "cycle"))
    missing = len(stored.records) - motions
    size = len(text.encode())
    return Exported(path, motions, certified, cycles, certified_cycles, missing, size)


def _checked(path: str | Path, where: str) -> Path:
    """Check that a page can be written to the path, before motions are computed for minutes."""
    path = Path(path)
    if path.suffix.lower() != ".html":
        reason = f"'{path}' does not end in .html"
        raise DeclarationError(where, reason, "Write it like page.html")
    if path.is_dir() or not path.parent.is_dir():
        there = "it is a folder" if path.is_dir() else f"there is no folder {path.parent}"
        raise StickslipError(f"{path}: cannot be written ({there})")
    return path


def page_text(system: System, plan: Plan, stored: Stored) -> str:
    """The file."""
    scripts = "\n".join(f"{{\n{_read(f'{name}.js')}}}" for name in _SCRIPTS)
    digest = base64.b64encode(hashlib.sha256(scripts.encode()).digest()).decode()
    data = json.dumps(
        _data(system, plan, stored), ensure_ascii=False, allow_nan=False, separators=(",", ":")
    )
    parts = {
        "policy": f"default-src 'none'; script-src 'sha256-{digest}'; "
        "style-src 'unsafe-inline'; img-src data:",
        "title": escape(system.title or system.name),
        "source": escape(system.source),
        "styles": "".join(_read(f"{name}.css") for name in _STYLES),
        "equations": equations_page(system),
        "data": data.replace("<", "\\u003c"),
        "scripts": scripts,
    }
    # In one pass, so that text of one part is not mistaken for the placeholder of another.
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], _read("offline.html"))


def _data(system: System, plan: Plan, stored: Stored) -> dict[str, Any]:
    """Data of the scripts."""
    from stickslip import __version__

    text = system.to_toml()
    model, more = _command(system)
    return {
        "version": __version__,
        "name": system.name,
        "command": model,
        "until": more,
        "toml": text if len(text) <= _MOST_TEXT else "",
        "span": list(map(float, system.span)),
        "together": plan.together,
        "sliders": [_slider(system, s.name, s.values) for s in plan.sliders],
        "others": _others(system, plan),
        "lines": stored.lines,
        "scenes": stored.scenes,
        "records": stored.records,
        "points": stored.points,
        "colours": {"lines": palette.LINES, "threshold": palette.THRESHOLD},
    }


def _command(system: System) -> tuple[str, str]:
    """Command that recomputes a motion: the name of the system, and the time span."""
    if system.name in catalogue.names():
        known = catalogue.get(system.name)
        if known == system:
            return system.name, ""
        if replace(known, span=system.span) == system and known.span[0] == system.span[0]:
            return system.name, repr(float(system.span[1]))
    return file_named(system.name), ""


def _slider(system: System, name: str, values: Sequence[float]) -> dict[str, Any]:
    """A slider of the page."""
    initial = name not in system.parameters
    declared = system.initial.get(name, 0.0) if initial else system.values[name]
    return {**_said(system, name, declared), "initial": initial, "values": list(values)}


def _others(system: System, plan: Plan) -> list[dict[str, Any]]:
    """Parameters and initial values that do not vary."""
    varied = {slider.name for slider in plan.sliders}
    given = {**system.values, **system.initial}
    return [_said(system, name, value) for name, value in given.items() if name not in varied]


def _said(system: System, name: str, value: float) -> dict[str, Any]:
    """A parameter or an initial value, its unit and its meaning."""
    said = quantity(system, name)
    meaning = said.get("long_name", "")
    start = "" if name in system.parameters else "initial value"
    return {
        "name": name,
        "symbol": str(name_in_html(name)),
        "plain": unicode_symbol(name),
        "meaning": ", ".join(filter(None, (start, meaning))),
        "unit": unicode_unit(said.get("units", "")),
        "declared": float(value),
    }


@cache
def _read(name: str) -> str:
    return (_FILES / name).read_text(encoding="utf-8")
