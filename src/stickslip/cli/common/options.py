"""Options that several commands share, singly or as objects.

Options that are used together are fields of a dataclass, and a command takes the object.
"""

from __future__ import annotations

import contextlib
import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from stickslip.errors import DeclarationError
from stickslip.model.formats.measurable import MEASURABLE


def _systems(begun: str) -> list[str]:
    """Names for shell completion."""
    from stickslip import catalogue

    return [name for name in catalogue.names() if name.startswith(begun)]


Model = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        help="Name of a catalogue system (see: stickslip list) or a .toml file.",
        autocompletion=_systems,
    ),
]
ParameterOptions = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Parameter, or a formula for a free function, or a file of samples for a drive, as "
        "in a=base.csv; may be repeated.",
    ),
]
Initial = Annotated[
    list[str] | None,
    typer.Option(
        "--initial", metavar="NAME=VALUE", help="Initial value, such as psi=0.8; may be repeated."
    ),
]
Until = Annotated[
    float | None,
    typer.Option("--until", metavar="T", help="End of the time span.  [default: the model's]"),
]
Accuracy = Annotated[float, typer.Option("--rtol", help="Relative tolerance of the motion.")]
AccuracyOfEach = Annotated[float, typer.Option("--rtol", help="Relative tolerance of the motions.")]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit",
        metavar="SECONDS",
        help="Wall-clock limit; the results so far are kept.",
    ),
]
TimeLimitOfEach = Annotated[
    float | None,
    typer.Option(
        "--time-limit",
        metavar="SECONDS",
        help="Processor-time limit of a motion; the others continue.",
    ),
]
MeasureOptions = Annotated[
    list[str],
    typer.Option(
        "--measure",
        metavar="MEASURE",
        help=f"Measure: {', '.join(MEASURABLE)}; of one part as in amplitude:psi, or "
        "cost_of_transport:m*g; 'name = formula' of these; file.py:function; may be repeated.",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for the results.  [default: out/NAME]"),
]
Json = Annotated[bool, typer.Option("--json", help="Print only the summary, as JSON.")]


def quantity_of(what: str) -> Any:
    """The option ``--of``: which quantity of a motion is followed."""
    return typer.Option(
        "--of",
        metavar="FORMULA",
        help=f"Quantity of {what}: a coordinate, an output, 'u[tip]' or 'u[tip] - u[root]'.",
    )


@dataclass(frozen=True)
class Workers:
    """Options for the threads, processes or machines that compute a map."""

    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", help="Number of threads or processes.  [default: number of cores]"
        ),
    ] = None
    processes: Annotated[
        bool, typer.Option("--processes", help="Use processes instead of threads.")
    ] = False
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", metavar="ADDRESS", help="Use the Dask cluster at this address."
        ),
    ] = None
    local_cluster: Annotated[
        bool, typer.Option("--local-cluster", help="Start a Dask cluster here.")
    ] = False

    @contextlib.contextmanager
    def started(self) -> Iterator[str]:
        """The name of the scheduler, which runs until the context ends."""
        from stickslip.sweeps.work.scheduler import local_cluster

        if (self.scheduler is not None) + self.local_cluster + self.processes > 1:
            reason = "--processes, --scheduler and --local-cluster exclude each other"
            raise DeclarationError("sweep", reason, "Use one of them")
        if self.local_cluster:
            with local_cluster(self.workers) as found:
                yield found
        else:
            yield self.scheduler or ("processes" if self.processes else "threads")


@dataclass(frozen=True)
class Stored:
    """Options for an existing store, as arguments of ``sweep``."""

    extend: Annotated[bool, typer.Option("--extend", help="Add points to a stored map.")] = False
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a stored map.")] = False
    repair: Annotated[bool, typer.Option("--repair", help="Recompute damaged chunks.")] = False


def with_single_options(command: Callable[..., None]) -> Callable[..., None]:
    """A command for registration with typer: each dataclass parameter is replaced by the fields of
    that class, in their order."""
    signature = inspect.signature(command, eval_str=True)
    single: list[inspect.Parameter] = []
    objects: dict[str, type] = {}
    for name, parameter in signature.parameters.items():
        kind = parameter.annotation
        if isinstance(kind, type) and is_dataclass(kind):
            objects[name] = kind
            single += inspect.signature(kind, eval_str=True).parameters.values()
        else:
            single.append(parameter)

    @wraps(command)
    def run(**options: Any) -> None:
        for name, kind in objects.items():
            options[name] = kind(**{field.name: options.pop(field.name) for field in fields(kind)})
        command(**options)

    # A required option may follow one with a default only among keywords.
    by_name = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in single]
    run.__dict__["__signature__"] = signature.replace(parameters=by_name)
    run.__annotations__ = {p.name: p.annotation for p in single}
    return run
