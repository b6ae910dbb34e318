"""Moreau's and Jean's time stepping: contacts that open, Coulomb's friction, Newton's impacts.

M. Jean, *The non-smooth contact dynamics method*, Comput. Methods Appl. Mech. Eng. 177 (1999)
235-257. No event is located: in every step impulses obey the law at the middle of the step. Order
one in the step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Contacts(NamedTuple):
    """Contacts with linear gaps.

    Attributes
    ----------
    normal, tangent : arrays, shape (c, d)
        Gap g = normal·q + offset, slip tangent·v.
    offset, mu, e : arrays, shape (c,)
    """

    normal: Array
    tangent: Array
    offset: Array
    mu: Array
    e: Array


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
    inverse: Array = np.asarray(np.linalg.inv(M), np.float64)
    return _stepped(inverse, C, K, push, contacts, start[0], start[1], end / steps, steps)


@njit(cache=True)
def _stepped(
    inverse: Array,
    C: Array,
    K: Array,
    push: Array,
    contacts: Contacts,
    q: Array,
    v: Array,
    h: float,
    steps: int,
) -> tuple[Array, Array]:
    normal, tangent = contacts.normal, contacts.tangent
    c = len(normal)
    q, v = q.copy(), v.copy()
    P, T = np.zeros(c), np.zeros(c)
    for k in range(steps):
        middle = q + 0.5 * h * v
        force = push[0] + push[1] * np.sin(push[2] * (k + 0.5) * h) - K @ middle - C @ v
        new = v + inverse @ (h * force)
        active = np.zeros(c, np.bool_)
        for i in range(c):
            active[i] = normal[i] @ middle + contacts.offset[i] <= 0.0
            P[i] = T[i] = 0.0
        before = normal @ v
        for _ in range(100_000):  # some pairs of contacts converge slowly
            moved = 0.0
            for i in range(c):
                if not active[i]:
                    continue
                own = normal[i] @ (inverse @ normal[i])
                off = normal[i] @ new + contacts.e[i] * min(before[i], 0.0)
                impulse = max(P[i] - off / own, 0.0)
                new += inverse @ normal[i] * (impulse - P[i])
                moved = max(moved, abs(impulse - P[i]))
                P[i] = impulse
                if contacts.mu[i] > 0.0:
                    own = tangent[i] @ (inverse @ tangent[i])
                    limit = contacts.mu[i] * P[i]
                    impulse = min(max(T[i] - (tangent[i] @ new) / own, -limit), limit)
                    new += inverse @ tangent[i] * (impulse - T[i])
                    moved = max(moved, abs(impulse - T[i]))
                    T[i] = impulse
            if moved <= 1e-14:
                break
        q = middle + 0.5 * h * new
        v = new
    return q, v
