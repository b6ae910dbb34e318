"""An elastic bar on dry ground, pulled at one end and let go again.

A bar of stiffness EA is held by a friction q along its length. The end moves by F²/(2 q EA) while
the force grows to F, where a front has reached F/q, and keeps half of that when the force is taken
away: the front of the way back has twice the friction, and reaches half as far. What is left is a
tension that grows to F/2 at F/(2q) and falls to 0 at F/q. Of n pieces the same sums are exact.
"""

from __future__ import annotations

import numpy as np
import pytest

from stickslip import Contact, RateIndependent, System, simulate
from systems import distance

F, Q, EA, LENGTH = 3.0, 2.0, 5.0, 1.7


def bar(n: int) -> System:
    """The bar in n pieces, in rest at its far end; pulled by F sin πt for half a period."""
    k, s = n * EA / LENGTH, Q * LENGTH / n
    x = [f"u_{i}" for i in range(1, n + 1)]
    springs = [f"{0.5 * k!r}*({a} - {b})**2" for a, b in zip(x, [*x[1:], "0"], strict=True)]
    return System(
        "bar",
        drives={"pull": f"{F}*sin(pi*t)"},
        coordinates={a: RateIndependent(force="pull" if a == "u_1" else 0.0) for a in x},
        potential=" + ".join(springs),
        contacts={f"ground_{a}": Contact(f"d_{a}", s) for a in x},
        span=(0.0, 1.0),
    )


def tensions(n: int, force: float, friction: float) -> np.ndarray:
    """Behind each node, where a force pulls against a friction along the bar."""
    return np.maximum(force - friction * LENGTH / n * np.arange(1, n + 1), 0.0)


@pytest.mark.parametrize("n", [4, 15, 40])
def test_an_elastic_bar_on_dry_ground(n: int) -> None:
    motion = simulate(bar(n))
    assert motion.certificate.ok
    pulled = tensions(n, F, Q)
    left = pulled - tensions(n, F, 2.0 * Q)
    for t, tension in ((0.5, pulled), (1.0, left)):
        moved = np.cumsum(tension[::-1])[::-1] * LENGTH / (n * EA)
        found = np.array([motion.at(t)[f"u_{i}"] for i in range(1, n + 1)])
        assert distance(found, moved) < 1e-13
    # The bar itself is what n pieces tend to, with an error of their length.
    end = motion.at(1.0)["u_1"]
    assert abs(end / (F**2 / (4.0 * Q * EA)) - 1.0) < 2.0 * LENGTH * Q / (F * n)
    events = motion.events
    ends = events.time[events.contact == "ground_u_1"].tolist()
    # The nearest node lets go where the force exceeds its friction, and turns at 2 of these.
    first = Q * LENGTH / n / F
    assert ends[0] == pytest.approx(np.arcsin(first) / np.pi, abs=1e-14)
    assert ends[-1] == pytest.approx(1.0 - np.arcsin(1.0 - 2.0 * first) / np.pi, abs=1e-13)
