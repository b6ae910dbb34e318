"""Contacts in a plane under normal forces: against thresholds that are given as formulas, friction
along a line, the closed form of a hopping puck, and impulses found by projections."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.arrays import Array
from stickslip.model.system import AnyContact
from systems import parameters

G = 9.81
PLANE = ("d_x", "d_y")


def certified(motion: ss.Trajectory) -> ss.Trajectory:
    assert motion.outcome.ok
    assert motion.certificate.ok, motion.certificate
    return motion


def plate(
    contacts: Mapping[str, AnyContact], angle: float = 0.0, *, lies: bool = True, **given: Any
) -> ss.System:
    """A parcel on a plate that shakes up and down and slopes, in a plane or along a line; one that
    `lies` on it has a height of its own."""
    values = {"g": G, "mu": 0.35, "e": 0.0, "a": 0.02, "w": 20.0, "T": 1.5} | given
    flat = any(getattr(c, "direction", "") == PLANE for c in contacts.values())
    names = ["x", *(["y"] if flat else []), *(["z"] if lies else [])]
    slope = f"{math.cos(angle)!r}*x" + (f" + {math.sin(angle)!r}*y" if flat else "")
    return ss.System(
        name="parcel on a plate",
        parameters=parameters(**values),
        coordinates={name: ss.Inertial() for name in names},
        kinetic=" + ".join(f"d_{name}**2/2" for name in names),
        potential=f"-T*({slope})" + (" + g*z" if lies else ""),
        contacts=contacts,
        span=(0.0, 3.0),
    )


GAP = "z - a*cos(w*t) + a"
RUBS = {"plate": ss.Unilateral(GAP, PLANE, "mu", restitution="e")}
BESIDE = {
    "plate": ss.Unilateral(GAP, restitution="e"),
    "pad": ss.Contact(PLANE, "mu*normal_plate"),
}
ALONG = {"plate": ss.Unilateral(GAP, "d_x", "mu", restitution="e")}
KNOWN = {"plate": ss.Contact(PLANE, "mu*(g - a*w**2*cos(w*t))")}


def test_a_normal_force_is_what_a_formula_says() -> None:
    """As long as the parcel stays on the plate, whose acceleration is 8 of 9.81 m/s²."""
    initial = {"d_x": 0.3, "d_y": 0.4}
    known = certified(ss.simulate(plate(KNOWN, lies=False), initial=initial)).final
    for contacts in (RUBS, BESIDE):
        found = certified(ss.simulate(plate(contacts), initial=initial)).final
        for name in known:
            assert found[name] == pytest.approx(known[name], rel=1e-10, abs=1e-13)


@pytest.mark.parametrize("e", [0.0, 0.3])
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5])
def test_along_a_line_a_hopping_parcel_is_that_of_friction_along_a_line(
    angle: float, e: float
) -> None:
    """It leaves the plate, falls back, and its friction has impulses."""
    along = ss.simulate(plate(ALONG, a=0.03, e=e), initial={"d_x": 0.3})
    assert len(certified(along).impacts) > 5
    initial = {"d_x": 0.3 * math.cos(angle), "d_y": 0.3 * math.sin(angle)}
    for contacts in (RUBS, BESIDE):
        system = plate(contacts, angle, a=0.03, e=e)
        found = certified(ss.simulate(system, initial=initial)).final
        assert found["x"] * math.cos(angle) + found["y"] * math.sin(angle) == pytest.approx(
            along.final["x"], rel=1e-9
        )
        assert found["y"] * math.cos(angle) - found["x"] * math.sin(angle) == pytest.approx(
            0.0, abs=1e-12
        )


def test_a_puck_that_hops_loses_its_speed_in_impacts() -> None:
    """Each takes μ(1 + e) of its approach from the speed, until nothing is left."""
    e, mu, height, speed = 0.5, 0.1, 0.2, 1.3
    system = plate(RUBS, e=e, mu=mu, a=0.0, T=0.0)
    initial = {"z": height, "d_x": 0.6 * speed, "d_y": 0.8 * speed}
    motion = certified(ss.simulate(system, initial=initial))
    approach = math.sqrt(2 * G * height)
    time, way = approach / G, speed * approach / G
    while time < 1.0:  # the bounces end at 3 approach/g
        speed = max(speed - mu * (1 + e) * approach, 0.0)
        approach *= e
        time += 2 * approach / G
        way += speed * 2 * approach / G
        if approach < 1e-14:
            break
    # what is left rubs on
    way += speed**2 / (2 * mu * G)
    assert motion.final["x"] == pytest.approx(0.6 * way, rel=1e-11)
    assert motion.final["y"] == pytest.approx(0.8 * way, rel=1e-11)
    assert motion.final["d_x"] == motion.final["d_y"] == 0.0


def test_a_slider_between_two_plates_is_pressed_from_either_side() -> None:
    """The force across changes its sign: |N| = |2 cos t|."""
    known = ss.System(
        name="known",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="(x**2 + 2*y**2)/2",
        contacts={"plates": ss.Contact(PLANE, "0.3*abs(2*cos(t))")},
        initial={"x": 1.0, "d_y": 0.7},
        span=(0.0, 10.0),
    )
    between = replace(
        known,
        coordinates={name: ss.Inertial() for name in "xyz"},
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2",
        potential=f"{known.potential} + 2*cos(t)*z",
        contacts={"plates": ss.Bilateral("z", PLANE, 0.3)},
    )
    found, expected = (certified(ss.simulate(system)).final for system in (between, known))
    for name in expected:
        assert found[name] == pytest.approx(expected[name], rel=1e-9, abs=1e-12)


# -- impacts ---------------------------------------------------------------------------------------


def impulses(G_: Array, free: Array, pressed: Array, axes: Array) -> Array:
    """Friction impulses of pads, by projections: of each pad |A⁻¹Λ| ≤ μΛ_N, and where it slips Λ is
    opposite to A(γ + GΛ).

    Parameters
    ----------
    G_ : array, shape (2n, 2n)
        Delassus' matrix of all directions.
    free : array, shape (2n,)
        Velocities without friction, γ.
    pressed : array, shape (n,)
        What each holds, μΛ_N.
    axes : array, shape (2n,)
    """
    scaled = axes[:, None] * G_ * axes
    eta = np.zeros(len(free))
    rate = 1.0 / np.linalg.norm(scaled, 2)
    for _ in range(20_000):
        before = eta
        eta = (eta - rate * (axes * free + scaled @ eta)).reshape(-1, 2)
        length = np.linalg.norm(eta, axis=1)
        eta = (eta * np.minimum(1.0, pressed / np.maximum(length, 1e-300))[:, None]).ravel()
        if np.max(np.abs(eta - before)) <= 1e-15:
            break
    return axes * eta


class Pucks:
    """One or two pucks, one on the other, coupled by mass in the plane, on ellipses."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.count = 1 + seed % 2
        n = 2 * self.count
        root = rng.normal(size=(n, n))
        self.M = np.diag(rng.uniform(0.5, 2.0, n)) + 0.2 * root @ root.T
        self.down = rng.uniform(0.5, 2.0, self.count)
        self.axes = rng.uniform(0.4, 1.2, (self.count, 2))
        self.mu = rng.uniform(0.1, 0.8, self.count)
        speed = rng.normal(size=n)
        self.along = [f"{a}{i}" for i in range(self.count) for a in "xy"]
        self.heights = [f"z{i}" for i in range(self.count)]
        self.speed = {f"d_{a}": float(v) for a, v in zip(self.along, speed, strict=True)}

    def system(self, initial: Mapping[str, float], coupled: float = 0.0) -> ss.System:
        contacts: dict[str, AnyContact] = {}
        for i in range(self.count):
            below = [f" - d_{a}{i - 1}" if i else "" for a in "xy"]
            along = (f"d_x{i}{below[0]}", f"d_y{i}{below[1]}")
            gap = f"z{i}" + (f" - z{i - 1}" if i else "")
            axes = (float(self.axes[i, 0]), float(self.axes[i, 1]))
            contacts[f"pad {i}"] = ss.Unilateral(gap, along, float(self.mu[i]), axes=axes)
        terms = [
            f"({float(self.M[i, j])!r})*d_{a}*d_{b}/2"
            for i, a in enumerate(self.along)
            for j, b in enumerate(self.along)
        ]
        terms += [f"{float(m)!r}*d_{z}**2/2" for m, z in zip(self.down, self.heights, strict=True)]
        terms += [f"{coupled!r}*d_z0*d_z1"] if coupled else []
        return ss.System(
            name="pucks that fall",
            coordinates={name: ss.Inertial() for name in (*self.along, *self.heights)},
            kinetic=" + ".join(terms),
            potential=" + ".join(self.heights),
            contacts=contacts,
            initial={**self.speed, **initial},
            span=(0.0, 3.0),
        )

    def jump(self, arriving: Array, held: Array) -> Array:
        """Of the velocities in the plane, under impulses that press the pads."""
        J = np.eye(len(arriving))
        if self.count == 2:
            J[2:, :2] = -np.eye(2)
        inverse = np.linalg.inv(self.M)
        G = J @ inverse @ J.T
        return inverse @ J.T @ impulses(G, J @ arriving, self.mu * held, self.axes.ravel())


_SOON = 1e-9  # after an impact, what its velocities are looked at


@pytest.mark.parametrize("seed", range(12))
def test_an_impact_has_the_impulses_of_the_law(seed: int) -> None:
    pucks = Pucks(seed)
    top = pucks.heights[-1]
    motion = certified(ss.simulate(pucks.system({top: 0.3})))
    (time,) = motion.impacts["time"]
    before, after = (motion.at(time + late) for late in (-_SOON, _SOON))
    # It is at rest then, and so is what it falls on, which is pressed as much.
    held = np.full(pucks.count, -pucks.down[-1] * float(before[f"d_{top}"]))
    assert all(float(after[f"d_{z}"]) == pytest.approx(0.0, abs=1e-12) for z in pucks.heights)
    arriving, leaving = (
        np.array([float(x[f"d_{a}"]) for a in pucks.along]) for x in (before, after)
    )
    np.testing.assert_allclose(leaving, arriving + pucks.jump(arriving, held), atol=50 * _SOON)


@pytest.mark.parametrize("coupled", [0.0, 0.3])
@pytest.mark.parametrize("fall", [0.0, 0.3, 0.4])
@pytest.mark.parametrize("seed", [2, 5, 7, 21, 43])
def test_what_touches_at_the_start_collides_there(seed: int, fall: float, coupled: float) -> None:
    """No velocity is as small then as the rounding errors of what it has lost."""
    pucks = Pucks(seed)
    coupled *= pucks.count - 1
    speeds = [-fall, -0.7][-pucks.count :]
    system = pucks.system(
        {f"d_{z}": v for z, v in zip(pucks.heights, speeds, strict=True)}, coupled
    )
    motion = certified(ss.simulate(system))
    first = motion.impacts["time"].iloc[0]
    assert first == 0.0
    mass = np.diag(pucks.down) + coupled * (np.ones((2, 2)) - np.eye(2) if coupled else 0.0)
    # The upper one gives the lower one, which cannot go on, all that it has.
    momenta = -mass @ np.array(speeds)
    held = np.cumsum(momenta[::-1])[::-1]
    arriving = np.array(list(pucks.speed.values()))
    after = motion.at(_SOON)
    assert all(float(after[f"d_{z}"]) == pytest.approx(0.0, abs=1e-12) for z in pucks.heights)
    leaving = np.array([float(after[f"d_{a}"]) for a in pucks.along])
    np.testing.assert_allclose(leaving, arriving + pucks.jump(arriving, held), atol=50 * _SOON)


# -- cycles ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("a", "impacts"), [(0.02, False), (0.03, True)])
def test_a_cycle_of_a_parcel_on_a_plate(a: float, impacts: bool) -> None:
    """Its derivatives pass impacts and both ends of a slip: neighbours say so."""
    swung = "140*(x - 0.03*cos(w*t))**2/2 + 60*(y - 0.03*sin(w*t))**2/2"
    system = plate(RUBS, a=a, e=0.2)
    system = replace(system, potential=f"{system.potential} + {swung}")
    cycle = ss.find_cycle(system)
    assert cycle.certificate.ok, cycle.certificate
    assert cycle.period == pytest.approx(2 * math.pi / 20, rel=1e-12)
    assert bool(len(cycle.trajectory.impacts)) == impacts
    # A parcel that lies on the plate has no freedom there; one that rests does not slip, either.
    zero = sum(abs(m) < 1e-9 for m in cycle.multipliers)
    assert zero == (4 if impacts else 3)


# -- declarations ----------------------------------------------------------------------------------


def refused(**given: Any) -> ss.DeclarationError:
    plain: dict[str, Any] = {
        "coordinates": {name: ss.Inertial() for name in "xyz"},
        "kinetic": "(d_x**2 + d_y**2 + d_z**2)/2",
        "contacts": {"foot": ss.Unilateral("z", PLANE, 0.3)},
    }
    with pytest.raises(ss.DeclarationError) as caught:
        ss.simulate(ss.System(name="refused", **(plain | given)), (0.0, 1.0))
    return caught.value


def test_one_normal_force_presses_a_contact_in_a_plane() -> None:
    contacts = {
        "foot": ss.Unilateral("z"),
        "pad": ss.Contact(PLANE, "0.3*normal_foot + 1"),
    }
    error = refused(contacts=contacts)
    assert error.where == "contacts.'pad'.threshold"
    assert "must be proportional to normal_foot" in str(error)


def test_it_is_kept_in_a_model_file(tmp_path: Any) -> None:
    foot = ss.Unilateral("z", PLANE, "mu", surface_speed=("0.1", "0"), axes=(1.0, "b"))
    system = plate({"foot": foot}, b=0.5)
    path = tmp_path / "plate.toml"
    path.write_text(system.to_toml())
    again = ss.load(path)
    assert again.contacts["foot"] == foot
    assert again.planes == {"foot": ("foot 1", "foot 2")}
    one, other = (ss.simulate(s, initial={"d_x": 0.3}).final for s in (system, again))
    assert one == other
