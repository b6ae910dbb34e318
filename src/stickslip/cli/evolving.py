"""The commands ``average`` and ``evolve``: rate-independent evolutions from model files."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stickslip import __version__
from stickslip.cli.folder import PICTURE, add_picture, result_folder
from stickslip.errors import FEW, ConvergenceError, DeclarationError, few

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip.rate_independent.dissipation import Average, Dissipation
    from stickslip.rate_independent.evolution.history import History
    from stickslip.rate_independent.evolution.model import EvolutionModel
    from stickslip.rate_independent.play.operator import Play

TOLERANCE = 1e-8  # of an average without a closed form, relative to the size of K(s)
AVERAGE_FILES = ("summary.json", PICTURE)
EVOLVE_FILES = ("summary.json", "evolution.nc", PICTURE)

File = Annotated[
    Path, typer.Argument(metavar="FILE", help="A .toml file that declares an evolution.")
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Parameter, or function as a formula; may be repeated."
    ),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for the results.  [default: out/NAME]"),
]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as JSON and nothing else.")]


def average(file: File, settings: Settings = None, out: Out = None, json_: Json = False) -> None:
    """Average oscillating friction: which friction is left, and which phases do the moving.

    Writes summary.json and overview.png into the folder DIR.

    Exit code: 0 within the tolerance, 1 not, 2 wrong input.
    """
    from stickslip.cli.app import NOT_CERTIFIED, finish

    model = configured(file, settings)
    began = time.perf_counter()
    folder = out or default_folder(model, "average")
    with result_folder(folder, AVERAGE_FILES) as place:
        try:
            averaged = model.potential.average(TOLERANCE)
            summary = summarise_average(model, averaged)
        except ConvergenceError as error:
            finish(str(error), NOT_CERTIFIED)
        summary["wall_time"] = time.perf_counter() - began
        write(place, summary)
    add_picture(folder, lambda: average_figure(model, averaged))
    show(summary, json_, average_rows(summary), folder, AVERAGE_FILES)
    raise typer.Exit(0 if summary["certified"] else NOT_CERTIFIED)


def evolve(
    file: File,
    settings: Settings = None,
    until: Annotated[
        float | None, typer.Option("--until", metavar="T", help="End of the time span.")
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option("--steps", metavar="N", help="Steps of equal length.  [default: adaptive]"),
    ] = None,
    averaged: Annotated[
        bool, typer.Option("--averaged", help="The limit of fast oscillations.")
    ] = False,
    out: Out = None,
    json_: Json = False,
) -> None:
    """Compute a rate-independent evolution, certify it, and write it down.

    Writes evolution.nc, summary.json and overview.png into the folder DIR. A scalar play is
    computed exactly.

    Exit code: 0 certified to its end, 1 not, 2 wrong input, 130 interrupted (what was computed is
    kept).
    """
    from stickslip.cli.app import INTERRUPTED, NOT_CERTIFIED, finish

    model = configured(file, settings)
    if until is not None:
        model = with_option("--until", model, span=(model.span[0], until))
    if steps is not None:
        model = with_option("--steps", model, steps=steps)
    _ = model.problem  # a dissipation potential alone does not evolve
    folder = out or default_folder(model, "averaged" if averaged else "")
    with result_folder(folder, EVOLVE_FILES) as place:
        began = time.perf_counter()
        result = computed(model, averaged)
        summary = summarise_evolution(model, result, averaged) | {
            "wall_time": time.perf_counter() - began
        }
        store(result, place / "evolution.nc")
        write(place, summary)
    add_picture(folder, result.plot)
    show(summary, json_, evolve_rows(summary), folder, EVOLVE_FILES)
    if summary["outcome"] == "interrupted":
        finish(
            f"interrupted; the evolution up to t = {summary['end']:g} is in {folder}", INTERRUPTED
        )
    raise typer.Exit(0 if summary["certified"] and summary["complete"] else NOT_CERTIFIED)


# -- what both share -------------------------------------------------------------------------------


def configured(file: Path, settings: Sequence[str] | None) -> EvolutionModel:
    """The model of a file with ``--set`` applied."""
    from stickslip.cli.models import assignments
    from stickslip.rate_independent.evolution.evolution_file import load_evolution

    return load_evolution(file).configure(assignments(settings or [], "--set"))


def with_option(option: str, model: EvolutionModel, **changes: Any) -> EvolutionModel:
    """The model with what an option changes; the option is named in errors."""
    try:
        return replace(model, **changes)
    except DeclarationError as error:
        raise DeclarationError(option, error.reason, error.remedy) from None


def default_folder(model: EvolutionModel, what: str) -> Path:
    """``out/NAME``, or ``out/NAME-what``."""
    name = re.sub(r"[^\w.-]+", "_", model.name)
    return Path("out") / (f"{name}-{what}" if what else name)


def write(place: Path, summary: dict[str, Any]) -> None:
    """Write the summary."""
    (place / "summary.json").write_text(as_json(summary) + "\n", encoding="utf-8")


def as_json(summary: dict[str, Any]) -> str:
    """The summary as text."""
    from stickslip.storage import plain

    return json.dumps(plain(summary), indent=2, ensure_ascii=False)


def show(
    summary: dict[str, Any],
    json_: bool,
    rows: list[tuple[str, str]],
    folder: Path,
    files: Sequence[str],
) -> None:
    """Print the summary, as JSON or as a short table."""
    if json_:
        typer.echo(as_json(summary))
        return
    from stickslip.cli.report import print_table, written

    more = [("wall time", f"{summary['wall_time']:.3g} s"), ("written", written(folder, files))]
    print_table(
        summary["title"] or summary["model"],
        [*rows, *more],
        summary["certified"] and summary["complete"],
    )


def heading(model: EvolutionModel) -> dict[str, Any]:
    """What a summary begins with."""
    return {
        "program": "stickslip",
        "version": __version__,
        "model": model.name,
        "title": model.title,
        "parameters": model.values,
        "functions": dict(model.functions),
        "dissipation": model.dissipation["kind"],
    }


# -- average ---------------------------------------------------------------------------------------


def summarise_average(model: EvolutionModel, averaged: Average) -> dict[str, Any]:
    """Everything about an average that fits on a page; plain data."""
    import numpy as np

    source = model.potential
    n = model.potential.dimension
    grid = np.arange(128) / 128 if source.depends_on_phase else np.zeros(1)
    unit_motions = []
    for i in range(n):
        for sign in (1, -1):
            v = sign * np.eye(n)[i]
            motion = averaged.optimal_motion(v)
            costs = source.sampled(np.union1d(grid, motion.phases)).support(v)
            unit_motions.append(
                {
                    "component": i + 1,
                    "sign": sign,
                    "average": motion.cost,
                    "range": [float(costs.min()), float(costs.max())],
                    "phases": motion.phases.tolist(),
                    "gap": motion.gap,
                }
            )
    largest = max(m["range"][1] for m in unit_motions)
    gap = max(abs(m["gap"]) for m in unit_motions)
    return {
        **heading(model),
        "dimension": n,
        "depends_on_phase": source.depends_on_phase,
        "complete": True,
        "certified": gap <= TOLERANCE * largest,
        **in_words(source, averaged),
        "coverage": averaged.coverage,
        "frictionless": averaged.verdict,
        "frictionless_directions": averaged.frictionless.T.tolist(),
        "duality_gap": gap,
        "unit_motions": unit_motions,
    }


def in_words(source: Dissipation, averaged: Average) -> dict[str, Any]:
    """How the average was found, what it is, and its numbers."""
    known = averaged.closed_form
    if known is not None:
        method = "closed form: each threshold at its least over the phase"
        return {"method": method, "psi_av": summed(known.terms), **known.numbers}
    low, high = extremes(averaged)
    words = (
        f"{low:.6g} |v|"
        if high - low <= TOLERANCE * high
        else f"between {low:.6g} |v| and {high:.6g} |v|"
    )
    return {
        "method": f"intersection of K(s) over all phases, by cone programs to {TOLERANCE:.0e}",
        "psi_av": words + ("" if source.dimension <= 2 else " along random directions"),
        "extremes": [low, high],
    }


def summed(terms: list[str]) -> str:
    """A sum, shortened in the middle."""
    if len(terms) > FEW:
        terms = [*terms[: FEW - 2], f"... ({len(terms)} terms)", terms[-1]]
    return " + ".join(terms)


def extremes(averaged: Average) -> tuple[float, float]:
    """Least and largest Ψ_av of unit vectors: all around in the plane, along random directions in
    space."""
    import numpy as np

    n = averaged.dimension
    if n == 2:
        angles = 2.0 * np.pi * np.arange(36) / 36
        directions = np.column_stack([np.cos(angles), np.sin(angles)])
    else:
        directions = np.random.default_rng(0).normal(size=(36, n))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
    values = [averaged.support(v) for v in directions]
    return min(values), max(values)


def average_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """The short table."""
    rows = [
        ("dissipation", f"{summary['dissipation']} on R^{summary['dimension']}"),
        ("method", summary["method"]),
        ("average", f"Psi_av(v) = {summary['psi_av']}"),
        ("friction", summary["frictionless"]),
    ]
    unit_motions = summary["unit_motions"]
    for motion in unit_motions[: 2 * FEW]:
        low, high = motion["range"]
        when = f"at s = {few(motion['phases'])}" if motion["phases"] else "at no phase"
        name = f"  {'+' if motion['sign'] > 0 else '-'}e_{motion['component']}"
        rows.append(
            (
                name,
                f"{motion['average']:.6g}, moves {when}; one phase alone costs {low:.6g} to "
                f"{high:.6g}",
            )
        )
    if len(unit_motions) > 2 * FEW:
        rows.append(("  ...", f"({summary['dimension']} components in all)"))
    verdict = "certified" if summary["certified"] else "not certified"
    return [
        *rows,
        (
            "certificate",
            f"{verdict}: duality gap {summary['duality_gap']:.1e}, {summary['coverage']}",
        ),
    ]


def average_figure(model: EvolutionModel, averaged: Average) -> Figure:
    """K(s) and K_av in the plane, and the costs over a phase."""
    from stickslip.figures.dissipation import plot_average

    return plot_average(model.potential, averaged)


# -- evolve ----------------------------------------------------------------------------------------


def computed(model: EvolutionModel, averaged: bool) -> History | Play:
    """The evolution: an exact play if it is scalar, else minimising movements."""
    from stickslip.rate_independent.evolution.blocks import PlayMotion
    from stickslip.rate_independent.evolution.evolve import evolve as by_steps
    from stickslip.rate_independent.evolution.model import with_nearest_start

    problem = with_nearest_start(model.problem.averaged) if averaged else model.problem
    if problem.dissipation.thresholds is not None:
        return PlayMotion(problem).play
    return by_steps(problem, steps=model.steps)


def store(result: History | Play, path: Path) -> None:
    """Write the data."""
    from stickslip.rate_independent.evolution.history import History

    if isinstance(result, History):
        result.save(path)
    else:
        result.dataset.to_netcdf(path, engine="netcdf4", format="NETCDF4")


def summarise_evolution(
    model: EvolutionModel, result: History | Play, averaged: bool
) -> dict[str, Any]:
    """Everything about an evolution that fits on a page; plain data."""
    from stickslip.rate_independent.evolution.history import History

    certificate = result.certificate
    common = {
        "averaged": averaged,
        "epsilon": None if averaged else model.problem.epsilon,
        "t_span": list(model.problem.span),
        "certified": certificate.ok,
    }
    if isinstance(result, History):
        own = {
            "method": "minimising movements",
            "outcome": result.outcome.label,
            "message": result.message,
            "complete": result.outcome.ok,
            "end": float(result.dataset["step_time"][-1]),
            "steps": result.steps,
            "final": result.final.tolist(),
            "dissipated": float(result.dataset["dissipated"][-1]),
        }
    else:
        own = {
            "method": "exact play",
            "outcome": "finished",
            "message": "The end of the time span was reached",
            "complete": True,
            "end": float(result.time[-1]),
            "switches": result.n_switches,
            "final": [result.final],
            "dissipated": result.dissipated,
        }
    return {**heading(model), **common, **own, "certificate": certificate.to_dict()}


def evolve_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """The short table."""
    from stickslip.cli.report import certificate_rows

    period = (
        "in the limit of fast oscillations"
        if summary["averaged"]
        else f"epsilon = {summary['epsilon']:g}"
    )
    count = (
        ("switches", str(summary["switches"]))
        if "switches" in summary
        else ("steps", str(summary["steps"]))
    )
    return [
        ("outcome", summary["outcome"] if summary["complete"] else summary["message"]),
        ("method", f"{summary['method']}, {period}"),
        ("time", f"{summary['t_span'][0]:g} to {summary['end']:g}"),
        count,
        ("final state", few(summary["final"])),
        ("dissipated", f"{summary['dissipated']:.6g}"),
        *certificate_rows(summary["certificate"]),
    ]
