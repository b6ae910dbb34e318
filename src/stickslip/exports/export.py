"""Results and systems as files for other programs, by the ending of the file."""

from __future__ import annotations

from pathlib import Path

from stickslip.arguments import validated
from stickslip.errors import DeclarationError, short
from stickslip.exports.sound import sound_of, write_wav
from stickslip.exports.tables import exported_table, motion_in, write_csv, write_parquet
from stickslip.results import Result


@validated
def export(
    result: Result,
    path: str | Path,
    *quantities: str,
    step: float | None = None,
    units: bool = False,
    rate: int = 44100,
    seconds: float = 1.0,
) -> None:
    """Write a result for other programs: its table, or a quantity of a motion as sound.

    Tables hold numbers that are read back exactly, and words for what stands for a word, such as
    modes and outcomes.

    Parameters
    ----------
    result : Result
        Any, such as a motion, a cycle, a map or a frequency response.
    path : str or path
        A file that ends in ``.csv``, in ``.parquet`` (title, units and version are in its metadata)
        or in ``.wav`` (16 bits, without the mean, as loud as the file can hold).
    *quantities : str
        Columns beside those of the coordinates, by default all; or what is heard.
    step : float, optional
        Time between rows of a motion or a cycle; by default the times of its dataset, which are
        denser at switches.
    units : bool
        Whether the names of the columns of a CSV file have their units, as in ``x [m]``.
    rate : int
        Samples a second of a sound. Jumps have frequencies above half of it, which are heard as
        lower ones.
    seconds : float
        How long a unit of time sounds.

    Raises
    ------
    DeclarationError
        If a quantity is unknown, the ending of the file is another, or a step or a sound is asked
        of what is neither a motion nor a cycle.
    StickslipError
        If the file cannot be written, or a package is missing; an existing file is replaced only by
        a complete one.

    Examples
    --------
    >>> import stickslip as ss
    >>> motion = ss.simulate(ss.catalogue.belt_block())
    >>> ss.export(motion, "block.csv", "x", "d_x", step=0.01)
    """
    match ending := Path(path).suffix.lower():
        case ".csv":
            write_csv(exported_table(result, quantities, step), path, units)
        case ".parquet":
            write_parquet(exported_table(result, quantities, step), path)
        case ".wav":
            motion = motion_in(result, "result")
            if len(quantities) != 1:
                reason = f"a sound is of one, not of {len(quantities)}"
                raise DeclarationError("quantities", reason, "Name one, like 'x'")
            write_wav(sound_of(motion, quantities[0], rate, seconds), rate, path)
        case _:
            reason = f"'{short(ending)}' is not the ending of a file that can be written"
            raise DeclarationError("path", reason, "Use .csv, .parquet or .wav")
