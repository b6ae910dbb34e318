"""The command ``records``: a system under many records."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stickslip.cli.commands.sweeping import computed_map
from stickslip.cli.common.ending import NOT_CERTIFIED
from stickslip.cli.common.models import given, load_model
from stickslip.cli.common.options import (
    AccuracyOfEach,
    Initial,
    Json,
    MeasureOptions,
    Model,
    ParameterOptions,
    Stored,
    TimeLimitOfEach,
    Workers,
)
from stickslip.cli.common.present import Files, ResultOptions, ShowProgress, folder_of, present
from stickslip.cli.common.report import print_summary
from stickslip.errors import DeclarationError, short

if TYPE_CHECKING:
    from stickslip import Fragility, Map, Records

FRAGILITY = Files.with_table("fragility")


@dataclass(frozen=True)
class Reading:
    """Options for reading files of records, as arguments of ``Records.read``."""

    drive: Annotated[
        list[str] | None,
        typer.Option(
            "--drive",
            metavar="NAME",
            help="Recorded drive; if there are several, one column each.  [default: the only "
            "drive]",
        ),
    ] = None
    time: Annotated[str, typer.Option("--time", metavar="NAME", help="Column of the times.")] = ""
    value: Annotated[
        str,
        typer.Option("--value", metavar="NAME", help="Column of the values."),
    ] = ""
    kind: Annotated[
        str,
        typer.Option(
            "--kind",
            metavar="linear|cubic|hold",
            help="Interpolation between samples.",
        ),
    ] = "linear"
    factor: Annotated[
        float, typer.Option("--factor", help="Factor of all values, such as 9.81.")
    ] = 1.0
    peak: Annotated[
        float | None,
        typer.Option("--peak", help="Scale each record to this largest absolute value."),
    ] = None
    pattern: Annotated[
        str,
        typer.Option(
            "--pattern", metavar="NAME", help="Pattern of the file names, such as '*_h1.csv'."
        ),
    ] = ""
    gaps: Annotated[bool, typer.Option("--gaps", help="Allow gaps in records.")] = False

    def records(self, folder: Path) -> Records:
        """The records of a folder."""
        from stickslip import Records

        options = dict(vars(self))
        return Records.read(folder, options.pop("drive") or (), **options)


@dataclass(frozen=True)
class RecordAxes:
    """The axes of the map besides the records."""

    scale: Annotated[
        str | None,
        typer.Option(
            "--scale",
            metavar="VALUES",
            help="Factors of the records, such as 0.2:2:10, or 1,2,5.",
        ),
    ] = None
    over: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="NAME=VALUES",
            help="Further axis, such as mu=0.1,0.2; may be repeated.",
        ),
    ] = None

    def with_records(self, records: Records) -> dict[str, Any]:
        """All axes: records, their factors, and those of ``--over``."""
        from stickslip.sweeps.request.axes import axes_of_texts

        axes: dict[str, Any] = {"record": records}
        axes |= {} if self.scale is None else {"scale": self.scale}
        for name, values in axes_of_texts(self.over or []).items():
            if name in axes:
                raise DeclarationError(
                    f"--over {short(name)}", "it is already varied", "Give it once only"
                )
            axes[name] = values
        return axes


def records_command(
    model: Model,
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="Folder of records: tables (.csv, ...) or PEER files (.AT2, ...).",
        ),
    ],
    measure: MeasureOptions,
    *,
    varied: RecordAxes,
    limit: Annotated[
        str | None,
        typer.Option(
            "--limit",
            metavar="MEASURE=VALUE",
            help="Report the fraction of records that exceed a limit, such as slip=0.05.",
        ),
    ] = None,
    reading: Reading,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="STORE", help="Path of the map.  [default: out/NAME-records.zarr]"
        ),
    ] = None,
    settings: ParameterOptions = None,
    initial: Initial = None,
    until: Annotated[
        float | None,
        typer.Option(
            "--until", metavar="T", help="End of the time span.  [default: the end of each record]"
        ),
    ] = None,
    rtol: AccuracyOfEach = 1e-10,
    by: Workers,
    stored: Stored,
    time_limit: TimeLimitOfEach = None,
    json_: Json = False,
) -> None:
    """Compute measures of a system under every record in a folder, at many scales, over parameters.

    Each motion covers the time of its record. Writes a Zarr store, record by record; run the same
    command again to resume, and use --extend to add records. With --limit, also writes the fraction
    of records that exceed it: fragility.nc, fragility.csv, summary.json and overview.png, into the
    folder of that name next to the store.

    Exit code: 0 complete (and certified, with --limit), 1 not, 2 wrong input, 130 interrupted (the
    results so far are kept).
    """
    from stickslip import Settings
    from stickslip import sweep as compute

    system = load_model(model, settings or [])
    start = given(initial)
    exceeded = None if limit is None else _limit(limit)
    axes = varied.with_records(reading.records(folder))
    path = out or folder_of(system.name, "records").with_suffix(".zarr")
    span = None if until is None else (float(system.span[0]), until)

    def work(**running: Any) -> Map:
        return compute(
            system,
            axes,
            measure,
            path,
            initial=start,
            span=span,
            settings=Settings(rtol=rtol),
            time_limit=time_limit,
            **vars(stored),
            **running,
        )

    found = computed_map(path, by, work)
    if exceeded is None:
        print_summary(found.summary(), json_, [("written", str(path))])
        raise typer.Exit(0 if found.outcome.ok else NOT_CERTIFIED)

    def fragility(progress: ShowProgress) -> Fragility:
        return found.fragility(*exceeded)

    if not json_:
        print_summary(found.summary(), more=[("written", str(path))])
    beside = path.with_name(f"{path.stem}-fragility")
    present("fragility", system.name, FRAGILITY, fragility, ResultOptions(beside, json_))


def _limit(text: str) -> tuple[str, float]:
    """The measure and the value of MEASURE=VALUE."""
    name, _, value = text.rpartition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        reason = "not of the form MEASURE=VALUE"
        raise DeclarationError(
            f"--limit {short(text)}", reason, "Write it like --limit slip=0.05"
        ) from None
