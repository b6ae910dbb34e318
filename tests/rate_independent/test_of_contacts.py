"""The sets of both halves of the library are the same objects: what a motion's contacts do is what
their potentials say, as a law that knows nothing of the engine."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.arrays import Array
from stickslip.errors import DeclarationError

LOADS = {"x": "1.1*sin(2.1*t)", "y": "0.5*cos(1.3*t + 0.4)", "phi": "0.2*sin(1.7*t + 1)"}
SKEW = np.array([[1.3, 0.4], [0.4, 0.7]])


def body(*names: str, **contact: object) -> ss.System:
    return ss.System(
        "body",
        coordinates={x: ss.Inertial(force=LOADS[x]) for x in names},
        kinetic="(" + " + ".join(f"d_{x}**2" for x in names) + ")/2",
        parameters={"s": ss.Parameter(0.8), "a": ss.Parameter(0.6)},
        contacts={"rub": ss.Contact(**contact)},  # type: ignore[arg-type]
    )


PLANE = ("d_x", "d_y")
FACE = ("d_x", "d_y", "d_phi")
SYSTEMS = {
    "line": body("x", direction="d_x", threshold=("s", "s/2")),
    "disc": body("x", "y", direction=PLANE, threshold="s"),
    "ellipse": body("x", "y", direction=PLANE, threshold="s", axes=(1, "a")),
    "ellipsoid": body("x", "y", direction=PLANE, threshold="s", dissipation=ss.Ellipsoid(SKEW)),
    "snake": body(
        "x",
        "y",
        direction=PLANE,
        threshold="s",
        dissipation="sqrt((max(v1, 0) + 1.5*max(-v1, 0))**2 + 2*v2**2)",
    ),
    "face": body("x", "y", "phi", direction=FACE, threshold="s", axes=(1, 1, "2*a/3")),
    "coin": body("x", "y", "phi", direction=FACE, threshold="s", dissipation="disc(v1, v2, a*v3)"),
}


def told(system: ss.System) -> tuple[Array, Array]:
    """Forces that friction holds, and velocities, at 200 instants of a motion."""
    motion = ss.simulate(system, (0.0, 9.0))
    assert motion.certificate.ok
    at = motion.at(np.linspace(0.0, 9.0, 200))
    keys = [x for x in at if x.startswith("friction_rub")]
    names = system.declaration.inertial
    assert len(keys) == len(names)
    return -np.array([at[key] for key in keys]).T, np.array([at[f"d_{x}"] for x in names]).T


@pytest.mark.parametrize("name", SYSTEMS)
def test_contact_obeys_its_potential(name: str) -> None:
    system = SYSTEMS[name]
    potential = ss.dissipation_of(system, "rub")
    forces, velocities = told(system)
    slips = np.abs(velocities).max(axis=1) > 1e-9
    assert 3 < slips.sum() < 198  # it sticks, and it slips
    for force, v in zip(forces, velocities, strict=True):
        assert potential.excess(force) <= 1e-9
        if np.abs(v).max() > 1e-9:
            assert force @ v == pytest.approx(potential.support(v), rel=1e-9)
            assert force == pytest.approx(potential.exposed(v), abs=1e-7)


def test_potentials_of_evolutions_are_taken_as_they_are() -> None:
    text = "sqrt(v1**2 + 4*v2**2) + 0.2*v1"
    given = body(*"xy", direction=PLANE, dissipation=ss.SupportFormula(text))
    assert given == body(*"xy", direction=PLANE, dissipation=text)
    again = ss.dissipation_of(given, "rub")
    v = np.array([0.3, -0.7])
    assert again.support(v) == pytest.approx(ss.SupportFormula(text).support(v), rel=1e-15)


def test_thresholds_have_values() -> None:
    foot = ss.System(
        "foot",
        coordinates={"x": ss.Inertial(), "z": ss.Inertial(force="-1")},
        kinetic="(d_x**2 + d_z**2)/2",
        parameters={"mu": ss.Parameter(0.3)},
        contacts={"foot": ss.Unilateral("z", direction="d_x", mu="mu*(1 + x)")},
    )
    potential = ss.dissipation_of(foot, "foot", {"normal_foot": 2.0, "x": 1.0})
    assert potential.support([-1.0]) == pytest.approx(1.2)
    with pytest.raises(DeclarationError, match=r"depends on 'normal_foot'.*Give its value"):
        ss.dissipation_of(foot, "foot", {"x": 1.0})
    with pytest.raises(DeclarationError, match=r"is -0\.3"):
        ss.dissipation_of(foot, "foot", {"normal_foot": 1.0, "x": -2.0})
    with pytest.raises(DeclarationError, match=r"unknown contact 'fot'.*Did you mean 'foot'"):
        ss.dissipation_of(foot, "fot")


def test_what_a_contact_does_not_take() -> None:
    with pytest.raises(DeclarationError, match="depends on a phase"):
        ss.Contact(PLANE, 1.0, dissipation=ss.SupportFormula("sqrt(v1**2+v2**2)*(2+sin(2*pi*s))"))
    with pytest.raises(DeclarationError, match="WeightedL1 has no formula"):
        ss.Contact(PLANE, 1.0, dissipation=ss.WeightedL1([1.0, 1.0]))
