"""Impacts of many contacts at once: together, and in turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import nnls

import stickslip as ss
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.model.system_file import dumps, loads
from stickslip.motion.outcome import Outcome

G = 9.81


class Struck(NamedTuple):
    """Rates v, mass matrix M, and contacts with gaps N q, directions T q̇, friction and
    restitution."""

    v: Array
    M: Array
    N: Array
    T: Array
    mu: Array
    e: Array

    def picked(self, feet: Sequence[int] | Array) -> Struck:
        """The same with some of the feet, in an order."""
        rows = np.asarray(feet)
        return self._replace(N=self.N[rows], T=self.T[rows], mu=self.mu[rows], e=self.e[rows])

    def energy(self, v: Array) -> float:
        return float(v @ self.M @ v) / 2


@cache
def declared(freedoms: int, feet: int, rubs: bool, law: str = "together") -> ss.System:
    """A body on feet, where everything is a parameter."""
    q = range(freedoms)
    names = [f"m_{i}_{k}" for i in q for k in q]
    names += [f"{a}_{f}_{k}" for f in range(feet) for k in q for a in ("n", "t")]
    names += [f"{a}_{f}" for f in range(feet) for a in ("mu", "e")]

    def along(name: str, f: int, rate: str) -> str:
        return " + ".join(f"{name}_{f}_{k}*{rate}{k}" for k in q)

    return ss.System(
        name="struck",
        parameters={name: ss.Parameter(0.0) for name in names}
        | {f"m_{i}_{i}": ss.Parameter(1.0) for i in q},
        coordinates={f"q{k}": ss.Inertial() for k in q},
        kinetic=" + ".join(f"m_{i}_{k}*d_q{i}*d_q{k}/2" for i in q for k in q),
        contacts={
            f"foot{f}": ss.Unilateral(
                along("n", f, "q"),
                along("t", f, "d_q") if rubs else "",
                f"mu_{f}" if rubs else 0.0,
                restitution=f"e_{f}",
            )
            for f in range(feet)
        },
        impacts=law,
        span=(0.0, 1e-3),
    )


def numbers(body: Struck) -> dict[str, float]:
    """The parameters of the declaration."""
    n, d = body.N.shape
    found = {f"m_{i}_{k}": body.M[i, k] for i in range(d) for k in range(d)}
    for f in range(n):
        found |= {f"n_{f}_{k}": body.N[f, k] for k in range(d)}
        found |= {f"t_{f}_{k}": body.T[f, k] for k in range(d)}
        found |= {f"mu_{f}": body.mu[f], f"e_{f}": body.e[f]}
    return {name: float(value) for name, value in found.items()}


def after(body: Struck, law: str = "together", rubs: bool = True) -> Array | Outcome:
    """The rates after the impact, or why there is none."""
    n, d = body.N.shape
    initial = {f"d_q{k}": float(body.v[k]) for k in range(d)}
    system = declared(d, n, rubs, law)
    given = numbers(body)
    if not rubs:
        given = {k: x for k, x in given.items() if k in system.parameters}
    found = ss.simulate(system, initial=initial, parameters=given)
    if found.outcome in (Outcome.NO_COLLISION, Outcome.CREATES_ENERGY):
        return found.outcome
    return np.array([found.final[f"d_q{k}"] for k in range(d)])


def jumped(body: Struck, law: str = "together", rubs: bool = True) -> Array:
    """The rates after an impact that there is."""
    new = after(body, law, rubs)
    assert not isinstance(new, Outcome), new
    return new


def drawn(rng: np.random.Generator, d: int, feet: int, mu: float = 0.0) -> Struck:
    """A random body on random feet, with one restitution, or none."""
    R = rng.normal(size=(d, d))
    N, T = rng.normal(size=(2, feet, d))
    v = rng.normal(size=d)
    e = np.full(feet, rng.choice([0.0, rng.uniform()]))
    return Struck(v, R @ R.T / d + 0.3 * np.eye(d), N, T, mu * rng.uniform(size=feet), e)


def planar(rng: np.random.Generator, feet: int, mu: float) -> Struck:
    """A body in a plane, with rates (x, y, θ), that lands on feet in a row on a floor."""
    a = np.sort(rng.uniform(-1.0, 1.0, feet))
    one, height = np.ones(feet), rng.uniform(0.05, 0.3)
    N = np.column_stack([0 * a, one, a])
    T = np.column_stack([one, 0 * a, height * one])
    M = np.diag([1.0, 1.0, rng.uniform(0.1, 0.5)])
    v = np.array([rng.normal(), -rng.uniform(0.5, 2.0), 0.5 * rng.normal()])
    return Struck(v, M, N, T, np.full(feet, mu), np.full(feet, rng.uniform()))


def by_least_distance(body: Struck) -> Array | Outcome:
    """Without friction: of the changes Δ with N Δ ≥ −(1 + e) N v the one of least energy (C. L.
    Lawson & R. J. Hanson, *Solving Least Squares Problems*, 1974, chapter 23)."""
    root = np.linalg.cholesky(body.M)
    near = body.N @ body.v
    asked = -(1.0 + np.where(near < 0.0, body.e, 0.0)) * near
    E = np.vstack([np.linalg.solve(root, body.N.T), asked])
    f = np.append(np.zeros(len(body.v)), 1.0)
    u, _ = nnls(E, f, maxiter=10000)
    r = E @ u - f
    if np.linalg.norm(r) < 1e-9:
        return Outcome.NO_COLLISION
    return body.v + np.linalg.solve(root.T, -r[:-1] / r[-1])


def unexplained(body: Struck, new: Array) -> float:
    """How far the law is from explaining new rates: by the cone of the impulses that it admits
    then, and by its inequalities."""
    closed = body.N @ body.v < 0.0
    moved = body.N @ new + np.where(closed, body.e, 0.0) * (body.N @ body.v)
    rubbed = body.T @ new
    size = float(np.max(np.abs(body.v)))
    rays = []
    for n, t, mu, g, u in zip(body.N, body.T, body.mu, moved, rubbed, strict=True):
        if g < 1e-9 * size:
            senses = (1.0, -1.0) if abs(u) < 1e-9 * size else (np.sign(u),)
            rays += [n - sense * mu * t for sense in senses]
    jump = body.M @ (new - body.v)
    _, off = nnls(np.array(rays).T, jump, maxiter=10000) if rays else (0, np.linalg.norm(jump))
    return max(float(off), -float(np.min(moved))) / size


@pytest.mark.parametrize(("d", "feet"), [(3, 5), (3, 20), (6, 12), (20, 16)])
def test_without_friction(d: int, feet: int) -> None:
    """A convex problem says the velocities, also where there are more feet than freedoms."""
    rng = np.random.default_rng(feet)
    for _ in range(15):
        body = drawn(rng, d, feet)
        expected, new = by_least_distance(body), after(body, rubs=False)
        if isinstance(expected, Outcome) or isinstance(new, Outcome):
            assert new is expected or new is Outcome.CREATES_ENERGY
        else:
            assert_allclose(new, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("d", "feet", "mu"), [(6, 5, 0.3), (6, 8, 0.3), (3, 20, 0.2), (21, 20, 1)])
def test_with_friction(d: int, feet: int, mu: float) -> None:
    """Velocities are explained by impulses of the law, and no energy is created; without
    restitution there are some always."""
    rng = np.random.default_rng(feet)
    for _ in range(15):
        body = drawn(rng, d, feet, mu)
        new = after(body)
        if isinstance(new, Outcome):
            assert body.e[0] > 0.0, new
            continue
        assert unexplained(body, new) <= 1e-9
        assert body.energy(new) <= body.energy(body.v) * (1 + 1e-12)


@pytest.mark.parametrize("d", [1, 2])
def test_no_rounding_error_is_an_impulse(d: int) -> None:
    """Two feet of a body with fewer freedoms than directions, each with its own restitution: the
    law explains the velocities, or there is no impact. Equations without a solution have none."""
    rng = np.random.default_rng(d)
    for _ in range(100):
        body = drawn(rng, d, 2, 0.5)._replace(e=rng.uniform(size=2))
        new = after(body)
        assert isinstance(new, Outcome) or unexplained(body, new) <= 1e-9


@pytest.mark.parametrize("feet", [4, 8, 20])
def test_order_and_halves_do_not_matter(feet: int) -> None:
    """Feet in another order, or each in two halves, and for a body on a floor the outer ones alone:
    the velocities are the same."""
    rng = np.random.default_rng(feet)
    for mu in (0.0, 0.1, 0.4):
        for _ in range(4):
            body = planar(rng, feet, mu)
            new = jumped(body)
            assert_allclose(jumped(body.picked(rng.permutation(feet))), new, rtol=0, atol=1e-10)
            assert_allclose(jumped(body.picked([0, feet - 1])), new, rtol=0, atol=1e-10)
            halves = body.picked(np.repeat(np.arange(feet), 2).tolist())
            assert_allclose(jumped(halves), new, rtol=0, atol=1e-10)
            # Which foot has how much of the impulse matters where each rubs in its own way.
            uneven = body._replace(mu=mu * rng.uniform(size=feet))
            again = jumped(uneven.picked(rng.permutation(feet)))
            assert_allclose(again, jumped(uneven), rtol=0, atol=1e-9)
            body = drawn(rng, 4, feet, 0.1)
            one, two = after(body), after(body.picked(rng.permutation(feet)))
            if isinstance(one, Outcome) or isinstance(two, Outcome):
                assert one is two
            else:
                assert_allclose(two, one, rtol=0, atol=1e-10)


def on_feet(n: int, mu: float, e: float, static: float | None = None) -> ss.System:
    """Feet that fall each by itself, and drag one body."""
    names = [f"y{i}" for i in range(n)]
    contacts: dict[str, Any] = {}
    for name in names:
        if static is None:
            contacts[name] = ss.Unilateral(name, "d_x", mu, restitution=e)
        else:
            contacts[name] = ss.Unilateral(name, restitution=e)
            normal = f"normal_{name}"
            contacts[f"under {name}"] = ss.Contact(
                "d_x", f"{static}*{normal}", kinetic=f"{mu}*{normal}"
            )
    return ss.System(
        name="on feet",
        coordinates={name: ss.Inertial() for name in [*names, "x"]},
        kinetic=" + ".join(f"d_{name}**2/2" for name in names) + f" + {n}*d_x**2/2",
        potential=" + ".join(f"{G}*{name}" for name in names),
        contacts=contacts,
        initial={name: 0.1 for name in names},
        span=(0.0, 0.6),
    )


@pytest.mark.parametrize("static", [None, 0.3])
def test_twenty_feet_move_as_one(static: float | None) -> None:
    """Twenty feet under a load of twenty are one foot under a load of one, bounces and all."""
    for speed in (0.05, 0.4, 2.0):
        one, many = (
            ss.simulate(on_feet(n, 0.1, 0.5, static), initial={"d_x": speed}) for n in (1, 20)
        )
        assert one.certificate.ok and many.certificate.ok, many.certificate
        assert len(many.impacts) >= len(one.impacts) > 30
        t = np.linspace(0.0, 0.6, 50)
        assert_allclose(many.at(t)["x"], one.at(t)["x"], rtol=0, atol=1e-10)
        assert_allclose(many.at(t)["y13"], one.at(t)["y0"], rtol=0, atol=1e-10)


def table(feet: int, mu: float) -> ss.System:
    """A round plate that lands flat on feet on a circle of radius 1."""
    angles = 2 * np.pi * np.arange(feet) / feet
    contacts = {}
    for i, (c, s) in enumerate(zip(np.cos(angles), np.sin(angles), strict=True)):
        contacts[f"foot{i}"] = ss.Unilateral(
            f"z + {c}*a + {s}*b", (f"d_x - {s}*d_w", f"d_y + {c}*d_w"), mu
        )
    return ss.System(
        name="table",
        coordinates={x: ss.Inertial() for x in ("x", "y", "z", "a", "b", "w")},
        kinetic="(d_x**2 + d_y**2 + d_z**2 + 0.3*d_a**2 + 0.3*d_b**2 + 0.5*d_w**2)/2",
        potential="-z",  # it is lifted again
        contacts=contacts,
        span=(0.0, 1e-3),
    )


@pytest.mark.parametrize("feet", [3, 5, 12])
def test_a_plate_lands_in_a_plane(feet: int) -> None:
    """It slides on, spins on, or does both: each foot rubs against its own velocity afterwards, and
    has its share of the impulse."""
    rng = np.random.default_rng(feet)
    angles = 2 * np.pi * np.arange(feet) / feet
    system = table(feet, 0.2)
    for start in ([2.0, 0.0, 0.0], [0.0, 0.0, 3.0], [0.1, 0.0, 0.0], [1.0, 1.0, 2.0], None):
        given = rng.normal(size=3) if start is None else np.array(start)
        initial = dict(zip(("d_x", "d_y", "d_w"), map(float, given), strict=True)) | {"d_z": -1.0}
        found = ss.simulate(system, initial=initial)
        assert found.certificate.ok, found.certificate
        new = np.array([found.at([0.0])[k][0] for k in initial])
        x, y, w, z = new
        assert abs(z) <= 1e-15
        u = np.array([x - np.sin(angles) * w, y + np.cos(angles) * w])
        speed = np.hypot(*u)
        force = np.zeros((2, feet))
        np.divide(-0.2 / feet * u, speed, out=force, where=speed > 1e-12)
        turns = np.sum(np.cos(angles) * force[1] - np.sin(angles) * force[0])
        expected = given + np.array([*np.sum(force, axis=1), turns / 0.5])
        if np.all(speed > 1e-12):
            assert_allclose(new[:3], expected, rtol=0, atol=1e-10)
        else:
            assert_allclose(new[:3], 0.0, rtol=0, atol=1e-12)
            assert np.hypot(*given[:2]) <= 0.2


# -- in turn ---------------------------------------------------------------------------------------


def one_by_one(body: Struck, v: Array) -> Array:
    """Impacts without friction, one after the other, as they are declared to be."""
    response = np.linalg.solve(body.M, body.N.T)
    own = np.einsum("ij,ji->i", body.N, response)
    first = 0.0
    while True:
        approach = np.minimum(body.N @ v, 0.0)
        energy = approach**2 / own
        first = max(first, float(np.max(energy)))
        i = int(np.argmax(energy))
        if energy[i] <= 1e-29 * first:
            return v
        v = v - response[:, i] * (1.0 + body.e[i]) * approach[i] / own[i]


@pytest.mark.parametrize(("d", "feet"), [(4, 3), (6, 12)])
def test_in_turn(d: int, feet: int) -> None:
    """The order of random bodies is that of a loop of five lines; each impact loses energy, and at
    last nothing approaches, whatever restitutions there are."""
    rng = np.random.default_rng(feet)
    for _ in range(15):
        body = drawn(rng, d, feet)._replace(e=rng.uniform(size=feet))
        new = jumped(body, "in turn", rubs=False)
        assert_allclose(new, one_by_one(body, body.v), rtol=0, atol=1e-10)
        assert body.energy(new) <= body.energy(body.v) * (1 + 1e-12)
        assert np.min(body.N @ new) >= -1e-12


def test_in_turn_with_friction() -> None:
    """Each impact obeys the law by itself, so that energy is never created without restitution, and
    the order of the contacts in the declaration does not matter."""
    rng = np.random.default_rng(7)
    for _ in range(15):
        body = drawn(rng, 5, 8, 0.3)
        body = body._replace(e=0 * body.e)
        new = jumped(body, "in turn")
        assert np.min(body.N @ new) >= -1e-12
        assert body.energy(new) <= body.energy(body.v) * (1 + 1e-12)
        again = jumped(body.picked(rng.permutation(8)), "in turn")
        assert_allclose(again, new, rtol=0, atol=1e-10)


@pytest.mark.parametrize("law", ["together", "in turn"])
def test_what_lands_in_a_plane_and_sticks_rests(law: str) -> None:
    """Friction that stops a slip in a plane at once holds both directions."""
    floor = ss.Unilateral(gap="z", restitution=0.0, mu="2", direction=("d_x", "d_y"))
    system = ss.System(
        "block",
        coordinates={name: ss.Inertial() for name in ("x", "y", "z")},
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2",
        potential="10*z",
        contacts={"floor": floor},
        initial={"z": 1.0, "d_x": 1.0, "d_y": 0.5},
        impacts=law,
    )
    motion = ss.simulate(system, (0.0, 1.0))
    assert motion.outcome is Outcome.AT_REST
    assert motion.certificate.ok
    assert not np.any(motion.knots.mode[-1])


def cradle(n: int, e: float, law: str, masses: Sequence[float] = ()) -> ss.System:
    """Balls in a row that touch, but for the first ones."""
    mass = [*masses, *[1.0] * (n - len(masses))]
    return ss.System(
        name="cradle",
        coordinates={f"x{i}": ss.Inertial() for i in range(n)},
        kinetic=" + ".join(f"{m}*d_x{i}**2/2" for i, m in enumerate(mass)),
        contacts={
            f"balls {i}": ss.Unilateral(f"x{i + 1} - x{i} - 1", restitution=e) for i in range(n - 1)
        },
        impacts=law,
        initial={f"x{i}": float(i) for i in range(n)},
        span=(0.0, 0.3),
    )


def swung(system: ss.System, balls: int) -> Array:
    """Velocities after some balls at its left end have struck the others at speed 1."""
    n = len(system.coordinates)
    initial = {f"x{i}": i - 0.1 for i in range(balls)} | {f"d_x{i}": 1.0 for i in range(balls)}
    found = ss.simulate(system, initial=initial)
    assert found.certificate.ok, found.certificate
    return np.array([found.final[f"d_x{i}"] for i in range(n)])


@pytest.mark.parametrize("n", [3, 4, 5, 20])
def test_the_cradle(n: int) -> None:
    """In turn as many balls fly off as have struck. Together the first contact has γ⁺ = −e γ⁻ and
    the others, which were at rest, γ⁺ = 0: both sides stay together."""
    for balls in range(1, min(n, 4)):
        in_turn = swung(cradle(n, 1.0, "in turn"), balls)
        assert_allclose(in_turn, np.arange(n) >= n - balls, rtol=0, atol=1e-12)
        for e in (0.0, 0.5, 1.0):
            right = balls * (1.0 + e) / n
            expected = np.where(np.arange(n) < balls, right - e, right)
            assert_allclose(swung(cradle(n, e, "together"), balls), expected, atol=1e-12)


@pytest.mark.parametrize("e", [0.0, 0.7, 1.0])
def test_a_cradle_of_any_balls(e: float) -> None:
    """Masses 3, 1, 2, 1 and a chain of impacts; the last one has Π (1 + e) mᵢ/(mᵢ + mᵢ₊₁) at
    first."""
    masses = np.array([3.0, 1.0, 2.0, 1.0])
    N = np.array([[-1.0, 1.0, 0.0, 0.0], [0.0, -1.0, 1.0, 0.0], [0.0, 0.0, -1.0, 1.0]])
    v = np.array([1.0, 0.0, 0.0, 0.0])
    body = Struck(v, np.diag(masses), N, 0 * N, np.zeros(3), np.full(3, e))
    new = swung(cradle(4, e, "in turn", masses.tolist()), 1)
    assert_allclose(new, one_by_one(body, v), rtol=0, atol=1e-11)
    assert float(masses @ new) == pytest.approx(3.0, rel=1e-12)
    first = np.prod((1.0 + e) * masses[:-1] / (masses[:-1] + masses[1:]))
    assert new[-1] >= first - 1e-12


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_what_lands_evenly(e: float) -> None:
    """Contacts that approach with equal energies have their impacts together: a rod that lands flat
    on two or on twenty feet stays level by both laws. A little tilted, elastic ends strike one
    after the other."""
    for feet in (2, 20):
        a = np.linspace(-1.0, 1.0, feet)[[0, -1]] if feet == 2 else np.linspace(-1.0, 1.0, feet)
        N = np.column_stack([0 * a, 1 + 0 * a, a])
        M = np.diag([1.0, 1.0, 1 / 3])
        body = Struck(np.array([0.0, -1.0, 0.0]), M, N, 0 * N, np.zeros(len(a)), np.full(len(a), e))
        for law in ("together", "in turn"):
            new = jumped(body, law, rubs=False)
            assert_allclose(new, [0.0, e, 0.0], rtol=0, atol=1e-11)


def test_a_law_is_declared() -> None:
    """By default together; model files keep it; anything else is refused by name."""
    system = cradle(3, 1.0, "in turn")
    assert cradle(3, 1.0, "together") == replace(system, impacts="together")
    assert 'impacts = "in turn"' in dumps(system) and loads(dumps(system)) == system
    assert "impacts" not in dumps(cradle(3, 1.0, "together"))
    assert "sequentially" in str(system.equations())
    with pytest.raises(DeclarationError, match=r"impacts: .*law.*'both'.*in turn"):
        cradle(3, 1.0, "both")
