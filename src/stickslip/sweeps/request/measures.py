"""The named measures of long-term motions, each a row of
:data:`stickslip.model.formats.measurable.MEASURABLE`.

They measure a cycle, rest, steady sliding, or the last part of a motion that has not converged;
some are defined for cycles only.

A measure of a component is that of the first component of the state, unless one is named:
``amplitude:x``. In its place there may be an output, an unknown of a structure, a force or any
other formula of the variables of results: ``high:tip``, ``amplitude:u[tip] - u[root]``,
``mean:friction_ground``.

If a drive is given for a limited time, such as an earthquake record, there is no long-term motion:
the motion over the declared span is measured, and measures of cycles are refused.

Harmonics, energies per distance, and all measures of formulas compute the period once more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import derive
from stickslip.errors import DeclarationError, listing, short, suggestion
from stickslip.model.formats.measurable import MEASURABLE, Measurable
from stickslip.model.system import System
from stickslip.motion.audit.observers import LASTED, STUCK
from stickslip.motion.between.formulas import read_formula
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem
from stickslip.orbits.cycles.measure import dissipated_by
from stickslip.orbits.settling.motions import ATTRACTORS, MEASURED, Observed
from stickslip.stopping.scopes import TimeUp, watching
from stickslip.sweeps.request import one_period
from stickslip.sweeps.request.carry import CARRIED
from stickslip.sweeps.request.one_period import PeriodRule

if TYPE_CHECKING:
    import xarray

    from stickslip.orbits.settling.motions import Settings


Rule = Callable[[Problem, Observed, str], Array]


def _component(problem: Problem, of: str) -> int:
    return problem.compiled.layout.state.index(of) if of else 0


def _contact(problem: Problem, of: str) -> list[int]:
    """Numbers of a contact: those of both components for a planar contact, which slip together."""
    numbers = problem.compiled.equations.numbers
    return [numbers[part] for part in problem.system.frictional.get(of, (of,))]


def _period(problem: Problem, o: Observed, of: str) -> Array:
    return np.where(o.outcome == Outcome.PERIODIC.code, o.duration, np.nan)


def _amplitude(problem: Problem, o: Observed, of: str) -> Array:
    i = _component(problem, of)
    return 0.5 * (o.sums.high[:, i] - o.sums.low[:, i])


def _speed(problem: Problem, o: Observed, of: str) -> Array:
    if of:
        return o.found.shift[:, _component(problem, of)] / o.duration
    return o.found.shift @ o.translation / (o.translation @ o.translation) / o.duration


def _stick_fraction(problem: Problem, o: Observed, of: str) -> Array:
    stuck = o.sums.stick[:, _contact(problem, of)[0]] if of else o.sums.total[:, STUCK]
    return stuck / o.sums.total[:, LASTED]


def _energy(problem: Problem, o: Observed, of: str) -> Array:
    own = _contact(problem, of) if of else slice(None)
    work = np.sum(o.sums.work[:, own], axis=1)
    return np.where(o.outcome == Outcome.PERIODIC.code, work, np.nan)


def _peak(problem: Problem, o: Observed, of: str) -> Array:
    return (
        o.sums.peak[:, _contact(problem, of)[0]] if of else np.max(o.sums.peak, axis=1, initial=0.0)
    )


def _mean(problem: Problem, o: Observed, of: str) -> Array:
    impulse = o.sums.impulse[:, _contact(problem, of)[0]] if of else np.sum(o.sums.impulse, axis=1)
    return impulse / o.duration


def _switches(problem: Problem, o: Observed, of: str) -> Array:
    return np.where(o.outcome == Outcome.PERIODIC.code, o.sums.switches[:, 0], np.nan)


def _lyapunov(problem: Problem, o: Observed, of: str) -> Array:
    return o.found.exponent


def _low(problem: Problem, o: Observed, of: str) -> Array:
    return o.sums.low[:, _component(problem, of)]


def _high(problem: Problem, o: Observed, of: str) -> Array:
    return o.sums.high[:, _component(problem, of)]


def _shift(problem: Problem, o: Observed, of: str) -> Array:
    return o.found.shift[:, _component(problem, of)]


def _state(problem: Problem, o: Observed, of: str) -> Array:
    return o.state[:, _component(problem, of)]


def _time(problem: Problem, o: Observed, of: str) -> Array:
    return o.time


def _duration(problem: Problem, o: Observed, of: str) -> Array:
    return o.duration


@dataclass(frozen=True)
class Named:
    """A measure: its rule, whether it needs more than the knots, and its rule for the motion of a
    period, which is the only one for formulas."""

    said: Measurable
    rule: Rule | None
    closely: bool
    again: PeriodRule | None


# Rules of measures that the engine accumulates, and whether they need more than the knots.
_SUMMED: dict[str, tuple[Rule, bool]] = {
    "period": (_period, False),
    "amplitude": (_amplitude, True),
    "speed": (_speed, False),
    "stick_fraction": (_stick_fraction, False),
    "energy_per_cycle": (_energy, True),
    "peak_force": (_peak, True),
    "mean_force": (_mean, True),
    "switches": (_switches, False),
    "lyapunov": (_lyapunov, False),
    "low": (_low, True),
    "high": (_high, True),
    "shift": (_shift, False),
    "state": (_state, False),
    "time": (_time, False),
    "duration": (_duration, False),
}
MEASURES = {
    name: Named(said, *_SUMMED.get(name, (None, False)), one_period.RULES.get(name))
    for name, said in MEASURABLE.items()
}


def ends_with_samples(system: System) -> bool:
    """Return whether a drive of the system is defined for a limited time only, so that no motion
    settles; the motion over the declared span is then measured."""
    return any(drive.ends for drive in system.declaration.given.values())


def needs_close_look(system: System, measures: Sequence[str]) -> bool:
    """Return whether one of the measures needs more than the knots; rejects unknown measures.

    Raises
    ------
    DeclarationError
        If there is no such measure, or the system has no such component or contact.
    """
    close = [
        _named(system, measure).closely and not _of_formula(system, measure) for measure in measures
    ]
    return any(close)


def _of_formula(system: System, measure: str) -> bool:
    """Return whether a measure is of a formula, since the engine accumulates sums of the state
    alone."""
    name, _, of = measure.partition(":")
    known = MEASURES[name]
    both = known.rule is not None and known.again is not None
    return both and bool(of) and of not in system.declaration.places


def _named(system: System, measure: str) -> Named:
    name, _, of = measure.partition(":")
    if name not in MEASURES:
        known = suggestion(name, MEASURES, accepts=lambda x: _named(system, x))
        raise DeclarationError("measure", f"unknown measure '{short(name)}'", known)
    known = {
        "component": system.declaration.state,
        "contact": list(system.frictional),
        "force": list(system.dry_contacts),
    }.get(MEASURES[name].said.of, [])
    opening = [c.name for c in system.declaration.contacts if c.opens]
    unknown = of not in known and not (MEASURES[name].said.of == "contact" and of in opening)
    if of and (MEASURES[name].said.of == "quantity" or _of_formula(system, measure)):
        remedy = "Declare it under 'outputs', and use its name"
        one_period.check_variable(of, f"measure.{name}", remedy)
        with listing(lambda x: _named(system, f"{name}:{x}")):
            read_formula(system, of, f"measure.{name}")
    elif of and unknown and MEASURES[name].said.of != "weight":
        remedy = suggestion(of, known, accepts=lambda x: _named(system, f"{name}:{x}"))
        remedy = remedy if known else f"Use '{name}'"
        raise DeclarationError(f"measure.{name}", f"unknown quantity '{short(of)}'", remedy)
    if name == "speed" and not of and not system.translation:
        raise DeclarationError(
            "measure.speed",
            f"{system.name} declares no translation",
            "Name a component, like speed:x",
        )
    asked = of or (next(iter(system.dry_contacts), "") if name == "mean_force" else "")
    if name in {"peak_force", "mean_force"}:
        for own in derive(system.declaration).members:
            others = " and ".join(f"'{c.name}'" for c in own if c.name != asked)
            if others and asked in {c.name for c in own}:
                raise DeclarationError(
                    f"measure.{name}",
                    f"'{asked}' has the same direction as {others}: in stick only the sum of "
                    "their forces is determined",
                    "Combine them into one contact, with the sum of the thresholds",
                )
    one_period.check_period_measure(system, name, of)
    if ends_with_samples(system) and not MEASURES[name].said.of_a_span:
        raise DeclarationError(
            f"measure.{name}",
            f"the samples that drive {system.name} end, so no motion settles",
            f"Use {', '.join(n for n, m in MEASURABLE.items() if m.of_a_span)}, or your own "
            "functions",
        )
    return MEASURES[name]


def measured(
    problem: Problem, observed: Observed, measures: Sequence[str], tolerance: float
) -> dict[str, Array]:
    """Values of the measures by name, and outcome, certificate, its failed criterion, and the
    excess of the start."""
    failed = ~np.isin(observed.outcome, [o.code for o in (*MEASURED, Outcome.FINISHED)])
    result = {"outcome": observed.outcome.astype(np.int8)}
    result["certificate"] = np.where(failed, np.nan, np.max(observed.found.audit, axis=1))
    result["lacking"] = first_missing(observed, tolerance)
    result["excess"] = observed.excess
    for measure in measures:
        name, _, of = measure.partition(":")
        rule = MEASURES[name].rule
        if rule is not None and not _of_formula(problem.system, measure):
            with np.errstate(invalid="ignore", divide="ignore"):
                result[measure] = np.where(failed, np.nan, rule(problem, observed, of))
    return result


def measured_again(
    problem: Problem,
    table: Array,
    observed: Observed,
    measures: Sequence[str],
    settings: Settings,
    time_limit: float | None = None,
) -> dict[str, Array]:
    """Values of the measures that need the motion over the period; NaN if undefined, and no
    harmonics at rest. A motion that exceeds the time limit has the outcome of one.

    Parameters
    ----------
    table : array, shape (points, parameters)
    time_limit : float, optional
        Processor-time limit of each motion in seconds.
    """
    from stickslip.motion.simulate import simulate

    named = [(m, *m.partition(":")[::2]) for m in measures]
    wanted = [(m, name, _again(problem, m), of) for m, name, of in named]
    wanted = [(m, name, rule, of) for m, name, rule, of in wanted if rule is not None]
    result = {m: np.full(len(table), np.nan) for m, *_ in wanted}
    cycles = np.isin(observed.outcome, [Outcome.PERIODIC.code, Outcome.STEADY.code])
    known = np.isin(observed.outcome, [o.code for o in (*MEASURED, Outcome.FINISHED)])
    known &= observed.duration > 0.0
    for m in result:
        still = (observed.outcome == Outcome.AT_REST.code) & m.startswith("harmonic")
        result[m][still] = 0.0
    system = problem.system
    beyond = any(MEASURABLE[name].of_any for _, name, _, _ in wanted)
    for i in np.flatnonzero(known if beyond else cycles) if wanted else ():
        begin = float(observed.time[i])
        with watching(time_limit, processor=True) as scope:
            try:
                motion = simulate(
                    system,
                    (begin, begin + float(observed.duration[i])),
                    initial=dict(
                        zip(system.declaration.state, observed.state[i].tolist(), strict=True)
                    ),
                    parameters=dict(zip(system.parameters, table[i].tolist(), strict=True)),
                    rtol=settings.rtol,
                    atol=settings.atol,
                )
            except TimeUp as up:
                if not scope.ends(up):
                    raise
                observed.outcome[i] = Outcome.TIME_UP.code
                continue
        repeats = observed.outcome[i] == Outcome.PERIODIC.code
        for m, name, rule, of in wanted:
            suits = cycles[i] or MEASURABLE[name].of_any
            if motion.outcome.ok and suits and (repeats or rule is not dissipated_by):
                result[m][i] = rule(motion, of)
    return result


def _again(problem: Problem, measure: str) -> PeriodRule | None:
    """The rule of a measure that needs the motion of the period, as all measures of formulas do.
    For contacts that slip as one, only their total dissipation is known without it."""
    name, _, of = measure.partition(":")
    members = problem.compiled.equations.members
    if name == "energy_per_cycle" and any(
        len(own) > 1 and of in {c.name for c in own} for own in members
    ):
        return dissipated_by
    known = MEASURES[name]
    return known.again if known.rule is None or _of_formula(problem.system, measure) else None


def first_missing(observed: Observed, tolerance: float) -> Array:
    """Failed criteria of certificates, as positions in :data:`MISSING`: the first residual that is
    too large."""
    wrong = ~(observed.found.audit <= tolerance)
    found = np.where(np.any(wrong, axis=1), 1 + np.argmax(wrong, axis=1), 0)
    known = np.isin(observed.outcome, [o.code for o in (*ATTRACTORS, Outcome.FINISHED)])
    other = np.where(np.isin(observed.outcome, [o.code for o in MEASURED]), "attractor", "result")
    return np.where(known, found, [MISSING.index(name) for name in other]).astype(np.int8)


def certified_below(settings: Settings) -> float:
    """Largest certificate of a certified point."""
    return max(settings.tolerance, 10.0 * settings.rtol)


OWN = ("certificate", "lacking", "excess", "outcome")
"""Variables of every map, besides its measures."""


def measures_of(data: xarray.Dataset) -> list[str]:
    """The measures of a map, in the requested order."""
    order = data.attrs.get("stickslip_measures", "")
    others = [str(n) for n in data.data_vars if n not in OWN]
    names = [n for n in others if not (n.endswith("_missing") or n.startswith(CARRIED))]
    return sorted(names, key=lambda name: order.find(f'"{name}'))


def how_carried(data: xarray.Dataset) -> str:
    """Axis of a map along which the state was carried, and the direction."""
    return str(data.attrs.get("stickslip_carry", ""))


MISSING = (
    "nothing",
    "energy balance",
    "friction law",
    "equations of motion",
    "closure",
    "minimal period",
    "attractor",
    "result",
)
"""Conditions of a certificate that a point may miss; 0: none of them. The order of the residuals is
that of the audit."""
