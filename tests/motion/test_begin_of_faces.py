"""Where faces leave rest: linear parts of their dissipation, flat sets of forces, small radii."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss


def face(formula, load):
    contact = ss.Contact(("d_x", "d_y", "d_phi"), 0.5, dissipation=formula)
    return ss.System(
        "face",
        coordinates={"x": ss.Inertial("m"), "y": ss.Inertial("m"), "phi": ss.Inertial("rad")},
        kinetic="(d_x**2 + d_y**2)/2 + d_phi**2/4",
        potential=load,
        contacts={"rub": contact},
    )


@pytest.mark.parametrize(
    ("formula", "forward", "backward"),
    [
        ("sqrt(v1**2 + v2**2 + 4*v3**2) + 1.5*v3", 3.5, 0.5),
        ("sqrt(v1**2 + v2**2 + v3**2/4) + 0.3*v3", 0.8, 0.2),
        ("sqrt(v1**2 + v2**2 + 1e-4*v3**2) - 0.003*v3", 0.007, 0.013),
        ("disc(v1, v2, v3) + v3/2", 7 / 6, 1 / 6),
        ("ring(v1, v2, v3/2) - 0.4*v3", 0.1, 0.9),
    ],
)
def test_a_face_that_turns_more_easily_one_way(formula, forward, backward):
    """Under a moment t it begins to turn at s R(0, 0, ±1): the set of moments is not even, and has
    another scale than that of forces."""
    for side, most in ((1, forward), (-1, backward)):
        motion = ss.simulate(face(formula, f"-({side})*t*phi"), (0.0, 2.5))
        assert motion.certificate
        assert motion.events["time"].iloc[0] == pytest.approx(0.5 * most, rel=1e-9)


@pytest.mark.parametrize("seed", (0, 1, 12, 34, 43, 72))
def test_a_flat_set_of_forces(seed):
    """Overloaded from the start, with a set that is flat one way or two: the acceleration w obeys
    b − k D ∇R(w) = w."""
    rng = np.random.default_rng(seed)
    axes = 10.0 ** np.array([rng.uniform(-1.8, 0.0), rng.uniform(-1.8, 0.0), 0.0])
    rng.shuffle(axes)
    load = rng.normal(size=3)
    load *= 0.5 * rng.uniform(1.001, 3.0) / np.linalg.norm(load / axes)
    formula = " + ".join(f"{float(a)!r}**2*v{i + 1}**2" for i, a in enumerate(axes))
    names = ("x", "y", "phi")
    pull = " - ".join(f"({float(f)!r})*{x}" for f, x in zip(load, names, strict=True))
    motion = ss.simulate(face(f"sqrt({formula})", f"-{pull}"), (0.0, 0.5))
    assert motion.certificate
    at = motion.at(0.4)
    w = np.array([float(at[f"d_{x}"]) for x in names]) / 0.4
    slope = axes**2 * w / np.linalg.norm(axes * w)
    masses = np.array([1.0, 1.0, 0.5])
    np.testing.assert_allclose(masses * w, load - 0.5 * slope, rtol=0, atol=1e-9)


def test_a_face_without_friction():
    """Its kinks are still those of the speed that is told."""
    system = replace(
        face("disc(v1, v2, v3)", "0"),
        contacts={"rub": ss.Contact(("d_x", "d_y", "d_phi"), 0.0, dissipation="disc(v1, v2, v3)")},
    )
    motion = ss.simulate(system, (0.0, 1.0), initial={"d_x": 0.5})
    assert motion.certificate
    assert motion.final["x"] == pytest.approx(0.5, rel=1e-12)


def test_a_dissipation_between_motions_that_are_given():
    """λ = −s ∇R(−w)."""
    rub = ss.Contact(("0", "0"), 0.5, ("0.3*cos(t)", "0.2"), dissipation="sqrt(v1**2 + 4*v2**2)")
    system = ss.System(
        "given",
        coordinates={"x": ss.Inertial("m")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"rub": rub},
    )
    motion = ss.simulate(system, (0.0, 10.0))
    assert motion.certificate
    t = np.linspace(0.1, 9.9, 23)
    w = np.array([0.3 * np.cos(t), np.full(len(t), 0.2)])
    size = np.hypot(w[0], 2.0 * w[1])
    at = motion.at(t)
    np.testing.assert_allclose(at["friction_rub_1"], 0.5 * w[0] / size, rtol=0, atol=1e-12)
    np.testing.assert_allclose(at["friction_rub_2"], 2.0 * w[1] / size, rtol=0, atol=1e-12)
