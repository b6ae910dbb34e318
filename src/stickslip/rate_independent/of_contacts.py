"""Contacts as potentials: what a contact dissipates, and the forces that it holds, as an object of
the same kinds as those of evolutions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arguments import validated
from stickslip.errors import DeclarationError, suggestion
from stickslip.model.entries.keys import normal_force
from stickslip.rate_independent.sets.potential import Dissipation
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.model.declaration import DryContact
    from stickslip.model.system import System
    from stickslip.symbolic.expressions import Expr


@validated
def dissipation_of(
    system: System, contact: str, values: Mapping[str, float] | None = None
) -> Dissipation:
    """Return the dissipation potential Ψ of a contact, with its set of admissible forces.

    A contact that slips with the velocity u at its threshold dissipates Ψ(u) = s R(u); one that
    sticks holds the forces λ with −λ ∈ K = ∂Ψ(0), [M] section 2.1. Along a line K is the interval
    [−s⁻, s⁺]; in a plane and of a face it is an ellipsoid, or what the gradients of a formula fill.

    Parameters
    ----------
    system : System
    contact : str
        Its name.
    values : mapping of str to float, optional
        Values of ``t``, the state, parameters (else their defaults), and ``normal_foot`` for the
        normal force of a contact named foot, if the threshold depends on them.

    Raises
    ------
    DeclarationError
        If the contact is unknown, a value is missing, or the threshold is negative.
    """
    from stickslip.rate_independent.dissipation.ellipsoid import Ellipsoid
    from stickslip.rate_independent.dissipation.formula_sets import FormulaSets
    from stickslip.rate_independent.dissipation.weighted_l1 import WeightedL1

    own = _components(system, contact)
    given = _given(system, values or {})

    def number(e: Expr) -> float:
        lacking = sorted(e.symbols - given.keys())
        if lacking:
            raise DeclarationError(
                "values",
                f"the threshold of '{contact}' depends on '{lacking[0]}'",
                "Give its value",
            )
        return ex.evaluate(e, given)

    first = own[0]
    plus, minus = number(first.plus), number(first.minus)
    if not (0.0 <= plus < np.inf and 0.0 <= minus < np.inf):
        raise DeclarationError(
            "values",
            f"the threshold of '{contact}' is {plus:g} (forward) and {minus:g} (backward) there",
            "Give values at which it is not negative",
        )
    if len(own) == 1:
        return WeightedL1([plus], [minus])
    if first.dissipation is None:
        return Ellipsoid(np.diag([(plus * number(c.axis)) ** 2 for c in own]))
    formula = first.dissipation
    fixed = {name: ex.num(given[name]) for name in formula.ranges}
    value = ex.num(plus) * ex.substitute(formula.value, fixed, undefined=True)
    return FormulaSets(replace(formula, value=value, ranges={}))


def _components(system: System, contact: str) -> list[DryContact]:
    """A contact by its components."""
    found = [
        c
        for c in system.declaration.contacts
        if not c.opens and c.name == (f"{contact} {c.plane}" if c.plane else contact)
    ]
    if not found:
        rubbing = [c.name for c in system.declaration.contacts if not (c.opens or c.plane)]
        planes = [c.name.rpartition(" ")[0] for c in system.declaration.contacts if c.plane == 1]
        raise DeclarationError(
            "contact",
            f"unknown contact '{contact}', or a contact without friction",
            suggestion(contact, [*rubbing, *planes]),
        )
    return found


def _given(system: System, values: Mapping[str, float]) -> dict[str, float]:
    """Values of all names. The normal force of a constraint is that of one of its sides."""
    given = {**system.values, **values}
    for c in system.declaration.contacts:
        if c.opens and c.side_of:
            whole = normal_force(c.side_of)
            if whole in given:
                given[c.name] = given.pop(whole)
                given.update(
                    {
                        other.name: 0.0
                        for other in system.declaration.contacts
                        if other.opens and other.side_of == c.side_of and other is not c
                    }
                )
    return given
