"""Samples that repeat are the same as samples that are written out. Long: ``python -m
tests.adversarial``."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from adversarial.kinds import samples
from adversarial.verdict import AGREED


@pytest.mark.parametrize("family", samples.FAMILIES)
@pytest.mark.parametrize("seed", range(4))
def test_repeated_samples(family: str, seed: int) -> None:
    verdict = samples.judge(case := samples.draw(family, seed))
    assert verdict.kind == AGREED, f"{verdict}\n{samples.reproduction(case)}"


def test_written_out() -> None:
    """The knots of a late period are where those of the written-out samples are."""
    for seed in range(4):
        case = samples.draw("belt", seed)
        once, repeated = (ss.simulate(case.system(once)) for once in (True, False))
        assert once.certificate.ok and repeated.certificate.ok
        size = float(np.max(np.abs(once["d_x"])))
        assert repeated.final["d_x"] == pytest.approx(once.final["d_x"], abs=1e-9 * size)
        assert repeated.n_switches == once.n_switches


def sent_back() -> tuple[ss.System, ss.System]:
    """A block on a belt that a wave of straight lines shakes: periodic, and written out."""
    t, w, T = np.array([0.0, 0.0075, 0.0125, 0.02]), np.array([0.0, 0.15, -0.15, 0.0]), 0.02
    turns = np.arange(200)[:, None] * T
    long = np.append((t[:-1] + turns).ravel(), 200 * T), np.append(np.tile(w[:-1], 200), 0.0)
    drives = ss.Samples(t, w, periodic=True), ss.Samples(*long)
    one, other = (
        ss.System(
            "shaken belt",
            drives={"w": drive},
            parameters={"g": ss.Parameter(9.81)},
            coordinates={"z": ss.Inertial(force="-g")},
            kinetic="d_z**2/2",
            contacts={"pad": ss.Contact("d_z", 36.0, "w", kinetic=30.0)},
            span=(0.0, 200 * T),
        )
        for drive in drives
    )
    return one, other


def test_cycles_maps_and_ensembles_agree() -> None:
    """What a cycle, a map and many motions say of repeated samples is what the written-out ones
    do."""
    repeated, once = sent_back()
    g = np.array([9.81, 7.0, 5.0])
    speeds = ss.sweep(repeated, {"g": g}, ["speed:z"]).dataset["speed:z"].values
    many = ss.simulate_many(repeated, parameters={"g": g})
    assert not many.certificate.ok  # an ensemble is never audited, and says so
    for value, speed, end in zip(g, speeds, many.dataset["final_z"].values, strict=True):
        motion = ss.simulate(once, parameters={"g": value})
        cycle = ss.find_cycle(repeated, parameters={"g": value})
        assert motion.certificate.ok and cycle.certificate.ok
        assert end == pytest.approx(motion.final["z"], rel=1e-9)
        pace = (motion.final["z"] - motion.at(2.0)["z"]) / 2.0
        assert cycle.drift / cycle.period == pytest.approx(pace, rel=1e-9)
        assert speed == pytest.approx(pace, rel=1e-9)
