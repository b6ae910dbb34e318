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
from matplotlib.patches import Polygon
from PIL import Image

from stickslip_paper.moving.animations import ANIMATIONS, frames, write_page, write_video
from stickslip_paper.moving.scenes import SLIP, STICK, Scene, compactor_scene, toy_scene


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
