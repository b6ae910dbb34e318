"""The output folder of a run: results are written completely or not at all, and files of other
origin are never replaced; then the plot."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip.cli.common.ending import EXIT_INTERRUPTED, finish
from stickslip.errors import StickslipError
from stickslip.progress import watched

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURE = "overview.png"


@contextmanager
def result_folder(path: Path, files: Sequence[str]) -> Iterator[Path]:
    """A temporary folder for results that is renamed to `path` on success, and deleted otherwise.

    Old files among `files` that are not rewritten are removed, since an old figure would not show
    the new result.

    Raises
    ------
    StickslipError
        If the folder cannot be written, or contains files of these names that the library has not
        written.
    """
    existed = path.exists()
    if existed:
        _check_ours(path, files)
    made: list[Path] = []
    try:
        made = _make(path if existed else path.parent)
        # In the same folder as the target, so that renaming never copies.
        place = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=path if existed else path.parent))
    except OSError as error:
        _remove_empty(made)
        reason = f"{path}: cannot be written ({error.strerror})"
        raise StickslipError(f"{reason}. Choose another folder with --out") from None
    try:
        yield place
        if existed or path.exists():
            for name in files:
                if (place / name).exists():
                    os.replace(place / name, path / name)
                else:
                    (path / name).unlink(missing_ok=True)
        else:
            place.chmod(0o777 & ~_umask())
            os.rename(place, path)
    finally:
        shutil.rmtree(place, ignore_errors=True)
        _remove_empty(made)


def add_picture(folder: Path, draw: Callable[[], Figure]) -> None:
    """Add the figure of a stored result; if plotting fails, the result is kept, with a warning."""
    from stickslip.cli.common.report import warn

    partial = folder / f".{PICTURE}.{os.getpid()}.tmp"
    try:
        from stickslip.figures.drawing.style import paper_style

        with watched("drawing"), paper_style():
            draw().savefig(partial, format="png")
        os.replace(partial, folder / PICTURE)
    except KeyboardInterrupt:
        finish(f"interrupted while plotting; the results are in {folder}", EXIT_INTERRUPTED)
    except Exception as error:  # an error here does not affect the result
        warn(
            f"the figure could not be plotted ({type(error).__name__}: {error}); the results are "
            f"in {folder}"
        )
    finally:
        partial.unlink(missing_ok=True)


def _check_ours(path: Path, files: Sequence[str]) -> None:
    if not path.is_dir():
        raise StickslipError(f"{path}: not a folder. Choose another folder with --out")
    found = [name for name in files if os.path.lexists(path / name)]
    if found and not _is_ours(path, files):
        raise StickslipError(
            f"{path}: contains {', '.join(found)}, not written by stickslip. Choose another "
            "folder with --out"
        )


def _is_ours(path: Path, files: Sequence[str]) -> bool:
    try:
        summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    regular = all((path / name).is_file() for name in files if os.path.lexists(path / name))
    return regular and isinstance(summary, dict) and summary.get("program") == "stickslip"


def _make(path: Path) -> list[Path]:
    """Make a folder; returns those that did not exist, innermost first."""
    missing = []
    folder = path
    while not folder.exists():
        missing.append(folder)
        folder = folder.parent
    path.mkdir(parents=True, exist_ok=True)
    return missing


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
