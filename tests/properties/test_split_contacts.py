"""Several contacts that rub along one direction are one with the sum of their thresholds: motions,
events, statistics and certificates are the same however the friction is written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import stickslip as ss

_DRIVE = "x**2/2 - P*x*cos(w*t)"


def system(
    contacts: Mapping[str, ss.Contact | ss.Unilateral | ss.Bilateral], pressed: bool = False
) -> ss.System:
    """An oscillator that is driven; its load presses it with a force of 10."""
    return ss.System(
        name="driven",
        parameters={"P": ss.Parameter(2.0), "w": ss.Parameter(0.5)},
        coordinates={n: ss.Inertial() for n in ("xy" if pressed else "x")},
        kinetic="(d_x**2 + d_y**2)/2" if pressed else "d_x**2/2",
        potential=f"10*y + {_DRIVE}" if pressed else _DRIVE,
        contacts=contacts,
        initial={"x": 0.5},
        span=(0, 60),
    )


part = st.floats(0.05, 0.95)
side = st.floats(0.3, 1.5)


@given(side, side, part, part, st.floats(0.5, 1.0), st.floats(1.6, 3.0))
@settings(max_examples=12, deadline=None)
def test_two_contacts_are_their_sum(
    plus: float, minus: float, a: float, b: float, drops: float, load: float
) -> None:
    """Thresholds of both ways in different parts, static above kinetic."""
    shares = ((a * plus, b * minus), ((1 - a) * plus, (1 - b) * minus))
    one = {"whole": ss.Contact("d_x", (plus, minus), kinetic=(drops * plus, drops * minus))}
    two = {
        name: ss.Contact("d_x", share, kinetic=(drops * share[0], drops * share[1]))
        for name, share in zip(("left", "right"), shares, strict=True)
    }
    whole, split = (ss.simulate(system(c), parameters={"P": load}) for c in (one, two))
    assert whole.certificate.ok
    assert split.certificate.ok, split.certificate
    assert len(split.events) == len(whole.events)
    np.testing.assert_allclose(split.events["time"], whole.events["time"], rtol=1e-10)
    assert set(split.events["contact"]) <= {"left + right"}
    np.testing.assert_array_equal(split.modes["left"], split.modes["right"])
    np.testing.assert_allclose(
        split.event_catalogue().dataset["size"], whole.event_catalogue().dataset["size"], rtol=1e-9
    )
    data = split.dataset
    total = data["friction_left"] + data["friction_right"]
    np.testing.assert_allclose(total, whole.dataset["friction_whole"], atol=1e-9)
    for key in two:
        force = data[f"friction_{key}"]
        room = 1e-12 + np.zeros(len(force))
        assert np.all(force <= data[f"threshold_minus_{key}"] + room)
        assert np.all(-force <= data[f"threshold_plus_{key}"] + room)


WRITTEN = {
    "threshold": ({"b": ss.Contact("d_x", 1.5)}, False),
    "gear": ({"a": ss.Contact("d_x", 1.0), "b": ss.Contact("-2*d_x", 0.25)}, False),
    "constraint": ({"f": ss.Bilateral("y", "d_x", 0.15)}, True),
    "constraint and gear": (
        {"f": ss.Bilateral("y", "-d_x/2", 0.1), "b": ss.Contact("3*d_x", "normal_f/30")},
        True,
    ),
    "floor": ({"f": ss.Unilateral("y", "d_x", 0.15)}, True),
    "sum": ({"f": ss.Unilateral("y"), "b": ss.Contact("d_x", "0.5 + 0.1*normal_f")}, True),
    "floor and brake": (
        {"f": ss.Unilateral("y", "d_x", 0.05), "b": ss.Contact("d_x", "0.5 + 0.05*normal_f")},
        True,
    ),
    "constraint and brakes": (
        {
            "f": ss.Bilateral("y", "d_x", 0.05),
            "b": ss.Contact("d_x", "0.2 + 0.05*normal_f"),
            "c": ss.Contact("d_x", 0.3),
        },
        True,
    ),
    "floor and gear": (
        {"b": ss.Contact("2*d_x", 0.25), "f": ss.Unilateral("y", "-2*d_x", 0.05)},
        True,
    ),
    "two floors along multiples": (
        {
            "left": ss.Unilateral("y", "d_x", 0.15),
            "right": ss.Unilateral("y", "-2*d_x", 0.075),
        },
        True,
    ),
    "two floors": (
        {
            "left": ss.Unilateral("y", "d_x", 0.15),
            "right": ss.Unilateral("y", "d_x", 0.15),
        },
        True,
    ),
}


@pytest.fixture(scope="module")
def plain() -> ss.Cycle:
    """The cycle of the oscillator with one threshold of 1.5."""
    return ss.find_cycle(system(WRITTEN["threshold"][0]))


@pytest.mark.parametrize("how", [how for how in WRITTEN if how != "threshold"])
def test_the_same_friction_written_otherwise(how: str, plain: ss.Cycle) -> None:
    """Cycles, phases, branches, maps, fits and pictures speak of what was declared."""
    contacts, pressed = WRITTEN[how]
    oscillator = system(contacts, pressed)
    motion = ss.simulate(oscillator)
    assert motion.certificate.ok, motion.certificate
    plain_motion = ss.simulate(system(WRITTEN["threshold"][0]))
    assert motion.n_switches == plain_motion.n_switches
    assert len(motion.event_catalogue()) == len(plain_motion.event_catalogue())
    cycle = ss.find_cycle(oscillator, motion)
    assert cycle.certificate.ok, cycle.certificate
    assert cycle.stick_time == pytest.approx(plain.stick_time, rel=1e-9)
    assert len(cycle.phases) == len(plain.phases)
    assert set(cycle.contacts) == set(contacts)
    assert set(cycle.phases[0].modes) == set(contacts)
    rubbing = [n for n, c in contacts.items() if c.direction]
    times = [cycle.contacts[n].stick_time for n in rubbing]
    np.testing.assert_allclose(times, plain.stick_time, rtol=1e-9)
    work = sum(cycle.contacts[n].dissipated for n in contacts)
    assert work == pytest.approx(plain.dissipated, rel=1e-9)
    assert plain.describe()
    assert cycle.describe()
    branch = ss.continue_cycle(cycle, "P", (1.95, 2.05))
    assert branch.certificate.ok, branch.certificate
    found = ss.sweep(oscillator, {"P": "1.9:2.1:2"}, ["stick_fraction", "switches"])
    same = ss.sweep(
        system(WRITTEN["threshold"][0]), {"P": "1.9:2.1:2"}, ["stick_fraction", "switches"]
    )
    for measure in ("stick_fraction", "switches"):
        np.testing.assert_allclose(found[measure], same[measure], rtol=1e-9)


def test_a_force_that_is_not_determined() -> None:
    """Peak forces of one of several contacts that are one are refused."""
    two = system({"a": ss.Contact("d_x", 1.0), "b": ss.Contact("d_x", 0.5)})
    with pytest.raises(ss.DeclarationError, match="only the sum of their forces is determined"):
        ss.sweep(two, {"P": "1.9:2.1:2"}, ["peak_force:a"])


def test_a_name_that_looks_joined() -> None:
    """What joins names stands in none."""
    with pytest.raises(ss.DeclarationError, match="is reserved for contacts"):
        system({"a + b": ss.Contact("d_x", 1.0)})


_SLIDING = "0.08 + 0.07*exp(-speed/0.2)"
WEAKENING = {
    "formula": {
        "f": ss.Unilateral("y"),
        "c": ss.Contact("d_x", "0.15*normal_f", 0.3, kinetic=f"({_SLIDING})*normal_f"),
    },
    "floor": {"c": ss.Unilateral("y", "d_x", 0.15, 0.3, kinetic=_SLIDING)},
    "constraint": {"c": ss.Bilateral("y", "d_x", 0.15, 0.3, kinetic=_SLIDING)},
    "law": {
        "f": ss.Unilateral("y"),
        "c": ss.laws.stribeck(
            "d_x", surface_speed=0.3, F_s="0.15*normal_f", F_c="0.08*normal_f", v_s=0.2
        ),
    },
}


def weakening(contacts: Mapping[str, ss.Contact]) -> ss.System:
    """A mass on a belt, pressed by a force that varies."""
    return ss.System(
        name="weakening",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="10*y + x**2/2 - 3*y*sin(3*t)",
        contacts=contacts,
        initial={"x": 0.2},
        span=(0, 10),
    )


@pytest.mark.parametrize("how", ["floor", "constraint", "law"])
def test_kinetic_coefficients(how: str, tmp_path: Path) -> None:
    """Sliding friction below the threshold under a normal force, however it is written."""
    plain, found = (ss.simulate(weakening(WEAKENING[name])) for name in ("formula", how))
    assert plain.certificate.ok
    assert found.certificate.ok, found.certificate
    assert found.n_switches == plain.n_switches == 3
    for name, value in plain.final.items():
        assert found.final[name] == pytest.approx(value, abs=1e-13)
    file = tmp_path / "weakening.toml"
    file.write_text(weakening(WEAKENING[how]).to_toml())
    assert ss.load(file) == weakening(WEAKENING[how])


def test_laws_that_know_no_normal_force() -> None:
    """What has a state or sliders of its own is refused under a normal force."""
    for law in (ss.laws.dahl, ss.laws.jenkins):
        contacts = {"f": ss.Unilateral("y"), "c": law("d_x", F_c="0.15*normal_f", k=5.0)}
        with pytest.raises(ss.DeclarationError, match="cannot depend on a normal force"):
            weakening(contacts)
