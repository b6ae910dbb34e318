"""The linear problem for the rates of rate-independent coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from stickslip.errors import DeclarationError
from stickslip.model.declaration import Declaration, DryContact
from stickslip.model.entries.declared import Kind
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

if TYPE_CHECKING:
    from stickslip.equations.planes import Plane


@dataclass(frozen=True)
class RateProblem:
    """The problem for the rates of the rate-independent coordinates r (contact i moves coordinate
    i).

    Attributes
    ----------
    weight : list of Expr
        Direction coefficients jᵢ, uᵢ = jᵢ ṙᵢ − wᵢ.
    force : list of Expr
        λᵢ = (∂ᵢΦ − forceᵢ)/jᵢ, a function of the state.
    stiffness, rest : matrix and list of Expr
        d/dt λᵢ = Σⱼ stiffnessᵢⱼ ṙⱼ + restᵢ.
    """

    weight: list[Expr]
    force: list[Expr]
    stiffness: list[list[Expr]]
    rest: list[Expr]
    threshold_slope: tuple[list[list[Expr]], list[list[Expr]]]
    threshold_rest: tuple[list[Expr], list[Expr]]
    partial: list[list[Expr]]
    threshold_partial: tuple[list[list[Expr]], list[list[Expr]]]

    def sliding(self, plane: Plane, i: int, j: int, first: int) -> Expr:
        """Coefficient of ṙⱼ in the equation of coordinate i while a contact in a plane slips: of
        its first component d/dt(n·A⁻¹λ + s) = 0, of its second n × Au = 0.

        Parameters
        ----------
        i, j : int
            Coordinates.
        first : int
            Number of the first contact that moves a rate-independent coordinate.
        """
        n = [ex.sym(f"n:{part}") for part in plane.parts]
        own = [part - first for part in plane.parts]
        if i == own[0]:
            terms = [
                (x / axis * self.stiffness[k][j], 1.0)
                for x, axis, k in zip(n, plane.axes, own, strict=True)
            ]
            return ex.add(*terms, (self.threshold_slope[0][i][j] / plane.axes[0], 1.0))
        if j not in own:
            return ex.ZERO
        side = own.index(j)
        turned = plane.axes[side] * self.weight[j] * n[1 - side]
        return turned if side else -turned

    def sliding_rest(self, plane: Plane, i: int, speeds: list[Expr], first: int) -> Expr:
        """The rest of that equation.

        Parameters
        ----------
        i : int
            Coordinate.
        speeds : list of Expr
            Of the surface.
        first : int
            As in :meth:`sliding`.
        """
        n = [ex.sym(f"n:{part}") for part in plane.parts]
        own = [part - first for part in plane.parts]
        if i == own[0]:
            terms = [
                (x / axis * self.rest[k], 1.0)
                for x, axis, k in zip(n, plane.axes, own, strict=True)
            ]
            return ex.add(*terms, (self.threshold_rest[0][i] / plane.axes[0], 1.0))
        a, b = (axis * w for axis, w in zip(plane.axes, speeds, strict=True))
        return a * n[1] - b * n[0]


def rate_problem_of(
    d: Declaration, contacts: list[DryContact], slope: dict[str, Expr]
) -> RateProblem:
    """The problem for the rates of all rate-independent coordinates.

    Parameters
    ----------
    slope : dict of str to Expr
        ∂Φ/∂x less the given force, by coordinate.

    Raises
    ------
    DeclarationError
        If a force on such a coordinate depends on a velocity, or its rate is not linear in rates.
    """
    acting = [c for c in contacts if c.kind == Kind.RATE_INDEPENDENT]
    names = d.rate_independent
    weight = [c.direction[r] for c, r in zip(acting, names, strict=True)]
    force = [slope[r] / j for r, j in zip(names, weight, strict=True)]
    rates = {
        "t": ex.ONE,
        **{x: ex.sym(f"d_{x}") for x in d.coordinates},
        **{a: d.laws[a] for a in d.internal},
    }

    def split(e: Expr, where: str) -> tuple[list[Expr], Expr]:
        if any(f"d_{q}" in e.symbols for q in d.inertial):
            raise DeclarationError(
                where,
                "a force on a rate-independent coordinate depends on a velocity",
                "Use t, coordinates and internal variables only",
            )
        total = ex.along(e, rates)
        linear = [ex.derivative(total, f"d_{r}") for r in names]
        own = {f"d_{r}" for r in names}
        if any(part.symbols & own for part in linear) or ex.bends(total, own):
            raise DeclarationError(
                where,
                "its rate is not linear in the rates of the rate-independent coordinates",
                "Make the law linear in these rates",
            )
        return linear, ex.substitute(total, {r: ex.ZERO for r in own})

    def rows(expressions: list[Expr]) -> tuple[list[list[Expr]], list[Expr]]:
        pairs = [split(e, f"contacts.'{c.name}'") for e, c in zip(expressions, acting, strict=True)]
        return [p[0] for p in pairs], [p[1] for p in pairs]

    def partials(expressions: list[Expr]) -> list[list[Expr]]:
        return [[ex.derivative(e, r) for r in names] for e in expressions]

    stiffness, rest = rows(force)
    plus, minus = [c.plus for c in acting], [c.minus for c in acting]
    (slope_plus, rest_plus), (slope_minus, rest_minus) = rows(plus), rows(minus)
    return RateProblem(
        weight,
        force,
        stiffness,
        rest,
        (slope_plus, slope_minus),
        (rest_plus, rest_minus),
        partials(force),
        (partials(plus), partials(minus)),
    )
