"""The command ``fit``: parameters of a system from data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stickslip.cli.common.models import assignments, load_model, numbers, settings_of
from stickslip.cli.common.options import Model, ParameterOptions
from stickslip.cli.common.present import Files, ResultOptions, ShowProgress, present
from stickslip.errors import DeclarationError, suggestion

if TYPE_CHECKING:
    from stickslip.fitting.recording import Recording
    from stickslip.model.system import System

FIT = Files.with_table("fit")


def fit_command(
    model: Model,
    data: Annotated[
        list[Path], typer.Argument(metavar="DATA...", help="Files with columns, one per record.")
    ],
    free: Annotated[
        list[str],
        typer.Option(
            "--free",
            metavar="NAME[=LOW:HIGH]",
            help="Parameter or initial value to fit; by default in its declared range.",
        ),
    ],
    observe: Annotated[
        list[str] | None,
        typer.Option(
            "--observe",
            metavar="QUANTITY=COLUMN",
            help="Quantity of a column, such as x=position; by default columns have the names of "
            "quantities.",
        ),
    ] = None,
    settings: ParameterOptions = None,
    initial: Annotated[
        list[str] | None,
        typer.Option(
            "--initial",
            metavar="NAME=VALUE",
            help="Initial value, a number or a formula of the parameters.",
        ),
    ] = None,
    drive: Annotated[
        list[str] | None,
        typer.Option("--drive", metavar="DRIVE=COLUMN", help="Recorded drive."),
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(
            "--noise",
            metavar="COLUMN=SIGMA",
            help="Standard deviation, or the name of its column; estimated by default.",
        ),
    ] = None,
    loss: Annotated[
        str, typer.Option("--loss", help="linear, soft_l1, huber or cauchy.")
    ] = "linear",
    time: Annotated[
        str,
        typer.Option("--time", metavar="COLUMN", help="Column of the time.  [default: time or t]"),
    ] = "",
    events: Annotated[
        str,
        typer.Option("--events", metavar="EVENT", help="Rows are events, such as 'ground slips'."),
    ] = "",
    starts: Annotated[int, typer.Option("--starts", help="Number of starts.")] = 8,
    *,
    output: ResultOptions,
) -> None:
    """Fit parameters of a system to data, with confidence intervals.

    Writes fit.nc, fit.csv, summary.json and overview.png into the folder DIR.

    Exit code: 0 found and certified, 1 not, 2 wrong input, 130 interrupted (the best fit so
    far is kept).
    """
    from stickslip import Fit, Recording, fit

    system, parameters = _configured(model, settings or [])
    begin = dict(assignments(initial or [], "--initial"))
    unknowns = dict(_unknown(text) for text in free)
    table = {"drives": _pairs(drive, "--drive"), "time": time, "events": events}
    records: list[Recording] = [Recording(str(path), initial=begin, **table) for path in data]
    chosen = _observed(observe, records[0])
    sizes = assignments(noise or [], "--noise")
    options: dict[str, Any] = {"noise": sizes, "loss": loss, "parameters": parameters}

    def work(progress: ShowProgress) -> Fit:
        return fit(system, records, unknowns, chosen, starts=starts, progress=progress, **options)

    present(f"fitting {system.name}", system.name, FIT, work, output)


def _configured(model: str, settings: list[str]) -> tuple[System, dict[str, float]]:
    """The system, and the values of parameters that are not fitted."""
    system = load_model(model, [])
    given = settings_of(settings)
    values = {n: v for n, v in given.items() if n in system.parameters}
    system = system.configure({n: v for n, v in given.items() if n not in values})
    plain = {n: v for n, v in values.items() if isinstance(v, str | float | int)}
    return system, numbers(plain, "--set")


def _unknown(text: str) -> tuple[str, tuple[float, float] | None]:
    """NAME, or NAME=LOW:HIGH."""
    name, equals, ends = (part.strip() for part in text.partition("="))
    if not equals:
        return name, None
    pieces = ends.split(":")
    if len(pieces) != 2:
        raise DeclarationError(
            f"--free {text}", "not of the form NAME=LOW:HIGH", f"Write it like {name}=0.1:1"
        )
    bounds = [numbers(assignments([f"{name}={p}"], "--free"), "--free")[name] for p in pieces]
    return name, (bounds[0], bounds[1])


def _pairs(texts: list[str] | None, option: str) -> dict[str, str]:
    found = {}
    for text in texts or []:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise DeclarationError(
                f"{option} {text}",
                "not of the form NAME=NAME",
                f"Write it like {option} x=position",
            )
        found[name] = value
    return found


def _observed(texts: list[str] | None, record: Recording) -> dict[str, str] | None:
    """Columns and their quantities; the column is the side of the equals sign that occurs in the
    file."""
    if not texts:
        return None
    columns = [str(name) for name in record.table.columns]
    found = {}
    for left, right in _pairs(texts, "--observe").items():
        if right in columns:
            found[right] = left
        elif left in columns:
            found[left] = right
        else:
            raise DeclarationError(
                f"--observe {left}={right}",
                f"{record.source} has no column '{right}'",
                suggestion(right, columns),
            )
    return found
