"""What the swings of a study are those of: a smooth formula of places and velocities, and its
rate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.model.system import System
from stickslip.motion.between.formulas import Along, evaluated, read_formula
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.cycles.over_period import linear_form
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

ValuesAndRates = Callable[[Array, AnyArray], tuple[Array, Array]]


@dataclass(frozen=True)
class Swinging:
    """A function of the coordinates with mass and of their rates, without kinks.

    Attributes
    ----------
    name : str
        A coordinate, an unknown of a structure, an output, or a formula of these.
    value, rate : Expr
        The function and its derivative by time, of what results show.
    state : tuple of str
        Names of the state.
    row, rates : array, shape (states,), or None
        Where it is a linear form of places with constant coefficients: these, and those of its
        rate.
    offset : float
        What is added to such a form.
    """

    name: str
    value: Expr
    rate: Expr
    state: tuple[str, ...]
    row: Array | None
    rates: Array | None
    offset: float = 0.0

    def along(self, motion: Trajectory) -> ValuesAndRates:
        """Values and rates at times since the origin, within the steps of knots.

        Parameters
        ----------
        motion : Trajectory
        """
        row, rates, offset = self.row, self.rates, self.offset
        if row is not None and rates is not None:

            def linear(clock: Array, index: AnyArray) -> tuple[Array, Array]:
                states = motion._states_on_clock(clock, index)
                return states @ row + offset, states @ rates

            return linear
        formulas = Along(motion, [self.value, self.rate])

        def computed(clock: Array, index: AnyArray) -> tuple[Array, Array]:
            found = formulas.on_clock(clock, index)
            if not np.all(np.isfinite(found)):
                raise DeclarationError(
                    "of",
                    f"'{short(self.name)}', or its rate, is undefined on the way",
                    "Follow what is a number everywhere",
                )
            return found[:, 0], found[:, 1]

        return computed

    def gradient(self, state: Array, parameters: Mapping[str, float]) -> Array:
        """Derivatives by the state, shape (states,).

        Parameters
        ----------
        state : array, shape (states,)
        parameters : mapping of str to float
        """
        if self.row is not None:
            return self.row
        slopes = [ex.derivative(self.value, x) for x in self.state]
        at = {**dict(zip(self.state, map(float, state), strict=True)), **parameters}
        return evaluated(slopes, at, 1)[:, 0]


def read_swinging(system: System, of: str | None, values: Mapping[str, float]) -> Swinging:
    """Whose swings are asked for.

    Parameters
    ----------
    system : System
    of : str or None
        By default the first inertial coordinate, or the first unknown of a structure.
    values : mapping of str to float
        Of all parameters.

    Raises
    ------
    DeclarationError
        If it is neither a name nor a formula of what results show, or not a smooth function of
        places and velocities alone.
    """
    declared = system.declaration
    inertial = list(declared.inertial)
    usual = [x for x in inertial if x in system.coordinates]
    usual += [x for x in system.places if system.unknown(x)]
    known = [*usual, *(inertial if not usual else []), *system.outputs]
    if not inertial:
        raise DeclarationError(
            system.name, "no coordinate has a mass", "Give an inertial coordinate that swings"
        )
    name = known[0] if of is None else of
    formula = read_formula(system, name, "of")
    if "t" in formula.symbols:
        zeros = {x: ex.ZERO for x, value in values.items() if value == 0.0}
        formula = ex.substitute(formula, zeros, undefined=True)
    rates = {**{q: f"d_{q}" for q in inertial}, **{f"d_{q}": f"dd_{q}" for q in inertial}}
    felt = sorted(formula.symbols - values.keys())
    reason = _refused(system, felt, rates)
    if not reason and ex.bends(formula, felt):
        reason = "it has kinks or jumps"
    if reason:
        raise DeclarationError("of", f"'{short(name)}': {reason}", suggestion("", known))
    rate = ex.add(*((ex.derivative(formula, x) * ex.sym(rates[x]), 1.0) for x in felt))
    state = tuple(declared.state)
    form = linear_form(inertial, values, formula)
    if form is None:
        return Swinging(name, formula, rate, state, None, None)
    row, slope = np.zeros(len(state)), np.zeros(len(state))
    for x, weight in form.weights.items():
        row[declared.places[x]] = slope[declared.places[f"d_{x}"]] = weight
    return Swinging(name, formula, rate, state, row, slope, ex.evaluate(form.rest, values))


def _refused(system: System, felt: list[str], rates: Mapping[str, str]) -> str:
    """Why a formula of some names has no swings; empty if it may have."""
    others = [x for x in felt if x not in rates]
    if "t" in others:
        return "it depends on time by itself"
    if others:
        massless = {*system.declaration.state, *(f"d_{x}" for x in system.declaration.coordinates)}
        if others[0] in massless:
            return f"{others[0]} has no mass: it does not swing by itself"
        return f"{others[0]} may jump: only places and velocities swing"
    return "" if felt else "it does not move"
