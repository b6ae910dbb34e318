"""Random declarations, against heyoka.

A seeded grammar writes formulas. We read them with our own parser; Python's parser and a few lines
below make heyoka expressions of the same texts, and heyoka differentiates and integrates them.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from stickslip import Contact, Inertial, Internal, System, Trajectory, simulate
from stickslip.arrays import Array

hy = pytest.importorskip("heyoka")

CONTACTS = range(7)
T = 15.0


class Grammar:
    """Random smooth formulas that are bounded wherever their names are."""

    def __init__(self, seed: int, names: list[str]) -> None:
        self.rng = np.random.default_rng(seed)
        self.names = names

    def number(self, low: float, high: float) -> str:
        return f"{self.rng.uniform(low, high):.3f}"

    def formula(self, depth: int) -> str:
        """Any formula of at most that depth."""
        if depth == 0:
            return f"{self.number(-1.5, 1.5)}*{self.rng.choice(self.names)}"
        a = self.formula(depth - 1)
        b = self.formula(int(self.rng.integers(depth)))
        c, d = self.number(0.2, 1.2), self.number(1.2, 2.5)
        rules = [
            f"{a} + {c}*({b})", f"({a}) - {c}", f"({a})*tanh({b})",
            f"({a})/({d} + cos({b}))", f"{c}/({d} + ({a})**2)",
            f"sin({a})", f"cos({a} - {c})", f"tan({c}*sin({a}))", f"sin({a})**3*cos({a})**2",
            f"sinh(cos({a}))", f"cosh(tanh({a}))", f"{c}*tanh({a})",
            f"asinh({a})*{d}", f"atan({a} + {c})",
            f"exp(sin({a}))", f"log({d} + ({a})**2)", f"sqrt({c} + ({a})**2)",
            f"({d} + sin({a}))**{d}", f"({d} + cos({a}))**(-{c})",
            f"({d} + sin({a}))**tanh({b})", f"{d}**cos({a})",
        ]  # fmt: skip
        return str(self.rng.choice(rules))

    def bounded(self, depth: int) -> str:
        """A formula with values in [−1, 1]."""
        return f"{self.rng.choice(['sin', 'cos', 'tanh'])}({self.formula(depth)})"


def to_heyoka(text: Any, names: Mapping[str, Any]) -> Any:
    """The same formula as an expression of heyoka."""

    def visit(node: ast.expr) -> Any:
        match node:
            case ast.Constant(value=int() | float() as value):
                return hy.expression(float(value))
            case ast.Name(id=name):
                return names[name]
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return -visit(inner)
            case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int() as exponent)):
                # Its own power has no series where the base vanishes.
                return hy.prod([visit(left)] * exponent)
            case ast.BinOp(left=left, op=op, right=right):
                a, b = visit(left), visit(right)
                match op:
                    case ast.Add():
                        return a + b
                    case ast.Sub():
                        return a - b
                    case ast.Mult():
                        return a * b
                    case ast.Div():
                        return a / b
                    case ast.Pow():
                        return a**b
            case ast.Call(func=ast.Name(id=function), args=[argument]):
                return getattr(hy, function)(visit(argument))
        raise TypeError(ast.dump(node))

    return visit(ast.parse(str(text), mode="eval").body)


def test_the_grammar_says_everything() -> None:
    text = " ".join(Grammar(seed, ["x"]).formula(3) for seed in range(200))
    functions = {"sin", "cos", "tan", "sinh", "cosh", "tanh", "asinh", "atan", "exp", "log", "sqrt"}
    assert {f for f in functions if f"{f}(" in text} == functions
    assert all(operation in text for operation in ("**3", "**(-", "**tanh", "/("))


# --- Internal variables only: any smooth ordinary differential equation ---------------------------


@pytest.mark.parametrize("seed", range(8))
def test_smooth_systems(seed: int) -> None:
    names = [f"a{i}" for i in range(2 + seed % 3)]
    grammar = Grammar(seed, [*names, "t"])
    laws = {name: f"{grammar.formula(3)} - {grammar.number(1.5, 3)}*{name}" for name in names}
    start = dict(zip(names, map(float, grammar.rng.normal(size=len(names))), strict=True))
    system = System(
        name=f"smooth {seed}", internal={name: Internal(law) for name, law in laws.items()}
    )
    times = np.linspace(0, 6, 13)
    trajectory = simulate(system, (0.0, 6.0), initial=start)
    assert trajectory.outcome.ok, trajectory.message
    assert trajectory.certificate.ok, trajectory.certificate.verdict
    ours = trajectory.at(times)
    assert max(np.ptp(ours[name]) for name in names) > 0.1

    variables = dict(zip(names, hy.make_vars(*names), strict=True))
    scope = {**variables, "t": hy.time}
    equations = [(variables[name], to_heyoka(law, scope)) for name, law in laws.items()]
    theirs = hy.taylor_adaptive(equations, list(start.values()), compact_mode=True).propagate_grid(
        times
    )[-1]
    np.testing.assert_allclose(
        np.stack([ours[name] for name in names], 1), theirs, rtol=0, atol=1e-10
    )


# --- One contact ----------------------------------------------------------------------------------


@cache
def contact_system(seed: int) -> System:
    """One or two masses in a random potential, a random drag, and one contact with a belt."""
    size = 1 + seed % 2
    names = [f"q{i}" for i in range(size)]
    grammar = Grammar(600 + seed, [*names, "t"])
    number = grammar.number
    coupling = f" + {number(0.2, 0.5)}*d_q0*d_q1" if size == 2 else ""
    springs = [f"{number(0.5, 1.5)}*{q}**2" for q in names] + [
        f"{number(0.1, 0.2)}*(q0 - q1)**4"
    ] * (size - 1)
    loads = [f"{number(0.9, 1.6)}*{q}*cos({number(0.5, 2)}*t)" for q in names]
    threshold = f"{number(0.6, 0.9)} + {number(0.1, 0.4)}*{grammar.bounded(2)}"
    kinetic = f"({threshold})/(1 + {number(0.1, 0.5)}*speed)" if seed % 3 == 0 else None
    return System(
        name=f"one contact {seed}",
        coordinates={
            q: Inertial(drag=f"{number(0.05, 0.2)}*d_{q} + {number(0, 0.1)}*d_{q}**3")
            for q in names
        },
        kinetic=" + ".join(f"{number(0.6, 1.2)}*d_{q}**2" for q in names) + coupling,
        potential=" - ".join([" + ".join([*springs, grammar.bounded(2)]), *loads]),
        viscous=f"{number(0, 0.1)}*d_{names[-1]}**2",
        contacts={
            "contact": Contact(
                "d_q0" if size == 1 else f"{number(0.5, 1)}*d_q0 - {number(0.2, 0.6)}*d_q1",
                threshold=threshold,
                kinetic=kinetic,
                surface_speed=f"{number(-0.3, 0.3)}*sin({number(0.5, 1)}*t)",
            )
        },
    )


class OneContact:
    """The same system for heyoka: its mode is the runtime parameter σ = −1, 0, 1."""

    def __init__(self, system: System) -> None:
        qs = list(system.coordinates)
        q = hy.make_vars(*qs)
        v = hy.make_vars(*(f"d_{x}" for x in qs))
        q, v = (x if isinstance(x, list) else [x] for x in (q, v))
        clock = hy.make_vars("clock")
        sigma = hy.par[0]
        scope = {
            **dict(zip(qs, q, strict=True)),
            **{f"d_{x}": w for x, w in zip(qs, v, strict=True)},
            "t": clock,
        }
        contact = system.dry_contacts["contact"]
        kinetic, potential, viscous, direction, s, belt = (
            to_heyoka(text, scope)
            for text in (
                *(system.kinetic, system.potential, system.viscous),
                *(contact.direction, contact.threshold, contact.surface_speed),
            )
        )
        zero = dict.fromkeys((str(w) for w in v), hy.expression(0.0))

        def value(e: Any) -> float:
            return float(str(hy.subs(e, zero)))

        M = np.array([[value(hy.diff(hy.diff(kinetic, a), b)) for b in v] for a in v])
        J = np.array([value(hy.diff(direction, a)) for a in v])
        inverse = np.linalg.inv(M)
        f = [
            -hy.diff(potential, x) - hy.diff(viscous, w) - to_heyoka(block.drag, scope)
            for block, x, w in zip(system.coordinates.values(), q, v, strict=True)
            if isinstance(block, Inertial)
        ]
        u = direction - belt
        free = hy.sum([float(c) * force for c, force in zip(J @ inverse, f, strict=True)])
        held = (hy.diff(belt, clock) - free) / float(J @ inverse @ J)
        k = (
            s
            if contact.kinetic is None
            else to_heyoka(contact.kinetic, {**scope, "speed": sigma * u})
        )
        friction = (1.0 - sigma**2.0) * held - sigma * k
        acceleration = [
            hy.sum([float(row[j]) * (f[j] + float(J[j]) * friction) for j in range(len(q))])
            for row in inverse
        ]
        # Time is a state here, so that belts may be differentiated by it.
        self.motion = hy.taylor_adaptive(
            [
                *zip(q, v, strict=True),
                *zip(v, acceleration, strict=True),
                (clock, hy.expression(1.0)),
            ],
            [0.0] * (2 * len(q) + 1),
            pars=[0.0],
            compact_mode=True,
        )
        self.observe = hy.cfunc([held, s, u], [*q, *v, clock])

    def follow(self, start: Array, begin: float, times: Array, sigma: int) -> Array:
        """States at given times of one mode that starts in a state."""
        self.motion.time = begin
        self.motion.state[:] = [*start, begin]
        self.motion.pars[0] = sigma
        return self.motion.propagate_grid(np.concatenate([[begin], times]))[-1][1:, :-1]


@cache
def contact_motion(seed: int) -> Trajectory:
    system = contact_system(seed)
    rng = np.random.default_rng(seed)
    start = {
        name: float(x)
        for name, x in zip(system.declaration.state, rng.normal(size=4), strict=False)
    }
    return simulate(system, (0.0, T), initial=start)


def test_the_contacts_stick_and_slip() -> None:
    modes = [contact_motion(seed).knots.mode[:, 0] for seed in CONTACTS]
    assert all({-1, 1} <= set(m.tolist()) for m in modes)
    assert sum(np.count_nonzero((m[1:] == 0) & (m[:-1] != 0)) for m in modes) > 8


@pytest.mark.parametrize("seed", CONTACTS)
def test_one_contact(seed: int) -> None:
    trajectory = contact_motion(seed)
    assert trajectory.outcome.ok, trajectory.message
    assert trajectory.certificate.ok, trajectory.certificate.verdict
    names = trajectory.system.declaration.state
    start = trajectory.knots.state[0]
    changes = np.flatnonzero(np.any(np.diff(trajectory.knots.mode, axis=0) != 0, axis=1)) + 1
    nodes = [0.0, *trajectory.knots.time[changes], T]
    modes = trajectory.knots.mode[[0, *changes], 0]
    assert len(modes) >= 4

    exact = OneContact(trajectory.system)
    state = start
    for i, ((begin, end), sigma) in enumerate(zip(pairwise(nodes), modes, strict=True)):
        inside = np.linspace(begin, end, 12)[1:]
        states = exact.follow(state, begin, inside, int(sigma))
        ours = trajectory.at(inside, side="left")
        np.testing.assert_allclose(
            np.stack([ours[name] for name in names], 1), states, rtol=0, atol=1e-10
        )
        state = states[-1]
        # heyoka's own motion obeys the law of friction in between, and reaches the boundary where
        # we switch.
        held, s, u = np.array(
            [exact.observe([*x, t]) for x, t in zip(states, inside, strict=True)]
        ).T
        if sigma == 0:
            assert np.all(np.abs(held) < s + 1e-9) and np.all(np.abs(u) < 1e-10)
            at_boundary = s[-1] - abs(held[-1])
        else:
            assert np.all(sigma * u > -1e-10)
            at_boundary = u[-1]
        if i < len(modes) - 1:
            assert at_boundary == pytest.approx(0, abs=1e-9)
