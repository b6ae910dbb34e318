"""Records of strong motion in the format of the PEER ground motion database: AT2 files
(accelerations), VT2 (velocities) and DT2 (displacements).

After three lines of text a fourth gives the number of samples and the time between them, as ``NPTS=
4000, DT= .0050 SEC`` or, in older files, ``4000 0.0050 NPTS, DT``. What follows are the values, in
the unit that the third line names (accelerations in parts of g).
"""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short
from stickslip.model.entries.columns import file_named, lines_of

ENDINGS = (".at2", ".vt2", ".dt2")
_HEADING = 4  # lines before the values
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?"
_FORMS = (
    re.compile(rf"NPTS\s*=\s*(?P<count>\d+)\s*,?\s*DT\s*=\s*(?P<step>{_NUMBER})", re.IGNORECASE),
    re.compile(rf"(?P<count>\d+)\s+(?P<step>{_NUMBER})\s+NPTS\s*,?\s*DT", re.IGNORECASE),
)


def is_strong_motion(file: str | PathLike[str]) -> bool:
    """Whether the name of a file is that of such a record."""
    return Path(file).suffix.lower() in ENDINGS


def strong_motion_of(file: str | PathLike[str]) -> tuple[Array, Array]:
    """Times, from 0 on, and values of a record.

    Raises
    ------
    DeclarationError
        If it cannot be read, the heading says neither number nor step, there are fewer or more
        values, or one is no number.
    """
    where = file_named(file)
    lines = lines_of(file)
    if not any(line.strip() for line in lines):
        raise DeclarationError(where, "the file is empty", "Give a record")
    heading = lines[_HEADING - 1] if len(lines) >= _HEADING else ""
    found = next((match for form in _FORMS if (match := form.search(heading))), None)
    if found is None:
        raise DeclarationError(
            f"{where}, line {_HEADING}",
            "it does not say how many samples there are, and how far apart",
            "Write it like NPTS= 4000, DT= .0050 SEC, or give a table with the ending .csv",
        )
    count, step = int(found["count"]), float(re.sub("[dD]", "e", found["step"]))
    if count < 2 or not 0.0 < step < np.inf:
        reason = f"{count} samples that are {step:g} apart"
        raise DeclarationError(f"{where}, line {_HEADING}", reason, "Give two or more, in time")
    values: list[float] = []
    for number, line in enumerate(lines[_HEADING:], _HEADING + 1):
        for cell in line.split():
            try:
                values.append(float(cell))
            except ValueError:
                reason = f"'{short(cell)}' is not a number"
                raise DeclarationError(f"{where}, line {number}", reason, "Mend the file") from None
            if not np.isfinite(values[-1]):
                reason = f"{values[-1]} is not a number"
                raise DeclarationError(f"{where}, line {number}", reason, "Mend the file")
    if len(values) != count:
        raise DeclarationError(
            where, f"there are {len(values)} values, NPTS says {count}", "Mend the file"
        )
    return step * np.arange(count), np.array(values)
