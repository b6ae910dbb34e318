"""Exports of a page: its computation as Python, as a command, or as a model file, and the files
that the library writes."""

from __future__ import annotations

import io
import json
import re
import shlex
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stickslip.errors import DeclarationError, StickslipError
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.limits import MOST_EXPORT
from stickslip.explorer.asking.request import PageSetting, Request
from stickslip.explorer.subject.systems import shown_motion, shown_span, system_of

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation
    from stickslip.motion.trajectory import Trajectory


def exported_page(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """A text, or a file in bytes.

    Raises
    ------
    DeclarationError
        If there is no such form.
    """
    form = request.text("form")
    if form in TEXTS:
        yield Answer({"text": TEXTS[form](request.setting)})
        return
    if form not in FILES:
        raise DeclarationError(
            "form", f"unknown format '{form}'", f"Use {', '.join([*TEXTS, *FILES])}"
        )
    motion = shown_motion(request.setting, cancellation)
    data = FILES[form](motion)
    if len(data) > MOST_EXPORT:
        raise StickslipError(
            f"the file has {len(data) / 1e6:.0f} MB, which is too large for the page; copy the "
            "command instead"
        )
    name = file_named(motion.system.name, form)
    yield Answer({"file": name, "type": _TYPES[form]}, {"bytes": np.frombuffer(data, np.uint8)})


def python_of(setting: PageSetting) -> str:
    """A script that computes the same motion."""
    system, numbers = system_of(setting)
    lines = ["import stickslip as ss", ""]
    if setting.toml:
        lines.append(f"system = ss.load({_quoted(file_named(system.name))})  # the model file")
    else:
        given = {n: v for n, v in setting.values.items() if isinstance(v, str)}
        # system_of ensures that the name is in the catalogue and the others are its parameters.
        values = ", ".join(f"{name}={_quoted(value)}" for name, value in given.items())
        lines.append(f"system = ss.catalogue.{setting.model}({values})")
    start, end = shown_span(system, setting)
    said = [f"({start!r}, {end!r})"]
    if setting.initial:
        said.append(f"initial={dict(setting.initial)!r}")
    if numbers:
        said.append(f"parameters={numbers!r}")
    lines += [
        f"trajectory = ss.simulate(system, {', '.join(said)})",
        "assert trajectory.certificate.ok",
        'trajectory.plot().savefig("motion.png")',
    ]
    return "\n".join(lines) + "\n"


def command_of(setting: PageSetting) -> str:
    """A command that computes the same motion."""
    words = ["stickslip", "run", model_of(setting)]
    for name, value in setting.values.items():
        words += ["--set", f"{name}={value!r}" if isinstance(value, float) else f"{name}={value}"]
    for name, value in setting.initial.items():
        words += ["--initial", f"{name}={value!r}"]
    if setting.until is not None:
        words += ["--until", repr(setting.until)]
    return shlex.join(words)


def toml_of(setting: PageSetting) -> str:
    """A model file with these values."""
    from dataclasses import replace

    system, numbers = system_of(setting)
    own = system.configure(numbers)
    return replace(
        own, initial={**own.initial, **setting.initial}, span=shown_span(own, setting)
    ).to_toml()


def model_of(setting: PageSetting) -> str:
    """The model as an argument of a command: its name, or the name of its file."""
    system, _ = system_of(setting)
    return file_named(system.name) if setting.toml else setting.model


def file_named(name: str, ending: str = "toml") -> str:
    """File name for a system, whose name may be any text."""
    plain = re.sub(r"[^\w.+-]+", "_", name).strip("._-")
    return f"{plain or 'system'}.{ending}"


def _quoted(text: str) -> str:
    """A Python string literal of any text."""
    return json.dumps(text, ensure_ascii=False)


def _csv(motion: Trajectory) -> bytes:
    return motion.table.to_csv(index=False).encode()


def _netcdf(motion: Trajectory) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motion.nc"
        motion.save(path)
        return path.read_bytes()


def _picture(form: str) -> Callable[[Trajectory], bytes]:
    def draw(motion: Trajectory) -> bytes:
        from stickslip.figures.drawing.style import paper_style

        with paper_style():
            buffer = io.BytesIO()
            motion.plot().savefig(buffer, format=form)
        return buffer.getvalue()

    return draw


TEXTS = {"python": python_of, "command": command_of, "toml": toml_of}
FILES = {"csv": _csv, "nc": _netcdf, "png": _picture("png"), "svg": _picture("svg")}
_TYPES = {
    "csv": "text/csv",
    "nc": "application/x-netcdf",
    "png": "image/png",
    "svg": "image/svg+xml",
}
