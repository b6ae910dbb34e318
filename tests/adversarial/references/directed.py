"""Dissipations R with their gradients in NumPy, and mechanics with one of them: smoothed as in
:mod:`.smoothed`, with R in place of the speed and its gradient in place of the direction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ellipe, ellipk

from ..case import Rng
from .mechanics import Array
from .smoothed import Smooth

Numbers = Mapping[str, float]
_BESIDE = 1e-3  # m below which elliptic integrals are summed


@dataclass(frozen=True)
class Rule:
    """A dissipation of its parameters.

    Attributes
    ----------
    count : int
        Number of directions.
    text : str
        As the library gets it.
    numbers : tuple of str
    draw : callable
        Random numbers of these names.
    found : callable
        (numbers, v) to (R, ∇R), v ≠ 0.
    """

    count: int
    text: str
    numbers: tuple[str, ...]
    draw: Callable[[Rng], dict[str, float]]
    found: Callable[[Numbers, Array], tuple[float, Array]]

    def value(self, n: Numbers, v: Array) -> float:
        """R alone."""
        return self.found(n, v)[0]


def _norm(B: Array, v: Array) -> tuple[float, Array]:
    """√(v·Bv)."""
    Bv = B @ v
    r = float(np.sqrt(v @ Bv))
    return r, Bv / r


def _ellipse(n: Numbers, v: Array) -> tuple[float, Array]:
    return _norm(np.array([[n["e1"] ** 2, n["e12"]], [n["e12"], n["e2"] ** 2]]), v)


def _ellipse_numbers(rng: Rng) -> dict[str, float]:
    e, f = rng.uniform(0.4, 1.5, 2)
    return {"e1": e, "e2": f, "e12": rng.choice([0.0, 0.8]) * rng.uniform(-1.0, 1.0) * e * f}


def _quartic(n: Numbers, v: Array) -> tuple[float, Array]:
    e = np.array([n[f"e{i + 1}"] for i in range(len(v))])
    scale = float(np.max(np.abs(v)))
    w = e * v / scale
    squares = w * w
    others = np.sum(squares) - squares
    whole = float(np.sum(squares**2) + n["c"] / 2.0 * np.sum(squares * others))
    slope = e * (4.0 * w**3 + 2.0 * n["c"] * w * others)
    return scale * whole**0.25, 0.25 * whole**-0.75 * slope


def _quartic_numbers(count: int) -> Callable[[Rng], dict[str, float]]:
    def draw(rng: Rng) -> dict[str, float]:
        e = rng.uniform(0.4, 1.5, count)
        most = 6.0 if count == 2 else 3.0
        c = rng.choice([0.0, 1.0, 1.0]) * rng.uniform(0.05, most - 0.1)
        return {f"e{i + 1}": x for i, x in enumerate(e)} | {"c": c}

    return draw


def _sum(n: Numbers, v: Array) -> tuple[float, Array]:
    one, a = _norm(np.diag([1.0, n["e2"] ** 2]), v)
    row = np.array([1.0, n["h"]])
    other, b = _norm(np.outer(row, row) + np.diag([0.0, n["f"] ** 2]), v)
    return n["e1"] * one + n["c"] * other, n["e1"] * a + n["c"] * b


def _sum_numbers(rng: Rng) -> dict[str, float]:
    return {
        "e1": rng.uniform(0.3, 1.0),
        "e2": rng.uniform(0.5, 1.5),
        "h": rng.normal(),
        "f": rng.choice([0.05, 0.3, 1.0]),
        "c": rng.uniform(0.1, 0.8),
    }


def _pieces(n: Numbers, v: Array) -> tuple[float, Array]:
    e = np.array([n[f"e{i + 1}"] for i in range(len(v))])
    e[0] = e[0] if v[0] >= 0.0 else n["back"]
    return _norm(np.diag(e**2), v)


def _pieces_numbers(count: int) -> Callable[[Rng], dict[str, float]]:
    def draw(rng: Rng) -> dict[str, float]:
        return {w: rng.uniform(0.3, 1.5) for w in _named(count, "back")}

    return draw


def _named(count: int, *others: str) -> tuple[str, ...]:
    return (*(f"e{i + 1}" for i in range(count)), *others)


def _ellipsoid(n: Numbers, v: Array) -> tuple[float, Array]:
    return _norm(np.diag([n[f"e{i}"] ** 2 for i in (1, 2, 3)]), v)


def _ellipsoid_numbers(rng: Rng) -> dict[str, float]:
    return {f"e{i}": rng.uniform(0.4, 1.5) for i in (1, 2, 3)}


def _B(m: float) -> float:
    """(E − (1 − m)K)/m = ∫ cos²/√(1 − m sin²), without cancellation."""
    if m < _BESIDE:
        # By its power series.
        total, term = 0.0, np.pi / 4.0
        for k in range(12):
            total += term
            term *= m * (k + 0.5) ** 2 / ((k + 1.0) * (k + 2.0))
        return total
    return float((ellipe(m) - (1.0 - m) * ellipk(m)) / m) if m < 1.0 else 1.0


def mean_speed_of_ring(slide: float, spin: float) -> tuple[float, float, float]:
    """Mean of |u + ω e × r| on a circle, and its derivatives by |u| and |ω|:
    (2/π)(|u| + |ω|) E(4|u||ω|/(|u| + |ω|)²), in the form with the smaller modulus."""
    low, high = min(slide, spin), max(slide, spin)
    m = (low / high) ** 2
    # 2E − (1 − m)K = E + mB, with dE/dm = −D/2, D = K − B.
    E, B = float(ellipe(m)), _B(m)
    value = 2.0 / np.pi * high * (E + m * B)
    by_low = 2.0 / np.pi * (low / high) * B
    by_high = (value - low * by_low) / high
    return (value, by_low, by_high) if slide <= spin else (value, by_high, by_low)


def mean_speed_of_disc(slide: float, spin: float) -> tuple[float, float, float]:
    """The same of a disc: force and moment of Farkas et al. (2003), where u ≪ ω by series."""
    if slide <= spin:
        eps = slide / spin
        m = eps * eps
        E, K = float(ellipe(m)), float(ellipk(m)) if m < 1.0 else 0.0
        force = _small_force(m) * eps if m < _BESIDE else ((m + 1.0) * E + (m - 1.0) * K) / eps
        moment = (4.0 - 2.0 * m) * E + (m - 1.0) * K
    else:
        m = (spin / slide) ** 2
        E, K = float(ellipe(m)), float(ellipk(m))
        # eps² (…): with m = 1/eps².
        if m < _BESIDE:
            force, moment = _small_sliding(m)
        else:
            force = ((1.0 + m) * E - (1.0 - m) * K) / m
            moment = ((4.0 - 2.0 / m) * E + (2.0 / m - 5.0 + 3.0 * m) * K) / np.sqrt(m)
    by_slide = 4.0 / (3.0 * np.pi) * force
    by_spin = 4.0 / (9.0 * np.pi) * moment
    return slide * by_slide + spin * by_spin, by_slide, by_spin


def _series(m: float) -> tuple[Array, Array]:
    """Coefficients of K and E in powers of m, times these powers."""
    k = np.arange(16)
    ratio = np.append(1.0, np.cumprod(((k[1:] - 0.5) / k[1:]) ** 2))
    K = np.pi / 2.0 * ratio
    return K, K / (1.0 - 2.0 * k)


def _small_force(m: float) -> float:
    """((m + 1)E + (m − 1)K)/m."""
    K, E = _series(m)
    row = E - K
    row[1:] += (E + K)[:-1]
    return float(np.polynomial.polynomial.polyval(m, row[1:]))


def _small_sliding(m: float) -> tuple[float, float]:
    """((1 + m)E − (1 − m)K)/m, and ((4 − 2/m)E + (2/m − 5 + 3m)K)/√m."""
    K, E = _series(m)
    force = E - K
    force[1:] += (E + K)[:-1]
    moment = 2.0 * (K - E)  # over m
    moment[1:] += (4.0 * E - 5.0 * K)[:-1]
    moment[2:] += 3.0 * K[:-2]
    poly = np.polynomial.polynomial.polyval
    # The first two coefficients of the moment vanish.
    return float(poly(m, force[1:])), float(poly(m, moment[2:]) * np.sqrt(m))


def _face(
    mean: Callable[[float, float], tuple[float, float, float]], v: Array
) -> tuple[float, Array]:
    slide, spin = float(np.hypot(v[0], v[1])), abs(float(v[2]))
    value, by_slide, by_spin = mean(slide, spin)
    way = v[:2] / slide if slide > 0.0 else np.zeros(2)
    return value, np.array([*(by_slide * way), by_spin * np.sign(v[2])])


def _off_disc(n: Numbers, v: Array) -> tuple[float, Array]:
    """A disc whose centre is elsewhere, and a norm."""
    J = np.array([[1.0, 0.0, n["h"]], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    one, slope = _face(mean_speed_of_disc, J @ v)
    other, b = _norm(np.diag([1.0, n["e2"] ** 2, n["e3"] ** 2]), v)
    return one + n["c"] * other, J.T @ slope + n["c"] * b


def _off_numbers(rng: Rng) -> dict[str, float]:
    e2, e3 = rng.uniform(0.5, 1.5, 2)
    return {"h": rng.uniform(-1, 1), "c": rng.choice([0.0, 0.5]), "e2": e2, "e3": e3}


_PIECE = "(e1*max(v1, 0) + back*max(-v1, 0))**2"
_QUARTIC = "c*(e1*v1)**2*(e2*v2)**2"
RULES = {
    "ellipse": Rule(
        2,
        "sqrt(e1**2*v1**2 + 2*e12*v1*v2 + e2**2*v2**2)",
        ("e1", "e2", "e12"),
        _ellipse_numbers,
        _ellipse,
    ),
    "quartic": Rule(
        2,
        f"((e1*v1)**4 + (e2*v2)**4 + {_QUARTIC})**0.25",
        ("e1", "e2", "c"),
        _quartic_numbers(2),
        _quartic,
    ),
    "sum": Rule(
        2,
        "e1*sqrt(v1**2 + e2**2*v2**2) + c*sqrt((v1 + h*v2)**2 + f**2*v2**2)",
        ("e1", "e2", "h", "f", "c"),
        _sum_numbers,
        _sum,
    ),
    "pieces": Rule(
        2, f"sqrt({_PIECE} + e2**2*v2**2)", _named(2, "back"), _pieces_numbers(2), _pieces
    ),
    "disc": Rule(
        3, "disc(v1, v2, v3)", (), lambda rng: {}, lambda n, v: _face(mean_speed_of_disc, v)
    ),
    "ring": Rule(
        3, "ring(v1, v2, v3)", (), lambda rng: {}, lambda n, v: _face(mean_speed_of_ring, v)
    ),
    "ellipsoid": Rule(
        3,
        "sqrt(e1**2*v1**2 + e2**2*v2**2 + e3**2*v3**2)",
        _named(3),
        _ellipsoid_numbers,
        _ellipsoid,
    ),
    "disc and norm": Rule(
        3,
        "disc(v1 + h*v3, v2, v3) + c*sqrt(v1**2 + e2**2*v2**2 + e3**2*v3**2)",
        ("h", "c", "e2", "e3"),
        _off_numbers,
        _off_disc,
    ),
    "quartic face": Rule(
        3,
        f"((e1*v1)**4 + (e2*v2)**4 + (e3*v3)**4 + {_QUARTIC}"
        " + c*(e1*v1)**2*(e3*v3)**2 + c*(e2*v2)**2*(e3*v3)**2)**0.25",
        _named(3, "c"),
        _quartic_numbers(3),
        _quartic,
    ),
    "pieces face": Rule(
        3,
        f"sqrt({_PIECE} + e2**2*v2**2 + e3**2*v3**2)",
        _named(3, "back"),
        _pieces_numbers(3),
        _pieces,
    ),
}


@dataclass(frozen=True)
class Directed:
    """Coordinates with constant M, C, K, one contact with a dissipation, and perhaps a line.

    Attributes
    ----------
    rule : Rule
    numbers : mapping of str to float
    size : int
    law, varies : str
        As of the families' Shape.
    turns : float
        Angle by which directions turn for one unit of the last coordinate, …
    turned : bool
        … where they turn.
    """

    rule: Rule
    numbers: Numbers
    size: int
    law: str
    varies: str
    turns: float
    turned: bool

    @property
    def drops(self) -> bool:
        """Whether static friction is above kinetic friction somewhere."""
        return self.law == "drop"

    def dropping(self, t: float, y: Array) -> Array:
        """R, if static friction is above kinetic friction."""
        u = self.slide(t, y[: self.size], y[self.size :])
        return np.array([self.dissipation(u)[0] if u.any() else 0.0] if self.drops else [])

    def _matrix(self, w: str) -> Array:
        n = self.size
        return np.array([[self.numbers[f"{w}_{min(i, j)}_{max(i, j)}"] for j in range(n)]
                         for i in range(n)])  # fmt: skip

    def _vector(self, w: str, count: int) -> Array:
        return np.array([self.numbers.get(f"{w}_{i}", 0.0) for i in range(count)])

    @cached_property
    def matrices(self) -> tuple[Array, Array, Array]:
        """M, K, C."""
        return self._matrix("M"), self._matrix("K"), self._matrix("C")

    @cached_property
    def loads(self) -> tuple[Array, Array, Array, Array]:
        """G, F, om, ph."""
        G, F, om, ph = (self._vector(w, self.size) for w in ("G", "F", "om", "ph"))
        return G, F, om, ph

    @cached_property
    def surface(self) -> tuple[Array, Array]:
        """W and V."""
        return self._vector("W", self.rule.count), self._vector("V", self.rule.count)

    @cached_property
    def shift(self) -> Array:
        """The linear part of R."""
        return self._vector("b", self.rule.count)

    @cached_property
    def line(self) -> Array:
        """Direction of the contact along a line; zeros: there is none."""
        return self._vector("B", self.size)

    @cached_property
    def _still(self) -> Array:
        shape = self.rule.count, self.size
        return np.array([[self.numbers[f"A_{i}_{j}"] for j in range(shape[1])]
                         for i in range(shape[0])])  # fmt: skip

    def directions(self, q: Array) -> Array:
        """u = A(q) v − w."""
        if not self.turned:
            return self._still
        c, s = np.cos(self.turns * q[-1]), np.sin(self.turns * q[-1])
        turn = np.eye(self.rule.count)
        turn[:2, :2] = [[c, s], [-s, c]]
        return turn @ self._still

    def slide(self, t: float, q: Array, v: Array) -> Array:
        """Relative velocities."""
        W, V = self.surface
        return self.directions(q) @ v - W - V * np.sin(self.numbers.get("wo", 0.0) * t)

    def dissipation(self, u: Array) -> tuple[float, Array]:
        """R and ∇R."""
        value, slope = self.rule.found(self.numbers, u)
        return value + float(self.shift @ u), slope + self.shift

    def threshold(self, t: float, q: Array) -> float:
        """s."""
        n = self.numbers
        if not self.varies:
            return n["s"]
        return n["s"] + n["r"] * np.cos(n["al"] * (t if self.varies == "time" else q[0]))

    def sliding(self, R: float) -> float:
        """k as a part of s."""
        n = self.numbers
        if self.law == "stribeck":
            return n["d"] + (1.0 - n["d"]) * np.exp(-R / n["vs"])
        return n["d"] if self.law == "drop" else 1.0

    def loaded(self, t: float, q: Array, v: Array) -> Array:
        """Forces on the coordinates without friction."""
        _, K, C = self.matrices
        G, F, om, ph = self.loads
        return G + F * np.cos(om * t + ph) - K @ q - C @ v

    def accelerations(self, t: float, q: Array, v: Array, force: Array, along: float) -> Array:
        """q″ for forces of both contacts."""
        total = self.loaded(t, q, v) + self.directions(q).T @ force + self.line * along
        return np.linalg.solve(self.matrices[0], total)

    def rates(self, law: Smooth, width: float) -> Callable[[float, Array], Array]:
        """The equations of motion of a smoothed law."""
        n, limit = self.size, self.numbers.get("sl", 0.0)
        count = self.rule.count

        def rate(t: float, y: Array) -> Array:
            q, v = y[:n], y[n:]
            u = self.slide(t, q, v)
            force = np.zeros(count)
            if u.any():
                R, slope = self.dissipation(u)
                part = self.sliding(R)
                if self.drops:
                    part += (1.0 - part) * float(law.left(np.array(R / (law.long * width))))
                hold = self.threshold(t, q) * part
                force = -hold * R * float(law.divided(np.array(R), width)) * slope
            rub = float(self.line @ v)
            along = -limit * rub * float(law.divided(np.array(abs(rub)), width))
            return np.concatenate([v, self.accelerations(t, q, v, force, along)])

        return rate
