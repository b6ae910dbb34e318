"""Structures in the explorer: their shape over the number of the unknown, and where they start."""

from __future__ import annotations

import numpy as np

import stickslip as ss
from stickslip.explorer.drawings.draw import scene_of
from stickslip.explorer.drawings.shapes import line_of, rubbing_unknowns
from stickslip.explorer.work.model import _initial
from stickslip.model.quantities import quantity


def test_a_beam_is_drawn_by_its_deflections_and_marks_its_contact() -> None:
    system = ss.catalogue.cantilever()
    motion = ss.simulate(system, (0.0, 0.1))
    times = np.linspace(0.0, 0.1, 40)
    scene = scene_of(motion, times, {})
    (line,) = [part for part in scene.parts if part.shape["kind"] == "curve"]
    assert line.shape["count"] == 8  # nodes, without their rotations
    (sole,) = [part for part in scene.parts if part.contact]
    assert sole.contact == "damper"
    shown = np.array([motion.at(t)["u[rub]"] for t in times])
    drawn = np.asarray(sole.values["y"])
    scale = np.max(np.abs(drawn)) / np.max(np.abs(shown))
    np.testing.assert_allclose(drawn, scale * shown, atol=1e-9)
    tip = np.asarray(line.values["y7"])
    np.testing.assert_allclose(tip, [scale * motion.at(t)["u[tip]"] for t in times], atol=1e-9)


def test_contacts_between_unknowns_are_marked_at_both() -> None:
    system = ss.catalogue.bladed_disk()
    part = system.written_structures["u"]
    marks = rubbing_unknowns(system, "u", part)
    assert marks[part.index("blade_1")] == ["damper_1", "damper_4"]
    assert set(marks) == {part.index(f"blade_{i}") for i in (1, 2, 3, 4)}


def test_a_long_line_has_some_dozens_of_points() -> None:
    at = np.linspace(0.0, 1.0, 3000)
    smooth = np.column_stack([np.sin(k * np.pi * at) for k in (1, 2, 3)])
    line = line_of(smooth, {1234})
    assert len(line) < 60
    assert 1234 in line


def test_a_motion_starts_in_unknowns_not_in_modes() -> None:
    names = [row["name"] for row in _initial(ss.catalogue.cantilever())]
    assert names == ["u[rub]", "u[tip]", "d_u[rub]", "d_u[tip]", "r_damper"]


def test_amplitudes_of_modes_have_the_root_of_a_mass_in_their_unit() -> None:
    system = ss.catalogue.cantilever()
    assert quantity(system, "u_mode_1")["units"] == "kg^(1/2)*m"
    assert quantity(system, "u[tip]")["units"] == "m"
    assert quantity(system, "d_u[tip]")["units"] == "m/s"
