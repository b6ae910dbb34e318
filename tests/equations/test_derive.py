"""Derived forces, rate problems and powers, against sympy.

sympy reads the texts of a declaration by itself and forms the equations of motion from section 1
and 2 of the mathematics; both sides are then compared as numbers at random states.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
import sympy as sp

import stickslip as ss
from stickslip import (
    Contact,
    DeclarationError,
    Inertial,
    Internal,
    Parameter,
    RateIndependent,
    System,
    Viscous,
)
from stickslip.equations.derive import MotionEquations, derive
from stickslip.symbolic import expressions as ex

Values = dict[str, float]


def _parameters(**defaults: float) -> dict[str, Parameter]:
    return {name: Parameter(value) for name, value in defaults.items()}


MIXED = System(
    name="all three kinds",
    parameters=_parameters(
        m=2.0, n=1.5, j=0.3, k=1.1, c=0.4, nu=0.7, gain=0.2, rho=0.6, tau=2.0, w=0.1
    ),
    functions={"well(s)": "k/2*s**2 + gain*cos(2*s)", "weight(s)": "rho*(2 + tanh(s))"},
    drives={"pull": "gain*sin(3*t)"},
    coordinates={
        "q": Inertial(drag="c*d_q*sqrt(1 + d_q**2)", force="gain*sin(q)*a"),
        "p": Inertial(force="pull*t"),
        "z": Viscous(force="gain*a**2"),
        "r": RateIndependent(force="pull"),
        "s": RateIndependent(),
    },
    internal={"a": Internal("(1 - a)/tau + w*abs(d_z) + gain*d_q*q")},
    kinetic="m/2*d_q**2 + n/2*d_p**2 + j*d_q*d_p",
    potential="well(q - z) + well(z - r) + k*(r - s)**2 + k*s**2 + k/2*p**2*(1 + a**2) - pull*q*s "
    "+ exp(r/5)*s",
    viscous="nu/2*d_z**2 + c/2*(d_q - d_z)**2 + nu/3*d_p**2",
    contacts={
        "s on r's rail": Contact("2*d_s", threshold=("weight(q) + rho*t", "weight(-q)*(1 + a**2)")),
        "middle": Contact("d_z", threshold="weight(z)", kinetic="weight(z)/2"),
        "r": Contact("-d_r", threshold="weight(r - s)", surface_speed="w*sin(t)"),
        "first": Contact(
            "d_q - 2*d_p",
            threshold="weight(p)",
            surface_speed="w*t",
            kinetic="weight(p)/(1 + speed**2)",
        ),
    },
)

TWO_LEGS = System(
    name="thresholds of rate-independent legs that depend on the state",
    parameters=_parameters(I_b=1.0, delta=0.1, a=1.2, b=1.0, c=0.3, P=0.4, rho=0.3, height=2.0),
    functions={"H(psi)": "height/2*(1 + clip(psi, -1, 1))"},
    coordinates={"psi": Inertial(), "x": RateIndependent(), "y": RateIndependent()},
    kinetic="I_b/2*d_psi**2",
    potential="a/2*(x - y)**2 + b/2*psi**2 - c*(x - y)*psi - P*(x + y) + b/4*max(x - 2, 0)**2",
    viscous="delta/2*d_psi**2",
    contacts={
        "right": Contact("d_x", threshold=("rho + H(psi) + (x - y)**2", "2*rho + H(psi)")),
        "left": Contact("d_y", threshold="rho + H(-psi)*(1 + cos(t)**2)"),
    },
)

RATE_IN_LAW = System(
    name="a threshold that hardens with the path",
    parameters=_parameters(k=1.3, s_0=0.5, wear=0.4, heal=0.2),
    drives={"ell": "2*sin(t)"},
    coordinates={"r": RateIndependent(), "x": RateIndependent()},
    internal={
        # The work of plastic sliding hardens r's threshold; h enters the energy, too.
        "h": Internal("wear*h*d_r - heal*h**2 + d_x*x"),
        "g": Internal("wear*d_x + heal*d_r*cos(r)"),
    },
    potential="k/2*(r - ell)**2 + k/2*(x - r)**2 + k*x**4/4 + h*r**2/2",
    contacts={
        "r": Contact("d_r", threshold="s_0 + h**2"),
        "x": Contact("3*d_x", threshold="s_0*(1 + g**2 + h**2)"),
    },
)

DASHPOTS = System(
    name="dashpots between masses and massless points",
    parameters=_parameters(m=1.0, c=0.5, d=0.8, e=0.2, k=2.0, mu=0.3, V=0.5),
    coordinates={"u": Inertial(), "v": Inertial(drag="e*d_v**3"), "y": Viscous(), "z": Viscous()},
    kinetic="m/2*d_u**2 + m*d_v**2",
    potential="k/2*u**2 + k/4*v**4 + k/2*(y - z)**2",
    viscous="c/2*(d_u - d_y)**2 + d/2*(d_v - d_z)**2 + e/2*(d_y + d_z)**2 + e*d_z**2/2",
    contacts={
        "belt": Contact("d_u - d_v", threshold="mu*(2 + sin(u))", surface_speed="V*t**2"),
        "joint": Contact("d_y + 2*d_z", threshold="mu*(1 + z**2)", surface_speed="V"),
    },
)

SYSTEMS = {system.name: system for system in (MIXED, TWO_LEGS, RATE_IN_LAW, DASHPOTS)}


# --- The same equations by sympy ------------------------------------------------------------------


class BySympy:
    """The equations of motion of section 1 and 2, from the texts of a declaration."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.kinds = {
            kind: [x for x, c in system.coordinates.items() if c.kind == kind]
            for kind in ("inertial", "viscous", "rate-independent")
        }
        self.scope: dict[str, Any] = {
            "clip": lambda x, low, high: sp.Piecewise((low, x < low), (high, x > high), (x, True)),
            "max": lambda a, b: sp.Piecewise((a, a > b), (b, True)),
            "abs": lambda x: sp.Piecewise((x, x > 0), (-x, True)),
        }
        names = [*system.parameters, *system.coordinates, *system.internal, "t", "speed"]
        self.scope |= {name: sp.Symbol(name, real=True) for name in names}
        self.scope |= {
            f"d_{x}": sp.Symbol(f"d_{x}", real=True)
            for x in (*system.coordinates, *system.internal)
        }
        for signature, text in {**system.functions, **system.drives}.items():
            name, _, argument = signature.rstrip(")").partition("(")
            # sympify reads the body with the argument as a symbol of its own.
            body = self.read(
                text, **({argument: sp.Symbol("argument", real=True)} if argument else {})
            )
            self.scope[name] = (
                (lambda x, b=body: b.subs(sp.Symbol("argument", real=True), x))
                if argument
                else body
            )
        self.potential, self.kinetic, self.viscous = map(
            self.read, (system.potential, system.kinetic, system.viscous)
        )
        self.laws = {name: self.read(internal.law) for name, internal in system.internal.items()}
        self.force = {x: self.read(c.force) for x, c in system.coordinates.items()}
        self.drag = {x: self.read(getattr(c, "drag", 0)) for x, c in system.coordinates.items()}

    def read(self, text: Any, **local: Any) -> Any:
        sympify: Any = sp.sympify  # its overloads refuse tables of names
        return sympify(text, locals={**self.scope, **local})

    def symbols(self, kind: str, rate: bool = False) -> list[Any]:
        return [self.scope[f"d_{x}" if rate else x] for x in self.kinds[kind]]

    def matrix(self, form: Any, kind: str) -> Any:
        return sp.hessian(form, self.symbols(kind, rate=True))

    def right_hand_side(self, kind: str) -> list[Any]:
        """All forces that are not from contacts, without the part of M a or C ż on the left."""
        result = []
        for x in self.kinds[kind]:
            resistance = sp.diff(self.viscous, self.scope[f"d_{x}"])
            if kind == "viscous":
                resistance = resistance.subs({v: 0 for v in self.symbols("viscous", rate=True)})
            result.append(
                self.force[x] - self.drag[x] - sp.diff(self.potential, self.scope[x]) - resistance
            )
        return result

    def contact(self, i: int) -> tuple[Any, ...]:
        """Direction, thresholds s⁺ and s⁻, and kinetic forces of the i-th contact as declared."""
        c = list(self.system.dry_contacts.values())[i]
        pairs = [
            f if isinstance(f, tuple) else (f, f) for f in (c.threshold, c.kinetic or c.threshold)
        ]
        return (self.read(c.direction), *(self.read(f) for pair in pairs for f in pair))

    def total(self, e: Any) -> Any:
        """d/dt along the joint motion."""
        result = sp.diff(e, self.scope["t"])
        for x in (*self.system.coordinates, *self.system.internal):
            result += sp.diff(e, self.scope[x]) * self.laws.get(x, self.scope[f"d_{x}"])
        return result

    def value(self, e: Any, values: Values) -> float:
        # doit: derivatives of piecewise functions are piecewise.
        return float(
            sp.sympify(e)
            .doit()
            .subs({self.scope[k]: v for k, v in values.items() if k in self.scope})
        )


@cache
def pair(name: str) -> tuple[System, MotionEquations, BySympy]:
    return SYSTEMS[name], derive(SYSTEMS[name].declaration), BySympy(SYSTEMS[name])


def draw(system: System, seed: int) -> Values:
    """Random parameters, state, rates of coordinates (and of internal variables, by their laws) and
    time."""
    rng = np.random.default_rng(seed)
    values = {
        name: p.default * float(rng.uniform(0.7, 1.3)) for name, p in system.parameters.items()
    }
    values |= {x: float(rng.normal()) for x in (*system.coordinates, *system.internal)}
    values |= {f"d_{x}": float(rng.normal()) for x in system.coordinates}
    return values | {"t": float(rng.uniform(0, 3))}


def check(derived: ex.Expr, expected: float, values: Values) -> None:
    assert ex.evaluate(derived, values) == pytest.approx(expected, rel=1e-12, abs=1e-12)


cases = pytest.mark.parametrize("name", SYSTEMS)
seeds = pytest.mark.parametrize("seed", range(3))


@cases
@seeds
def test_forces_and_matrices(name: str, seed: int) -> None:
    system, derived, exact = pair(name)
    values = draw(system, seed)
    for kind, forces, matrix, form in (
        ("inertial", derived.inertial_force, derived.mass, exact.kinetic),
        ("viscous", derived.viscous_force, derived.damping, exact.viscous),
    ):
        expected = exact.right_hand_side(kind)
        assert len(forces) == len(expected)
        for ours, theirs in zip(forces, expected, strict=True):
            check(ours, exact.value(theirs, values), values)
        if expected:
            hessian = exact.matrix(form, kind)
            for i, j in product(range(len(forces)), repeat=2):
                entry = matrix.get((i, j), ex.ZERO)
                check(entry, exact.value(hessian[i, j], values), values)
    for ours, theirs in zip(derived.laws, exact.laws.values(), strict=True):
        check(ours, exact.value(theirs, values), values)


@cases
@seeds
def test_contacts(name: str, seed: int) -> None:
    system, derived, exact = pair(name)
    values = draw(system, seed) | {"speed": 0.7}
    numbers = {contact: i for i, contact in enumerate(system.dry_contacts)}
    kinds = [c.kind for c in derived.contacts]
    assert kinds == sorted(kinds, key=["inertial", "viscous", "rate-independent"].index)
    for i, c in enumerate(derived.contacts):
        direction, *forces = exact.contact(numbers[c.name])
        assert set(c.direction) == {
            x for x in system.coordinates if direction.has(exact.scope[f"d_{x}"])
        }
        for x, weight in c.direction.items():
            check(weight, exact.value(sp.diff(direction, exact.scope[f"d_{x}"]), values), values)
        own = values | {f"speed:{i}": 0.7}
        for ours, theirs in zip(
            (c.plus, c.minus, c.kinetic_plus, c.kinetic_minus), forces, strict=True
        ):
            check(ours, exact.value(theirs, values), own)
        check(
            c.speed,
            exact.value(exact.read(system.dry_contacts[c.name].surface_speed), values),
            values,
        )


@pytest.mark.parametrize(
    "name", [name for name, s in SYSTEMS.items() if s.declaration.rate_independent]
)
@seeds
def test_rate_problem(name: str, seed: int) -> None:
    """λᵢ and sᵢ of rate-independent coordinates, and how they change along the motion: affine in
    the rates ṙ."""
    system, derived, exact = pair(name)
    values = draw(system, seed)
    rate = derived.rate
    names = exact.kinds["rate-independent"]
    rates = exact.symbols("rate-independent", rate=True)
    acting = [c for c in derived.contacts if c.kind == "rate-independent"]
    numbers = {contact: i for i, contact in enumerate(system.dry_contacts)}
    for i, (r, c) in enumerate(zip(names, acting, strict=True)):
        direction, plus, minus, *_ = exact.contact(numbers[c.name])
        weight = sp.diff(direction, rates[i])
        check(rate.weight[i], exact.value(weight, values), values)
        force = (sp.diff(exact.potential, exact.scope[r]) - exact.force[r]) / weight
        check(rate.force[i], exact.value(force, values), values)
        for whole, slopes, rest, partials in (
            (force, rate.stiffness[i], rate.rest[i], rate.partial[i]),
            (
                plus,
                rate.threshold_slope[0][i],
                rate.threshold_rest[0][i],
                rate.threshold_partial[0][i],
            ),
            (
                minus,
                rate.threshold_slope[1][i],
                rate.threshold_rest[1][i],
                rate.threshold_partial[1][i],
            ),
        ):
            total = exact.total(whole)
            for j, other in enumerate(rates):
                check(slopes[j], exact.value(sp.diff(total, other), values), values)
                check(
                    partials[j], exact.value(sp.diff(whole, exact.scope[names[j]]), values), values
                )
            check(rest, exact.value(total.subs({v: 0 for v in rates}), values), values)


@cases
@seeds
def test_powers_balance(name: str, seed: int) -> None:
    """d/dt energy + dissipated = supplied for every motion that obeys the equations, whatever the
    contact forces."""
    system, derived, exact = pair(name)
    rng = np.random.default_rng([seed, 1])
    values = draw(system, seed)
    # Contact forces are free, accelerations follow; massless coordinates: forces follow from free
    # rates.
    force = {x: 0.0 for x in system.coordinates}
    for i, c in enumerate(derived.contacts):
        u = sum(ex.evaluate(w, values) * values[f"d_{x}"] for x, w in c.direction.items())
        values[f"u:{i}"] = u - ex.evaluate(c.speed, values)
        values[f"lambda:{i}"] = float(rng.normal())
        for x, w in c.direction.items():
            force[x] += ex.evaluate(w, values) * values[f"lambda:{i}"]
    for a, law in exact.laws.items():
        values[f"d_{a}"] = exact.value(law, values)
    inertial = exact.kinds["inertial"]
    change = exact.value(exact.total(exact.potential), values)
    if inertial:
        f = [exact.value(e, values) for e in exact.right_hand_side("inertial")]
        rates = np.array([values[f"d_{q}"] for q in inertial])
        # d/dt ½vᵀMv = v·Ma
        change += rates @ (np.array(f) + [force[q] for q in inertial])
    # The balance of a massless coordinate holds only if its forces do: add the power of what is
    # missing.
    missing = 0.0
    for kind in ("viscous", "rate-independent"):
        for x in exact.kinds[kind]:
            resistance = sp.diff(exact.viscous, exact.scope[f"d_{x}"])
            rest = exact.force[x] - sp.diff(exact.potential, exact.scope[x]) - resistance
            missing += values[f"d_{x}"] * (exact.value(rest, values) + force[x])
    dissipated, supplied = (ex.evaluate(e, values) for e in (derived.dissipation, derived.supply))
    assert change + dissipated - supplied == pytest.approx(-missing, rel=1e-12, abs=1e-12)
    energy = exact.kinetic + exact.potential
    check(derived.energy, exact.value(energy, values), values)


def test_every_kink_is_a_guard() -> None:
    assert [str(g) for g in derive(MIXED.declaration).kinks] == ["d_z"]
    assert {str(g) for g in derive(TWO_LEGS.declaration).kinks} == {"psi - 1", "psi + 1", "x - 2"}
    assert derive(DASHPOTS.declaration).kinks == []


def test_what_is_not_linear_in_the_rates_is_refused() -> None:
    with pytest.raises(DeclarationError, match="not linear in the rates"):
        derive(
            System(
                name="quadratic law",
                coordinates={"r": RateIndependent()},
                internal={"h": Internal("d_r**2")},
                potential="r**2",
                contacts={"r": Contact("d_r", threshold="1 + h**2")},
            ).declaration
        )
    with pytest.raises(DeclarationError, match="depends on a velocity"):
        derive(
            System(
                name="threshold of a velocity",
                coordinates={"q": Inertial(), "r": RateIndependent()},
                kinetic="d_q**2",
                potential="r**2 + q**2",
                contacts={"r": Contact("d_r", threshold="1 + d_q**2")},
            ).declaration
        )


def test_springs_of_structures_have_few_terms() -> None:
    """A spring at a structure pulls at every mode by one stretch: the forces of n modes have of the
    order of n terms, not n², and are the same."""
    n = 12
    body = ss.Structure(np.eye(n), 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    system = System(
        "chain",
        parameters=_parameters(F_c=0.1),
        structures={"u": body},
        contacts={f"damper {at}": ss.laws.jenkins(f"d_u[{at}]", F_c="F_c", k=0.5) for at in (3, 8)},
    )
    equations = derive(system.declaration)
    rng = np.random.default_rng(1)
    point = {name: rng.normal() for name in [*system.declaration.state, "F_c", "t"]}
    for name, stretch in equations.stretches.items():
        point[name] = ex.evaluate(stretch, point)
    pairs = zip(equations.shared_force, equations.inertial_force, strict=True)
    for shared, plain in pairs:
        assert len(shared.terms) <= 3
        assert len(plain.terms) > n
        assert ex.evaluate(shared, point) == pytest.approx(ex.evaluate(plain, point), rel=1e-13)
    assert len(equations.stretches) == 2


def test_short_sums_are_not_shared() -> None:
    """A spring between two masses needs no value of its own."""
    equations = derive(MIXED.declaration)
    assert not equations.stretches
    assert equations.shared_force == equations.inertial_force
