"""Potentials given by a formula: any convex R."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.convex.formula import ConvexFormula, convex_formula
from stickslip.errors import DeclarationError
from stickslip.rate_independent.dissipation.formula_sets import FormulaSets
from stickslip.rate_independent.dissipation.recognised import recognised
from stickslip.rate_independent.sets.cones import ConeForm
from stickslip.rate_independent.sets.potential import Average, Dissipation
from stickslip.rate_independent.sets.stable_sets import StableSets
from stickslip.rate_independent.sets.stretches import AtPhases, Near, Stretches
from stickslip.rate_independent.signals.signal import OF_PHASE, Signal
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Scope, check_name, formula_text, is_finite

_COMPONENT = re.compile(r"\bv([1-9]\d{0,3})\b")
_PHASE = OF_PHASE.name
_MOST_COMPONENTS = 64


@dataclass(frozen=True, eq=False)
class SupportFormula(Dissipation, kind="formula"):
    """Ψ(s, v) as a formula in v1, ..., vn and the phase s; K(s) is filled by its gradients.

    Parameters
    ----------
    formula : str or number
        Ψ: nonnegative, convex and homogeneous of degree 1 in ``v1``, ..., ``vn``, of period 1 in
        ``s``. It may have kinks, so that K(s) has corners and flat sides, and need not be even.
    dimension : int, optional
        n; by default the largest number of a component in the formula.
    parameters : mapping of str to float, optional
        Values of other names in the formula.

    Attributes
    ----------
    convex : ConvexFormula
        The formula with its derivatives, and what is proved of it.
    form : Dissipation
        What answers: a potential of another kind if the formula is seen to be one (a weighted l1
        norm, an ellipsoid, a polytope, a product), else the sets that its gradients fill.

    Raises
    ------
    DeclarationError
        If the formula cannot be read, is negative or undefined somewhere, is not homogeneous of
        degree 1 or not of period 1, or is not convex; then two motions show it.

    Notes
    -----
    That the formula is convex is proved by its form (sums, the larger of two, norms), or by bounds
    of its second derivatives in all directions; ``convex.said`` says how. What can be proved in
    neither way is convex as sampled, and certificates say so.

    Nearest points are exact to rounding. Where the formula is of no other kind, Newton's method
    finds the motion that is normal to K(s), also where the formula has a kink in it.
    """

    formula: Any
    dimension: int = field(default=0, metadata={"plain": True})  # type: ignore[assignment]
    parameters: Mapping[str, float] | None = field(default=None, metadata={"plain": True})
    convex: ConvexFormula = field(init=False, repr=False)
    form: Dissipation = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = self._read_dimension()
        names = tuple(f"v{i + 1}" for i in range(count))
        parameters = _read_parameters({} if self.parameters is None else self.parameters)
        scope = Scope({name: ex.sym(name) for name in (*names, _PHASE)} | parameters)
        value = scope.parse(self.formula, "formula")
        varies = _PHASE in value.symbols
        ranges = {_PHASE: (0.0, 1.0)} if varies else {}
        checked = convex_formula(value, names, ranges, "formula", symbol="Psi")
        object.__setattr__(self, "dimension", count)
        object.__setattr__(self, "convex", checked)
        form = recognised(value, names, ranges) or FormulaSets(checked)
        object.__setattr__(self, "form", form)
        if varies:
            self._check_period()

    def _read_dimension(self) -> int:
        text = self.formula
        used = text.symbols if isinstance(text, Expr) else {f"v{i}" for i in _components(text)}
        largest = max((int(i) for name in used for i in _components(name)), default=0)
        given: Any = self.dimension
        if isinstance(given, bool) or not isinstance(given, int | np.integer) or given < 0:
            raise DeclarationError(
                "dimension", f"{given!r} is not a dimension", "Give 1, 2, 3, ..."
            )
        if given and largest > given:
            raise DeclarationError(
                "formula",
                f"it contains the component v{largest}, but n = {given}",
                "Correct one of them",
            )
        count = int(given) or largest
        if not count:
            raise DeclarationError(
                "formula",
                "it contains no component v1, v2, ...",
                "Write the formula in v1, v2, ..., or give n",
            )
        if count > _MOST_COMPONENTS:
            raise DeclarationError(
                "formula",
                f"it has {count} components (at most {_MOST_COMPONENTS})",
                "Use a Product of smaller ones",
            )
        return count

    def _check_period(self) -> None:
        v = np.random.default_rng(0).normal(size=(self.dimension, 16))
        start, end = (self.convex.values(np.vstack([v, np.full(16, s)]))[0] for s in (0.0, 1.0))
        off = np.abs(end - start) - 1e-9 * np.maximum(np.abs(start), np.abs(end))
        if (off > 0.0).any():
            raise DeclarationError(
                "formula",
                "it differs between the phases s = 0 and s = 1",
                "Write it with period 1 in s",
            )

    @classmethod
    def variables(cls, given: Mapping[str, Any]) -> tuple[str, ...]:
        count = given.get("dimension") or 0
        largest = max(_components(given.get("formula", "")), default=0)
        count = max(count if isinstance(count, int) else 0, largest)
        return tuple(f"v{i + 1}" for i in range(min(count, _MOST_COMPONENTS)))

    def _formula(self) -> str:
        if isinstance(self.formula, str) and not self.parameters:
            return self.formula
        return formula_text(self.convex.value, "dissipation")

    @property
    def depends_on_phase(self) -> bool:
        return bool(self.convex.ranges)

    @property
    def doubt(self) -> str:
        return FormulaSets(self.convex).doubt

    def hessian(self, v: ArrayLike, s: float = 0.0) -> Array:
        """Second derivatives of Ψ(s, ·) at v, shape (n, n): how the point that v exposes turns with
        v; NaN on a kink.

        Parameters
        ----------
        v : array of shape (n,)
            Not 0.
        s : float
            Phase.
        """
        return FormulaSets(self.convex).hessian(v, s)

    # -- what the form answers ---------------------------------------------------------------------

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        return self.form.support(v, s)

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        return self.form.exposed(v, s)

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        return self.form.project(xi, s, metric)

    def member(self, xi: Array, s: float) -> Array:
        return self.form.member(xi, s)

    def projection(self, xi: Array, s: float = 0.0) -> tuple[Array, Array]:
        return self.form.projection(xi, s)

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        return self.form.excess(xi, s)

    @validated
    def gauge(self, xi: ArrayLike, s: float = 0.0) -> float:
        return self.form.gauge(xi, s)

    def holds(self, xi: Array, s: float, noise: float) -> bool:
        return self.form.holds(xi, s, noise)

    def cone_form(self, s: float) -> ConeForm | None:
        return self.form.cone_form(s)

    def average(self, tolerance: float = 1e-8) -> Average:
        return self.form.average(tolerance)

    def sampled(self, phases: Array) -> AtPhases:
        return self.form.sampled(phases)

    def sets(self, phases: Array) -> StableSets:
        return self.form.sets(phases)

    @property
    def thresholds(self) -> tuple[Signal, Signal] | None:
        return self.form.thresholds

    def halfspaces(self, phases: Array) -> tuple[Array, Array] | None:
        return self.form.halfspaces(phases)

    @property
    def bounded(self) -> bool:
        return self.form.bounded

    def over(self, low: Array, high: Array) -> Stretches[Any]:
        return self.form.over(low, high)

    def closest(self, phases: Array, xi: Array) -> Array:
        return self.form.closest(phases, xi)

    def around(self, phases: Array, xi: Array, enough: float) -> Near:
        return self.form.around(phases, xi, enough)


def _components(text: object) -> list[int]:
    """Numbers of the components in a formula."""
    return [int(i) for i in _COMPONENT.findall(text)] if isinstance(text, str) else []


def _read_parameters(given: Any) -> dict[str, Expr]:
    if not isinstance(given, Mapping):
        raise DeclarationError(
            "parameters", f"a {type(given).__name__} is not a mapping", "Give {name: value}"
        )
    for name, value in given.items():
        where = f"parameters.{name}"
        check_name(name, where)
        if name == _PHASE or _COMPONENT.fullmatch(name):
            raise DeclarationError(where, f"'{name}' is reserved", "Choose another name")
        if not is_finite(value):
            raise DeclarationError(where, f"{value!r} is not a finite number", "Give a number")
    return {name: ex.num(float(value)) for name, value in given.items()}
