"""Results and systems as files for other programs, by the ending of the file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stickslip.arguments import validated
from stickslip.errors import DeclarationError, short
from stickslip.exports.fmu import write_fmu
from stickslip.exports.numpy_file import write_numpy
from stickslip.exports.sound import sound_of, write_wav
from stickslip.exports.tables import exported_table, motion_in, write_csv, write_parquet
from stickslip.model.system import System
from stickslip.results import Result
from stickslip.storage import named


@validated
def export(
    result: Result | System,
    path: str | Path,
    *quantities: str,
    step: float | None = None,
    units: bool = False,
    rate: int = 44100,
    seconds: float = 1.0,
    inputs: Sequence[str] | None = None,
    over: Mapping[str, Any] | Sequence[str] | None = None,
) -> None:
    """Export a result for other programs: its table, or a quantity of a motion as sound; or a
    system for simulation by other programs, or for readers in a browser.

    Numbers in tables can be read back exactly; coded values, such as modes and outcomes, are
    written as words.

    Parameters
    ----------
    result : Result or System
        Any result, such as a motion, a cycle, a map or a frequency response.
    path : str or path
        For a result, a file with the suffix ``.csv``, ``.parquet`` (title, units and version are in
        its metadata) or ``.wav`` (16 bits, without the mean, normalised). For a system, a file with
        the suffix ``.fmu`` (FMI 2 for co-simulation: a :class:`stickslip.Stepper` behind the
        interface of other simulators), ``.py`` (right-hand side and events as functions of NumPy,
        for other integrators) or ``.html`` (a page with sliders over computed motions and cycles,
        which needs neither this program nor a network).
    *quantities : str
        Additional columns, or outputs of an FMU, by default all; or the quantity of a sound.
    step : float, optional
        Time between rows of a motion or a cycle; by default the times of its dataset, which are
        denser at switches.
    units : bool
        Whether column names of a CSV file include units, as in ``x [m]``.
    rate : int
        Samples per second of a sound. Jumps have frequencies above half of this rate, which alias
        to lower ones.
    seconds : float
        Duration in seconds of a unit of time in a sound.
    inputs : sequence of str, optional
        Parameters and drives that are inputs of an FMU, held during its steps; by default all
        drives except those whose rates are used. Other drives are as declared.

    Raises
    ------
    DeclarationError
        If a quantity is unknown, the file format is not supported, a step or a sound is requested
        for a result other than a motion or a cycle, or an input or system is not supported; if the
        values of a page are wrong or too many.
    StickslipError
        If the file cannot be written, or a package is missing; an existing file is replaced only by
        a complete one.

    Examples
    --------
    >>> import stickslip as ss
    >>> motion = ss.simulate(ss.catalogue.belt_block())
    >>> ss.export(motion, "block.csv", "x", "d_x", step=0.01)
    >>> ss.export(ss.catalogue.belt_block(), "block.py")
    >>> ss.export(ss.catalogue.belt_block(), "block.html", over={"V": "0.1:1:3"})
    """
    ending = Path(path).suffix.lower()
    if isinstance(result, System):
        _export_system(result, path, ending, quantities, inputs, over)
        return
    if over is not None:
        raise DeclarationError("over", "only pages of systems have sliders", "Remove it")
    match ending:
        case ".csv":
            write_csv(exported_table(result, quantities, step), path, units)
        case ".parquet":
            write_parquet(exported_table(result, quantities, step), path)
        case ".wav":
            motion = motion_in(result, "result")
            if len(quantities) != 1:
                reason = f"a sound contains one quantity, but {len(quantities)} were given"
                raise DeclarationError("quantities", reason, "Give one, like 'x'")
            write_wav(sound_of(motion, quantities[0], rate, seconds), rate, path)
        case ".fmu" | ".py" | ".html":
            reason = f"'{ending}' is the format of a system, but this is {named(result.KIND)}"
            raise DeclarationError("path", reason, "Export the system")
        case _:
            reason = f"unknown file format '{short(ending)}'"
            raise DeclarationError("path", reason, "Use .csv, .parquet or .wav")


def _export_system(
    system: System,
    path: str | Path,
    ending: str,
    quantities: Sequence[str],
    inputs: Sequence[str] | None,
    over: Mapping[str, Any] | Sequence[str] | None,
) -> None:
    if over is not None and ending != ".html":
        raise DeclarationError("over", "only pages have sliders", "Use .html, or remove it")
    match ending:
        case ".fmu":
            write_fmu(system, path, inputs, quantities)
        case ".py" if quantities or inputs:
            reason = "a Python file always has the complete state and the declared drives"
            raise DeclarationError("quantities" if quantities else "inputs", reason, "Remove it")
        case ".py":
            write_numpy(system, path)
        case ".html" if quantities or inputs:
            reason = "a page shows the coordinates, rates and forces of the system"
            raise DeclarationError("quantities" if quantities else "inputs", reason, "Remove it")
        case ".html":
            from stickslip.explorer.offline.page import export_page

            export_page(system, path, over)
        case ".csv" | ".parquet" | ".wav":
            reason = f"'{ending}' is the format of a result, but this is a system"
            raise DeclarationError("path", reason, "Simulate it first, or use .fmu, .py or .html")
        case _:
            reason = f"unknown file format '{short(ending)}'"
            raise DeclarationError("path", reason, "Use .fmu, .py or .html")
