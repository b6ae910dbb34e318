"""The commands ``average`` and ``evolve``: rate-independent evolutions from model files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from stickslip import __version__
from stickslip.certificates import Certificate, Residual
from stickslip.cli.common.models import settings_of
from stickslip.cli.common.present import Files, ResultOptions, ShowProgress, present
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.model.names import measured_drives
from stickslip.results import Completion, Summary, certificate_rows, listed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip.model.system import Drive
    from stickslip.rate_independent.dissipation import Average, Dissipation
    from stickslip.rate_independent.evolution.history import History
    from stickslip.rate_independent.evolution.model import EvolutionModel
    from stickslip.rate_independent.play.operator import Play

_TOLERANCE = 1e-8  # error of an average without a closed form, relative to the size of K(s)
AVERAGE = Files(folder="average")
EVOLUTION = Files("evolution.nc")
_SHOWN = 8  # components in a table; all are in summary.json

File = Annotated[
    Path, typer.Argument(metavar="FILE", help="A .toml file that declares an evolution.")
]
EvolutionOptions = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Parameter, or a formula for a function or drive, or a file of samples for a drive, "
        "as in a=base.csv; may be repeated.",
    ),
]


def average_command(
    file: File, settings: EvolutionOptions = None, *, output: ResultOptions
) -> None:
    """Average oscillating friction: the effective friction, and the phases at which motion occurs.

    Writes summary.json and overview.png into the folder DIR.

    Exit code: 0 within the tolerance, 1 not, 2 wrong input.
    """
    model = configured(file, settings)

    def work(progress: ShowProgress) -> Averaged:
        return Averaged(model, model.potential.average(_TOLERANCE))

    present(f"average of {model.name}", model.name, AVERAGE, work, output, heading(model))


def evolve_command(
    file: File,
    settings: EvolutionOptions = None,
    until: Annotated[
        float | None, typer.Option("--until", metavar="T", help="End of the time span.")
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option("--steps", metavar="N", help="Number of equal steps.  [default: adaptive]"),
    ] = None,
    averaged: Annotated[
        bool, typer.Option("--averaged", help="Compute the limit of fast oscillations.")
    ] = False,
    *,
    output: ResultOptions,
) -> None:
    """Compute, certify and store a rate-independent evolution.

    Writes evolution.nc, summary.json and overview.png into the folder DIR. A scalar play is
    computed exactly.

    Exit code: 0 certified to its end, 1 not, 2 wrong input, 130 interrupted (the results so far
    are kept).
    """
    from stickslip.rate_independent.evolution.blocks import evolved

    model = configured(file, settings, until)
    if steps is not None:
        model = with_option("--steps", model, steps=steps)
    _ = model.problem  # a dissipation potential alone does not evolve
    more = {
        "averaged": averaged,
        "epsilon": None if averaged else model.problem.epsilon,
        "t_span": list(model.problem.span),
    }

    def work(progress: ShowProgress) -> History | Play:
        return evolved(model, averaged, progress)

    files = replace(EVOLUTION, folder="averaged" if averaged else "")
    more = {**heading(model), **more}
    present(f"evolution of {model.name}", model.name, files, work, output, more)


# -- common parts ----------------------------------------------------------------------------------


def configured(
    file: Path, settings: Sequence[str] | None, until: float | None = None
) -> EvolutionModel:
    """The model of a file with ``--set`` and ``--until`` applied."""
    from stickslip.rate_independent.evolution.evolution_file import load_evolution

    given = settings_of(settings or [])
    samples = measured_drives(given)
    others = {name: value for name, value in given.items() if name not in samples}
    # Values that are neither formulas nor samples are rejected there.
    model = load_evolution(file).configure(cast("dict[str, Drive]", others))
    if until is not None:
        model = with_option("--until", model, span=(model.span[0], until))
    return model.configure(samples)  # the samples have to cover the span


def with_option(option: str, model: EvolutionModel, **changes: Any) -> EvolutionModel:
    """The model with the change by an option, which errors name."""
    try:
        return replace(model, **changes)
    except DeclarationError as error:
        raise DeclarationError(option, error.reason, error.remedy) from None


def heading(model: EvolutionModel) -> dict[str, Any]:
    """First line of a summary."""
    return {
        "model": model.name,
        "title": model.title or model.name,
        "parameters": model.values,
        "functions": {**model.functions, **{k: str(d) for k, d in model.drives.items()}},
        "dissipation": model.dissipation["kind"],
    }


# -- average ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Averaged:
    """An average, in the form of a result for commands."""

    model: EvolutionModel
    average: Average

    @property
    def outcome(self) -> Completion:
        """Always complete: if the average cannot be computed, an error is raised."""
        return Completion.FINISHED

    @cached_property
    def unit_motions(self) -> list[dict[str, Any]]:
        """Costs of unit motions along each axis: on average, and at a single phase."""
        import numpy as np

        source = self.model.potential
        n = source.dimension
        grid = np.arange(128) / 128 if source.depends_on_phase else np.zeros(1)
        found = []
        for i, sign in product(range(n), (1, -1)):
            v = sign * np.eye(n)[i]
            motion = self.average.optimal_motion(v)
            costs = source.sampled(np.union1d(grid, motion.phases)).support(v)
            found.append(
                {
                    "component": i + 1,
                    "sign": sign,
                    "average": motion.cost,
                    "range": [float(costs.min()), float(costs.max())],
                    "phases": motion.phases.tolist(),
                    "gap": motion.gap,
                }
            )
        return found

    @property
    def certificate(self) -> Certificate:
        """The duality gap, relative to the largest cost of one phase alone."""
        largest = max(m["range"][1] for m in self.unit_motions)
        gap = max(abs(m["gap"]) for m in self.unit_motions)
        relative = gap / largest if largest > 0.0 else gap
        notes = (self.average.coverage,)
        return Certificate((Residual("duality gap", relative, _TOLERANCE),), notes=notes)

    def summary(self) -> Summary:
        """The summary."""
        certificate = self.certificate
        source = self.model.potential
        data = {
            "program": "stickslip",
            "version": __version__,
            "result": "average",
            **heading(self.model),
            "dimension": source.dimension,
            "depends_on_phase": source.depends_on_phase,
            "complete": True,
            "certified": certificate.ok,
            "certificate": certificate.to_dict(),
            **in_words(source, self.average),
            "coverage": self.average.coverage,
            "frictionless": self.average.verdict,
            "frictionless_directions": self.average.frictionless.T.tolist(),
            "duality_gap": max(abs(m["gap"]) for m in self.unit_motions),
            "unit_motions": self.unit_motions,
        }
        rows = (*self._rows(data), *certificate_rows(certificate))
        return Summary(str(data["title"]), rows, data, certificate.ok)

    def _rows(self, data: dict[str, Any]) -> list[tuple[str, str]]:
        rows = [
            ("dissipation", f"{data['dissipation']} on R^{data['dimension']}"),
            ("method", data["method"]),
            ("average", f"Psi_av(v) = {data['psi_av']}"),
            ("friction", data["frictionless"]),
        ]
        for motion in self.unit_motions[: 2 * _SHOWN]:
            low, high = motion["range"]
            when = f"at s = {_few(motion['phases'])}" if motion["phases"] else "at no phase"
            cost = f"{motion['average']:.6g}, moves {when}"
            sign = "+" if motion["sign"] > 0 else "-"
            name = f"  {sign}e_{motion['component']}"
            rows.append((name, f"{cost}; a single phase costs {low:.6g} to {high:.6g}"))
        if len(self.unit_motions) > 2 * _SHOWN:
            rows.append(("  ...", f"({data['dimension']} components in all)"))
        return rows

    def plot(self) -> Figure:
        """K(s) and K_av in the plane, and the costs over a phase."""
        from stickslip.figures.dissipation import plot_average

        return plot_average(self.model.potential, self.average)

    def save(self, path: str | Path) -> None:
        """Averages are not stored: the summary is complete."""
        raise NotImplementedError


def _few(numbers: Sequence[float]) -> str:
    """A few numbers."""
    return listed([f"{x:.6g}" for x in numbers], _SHOWN)


def in_words(source: Dissipation, averaged: Average) -> dict[str, Any]:
    """The method of the average, its formula, and its numbers."""
    known = averaged.closed_form
    if known is not None:
        method = "closed form: minimum of each threshold over the phase"
        return {"method": method, "psi_av": summed(known.terms), **known.numbers}
    low, high = extremes(averaged)
    words = (
        f"{low:.6g} |v|"
        if high - low <= _TOLERANCE * high
        else f"between {low:.6g} |v| and {high:.6g} |v|"
    )
    return {
        "method": "intersection of K(s) over all phases, by cone programs with tolerance "
        f"{_TOLERANCE:.0e}",
        "psi_av": words + ("" if source.dimension <= 2 else " along random directions"),
        "extremes": [low, high],
    }


def summed(terms: list[str]) -> str:
    """A sum, shortened in the middle."""
    if len(terms) > _SHOWN:
        terms = [*terms[: _SHOWN - 2], f"... ({len(terms)} terms)", terms[-1]]
    return " + ".join(terms)


def extremes(averaged: Average) -> tuple[float, float]:
    """Smallest and largest Ψ_av of unit vectors: over all directions in the plane, over random
    directions in space."""
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


# -- evolve ----------------------------------------------------------------------------------------
