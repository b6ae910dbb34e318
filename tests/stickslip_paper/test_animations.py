"""The animations: feet keep still in stick, colours tell the modes, files are small and need
nothing from outside."""

from __future__ import annotations

import base64
import io
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from numpy.testing import assert_allclose
from PIL import Image

import stickslip as ss
from stickslip_paper.drawing.parts import SLIP, STICK, Scene
from stickslip_paper.moving.animations import ANIMATIONS, frames, write_page, write_video
from stickslip_paper.moving.impacts import (
    ramp_walker_scene,
    simplest_walker_scene,
    woodpecker_scene,
)
from stickslip_paper.moving.scenes import compactor_scene, toy_scene


def soles(scene: Scene, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Leftmost x of the first soles in every frame, and whether they are drawn as slipping."""
    parts = [
        part for part in scene.moving if isinstance(part, Polygon) and part.get_linewidth() == 0.0
    ][:count]
    x = np.empty((scene.frames, count))
    slips = np.empty((scene.frames, count), bool)
    for i in range(scene.frames):
        scene.place(i)
        x[i] = [np.min(part.get_xy()[:, 0]) for part in parts]
        colours = [to_hex(part.get_facecolor()) for part in parts]
        assert set(colours) <= {SLIP.lower(), STICK.lower()}
        slips[i] = [colour == SLIP.lower() for colour in colours]
    return x, slips


@pytest.mark.parametrize(
    ("make", "count", "least", "most"), [(toy_scene, 4, 0.08, 0.1), (compactor_scene, 1, 0.3, 0.5)]
)
def test_what_sticks_keeps_still(
    make: Callable[[int], Scene], count: int, least: float, most: float
) -> None:
    x, slips = soles(make(150), count)
    steps = np.diff(x, axis=0)
    still = ~slips[:-1] & ~slips[1:]
    assert np.all(np.abs(steps[still]) < 1e-9)
    assert np.all(steps > -1e-9)
    assert np.all(steps[slips[:-1] & slips[1:]] > 1e-6)
    assert np.all((slips.mean(axis=0) > least) & (slips.mean(axis=0) < most))
    if count == 4:
        # Two left feet, two right feet: never do both sides slip; each goes 4X = 2 m in two
        # periods.
        assert not np.any(slips[:, :2] & slips[:, 2:])
        assert x[-1] - x[0] == pytest.approx(np.full(4, 2.0), abs=1e-3)


WHITE = "#ffffff"


def test_what_the_ramp_walker_stands_on() -> None:
    """A foot that sticks keeps still, one that slips is on the ramp, one that is lifted is off it,
    and each goes two strides down the ramp."""
    scene = ramp_walker_scene(300)
    slope = ss.catalogue.ramp_walker().values["gamma"]
    scene.place(0)
    feet = [p for p in scene.moving if isinstance(p, Polygon) and p.get_linewidth() in (0.0, 1.2)]
    feet = [foot for foot in feet if to_hex(foot.get_facecolor()) in (SLIP.lower(), STICK.lower())]
    assert len(feet) == 4  # two from the side, two from behind
    low = np.empty((scene.frames, 2))
    along = np.empty((scene.frames, 2))
    colours = np.empty((scene.frames, 4), dtype="<U7")
    turn = np.array([[np.cos(slope), np.sin(slope)], [-np.sin(slope), np.cos(slope)]])
    for i in range(scene.frames):
        scene.place(i)
        for k, foot in enumerate(feet[:2]):
            points = foot.get_xy() @ turn
            along[i, k], low[i, k] = points.min(axis=0)
        colours[i] = [to_hex(foot.get_facecolor()) for foot in feet]
    lifted, sticks = colours[:, :2] == WHITE, colours[:, :2] == STICK.lower()
    assert {str(c) for c in colours.flat} == {WHITE, STICK.lower(), SLIP.lower()}
    assert_allclose(low[~lifted], -0.02, atol=1e-9)
    assert np.all(low[lifted] > -0.02) and low.max() == pytest.approx(0.356 - 0.02, abs=2e-3)
    still = sticks[1:] & sticks[:-1]
    # A slip may be shorter than a frame.
    assert np.mean(np.abs(np.diff(along, axis=0)[still]) < 1e-9) > 0.97
    assert not np.any(lifted[:, 0] & lifted[:, 1])
    assert_allclose(along[-1] - along[0], 2 * 1.95071, atol=2e-4)
    assert sorted(map(tuple, colours[:, :2].T)) == sorted(map(tuple, colours[:, 2:].T))


def test_the_beak_reaches_the_pole() -> None:
    """The star shows where the beak is at the pole, of radius 2.5 mm; the sleeve jams by the edge
    that touches it."""
    scene = woodpecker_scene(280)
    stars = [p for p in scene.moving if isinstance(p, Line2D) and p.get_marker() == (8, 1, 0)]
    discs = [p for p in scene.moving if isinstance(p, Circle) and p.get_radius() == 0.85]
    beaks = [p for p in scene.moving if isinstance(p, Polygon) and len(p.get_xy()) == 4]
    (star,) = stars
    (beak,) = beaks
    tip = np.empty(scene.frames)
    shown = np.empty(scene.frames, bool)
    for i in range(scene.frames):
        scene.place(i)
        tip[i] = np.min(beak.get_xy()[:, 0])
        shown[i] = star.get_visible()
        for disc in discs:
            if to_hex(disc.get_facecolor()) != WHITE:
                assert np.ravel(disc.get_center())[0] == pytest.approx(2.5, abs=0.2)
    began = np.flatnonzero(np.diff(shown.astype(int)) == 1)
    assert len(began) == 2 and np.diff(began)[0] == pytest.approx(scene.frames / 2, abs=1)
    assert_allclose(tip[began], 2.5, atol=0.4)
    assert np.all(tip > 2.3)


def test_the_simplest_walker_stands_on_its_foot() -> None:
    """The foot that stands keeps still for a step, then the other one stands 2 sin θ further on."""
    scene = simplest_walker_scene(200)
    lifted, foot, hip = [p for p in scene.moving if isinstance(p, Circle)]
    at = np.empty((scene.frames, 3, 2))
    for i in range(scene.frames):
        scene.place(i)
        at[i] = [disc.get_center() for disc in (lifted, foot, hip)]
    steps = np.linalg.norm(np.diff(at[:, 1], axis=0), axis=1)
    moved = steps[steps > 1e-9]
    assert_allclose(moved, 2 * np.sin(0.2003109), atol=1e-6)
    assert len(moved) == 3
    assert_allclose(np.linalg.norm(at[:, :2] - at[:, 2:], axis=2), 1.0, rtol=1e-12)
    # Down a slope of 0.009, and the hip is never above the length of a leg.
    down = at[-1, 1] - at[0, 1]
    assert -down[1] / down[0] == pytest.approx(np.tan(0.009), rel=1e-9)
    assert np.all(at[:, 2, 1] - at[:, 1, 1] <= 1.0 + 1e-12)


def test_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    for entry in ANIMATIONS.values():
        gif, page = entry.make(tmp_path / entry.key)
        assert (gif.suffix, page.suffix) == (".gif", ".html")
        assert gif.stat().st_size < 2e6 and page.stat().st_size < 4e6
        with Image.open(gif) as film:
            assert getattr(film, "n_frames", 1) == 140
            assert 5.0 <= 140 * film.info["duration"] / 1000 <= 8.0
            assert film.convert("RGB").getpixel((2, 2)) == (255, 255, 255)
        assert entry.caption.endswith(".")


def test_the_page_is_complete(tmp_path: Path) -> None:
    images = frames(toy_scene(3))
    text = write_page(images, tmp_path / "walking-toy.html").read_text(encoding="utf-8")
    assert "http" not in text and "<title>walking toy</title>" in text
    stored = re.findall(r'"([A-Za-z0-9+/=]{1000,})"', text)
    assert len(stored) == 3
    for image, data in zip(images, stored, strict=True):
        again = Image.open(io.BytesIO(base64.b64decode(data)))
        assert again.convert("RGB").tobytes() == image.convert("RGB").tobytes()


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_video(tmp_path: Path) -> None:
    ffmpeg = shutil.which("ffmpeg")
    assert ffmpeg
    path = write_video(frames(compactor_scene(10)), tmp_path / "film.mp4", ffmpeg)
    report = subprocess.run(
        [ffmpeg, "-hide_banner", "-i", str(path)], capture_output=True, text=True, check=False
    )
    assert "640x450" in report.stderr and "h264" in report.stderr
