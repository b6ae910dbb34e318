"""Contacts whose relative velocities are multiples of one another are one contact with the sum of
|rᵢ|sᵢ: motions, events, statistics and certificates are the same however friction is written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss

_SIDES = ("a", "b", "c", "d")


def driven(
    contacts: Mapping[str, Any], parameters: Mapping[str, float] | None = None, pressed: str = ""
) -> ss.System:
    """An oscillator that is driven; `pressed` is what its load varies by."""
    coordinates = "xy" if pressed else "x"
    drive = "x**2/2 - P*x*cos(w*t)"
    given = {"P": 2.5, "w": 0.5, **(parameters or {})}
    return ss.System(
        name="driven",
        parameters={name: ss.Parameter(value) for name, value in given.items()},
        coordinates={n: ss.Inertial() for n in coordinates},
        kinetic="(d_x**2 + d_y**2)/2" if pressed else "d_x**2/2",
        potential=f"10*y + y*({pressed}) + {drive}" if pressed else drive,
        contacts=contacts,
        initial={"x": 0.5},
        span=(0, 30),
    )


class Parts:
    """A contact in random parts along random multiples of d_x, and the whole of them along one of
    these."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.count = int(rng.integers(2, 5))
        self.ratios = rng.choice([-1.0, 1.0], self.count) * rng.uniform(0.2, 4.0, self.count)
        self.sides = rng.dirichlet(np.ones(self.count), 2).T * rng.uniform(0.6, 1.6, 2)
        self.sides /= np.abs(self.ratios)[:, None]  # for u > 0, u < 0, each along its own direction
        self.drops = rng.uniform(0.5, 1.0, self.count)
        self.belt = float(rng.choice([0.0, 0.3]))
        self.pressed = bool(rng.integers(2))
        self.written = rng.choice(["number", "parameter", "quotient"], self.count)
        self.names = _SIDES[: self.count]
        # The first is one whose direction no parameter can let vanish.
        numbers = np.flatnonzero(self.written == "number")
        self.first = int(numbers[0]) if len(numbers) else 0

    @property
    def joined(self) -> str:
        """The name of what is one."""
        return " + ".join(sorted(self.names, key=lambda name: name != self.names[self.first]))

    def _factor(self, i: int) -> str:
        r = float(self.ratios[i])
        match self.written[i]:
            case "parameter":
                return f"r_{i}*"
            case "quotient":
                return f"2*r_{i}/2*"
        return f"({r!r})*"

    @property
    def parameters(self) -> dict[str, float]:
        return {f"r_{i}": float(r) for i, r in enumerate(self.ratios)}

    def system(self, whole: bool) -> ss.System:
        """With all parts, or with what they are together."""
        force = "normal_f/10" if self.pressed else "1"
        belt = f"{self.belt!r}*cos(t/3)"
        lead = float(self.ratios[self.first])
        totals: list[list[str]] = [[], [], [], []]
        contacts: dict[str, Any] = {"f": ss.Unilateral("y")} if self.pressed else {}
        for i, name in enumerate(self.names):
            plus, minus = map(float, self.sides[i])
            drop, r = float(self.drops[i]), float(self.ratios[i]) / lead
            laws = [
                f"{s!r}*({drop!r} + {1.0 - drop!r}*exp(-{{k!r}}*speed))*{force}"
                for s in (plus, minus)
            ]
            own = [f"{plus!r}*{force}", f"{minus!r}*{force}", *(law.format(k=1.0) for law in laws)]
            seen = [*own[:2], *(law.format(k=abs(r)) for law in laws)]
            if r < 0:
                seen = [seen[1], seen[0], seen[3], seen[2]]
            for total, side in zip(totals, seen, strict=True):
                total.append(f"{abs(r)!r}*{side}")
            factor = self._factor(i)
            if not whole:
                contacts[name] = ss.Contact(
                    f"{factor}d_x",
                    (own[0], own[1]),
                    f"{factor}{belt}",
                    kinetic=(own[2], own[3]),
                )
        if whole:
            plus, minus, *kinetic = [" + ".join(total) for total in totals]
            factor = f"({lead!r})*"
            contacts["all"] = ss.Contact(
                f"{factor}d_x", (plus, minus), f"{factor}{belt}", kinetic=(kinetic[0], kinetic[1])
            )
        return driven(contacts, self.parameters, "3*sin(3*t)" if self.pressed else "")


@pytest.mark.parametrize("seed", range(10))
def test_parts_along_multiples_are_their_sum(seed: int) -> None:
    """Motion, modes, events, forces, energies, catalogues."""
    parts = Parts(seed)
    split, whole = (ss.simulate(parts.system(way)) for way in (False, True))
    assert whole.certificate.ok
    assert split.certificate.ok, split.certificate
    assert split.n_switches == whole.n_switches > 2
    np.testing.assert_allclose(split.events["time"], whole.events["time"], rtol=1e-9)
    assert set(split.events["contact"]) <= {parts.joined, "f"}
    assert list(split.events["to"]) == list(whole.events["to"])
    for name, r in zip(parts.names, parts.ratios, strict=True):
        sense = np.sign(r / parts.ratios[parts.first])
        np.testing.assert_array_equal(split.modes[name], sense * whole.modes["all"])
    ours, theirs = split.event_catalogue().dataset, whole.event_catalogue().dataset
    assert len(ours["size"]) > 0
    for column in ("size", "largest_slip", "contacts", "duration", "energy_released"):
        np.testing.assert_allclose(ours[column], theirs[column], rtol=1e-8)
    times = np.linspace(*split.t_span, 301)
    data, of_whole = split.at(times), whole.at(times)
    ratios = parts.ratios / parts.ratios[parts.first]
    forces = [data[f"friction_{name}"] for name in parts.names]
    speeds = [data[f"slip_speed_{name}"] for name in parts.names]
    np.testing.assert_allclose(ratios @ np.array(forces), of_whole["friction_all"], atol=1e-8)
    for name, r, force, speed in zip(parts.names, ratios, forces, speeds, strict=True):
        np.testing.assert_allclose(speed, r * of_whole["slip_speed_all"], atol=1e-8)
        assert np.all(force * speed < 1e-9)
        assert np.all(force <= data[f"threshold_minus_{name}"] + 1e-9)
        assert np.all(-force <= data[f"threshold_plus_{name}"] + 1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_cycles_and_maps_of_parts(seed: int) -> None:
    """Stick times, works and shares of maps."""
    parts = Parts(100 + seed)
    parts.pressed, parts.belt = False, 0.0
    split, whole = parts.system(False), parts.system(True)
    ours, theirs = ss.find_cycle(split), ss.find_cycle(whole)
    assert ours.certificate.ok, ours.certificate
    assert len(ours.phases) == len(theirs.phases)
    assert ours.stick_time == pytest.approx(theirs.stick_time, rel=1e-9)
    works = [ours.contacts[name].dissipated for name in parts.names]
    assert min(works) > 0.0
    assert sum(works) == pytest.approx(theirs.dissipated, rel=1e-9)
    measures = ["stick_fraction", "energy_per_cycle", "switches"]
    of_parts = [f"{m}:{n}" for m in ("stick_fraction", "energy_per_cycle") for n in parts.names]
    found = ss.sweep(split, {"P": "2.4:2.6:2"}, [*measures, *of_parts])
    same = ss.sweep(whole, {"P": "2.4:2.6:2"}, measures)
    for measure in measures:
        np.testing.assert_allclose(found[measure], same[measure], rtol=1e-8)
    total = sum(found[f"energy_per_cycle:{name}"] for name in parts.names)
    np.testing.assert_allclose(total, same["energy_per_cycle"], rtol=1e-8)
    for name in parts.names:
        np.testing.assert_allclose(found[f"stick_fraction:{name}"], same["stick_fraction"])


def test_directions_of_several_coordinates() -> None:
    """Two masses that rub on each other in two ways, one of them through a gear."""

    def masses(contacts: Mapping[str, ss.Contact]) -> ss.System:
        return ss.System(
            name="masses",
            coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
            kinetic="d_x**2/2 + d_y**2",
            potential="x**2/2 + y**2 - 3*x*sin(t)",
            contacts=contacts,
            span=(0, 30),
        )

    one = ss.simulate(masses({"a": ss.Contact("d_x/3 - 0.1*d_y", 3.0)}))
    two = ss.simulate(
        masses(
            {
                "a": ss.Contact("d_x/3 - 0.1*d_y", 1.0),
                "b": ss.Contact("0.7*d_y/3 - 0.7*d_x/0.9", 2.0 / 0.7 * 0.3),
            }
        )
    )
    assert two.certificate.ok
    assert two.n_switches == one.n_switches > 4
    np.testing.assert_allclose(two.events["time"], one.events["time"], rtol=1e-10)
    np.testing.assert_array_equal(two.modes["a"], one.modes["a"])
    np.testing.assert_array_equal(two.modes["b"], -one.modes["a"])


def test_a_factor_that_changes_on_the_way() -> None:
    """A brake on a lever whose arm x passes through zero."""
    lever = driven({"b": ss.Contact("x*d_x", 0.5), "a": ss.Contact("d_x", 1.0)})
    plain = driven({"a": ss.Contact("d_x", "1 + 0.5*abs(x)")})
    two, one = ss.simulate(lever), ss.simulate(plain)
    assert two.certificate.ok
    assert two.n_switches == one.n_switches > 4
    for name, value in one.final.items():
        assert two.final[name] == pytest.approx(value, abs=1e-9)
    x = two.knots.state[:, 0]
    side = np.where(two.knots.region[:, 0] == (x[0] >= 0), np.sign(x[0]), -np.sign(x[0]))
    np.testing.assert_array_equal(two.modes["b"], side * two.modes["a"])
    assert np.any(side < 0)
    assert np.any(side > 0)
    none = {"a": ss.Contact("sin(x)*d_x", 1.0), "b": ss.Contact("cos(x)*d_x", 1.0)}
    with pytest.raises(ss.DeclarationError, match="vanishes where the other does not"):
        ss.simulate(driven(none))


def test_a_factor_that_is_zero() -> None:
    """A gear whose ratio is a parameter, across zero."""
    gear = driven({"a": ss.Contact("d_x", 1.0), "b": ss.Contact("r*d_x", 0.5)}, {"r": 1.0})
    for r in (-1.2, 0.0, 1.2):
        motion = ss.simulate(gear, parameters={"r": r})
        one = ss.simulate(driven({"a": ss.Contact("d_x", 1.0 + 0.5 * abs(r))}))
        assert motion.certificate.ok
        np.testing.assert_allclose(motion.events["time"], one.events["time"], rtol=1e-10)
        np.testing.assert_array_equal(motion.modes["b"], (-1 if r < 0 else 1) * one.modes["a"])


def test_what_is_said_of_steady_sliding(tmp_path: Path) -> None:
    """On a belt one slips back and the other forward, in all that has words for it."""
    belt = ss.System(
        name="belt",
        parameters={"r": ss.Parameter(-2.0), "V": ss.Parameter(0.5)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        viscous="0.3*d_x**2",
        contacts={
            "a": ss.Contact("d_x", 1.0, "V", kinetic=0.8),
            "b": ss.Contact("r*d_x", 0.25, "r*V", kinetic=0.2),
        },
    )
    found = ss.equilibria(belt)
    (rest,) = found.isolated
    assert rest.modes == {"a": "slip-", "b": "slip+"}
    assert rest.state["x"] == pytest.approx(1.2, abs=1e-12)
    found.save(tmp_path / "found.nc")
    assert ss.open(tmp_path / "found.nc").isolated == found.isolated
    field = ss.vector_field(belt, rest.modes, at=rest.state)
    assert field.forces_at() == pytest.approx({"a": 0.8, "b": -0.2})
    with pytest.raises(ss.DeclarationError, match="'b' backward"):
        ss.vector_field(belt, {"a": "slip-", "b": "slip-"})


def test_derivatives_of_parts() -> None:
    """Those of forces and relative velocities of a contact that slips backward."""
    gear = driven({"a": ss.Contact("d_x", 1.0), "b": ss.Contact("r*d_x", "s")}, {"r": -2, "s": 0.2})
    motion = ss.simulate(gear)
    names = ["P", "r", "s"]
    of = ["x", "friction_b", "slip_speed_b", "friction_a"]
    found = motion.sensitivity(names, [4.0, 11.0], of=of)
    step = 1e-5
    for i, name in enumerate(names):
        at = gear.values[name]
        ends = [ss.simulate(gear, parameters={name: at + s}).at([4.0, 11.0]) for s in (-step, step)]
        for quantity in of:
            differences = (ends[1][quantity] - ends[0][quantity]) / (2.0 * step)
            np.testing.assert_allclose(found[quantity][i], differences, atol=1e-5)


@pytest.mark.parametrize("how", ["brakes", "constraint"])
def test_forces_between_knots(how: str) -> None:
    """Pictures and harmonics take forces of parts, and of constraints, where they are."""
    contacts, pressed = {
        "brakes": ({"a": ss.Contact("d_x", 1.0), "b": ss.Contact("d_x", 0.5)}, ""),
        "constraint": ({"f": ss.Bilateral("y", "d_x", 0.15)}, "3*sin(t)"),
    }[how]
    motion = ss.simulate(driven(contacts, pressed=pressed))
    times = np.linspace(0.01, 29.9, 301)
    index = np.searchsorted(motion.knots.time, times, side="right") - 1
    names = [
        n for n in map(str, motion.dataset) if n.startswith(("friction_", "normal_", "slip_speed_"))
    ]
    traced, exact = motion.trace(names, times, index), motion.at(times)
    for name in names:
        np.testing.assert_allclose(traced[name], exact[name], atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_planes_along_multiples(seed: int) -> None:
    """Friction in a plane in two parts, the other one on turned and scaled axes."""
    rng = np.random.default_rng(seed)
    turn, r, part = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 3.0), rng.uniform(0.2, 0.8)
    c, s = float(r * np.cos(turn)), float(r * np.sin(turn))
    flip = float(rng.choice([-1.0, 1.0]))
    turned = (f"{c!r}*d_x + {s!r}*d_y", f"{-flip * s!r}*d_x + {flip * c!r}*d_y")
    load = float(rng.uniform(1.5, 2.0))

    def puck(contacts: Mapping[str, ss.Contact]) -> ss.System:
        return ss.System(
            name="puck",
            coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
            kinetic="(d_x**2 + d_y**2)/2",
            potential=f"-{load!r}*x*sin(t) - y*cos(1.3*t)",
            contacts=contacts,
            span=(0, 30),
        )

    plane = ("d_x", "d_y")
    one = ss.simulate(puck({"a": ss.Contact(plane, 1.5, kinetic=1.2)}))
    two = ss.simulate(
        puck(
            {
                "a": ss.Contact(plane, 1.5 * part, kinetic=1.2 * part),
                "b": ss.Contact(turned, 1.5 * (1 - part) / r, kinetic=1.2 * (1 - part) / r),
            }
        )
    )
    assert one.certificate.ok
    assert two.certificate.ok, two.certificate
    np.testing.assert_array_equal(two.modes["a"], two.modes["b"])
    assert one.n_switches > 2
    changes = np.unique(two.events["time"])
    np.testing.assert_allclose(changes, one.events["time"], rtol=1e-8)
    for name, value in one.final.items():
        assert two.final[name] == pytest.approx(value, abs=1e-8)


@pytest.mark.parametrize("rubs", [False, True])
@pytest.mark.parametrize("r", [1.0, 2.5])
def test_floors_under_one_foot(r: float, rubs: bool) -> None:
    """Floors whose gaps are multiples of one another are closed together, and share their force;
    with friction under it, and impacts."""

    def hopper(gaps: Mapping[str, str], mu: str) -> ss.System:
        friction: dict[str, Any] = {"direction": "d_x", "mu": mu} if rubs else {}
        floors = {
            name: ss.Unilateral(gap, restitution=0.5, **friction) for name, gap in gaps.items()
        }
        return ss.System(
            name="hopper",
            parameters={"P": ss.Parameter(13.0)},
            coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
            kinetic="(d_x**2 + d_y**2)/2",
            potential="x**2/2 - 2*x*sin(t) + 10*y + P*y*sin(2*t)",
            contacts=floors,
            initial={"x": 0.5},
            span=(0, 20),
        )

    # N = N_f + r N_g, shared as 1 to r
    two = ss.simulate(hopper({"f": "y", "g": f"{r!r}*y"}, "0.3"))
    one = ss.simulate(hopper({"f": "y"}, f"{0.3 * (1 + r) / (1 + r * r)!r}"))
    assert two.certificate.ok, two.certificate
    assert two.n_switches == one.n_switches > 10
    np.testing.assert_allclose(two.events["time"], one.events["time"], rtol=1e-9)
    assert set(two.events["contact"]) == {"f + g"}
    assert len(two.impacts) == len(one.impacts) > 100
    for name in "fg":
        np.testing.assert_array_equal(two.modes[name], one.modes["f"])
    times = np.linspace(0.01, 20, 301)
    data, whole = two.at(times), one.at(times)
    np.testing.assert_allclose(data["gap_g"], r * data["gap_f"], atol=1e-12)
    assert np.all((data["normal_g"] > 0) == (data["normal_f"] > 0))
    total = data["normal_f"] + r * data["normal_g"]
    np.testing.assert_allclose(total, whole["normal_f"], atol=1e-8)
    late = np.array([6.5, 15.9])
    slopes = two.sensitivity(["P"], late, of=["y", "normal_f", "normal_g", "gap_g"])
    np.testing.assert_allclose(slopes["gap_g"], r * slopes["y"], atol=1e-9)
    np.testing.assert_allclose(slopes["normal_g"], r * slopes["normal_f"], atol=1e-9)


def test_names_that_cancel_between_two_directions_are_given_values() -> None:
    """Of two feet at the same height, what is compared does not depend on the height alone."""
    system = ss.System(
        "two feet",
        parameters={name: ss.Parameter(1.0) for name in ("a0", "a1", "h")},
        coordinates={name: ss.Inertial() for name in ("x", "th")},
        kinetic="(d_x**2 + d_th**2)/2",
        contacts={
            f"f{i}": ss.Contact(f"d_x + (h*cos(th) - a{i}*sin(th))*d_th", 1.0) for i in range(2)
        },
        span=(0.0, 1.0),
    )
    motion = ss.simulate(system, initial={"d_x": 1.0, "d_th": 0.3})
    assert motion.certificate.ok
    assert set(motion.modes) == {"f0", "f1"}
