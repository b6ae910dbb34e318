"""Cycles of contacts in a plane and of faces, against the motions that come to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss


def driven(dissipation: str) -> ss.System:
    """A disc on springs, shaken and turned."""
    return ss.System(
        "driven disc",
        parameters={"F": ss.Parameter(1.5)},
        coordinates={
            "x": ss.Inertial(force="F*sin(t) - 3*x"),
            "y": ss.Inertial(force="-2*y"),
            "phi": ss.Inertial(force="1.2*cos(t) - 2.3*phi"),
        },
        kinetic="(d_x**2 + d_y**2 + d_phi**2)/2",
        contacts={"face": ss.Contact(("d_x", "d_y", "d_phi"), 0.5, dissipation=dissipation)},
        initial={"d_x": 0.1},
    )


@pytest.mark.parametrize("dissipation", ["disc(v1, v2, v3)", "sqrt(v1**2 + v2**2 + v3**2/2)"])
def test_a_driven_face(dissipation: str, tmp_path: Path) -> None:
    system = driven(dissipation)
    cycle = ss.find_cycle(system)
    assert cycle.certificate.ok
    assert cycle.period == pytest.approx(2 * np.pi, rel=1e-12)
    # the motion that comes to it, after 40 periods
    begin = 80 * np.pi
    motion = ss.simulate(system, (0.0, begin + 2 * np.pi))
    times = np.linspace(0.0, 2 * np.pi, 50)[1:-1]
    own = cycle.trajectory
    for name in ("x", "phi", "d_x", "d_phi"):
        there = motion.at(begin + times)[name]
        start = own.t_span[0]
        here = own.at(start + np.mod(times - start, 2 * np.pi))[name]
        assert here == pytest.approx(there, abs=1e-9)
    path = tmp_path / "cycle.nc"
    cycle.save(path)
    assert ss.open(path).period == cycle.period


def test_a_block_on_a_turntable() -> None:
    """Near the end of its slips linear motions decay at once: a step was to be looked at in 5e15
    parts."""
    system = ss.catalogue.turntable()
    cycle = ss.find_cycle(system)
    events = ss.simulate(system, (0.0, 60.0)).events
    stops = np.asarray(events["time"])[np.asarray(events["to"] == "stick")]
    assert cycle.period == pytest.approx(stops[-1] - stops[-2], rel=1e-7)


@pytest.mark.parametrize("omega", [1.1, 1.2001, 1.25, 1.3])
def test_a_slider_in_a_plane_is_moved_along(omega: float) -> None:
    """To first order its force leaves the disc of those it can hold; it is put back into it."""
    system = ss.catalogue.planar_jenkins()
    moved = ss.find_cycle(system, ss.find_cycle(system), parameters={"omega": omega})
    assert moved.certificate.ok
    settled = ss.find_cycle(system, parameters={"omega": omega})
    assert moved.dissipated == pytest.approx(settled.dissipated, rel=1e-9)
