"""A user-defined rate-independent evolution: the stable set of its dissipation potential over the
phase, its average, and the motions of both.

Mielke 2017, Theorem 2.2: as ε → 0 the motions z_ε with Ψ(t/ε, ·) converge to the motion with Ψ_av,
whose stable set is the intersection of all K(s).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.display.symbols import unicode_symbol
from stickslip.errors import DeclarationError, StickslipError
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import Request, real_number
from stickslip.explorer.subject.results import verdict
from stickslip.explorer.subject.systems import check_no_files
from stickslip.explorer.work.model import parameter_rows

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation
    from stickslip.rate_independent.evolution.evolution import Evolution
    from stickslip.rate_independent.evolution.history import History
    from stickslip.rate_independent.evolution.model import EvolutionModel
    from stickslip.rate_independent.play.operator import Play

_LARGEST = 40  # components of an evolution that a page computes
_SHOWN = 6  # components that are drawn
_TIMES = 2000
_PHASES = 256  # number of phases at which K(s) is evaluated
_SETS = 12  # number of these sets that are drawn in the plane
_RAYS = 360  # points of a boundary


def follow_evolution(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """The declaration with its sets; then the averaged motion; then the motion itself.

    Raises
    ------
    DeclarationError
        If the text is no evolution, or has too many components for a page.
    """
    from stickslip.rate_independent.evolution.blocks import evolved

    model = _configured(request)
    n = model.potential.dimension
    if n > _LARGEST:
        reason = f"it has {n} components; the explorer computes at most {_LARGEST}"
        raise DeclarationError("dissipation", reason, "Use the command line: stickslip evolve FILE")
    names = [f"z_{i + 1}" if n > 1 else "z" for i in range(min(n, _SHOWN))]
    head = {
        "title": model.title or model.name,
        "source": model.source,
        "parameters": parameter_rows(model.parameters),
        "names": [unicode_symbol(name) for name in names],
        "moves": model.is_evolution,
    }
    costs, arrays = _costs(model, len(names))
    yield Answer({"part": "sets", **head, "costs": costs}, arrays)
    for averaged in (True, False) if model.is_evolution else ():
        part = "averaged" if averaged else "resolved"
        try:
            found = evolved(model, averaged, cancellation.check)
        except StickslipError as error:
            yield Answer({"part": part, "reason": str(error)})
            continue
        times, states = _drawn(found)
        said = verdict(found) | {"part": part}
        yield Answer(said, _motion(model.problem, times, states, len(names)))


def _configured(request: Request) -> EvolutionModel:
    """The model of a page, with its parameter values."""
    given = request.options.get("values", {})
    if not isinstance(given, dict):
        raise DeclarationError("values", "not a table", "Reload the page")
    numbers = {str(name): real_number(value, str(name)) for name, value in given.items()}
    return _declared(request.text("toml")).configure(numbers)


@lru_cache(maxsize=8)
def _declared(text: str) -> EvolutionModel:
    from stickslip.rate_independent.evolution.evolution_file import EVOLUTIONS

    check_no_files(text)
    return EVOLUTIONS.loads(text, "model file")


def _costs(model: EvolutionModel, shown: int) -> tuple[list[dict[str, Any]], dict[str, Array]]:
    """Costs of moving each component forward and backward, over a phase and on average; in the
    plane also the sets."""
    from stickslip.rate_independent.sets.plane import stable_boundary

    potential = model.potential
    average = potential.average()
    phases = np.arange(_PHASES) / _PHASES if potential.depends_on_phase else np.zeros(1)
    sampled = potential.sampled(phases)
    costs: list[dict[str, Any]] = []
    arrays = {"s": np.append(phases, 1.0)}
    for i in range(shown):
        e = np.eye(potential.dimension)[i]
        for side, v in (("plus", e), ("minus", -e)):
            over = sampled.support(v)
            arrays[f"{side}:{i}"] = np.append(over, over[0])
        costs.append(
            {
                "plus": float(average.support(e)),
                "minus": float(average.support(-e)),
                "plus_at": float(phases[np.argmin(arrays[f"plus:{i}"][:-1])]),
                "minus_at": float(phases[np.argmin(arrays[f"minus:{i}"][:-1])]),
                "mean": float(np.mean((arrays[f"plus:{i}"] + arrays[f"minus:{i}"])[:-1]) / 2.0),
            }
        )
    if potential.dimension == 2:
        chosen = phases[:: max(len(phases) // _SETS, 1)]
        borders = {f"set:{k}": np.array([s]) for k, s in enumerate(chosen.tolist())}
        for name, at in {**borders, "common": phases}.items():
            border = stable_boundary(potential, at, _RAYS)
            arrays[name] = np.vstack([border, border[:1]]).T
    return costs, arrays


def _drawn(found: History | Play) -> tuple[Array, Array]:
    """Times and states (m, n) of a motion at the resolution of the screen, including the switches
    of a play."""
    from stickslip.rate_independent.play.operator import Play

    if isinstance(found, Play):
        nodes = found.time[:: max(len(found.time) // _TIMES, 1)]
        times = np.union1d(np.linspace(found.time[0], found.time[-1], _TIMES), nodes)
        return times, found.position(times)[:, None]
    stride = max(len(found.times) // (2 * _TIMES), 1)
    return found.times[::stride], found.z[::stride]


def _motion(problem: Evolution, times: Array, states: Array, shown: int) -> dict[str, Array]:
    """States, and forces ℓ − A z, which friction balances."""
    forces = problem.ell.over(times) - (problem.A @ states.T).T
    arrays = {"t": times, "phase": times / problem.epsilon % 1.0}
    for i in range(shown):
        arrays |= {f"z:{i}": states[:, i], f"force:{i}": forces[:, i]}
    return arrays
