"""Contacts whose directions depend on each other stick where their relative velocities are zero,
whichever of them a solver would have called full."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss


def bodies(seed: int) -> ss.System:
    """Two or three coordinates, and more contacts along random combinations of them than there are;
    at every other seed some of them slip under less than their thresholds."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    names = "xyz"[:n]
    count = n + int(rng.integers(1, 3))
    contacts = {}
    for i in range(count):
        weights = rng.integers(-2, 3, n).astype(float).tolist()
        if not any(weights):
            weights[0] = 1.0
        direction = " + ".join(f"({w!r})*d_{x}" for w, x in zip(weights, names, strict=True) if w)
        threshold = float(rng.uniform(0.1, 0.5))
        kinetic = 0.8 * threshold if seed % 2 and rng.integers(2) else None
        contacts[f"c{i}"] = ss.Contact(direction, threshold, kinetic=kinetic)
    loads = rng.uniform(0.5, 2.5, n)
    waves = rng.uniform(0.7, 1.4, n)
    return ss.System(
        name="bodies",
        coordinates={x: ss.Inertial() for x in names},
        kinetic=" + ".join(f"d_{x}**2/2" for x in names),
        potential=" + ".join(
            f"{x}**2/20 - {float(p)!r}*{x}*sin({float(w)!r}*t)"
            for x, p, w in zip(names, loads, waves, strict=True)
        ),
        contacts=contacts,
        span=(0, 25),
    )


def puck(seed: int) -> ss.System:
    """A puck with friction in a plane and along one to three lines, whose directions are
    combinations of those of the plane; at every other seed some slip under less than their
    thresholds."""
    rng = np.random.default_rng(seed)

    def contact(direction: str | tuple[str, str], least: float, most: float) -> ss.Contact:
        threshold = float(rng.uniform(least, most))
        kinetic = 0.8 * threshold if seed % 2 and rng.integers(2) else None
        return ss.Contact(direction, threshold, kinetic=kinetic)

    contacts = {"p": contact(("d_x", "d_y"), 0.3, 1.0)}
    for i in range(int(rng.integers(1, 4))):
        a, b = 0, 0
        while a == 0 and b == 0:
            a, b = map(int, rng.integers(-2, 3, 2))
        contacts[f"c{i}"] = contact(f"({a})*d_x + ({b})*d_y", 0.1, 0.5)
    if rng.integers(2):
        contacts = dict(reversed(contacts.items()))
    loads, waves = rng.uniform(0.5, 2.5, 2), rng.uniform(0.7, 1.4, 2)
    return ss.System(
        name="puck",
        coordinates={x: ss.Inertial() for x in "xy"},
        kinetic="(d_x**2 + d_y**2)/2",
        potential=" + ".join(
            f"{x}**2/20 - {float(p)!r}*{x}*sin({float(w)!r}*t)"
            for x, p, w in zip("xy", loads, waves, strict=True)
        ),
        contacts=contacts,
        span=(0, 25),
    )


@pytest.mark.parametrize(
    "system",
    [*map(bodies, range(8)), *map(puck, range(24))],
    ids=[*(f"lines-{i}" for i in range(8)), *(f"plane-{i}" for i in range(24))],
)
def test_what_rests_sticks(system: ss.System) -> None:
    """Modes say stick where a relative velocity is zero, and only there; so do all shares."""
    motion = ss.simulate(system)
    assert motion.certificate.ok, motion.certificate
    time = motion.knots.time
    lasts = np.diff(time) > 1e-6
    index = np.flatnonzero(lasts)
    inside = time[index] + np.outer([0.31, 0.5, 0.77], np.diff(time)[index])
    values = [motion.at(t) for t in inside]
    modes = {name: motion.modes[name][index] for name in motion.system.contacts}
    for name, mode in modes.items():
        own = [n for n in values[0] if n in {f"slip_speed_{name}{i}" for i in ("", "_1", "_2")}]
        u = np.array([np.abs(v[n]) for v in values for n in own])
        assert len(own) > 0
        still = np.max(u, axis=0) < 1e-11
        np.testing.assert_array_equal(mode == 0, still)
    pauses = np.all([mode == 0 for mode in modes.values()], axis=0)
    slips = motion.event_catalogue()
    begun = slips.dataset["start"].values
    for start, end in zip(begun, begun + slips.dataset["duration"].values, strict=True):
        own = (time[index] >= start) & (time[index] < end - 1e-9)
        assert not np.any(pauses & own)
