"""The commands ``equilibria``, ``cycle``, ``branch`` and ``basin``: where a system ends up in the
long run."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stickslip import __version__
from stickslip.cli.evolving import Json, Out, show, write
from stickslip.cli.folder import PICTURE, add_picture, result_folder
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.model.units import with_unit
from stickslip.progress import watched

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from stickslip.model.system import System
    from stickslip.orbits.continuation.branch import Branch
    from stickslip.orbits.cycles.cycle import Cycle
    from stickslip.orbits.equilibria.equilibrium import Equilibria

Draw = Callable[[], "Figure"]  # draws the picture of a result

SHOWN = 12  # equilibria, multipliers or special points in a table; all are in summary.json
EQUILIBRIA_FILES = ("summary.json", "equilibria.csv", PICTURE)
CYCLE_FILES = ("summary.json", "cycle.nc", PICTURE)
BRANCH_FILES = ("summary.json", "branch.nc", "branch.csv", PICTURE)
# labels of states that reach no attractor
NOWHERE = {-1: "stopped", -2: "not_settled", -3: "undamped"}
BASIN_FILES = ("summary.json", "basin.nc", PICTURE)

Model = Annotated[
    str,
    typer.Argument(
        metavar="MODEL", help="A name of the catalogue (see: stickslip list) or a .toml file."
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Parameter, or free function as a formula; may be repeated.",
    ),
]
Initial = Annotated[
    list[str] | None,
    typer.Option(
        "--initial", metavar="NAME=VALUE", help="Initial value, such as psi=0.8; may be repeated."
    ),
]


def equilibria(
    model: Model, settings: Settings = None, out: Out = None, json_: Json = False
) -> None:
    """Find the states of rest and of steady sliding, and whether they are stable.

    Writes equilibria.csv, summary.json and overview.png into the folder DIR.

    Exit code: 0 found, 1 none found, 2 wrong input.
    """
    from stickslip.figures.spectrum import plot_eigenvalues
    from stickslip.orbits.equilibria.finding import equilibria as find

    def work(system: System, place: Path) -> tuple[dict[str, Any], Draw]:
        found = find(system)
        found.table.to_csv(place / "equilibria.csv", index=False)
        return summarise_equilibria(found), lambda: plot_eigenvalues(found)

    present(
        system_of(model, settings),
        "equilibria",
        EQUILIBRIA_FILES,
        work,
        equilibria_rows,
        out,
        json_,
    )


def cycle(
    model: Model,
    settings: Settings = None,
    initial: Initial = None,
    out: Out = None,
    json_: Json = False,
) -> None:
    """Find the cycle or gait that the motion from the initial state settles on.

    Writes cycle.nc (one period), summary.json and overview.png into the folder DIR.

    Exit code: 0 certified, 1 not, or no cycle found, 2 wrong input.
    """
    from stickslip.figures.gait import plot_gait
    from stickslip.orbits.cycles.cycle import find_cycle

    start = given(initial)

    def work(system: System, place: Path) -> tuple[dict[str, Any], Draw]:
        found = find_cycle(system, start)
        found.trajectory.save(place / "cycle.nc")
        gait = found.drift and found.contacts
        return summarise_cycle(found), (lambda: plot_gait(found)) if gait else found.trajectory.plot

    present(system_of(model, settings), "cycle", CYCLE_FILES, work, cycle_rows, out, json_)


def branch(
    model: Model,
    over: Annotated[
        list[str],
        typer.Option("--over", metavar="NAME=LOW:HIGH", help="The parameter, such as V=0.05:0.4."),
    ],
    settings: Settings = None,
    initial: Initial = None,
    cycles: Annotated[
        bool, typer.Option("--cycle", help="Follow a cycle instead of an equilibrium.")
    ] = False,
    out: Out = None,
    json_: Json = False,
) -> None:
    """Follow an equilibrium (or a cycle) over a parameter, and name what happens to it.

    Writes branch.nc, branch.csv, summary.json and overview.png into the folder DIR.

    Exit code: 0 certified, 1 not, or nothing to follow, 2 wrong input, 130 interrupted (what was
    computed is kept).
    """
    from stickslip.orbits.branches.cycle_branch import continue_cycle
    from stickslip.orbits.branches.equilibrium_branch import checked_range, continue_equilibrium
    from stickslip.orbits.cycles.cycle import find_cycle

    ranges = spans(over, ("LOW", "HIGH"))
    if len(ranges) != 1:
        raise DeclarationError("--over", f"{len(ranges)} parameters vary", "A branch has one")
    (parameter, (low, high)), start = next(iter(ranges.items())), given(initial)
    system = system_of(model, settings)
    checked_range(system, parameter, (low, high))
    inside = low <= system.values[parameter] <= high

    def work(system: System, place: Path) -> tuple[dict[str, Any], Draw]:
        at = {} if inside else {parameter: 0.5 * (low + high)}
        if cycles:
            found = continue_cycle(find_cycle(system, start, at), parameter, (low, high))
        else:
            found = continue_equilibrium(system, parameter, (low, high), start=start, parameters=at)
        found.save(place / "branch.nc")
        found.to_csv(place / "branch.csv")
        return summarise_branch(found), found.plot

    present(system, "branch", BRANCH_FILES, work, branch_rows, out, json_)


def basin(
    model: Model,
    over: Annotated[
        list[str],
        typer.Option(
            "--over",
            metavar="NAME=LOW:HIGH:N",
            help="Initial values, such as psi=-2:2:80; twice for a map.",
        ),
    ],
    settings: Settings = None,
    initial: Initial = None,
    out: Out = None,
    json_: Json = False,
) -> None:
    """Find out which attractor each of many initial states reaches.

    Writes basin.nc, summary.json and overview.png into the folder DIR.

    Exit code: 0 all arrived and certified, 1 not, 2 wrong input, 130 interrupted (what was computed
    is kept).
    """
    from stickslip.figures.basin import plot_basin
    from stickslip.sweeps.basin import basin as find

    axes = {name: grid(name, values) for name, values in spans(over, ("LOW", "HIGH", "N")).items()}
    if len(axes) != 2:
        raise DeclarationError(
            "--over", f"{len(axes)} initial values vary", "A map needs two, with --over each"
        )
    start = given(initial)

    def work(system: System, place: Path) -> tuple[dict[str, Any], Draw]:
        found = find(system, axes, initial=start)
        found.to_netcdf(place / "basin.nc", engine="netcdf4", format="NETCDF4")
        return summarise_basin(found), lambda: plot_basin(found)

    present(system_of(model, settings), "basin", BASIN_FILES, work, basin_rows, out, json_)


# -- what all share --------------------------------------------------------------------------------


def present(
    system: System,
    what: str,
    files: Sequence[str],
    work: Callable[[System, Path], tuple[dict[str, Any], Draw]],
    rows: Callable[[dict[str, Any]], list[tuple[str, str]]],
    out: Path | None,
    json_: bool,
) -> None:
    """Do the work, write its results together, draw them, print them, and end with the exit code
    that fits."""
    from stickslip.cli.app import INTERRUPTED, NOT_CERTIFIED, finish

    name = re.sub(r"[^\w.-]+", "_", system.name)
    folder = out or Path("out") / f"{name}-{what}"
    began = time.perf_counter()
    with result_folder(folder, files) as place:
        try:
            with watched(f"{what} of {system.name}"):
                found, draw = work(system, place)
        except ConvergenceError as failure:
            finish(str(failure), NOT_CERTIFIED)
        summary = heading(system) | found | {"wall_time": time.perf_counter() - began}
        write(place, summary)
    add_picture(folder, draw)
    show(summary, json_, rows(summary), folder, files)
    if not summary["complete"]:
        finish(f"interrupted; what was computed is in {folder}", INTERRUPTED)
    raise typer.Exit(0 if summary["certified"] else NOT_CERTIFIED)


def system_of(model: str, settings: list[str] | None) -> System:
    """The system with ``--set`` applied."""
    from stickslip.cli.models import load_model

    return load_model(model, settings or [])


def given(initial: list[str] | None) -> dict[str, float] | None:
    """Initial values; None if there are none."""
    from stickslip.cli.models import assignments, numbers

    return numbers(assignments(initial or [], "--initial"), "--initial") or None


def spans(texts: list[str], parts: tuple[str, ...]) -> dict[str, list[float]]:
    """Read NAME=LOW:HIGH or NAME=LOW:HIGH:N; every number may be a fraction."""
    from stickslip.cli.models import assignments, numbers

    for text in texts:
        if "=" not in text:
            shape = ":".join(parts)
            raise DeclarationError(
                f"--over {text}",
                f"not of the form NAME={shape}",
                f"Write it like --over {text}={shape}",
            )
    found = {}
    for name, value in assignments(texts, "--over").items():
        pieces = str(value).split(":")
        if len(pieces) != len(parts):
            shape = f"{name}={':'.join(parts)}"
            raise DeclarationError(
                f"--over {name}={value}",
                f"not of the form {shape}",
                f"Write it like --over {shape}",
            )
        found[name] = [
            numbers(assignments([f"{name}={p}"], "--over"), "--over")[name] for p in pieces
        ]
    return found


def grid(name: str, values: list[float]) -> tuple[float, float, int]:
    """A range with a whole number of values."""
    low, high, number = values
    if number != int(number) or number < 2:
        raise DeclarationError(
            f"--over {name}", f"{number:g} values", "Give a whole number, at least 2"
        )
    return low, high, int(number)


def heading(system: System) -> dict[str, Any]:
    """What a summary begins with."""
    return {
        "program": "stickslip",
        "version": __version__,
        "model": system.name,
        "title": system.title,
        "parameters": system.values,
        "functions": {**system.functions, **system.drives},
        "complete": True,
    }


def shortened(rows: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """A few rows."""
    more = [("  ...", f"({len(rows)} in all)")] if len(rows) > SHOWN else []
    return rows[:SHOWN] + more


# -- equilibria ------------------------------------------------------------------------------------


def summarise_equilibria(found: Equilibria) -> dict[str, Any]:
    """Everything about equilibria that fits on a page; plain data."""
    from stickslip.orbits.equilibria.equilibrium import EquilibriumSet

    entries = []
    for e in found:
        entry = {
            "state": e.state,
            "modes": e.modes,
            "stable": e.stable,
            "drift": e.drift,
            "eigenvalues": [[z.real, z.imag] for z in e.eigenvalues or ()],
            "certificate": e.certificate.to_dict(),
            "text": e.describe(),
        }
        if isinstance(e, EquilibriumSet):
            entry |= {
                "dimension": e.dimension,
                "extent": {x: list(ends) for x, ends in e.extent.items()},
            }
        entries.append(entry)
    certified = bool(entries) and all(entry["certificate"]["ok"] for entry in entries)
    return {
        "certified": certified,
        "message": found.message,
        "tried": found.tried,
        "equilibria": entries,
    }


def equilibria_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """The short table."""
    entries = summary["equilibria"]
    outcome = f"{len(entries)} found" if entries else summary["message"]
    rows = [("set" if "extent" in e else "equilibrium", e["text"]) for e in entries]
    verdict = (
        [("certificate", "certified" if summary["certified"] else "not certified")]
        if entries
        else []
    )
    return [("outcome", outcome), *shortened(rows), *verdict]


# -- cycle -----------------------------------------------------------------------------------------


def summarise_cycle(found: Cycle) -> dict[str, Any]:
    """Everything about a cycle that fits on a page; plain data."""
    from dataclasses import asdict

    return {
        "certified": found.certificate.ok,
        "certificate": found.certificate.to_dict(),
        **{
            x: getattr(found, x)
            for x in ("period", "stable", "stability", "drift", "speed", "stick_time", "slip_time")
        },
        "state": found.state,
        "units": found.units,
        "multipliers": [[float(z.real), float(z.imag)] for z in found.multipliers],
        "extrema": {name: list(ends) for name, ends in found.extrema.items()},
        "contacts": {name: asdict(share) for name, share in found.contacts.items()},
        "phases": [asdict(phase) for phase in found.phases],
        "energy_per_distance": found.energy_per_distance,
        "dissipated": found.dissipated,
        "residual": found.residual,
    }


def cycle_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """The short table."""
    from stickslip.cli.report import certificate_rows

    multipliers = [f"{x:.6g}" + (f"{y:+.6g}i" if y else "") for x, y in summary["multipliers"]]

    def text(name: str, unit: str, digits: int = 9) -> str:
        return with_unit(summary[name], summary["units"][unit], digits)

    rows = [
        ("period", text("period", "time", 12)),
        ("stability", summary["stability"]),
        ("multipliers", ", ".join(multipliers[:SHOWN])),
    ]
    if summary["contacts"]:
        rows.append(("stick, slip", f"{text('stick_time', 'time')}, {text('slip_time', 'time')}"))
    if summary["drift"]:
        rows.append(("drift", f"{text('drift', 'drift')} a period, speed {text('speed', 'speed')}"))
        rows.append(("energy per distance", text("energy_per_distance", "energy_per_distance")))
    return [*rows, *certificate_rows(summary["certificate"])]


# -- branch ----------------------------------------------------------------------------------------


def summarise_branch(found: Branch) -> dict[str, Any]:
    """Everything about a branch that fits on a page; plain data."""
    from dataclasses import asdict

    points = found.points
    return {
        "complete": found.complete,
        "certified": found.certificate.ok,
        "certificate": found.certificate.to_dict(),
        "parameter": found.parameter,
        "points": int(points.sizes["point"]),
        "range": [float(points[found.parameter].min()), float(points[found.parameter].max())],
        "special": [asdict(s) | {"text": s.describe()} for s in found.special],
        "ended": found.ended,
    }


def branch_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """The short table."""
    from stickslip.cli.report import certificate_rows

    low, high = summary["range"]
    rows = [("points", f"{summary['points']}, {summary['parameter']} = {low:.9g} to {high:.9g}")]
    rows += shortened([("special point", s["text"]) for s in summary["special"]])
    return [*rows, ("ended", summary["ended"]), *certificate_rows(summary["certificate"])]


# -- basin -----------------------------------------------------------------------------------------


def summarise_basin(found: xarray.Dataset) -> dict[str, Any]:
    """Everything about basins that fits on a page; plain data."""
    table = found.drop_dims([d for d in found["attractor"].dims])
    entries = [
        {str(name): values.values[i].item() for name, values in table.items()}
        | {"name": str(table["reached"].values[i])}
        for i in range(table.sizes["reached"])
    ]
    labels = found["attractor"].values
    return {
        "complete": not found.attrs["interrupted"],
        "certified": bool(found["certified"].all()) and int(labels.min()) >= 0,
        "uncertified": int(((found["lacking"].values > 0) & (labels >= 0)).sum()),
        "section": {
            str(d): [float(found[d][0]), float(found[d][-1]), found.sizes[d]]
            for d in found["attractor"].dims
        },
        "attractors": entries,
        "units": {name: found[name].attrs["units"] for name in ("period", "speed")},
        **{name: int((labels == code).sum()) for code, name in NOWHERE.items()},
    }


def basin_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """The short table."""
    rows = []
    for e in summary["attractors"]:
        said = [
            f"{x} {with_unit(e[x], summary['units'][x], 6)}" for x in ("period", "speed") if e[x]
        ]
        said += [e["stability"]] * (e["stability"] not in ("", "stable")) + ["one of a family"] * e[
            "family"
        ]
        more = "".join(f", {text}" for text in said)
        rows.append((e["name"].replace("_", " "), f"{100 * e['share']:.3g} % of the section{more}"))
    rows = shortened(rows)
    names = (*NOWHERE.values(), "uncertified")
    rows += [(name.replace("_", " "), f"{summary[name]} states") for name in names if summary[name]]
    return [*rows, ("certificate", "certified" if summary["certified"] else "not certified")]
