"""Derivatives of motions in which several forces act on one rate: which of them is full when all
rest is no event, and the derivative is that of one contact that has the sum of the forces."""

from __future__ import annotations

import numpy as np

import stickslip as ss


def driven(rng: np.random.Generator) -> tuple[ss.System, ss.System]:
    """Blocks under several brakes, and the same with one brake on each rate."""
    blocks = int(rng.integers(1, 3))
    names = [f"x{i}" for i in range(blocks)]
    rates = ["d_x0", "d_x1 - d_x0"][:blocks]
    several: dict[str, ss.Contact] = {}
    one: dict[str, ss.Contact] = {}
    for rate in rates:
        s = [float(v) for v in rng.uniform(0.2, 0.8, int(rng.integers(1, 4)))]
        part = float(rng.uniform(0.5, 0.9)) if rng.random() < 0.5 else 1.0
        for value in s:
            several[f"b{len(several)}"] = brake(rate, value, part)
        one[f"c{len(one)}"] = brake(rate, sum(s), part)
    loads = [
        f"a*{rng.uniform(0.8, 3.0):.3f}*{x}*sin({rng.uniform(1.0, 3.0):.3f}*t + {i})"
        for i, x in enumerate(names)
    ]
    spring = f"{rng.uniform(0.0, 2.0):.3f}*({' - '.join(reversed(names))})**2/2"

    def system(contacts: dict[str, ss.Contact]) -> ss.System:
        return ss.System(
            "brakes",
            parameters={"a": ss.Parameter(1.0)},
            coordinates={x: ss.Inertial() for x in names},
            kinetic=" + ".join(f"d_{x}**2/2" for x in names),
            potential=" - ".join([spring, *loads]),
            contacts=contacts,
            initial={"d_x0": 0.5},
            span=(0.0, 8.0),
        )

    return system(several), system(one)


def brake(rate: str, threshold: float, part: float) -> ss.Contact:
    if part == 1.0:
        return ss.Contact(rate, threshold)
    return ss.Contact(rate, threshold, kinetic=part * threshold)


def test_several_brakes_and_one() -> None:
    """Neither crashes nor events that are none: derivatives exist where those of one brake do."""
    rng = np.random.default_rng(2)
    times = np.linspace(0.0, 8.0, 5)
    for _ in range(24):
        several, one = (ss.simulate(system) for system in driven(rng))
        found, meant = (m.sensitivity(["a", "d_x0"], times) for m in (several, one))
        assert found.attrs["missing"] == meant.attrs["missing"]
        for name in several.system.coordinates:
            np.testing.assert_allclose(found[name], meant[name], rtol=1e-7, atol=1e-7)


def pressed(rng: np.random.Generator) -> ss.System:
    """A block on a floor under another one that is held by a force and by friction at once."""
    mu = float(rng.choice([0.0, 0.2, 0.4]))
    threshold = f"{rng.uniform(0.1, 0.5):.3f} + {rng.uniform(0.02, 0.1):.3f}*normal_floor"
    kinetic = f"{rng.uniform(0.5, 0.95):.3f}*({threshold})" if rng.random() < 0.6 else None
    floor = ss.Unilateral("y", "d_x", mu) if mu else ss.Unilateral("y")
    return ss.System(
        "blocks",
        parameters={"g": ss.Parameter(10.0)},
        coordinates={x: ss.Inertial() for x in "xyz"},
        kinetic=f"(d_x**2 + d_y**2 + {rng.uniform(0.3, 2.0):.3f}*d_z**2)/2 + 0.1*d_x*d_z",
        potential=f"g*y + {rng.uniform(0.0, 2.0):.3f}*(x - z)**2"
        f" - {rng.uniform(0.0, 1.5):.3f}*x*sin({rng.uniform(1.0, 4.0):.3f}*t)",
        contacts={"floor": floor, "between": ss.Contact("d_z - d_x", threshold, kinetic=kinetic)},
        initial={
            "d_x": float(rng.uniform(0.3, 2.0)),
            "d_z": float(rng.uniform(-0.5, 0.5)),
            "y": float(rng.uniform(0.05, 0.4)) * (rng.random() < 0.5),
        },
        span=(0.0, 3.0),
    )


def test_force_and_friction_that_stick_together() -> None:
    """Derivatives are those of differences of motions."""
    rng = np.random.default_rng(3)
    times = np.array([0.9, 1.8, 3.0])
    for _ in range(20):
        motion = ss.simulate(pressed(rng))
        assert motion.certificate.ok
        found = motion.sensitivity(["g", "d_x"], times, second_opinion=True)
        assert not found.attrs["missing"], found.attrs["missing"]
        for name in motion.system.coordinates:
            by_differences = found[f"{name}_by_differences"]
            np.testing.assert_allclose(found[name], by_differences, rtol=1e-5, atol=1e-6)
