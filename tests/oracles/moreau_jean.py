"""Moreau's and Jean's time stepping: contacts that open, Coulomb's friction, Newton's impacts.

M. Jean, *The non-smooth contact dynamics method*, Comput. Methods Appl. Mech. Eng. 177 (1999)
235-257. No event is located: in every step impulses obey the law at the middle of the step. Order
one in the step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.translator import compiled

from .moreau import dot_product


class Contacts(NamedTuple):
    """Contacts with linear gaps.

    Attributes
    ----------
    normal, tangent : arrays, shape (c, d)
        Gap g = normal·q + offset, slip tangent·v.
    offset, mu, e : arrays, shape (c,)
    """

    normal: Matrix
    tangent: Matrix
    offset: Vector
    mu: Vector
    e: Vector


class Work(NamedTuple):
    """Work space.

    Attributes
    ----------
    middle, new, pull : arrays, shape (d,)
        Place at the middle of a step, velocity after it, momenta in it.
    before, P, T : arrays, shape (c,)
        Speeds of gaps before a step, and impulses in it.
    along, across : arrays, shape (c, d)
        What an impulse of one changes the velocities by.
    give, slide : arrays, shape (c,)
        … and the speed of its own gap, and its own slip.
    """

    middle: Vector
    new: Vector
    pull: Vector
    before: Vector
    P: Vector
    T: Vector
    along: Matrix
    across: Matrix
    give: Vector
    slide: Vector


def final_state(
    M: Array,
    C: Array,
    K: Array,
    push: Array,
    contacts: Contacts,
    start: tuple[Array, Array],
    end: float,
    steps: int,
) -> tuple[Array, Array]:
    """Places and velocities at the end of M q'' + C q' + K q = push₀ + push₁ sin(push₂ t).

    Parameters
    ----------
    M, C, K : arrays, shape (d, d)
    push : array, shape (3, d)
    contacts : Contacts
    start : tuple of arrays
        Places and velocities.
    end : float
    steps : int
    """
    inverse, C, K, push = map(_dense, (np.linalg.inv(M), C, K, push))
    contacts = Contacts(*map(_dense, contacts))
    q = np.array(start[0], np.float64)
    v = np.array(start[1], np.float64)
    c, d = contacts.normal.shape
    shapes = (d, d, d, c, c, c, (c, d), (c, d), c, c)
    work = Work(*(np.zeros(shape) for shape in shapes))
    _stepped(inverse, C, K, push, contacts, q, v, end / steps, steps, work)
    return q, v


def _dense(a: Array) -> Array:
    """The one memory layout that the kernels are compiled for."""
    return np.require(a, np.float64, ("C", "A", "W"))


@compiled()
def _struck(v: Vector, change: Vector, impulse: float) -> None:
    """Velocities after one more impulse."""
    for a in range(len(v)):
        v[a] += change[a] * impulse


@entry_point()
def _stepped(
    inverse: Matrix,
    C: Matrix,
    K: Matrix,
    push: Matrix,
    contacts: Contacts,
    q: Vector,
    v: Vector,
    h: float,
    steps: int,
    work: Work,
) -> None:
    """Follow the motion for so many steps of length h: changes q and v."""
    normal = contacts.normal
    tangent = contacts.tangent
    middle = work.middle
    new = work.new
    pull = work.pull
    before = work.before
    P = work.P
    T = work.T
    d = len(q)
    c = len(normal)
    for i in range(c):
        for a in range(d):
            work.along[i, a] = dot_product(inverse[a], normal[i])
            work.across[i, a] = dot_product(inverse[a], tangent[i])
        work.give[i] = dot_product(normal[i], work.along[i])
        work.slide[i] = dot_product(tangent[i], work.across[i])
    for k in range(steps):
        for a in range(d):
            middle[a] = q[a] + 0.5 * h * v[a]
        for a in range(d):
            force = push[0, a] + push[1, a] * math.sin(push[2, a] * (k + 0.5) * h)
            pull[a] = h * (force - dot_product(K[a], middle) - dot_product(C[a], v))
        for a in range(d):
            new[a] = v[a] + dot_product(inverse[a], pull)
        for i in range(c):
            before[i] = dot_product(normal[i], v)
            P[i] = 0.0
            T[i] = 0.0
        for _ in range(100_000):  # some pairs of contacts converge slowly
            moved = 0.0
            for i in range(c):
                if dot_product(normal[i], middle) + contacts.offset[i] > 0.0:
                    continue
                off = dot_product(normal[i], new) + contacts.e[i] * min(before[i], 0.0)
                impulse = max(P[i] - off / work.give[i], 0.0)
                _struck(new, work.along[i], impulse - P[i])
                moved = max(moved, abs(impulse - P[i]))
                P[i] = impulse
                if contacts.mu[i] > 0.0:
                    limit = contacts.mu[i] * P[i]
                    impulse = T[i] - dot_product(tangent[i], new) / work.slide[i]
                    impulse = min(max(impulse, -limit), limit)
                    _struck(new, work.across[i], impulse - T[i])
                    moved = max(moved, abs(impulse - T[i]))
                    T[i] = impulse
            if moved <= 1e-14:
                break
        for a in range(d):
            q[a] = middle[a] + 0.5 * h * new[a]
            v[a] = new[a]
