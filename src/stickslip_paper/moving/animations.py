"""Animations: the walking toy, the woodpecker toy, the plate compactor, the simplest walker.

Only the moving parts of a scene are drawn anew in each frame. Films are written as GIF, and as MP4
where ffmpeg is installed, else as a page that plays the frames.
"""

from __future__ import annotations

import base64
import io
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy import ndarray as Array
from PIL import Image

import stickslip as ss
from stickslip_paper.drawing.parts import Scene
from stickslip_paper.moving.impacts import (
    ramp_walker_scene,
    simplest_walker_scene,
    woodpecker_scene,
)
from stickslip_paper.moving.scenes import compactor_scene, toy_scene

_RATE = 20  # frames per second
_COLOURS = 96


@dataclass(frozen=True)
class AnimationEntry:
    """One animation.

    Attributes
    ----------
    caption : str
        Plain text, with equation numbers and the values of the parameters.
    make : callable
        Writes the files into a folder and returns their paths, the GIF first.
    """

    key: str
    title: str
    caption: str
    make: Callable[[Path], list[Path]]


def walking_toy(folder: Path) -> list[Path]:
    """Two periods of settled walking."""
    with ss.style.paper_style():
        return film(toy_scene(), folder / "walking-toy")


def plate_compactor(folder: Path) -> list[Path]:
    """Six turns of the imbalance, in slow motion."""
    with ss.style.paper_style():
        return film(compactor_scene(), folder / "plate-compactor")


def woodpecker(folder: Path) -> list[Path]:
    """Two pecks of the woodpecker, in slow motion."""
    with ss.style.paper_style():
        return film(woodpecker_scene(), folder / "woodpecker")


def ramp_walker(folder: Path) -> list[Path]:
    """Two periods of the ramp walker, in slow motion."""
    with ss.style.paper_style():
        return film(ramp_walker_scene(), folder / "ramp-walker")


def simplest_walker(folder: Path) -> list[Path]:
    """Four steps of the simplest walker."""
    with ss.style.paper_style():
        return film(simplest_walker_scene(), folder / "simplest-walker")


def film(scene: Scene, path: Path) -> list[Path]:
    """The GIF, and an MP4 if ffmpeg is installed, else a page that plays the frames."""
    images = frames(scene)
    path.parent.mkdir(parents=True, exist_ok=True)
    gif = write_gif(images, path.with_suffix(".gif"))
    if ffmpeg := shutil.which("ffmpeg"):
        return [gif, write_video(images, path.with_suffix(".mp4"), ffmpeg)]
    return [gif, write_page(images, path.with_suffix(".html"))]


def frames(scene: Scene) -> list[Image.Image]:
    """All frames in one palette, so that the static background is stored and drawn only once."""
    canvas = FigureCanvasAgg(scene.figure)
    for artist in scene.moving:
        artist.set_animated(True)
    canvas.draw()
    background = canvas.copy_from_bbox(scene.figure.bbox)
    images: list[Image.Image] = []
    palette = table = np.empty(0, np.uint8)
    for i in range(scene.frames):
        canvas.restore_region(background)
        scene.place(i)
        for artist in scene.moving:
            scene.figure.draw_artist(artist)
        colours = np.asarray(canvas.buffer_rgba())[..., :3]
        if i == 0:
            palette, table = reduced(colours)
        red, green, blue = np.moveaxis(colours >> 2, -1, 0)
        image = Image.fromarray(table[red, green, blue])
        image.putpalette(palette.tobytes())
        images.append(image)
    return images


def reduced(colours: Array) -> tuple[Array, Array]:
    """The commonest colours, and the nearest of them for every colour of 6 bits a channel (Pillow's
    are less exact)."""
    from scipy.spatial import KDTree

    found, counts = np.unique(colours.reshape(-1, 3), axis=0, return_counts=True)
    palette = found[np.argsort(counts)[: -_COLOURS - 1 : -1]]
    levels = np.rint(np.arange(64) * 255 / 63)
    every = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), axis=-1)
    nearest = np.asarray(KDTree(palette).query(every)[1], np.uint8)
    return palette, nearest


def write_gif(images: Sequence[Image.Image], path: Path) -> Path:
    """A GIF that repeats."""
    images[0].save(
        path,
        save_all=True,
        append_images=images[1:],
        duration=1000 // _RATE,
        loop=0,
        optimize=False,
    )
    return path


def write_video(images: Sequence[Image.Image], path: Path, ffmpeg: str) -> Path:
    """An MP4 (H.264), through the program ffmpeg."""
    width, height = images[0].size
    given = [
        "-f",
        "rawvideo",
        "-pixel_format",
        "rgb24",
        "-video_size",
        f"{width}x{height}",
        "-framerate",
        str(_RATE),
    ]
    made = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    command = [ffmpeg, "-y", "-loglevel", "error", *given, "-i", "-", *made, str(path)]
    subprocess.run(
        command, input=b"".join(image.convert("RGB").tobytes() for image in images), check=True
    )
    return path


def write_page(images: Sequence[Image.Image], path: Path) -> Path:
    """Write a self-contained page with all frames, a button and a slider."""
    stored = []
    for image in images:
        buffer = io.BytesIO()
        image.save(buffer, "png")
        stored.append(f'"{base64.b64encode(buffer.getvalue()).decode()}"')
    values = {
        "TITLE": path.stem.replace("-", " "),
        "LAST": str(len(images) - 1),
        "PAUSE": str(1000 // _RATE),
    }
    page = _PAGE
    for name, value in {**values, "FRAMES": ",".join(stored)}.items():
        page = page.replace(name, value)
    path.write_text(page, encoding="utf-8")
    return path


_PAGE = """<!DOCTYPE html>
<html lang="en">
<meta charset="utf-8">
<title>TITLE</title>
<link rel="icon" href="data:,">
<style>
body { font-family: sans-serif; width: max-content; margin: 1em auto; }
#at { width: 85%; }
</style>
<img id="picture" alt="TITLE"><br>
<button id="button">Pause</button>
<input id="at" type="range" min="0" max="LAST" value="0" aria-label="frame">
<script>
const frames = [FRAMES];
const picture = document.getElementById("picture");
const at = document.getElementById("at");
const button = document.getElementById("button");
let playing = true;
const show = () => { picture.src = "data:image/png;base64," + frames[at.value]; };
const toggle = () => { playing = !playing; button.textContent = playing ? "Pause" : "Play"; };
setInterval(() => { if (playing) { at.value = (+at.value + 1) % frames.length; show(); } }, PAUSE);
button.onclick = toggle;
at.oninput = () => { if (playing) toggle(); show(); };
show();
</script>
</html>
"""

ANIMATIONS: dict[str, AnimationEntry] = {
    entry.key: entry
    for entry in (
        AnimationEntry(
            "compactor",
            "The plate compactor at work",
            "Figure 1.1(A) with inertia, in slow motion: six turns of the imbalance in 7 s "
            "instead of 0.63 s. The plate of 100 kg (μ = 0.6, imbalance F = 800 N, "
            "Ω = 60 rad/s) is pulled by a spring of 5000 N/m at 5 mm/s. It sticks (black) until "
            "the threshold μN(t), N = mg + F cos Ωt, has fallen to the force of the spring, and "
            "slips (red) half a millimetre in each turn. The force of the spring, about 245 N, "
            "is far below μmg = 589 N. Its way is drawn enlarged (see the scale), the stretch "
            "of the spring is not shown.",
            plate_compactor,
        ),
        AnimationEntry(
            "walking",
            "The rocking toy walks",
            "Two periods of settled walking of (4.2), 11.94 s shown in 7 s: I_b = 1 kg m², "
            "a = 1 N/m, b = 1 N m, c = 0.3 N, δ = 0.04 N m s, P = 1 N, ρ = 0.2 N, ψ* = 1, "
            "H* = 3 N. Feet are black in stick and red in slip; a leg slips only while the body "
            "leans to the other side. Right legs are white, left legs dark. From behind, the tilt "
            "is drawn at a tenth of ψ; the lift of an unloaded foot is drawn for illustration, the "
            "model only has its friction ρ + H(ψ).",
            walking_toy,
        ),
        AnimationEntry(
            "ramp-walker",
            "The ramp walker rocks down its ramp",
            "A toy like that of figure 1.1(B): two periods of settled walking, 0.97 s in 7 s. "
            "Body of 0.1 kg, legs of 2 g with springs of 100 N/m at 2.5 cm from the middle, "
            "μ = 0.3, a ramp of 0.15 rad; the other parameters are those of the catalogue's "
            "ramp_walker. Feet are black in stick, red in slip and hollow where they are lifted: "
            "they are contacts that open, and land with impacts without rebound. It advances 1.95 "
            "cm in a period of 0.485 s. Lengths of the ramp, lifts (up to 3.6 mm) and the angle ψ "
            "(up to 0.274 rad) are drawn true to scale.",
            ramp_walker,
        ),
        AnimationEntry(
            "woodpecker",
            "The woodpecker pecks its way down a pole",
            "Two pecks of the settled motion, 0.292 s shown in 7 s, with the parameters of Leine, "
            "Glocker and van Campen (2003), μ = 0.3. The inner edges of the sleeve are black where "
            "they stick, red where they slide and hollow where they are open. The sleeve jams "
            "while the bird swings back and forth, comes free, and the beak strikes the pole "
            "(star); then the sleeve slides until it jams again. In a period of 0.146 s it comes "
            "down by 19.4 mm. The clearance of the sleeve, 0.6 mm, and its angle, 0.103 rad at "
            "most, are drawn 2.5 times as large, the rest true to scale.",
            woodpecker,
        ),
        AnimationEntry(
            "simplest-walker",
            "The simplest walker takes four steps",
            "Two legs of length ℓ with a heavy hip on a slope γ = 0.009, after Garcia, Chatterjee, "
            "Ruina and Coleman (1998): the long, stable gait from θ = 0.2003, whose steps last "
            "3.88246 √(ℓ/g). At heel strike (star) the legs exchange their parts, and the state "
            "jumps. The foot that stands is black, the one that swings hollow. Both legs have the "
            "same length, so that the swinging foot scuffs the ground where they pass each other, "
            "which the model ignores. The slope is drawn true to scale.",
            simplest_walker,
        ),
    )
}
