"""The oscillating quantity of a backbone or a ring-down: a smooth formula of positions and
velocities, and its rate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.errors import DeclarationError, listing, short, suggestion
from stickslip.model.system import System
from stickslip.motion.between.formulas import Along, evaluated, read_formula
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.cycles.over_period import linear_form
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

_LARGEST = 1e150  # largest value: its square is finite, as products of slopes have to be

ValuesAndRates = Callable[[Array, AnyArray], tuple[Array, Array]]


@dataclass(frozen=True)
class Swinging:
    """A function of the inertial coordinates and their rates, without kinks.

    Attributes
    ----------
    name : str
        A coordinate, an unknown of a structure, an output, or a formula of these.
    value : Expr
        The function, in terms of the variables of results.
    state : tuple of str
        Names of the state.
    row, rates : array, shape (states,), or None
        Coefficients of the function and of its rate, if it is a linear form of positions with
        constant coefficients.
    offset : float
        Constant that is added to the linear form.
    """

    name: str
    value: Expr
    state: tuple[str, ...]
    row: Array | None
    rates: Array | None
    offset: float = 0.0

    def along(self, motion: Trajectory) -> ValuesAndRates:
        """Values and rates at times since the origin, within the steps of knots."""
        row, rates, offset = self.row, self.rates, self.offset
        if row is not None and rates is not None:

            def linear(clock: Array, index: AnyArray) -> tuple[Array, Array]:
                states = motion.dense_output.states(clock, index)
                values = states @ row
                return values + offset if offset else values, states @ rates

            return linear
        names = _rates(motion.system)
        felt = sorted(self.value.symbols & names.keys())
        rate = ex.add(*((ex.derivative(self.value, x) * ex.sym(names[x]), 1.0) for x in felt))
        formulas = Along(motion, [self.value, rate, *_divisors(self.value)])

        def computed(clock: Array, index: AnyArray) -> tuple[Array, Array]:
            found = formulas.on_clock(clock, index)
            divisors = found[:, 2:]
            # A divisor of both signs has been zero in between.
            poles = np.any(divisors <= 0.0, axis=0) & np.any(divisors >= 0.0, axis=0)
            # The slope of a cubic between two values has to be finite, too.
            large = np.abs(found) > _LARGEST
            if not np.all(np.isfinite(found)) or np.any(poles) or np.any(large):
                raise DeclarationError(
                    "of",
                    f"'{short(self.name)}', or its rate, becomes undefined or infinite during the "
                    "motion",
                    "Choose a formula that is defined everywhere",
                )
            return found[:, 0], found[:, 1]

        return computed

    def gradient(self, state: Array, parameters: Mapping[str, float]) -> Array:
        """Derivatives with respect to the state, shape (states,)."""
        if self.row is not None:
            return self.row
        slopes = [ex.derivative(self.value, x) for x in self.state]
        at = {**dict(zip(self.state, map(float, state), strict=True)), **parameters}
        found = evaluated(slopes, at, 1)[:, 0]
        if not np.all(np.isfinite(found)):
            raise DeclarationError(
                "of",
                f"'{short(self.name)}' has no finite slope in the middle of small oscillations",
                "Choose a formula that is smooth there",
            )
        return found


def read_swinging(system: System, of: str | None, values: Mapping[str, float]) -> Swinging:
    """Read the oscillating quantity of a study.

    Parameters
    ----------
    of : str or None
        By default the first inertial coordinate, or the first unknown of a structure.
    values : mapping of str to float
        Of all parameters.

    Raises
    ------
    DeclarationError
        If it is neither a name nor a formula of variables of results, or not a smooth function of
        positions and velocities only.
    """
    with listing(lambda name: _read_swinging(system, name, values)):
        return _read_swinging(system, of, values)


def _read_swinging(system: System, of: str | None, values: Mapping[str, float]) -> Swinging:
    declared = system.declaration
    inertial = list(declared.inertial)
    usual = [x for x in inertial if x in system.coordinates]
    usual += [x for x in system.places if system.unknown(x)]
    known = [*usual, *(inertial if not usual else []), *system.outputs]
    if not inertial:
        raise DeclarationError(
            system.name, "no coordinate has a mass", "Declare an inertial coordinate"
        )
    name = known[0] if of is None else of
    formula = read_formula(system, name, "of")
    if "t" in formula.symbols:
        zeros = {x: ex.ZERO for x, value in values.items() if value == 0.0}
        formula = ex.substitute(formula, zeros, undefined=True)
    felt = sorted(formula.symbols - values.keys())
    reason = _refused(system, felt)
    if not reason and ex.bends(formula, felt):
        reason = "it has kinks or jumps"
    if reason:
        known = suggestion("", known, accepts=lambda x: _read_swinging(system, x, values))
        raise DeclarationError("of", f"'{short(name)}': {reason}", known)
    state = tuple(declared.state)
    form = linear_form(inertial, values, formula)
    if form is None:
        return Swinging(name, formula, state, None, None)
    row, slope = np.zeros(len(state)), np.zeros(len(state))
    for x, weight in form.weights.items():
        row[declared.places[x]] = slope[declared.places[f"d_{x}"]] = weight
    return Swinging(name, formula, state, row, slope, ex.evaluate(form.rest, values))


def _divisors(formula: Expr) -> list[Expr]:
    """Denominators of a formula that are not constant."""
    products = [e for e in ex.walk([formula]) if e.op == "prod"]
    bases = (base for e in products for base, power in e.terms if power < 0.0 and base.symbols)
    return list(dict.fromkeys(bases))


def _rates(system: System) -> dict[str, str]:
    """Names of the time derivatives of inertial coordinates and of their rates."""
    inertial = system.declaration.inertial
    return {**{q: f"d_{q}" for q in inertial}, **{f"d_{q}": f"dd_{q}" for q in inertial}}


def _refused(system: System, felt: list[str]) -> str:
    """Reason why a formula of some names is refused; empty if it is accepted."""
    rates = _rates(system)
    others = [x for x in felt if x not in rates]
    if "t" in others:
        return "it depends explicitly on time"
    if others:
        massless = {*system.declaration.state, *(f"d_{x}" for x in system.declaration.coordinates)}
        if others[0] in massless:
            return f"{others[0]} has no mass and does not oscillate by itself"
        return f"{others[0]} may jump; only positions and velocities are allowed"
    return "" if felt else "it is constant"
