"""The animation of the explorer for the README, from the real page:

python benchmarks/explorer_animation.py docs/images/explorer.gif
"""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from PIL import Image
from selenium import webdriver

from explorer import browser, ready, serving

_SIZE = (1280, 760)
_WIDTH = 860  # pixels of the animation
_FRAME = 0.2  # seconds
_COLOURS = 128


def scenes(driver: webdriver.Chrome) -> Iterator[None]:
    """What is done, frame by frame: the toy walks, its pull is dragged, motions begin elsewhere,
    and the long run of the slider is followed."""
    for k in range(30):
        driver.execute_script(f"explorer.clock.set({20 + 0.42 * k})")
        yield
    for k in range(20):
        driver.execute_script(
            f"explorer.change('drag', (s) => {{ s.values.P = {1.0 + 0.02 * k:.3f} }});"
            f"explorer.clock.set({30 + 0.3 * k})"
        )
        time.sleep(0.2)
        yield
    driver.execute_script("explorer.change('set', (s) => { s.values.P = 1.38 })")
    for start in (1.5, 0.4):
        driver.execute_script(f"explorer.change('set', (s) => {{ s.initial.psi = {start} }})")
        time.sleep(0.6)
        for k in range(7):
            driver.execute_script(f"explorer.clock.set({40 + 0.4 * k})")
            yield
    driver.execute_script(
        "explorer.change('model', () => { explorer.state = {...explorer.fresh('spring_slider'),"
        " values: {mu: '2/sqrt(alpha)', nu: 0.05, V: 0.1}, panel: 'branch',"
        " view: {over: 'V', 'over.low': '0.02', 'over.high': '0.4', x: 'U', y: 'alpha'}} })"
    )
    until(driver, "document.getElementById('branch-high').value === '0.4'")
    driver.execute_script("document.getElementById('branch-go').click()")
    following = "document.body.classList.contains('following')"
    until(driver, "explorer.branches.found.length > 0")
    while driver.execute_script(f"return {following}"):  # points arrive
        yield
    for _ in range(4):
        yield
    for k in range(26):
        driver.execute_script(
            f"explorer.change('drag', (s) => {{ s.values.V = {0.1 + 0.006 * k:.3f} }});"
            f"explorer.clock.set({20 + 0.35 * k})"
        )
        time.sleep(0.2)
        yield


def until(driver: webdriver.Chrome, condition: str, seconds: float = 20.0) -> None:
    """Wait for something on the page."""
    ends = time.monotonic() + seconds
    while not driver.execute_script(f"return {condition}"):
        assert time.monotonic() < ends, condition
        time.sleep(0.1)


def main() -> None:
    """Write the animation."""
    target = Path(sys.argv[1])
    frames: list[Image.Image] = []
    with serving("rocking_toy") as (address, _, _process), browser() as driver:
        size = {"width": _SIZE[0], "height": _SIZE[1], "deviceScaleFactor": 1, "mobile": False}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        driver.get(address)
        ready(driver)
        time.sleep(1.5)
        for _ in scenes(driver):
            picture = Image.open(io.BytesIO(driver.get_screenshot_as_png())).convert("RGB")
            small = picture.resize(
                (_WIDTH, _WIDTH * _SIZE[1] // _SIZE[0]), Image.Resampling.LANCZOS
            )
            frames.append(small)
    # One palette for all, and no dithering: what stands still costs nothing.
    sheet = Image.new("RGB", (_WIDTH, 2 * frames[0].height))
    sheet.paste(frames[0], (0, 0))
    sheet.paste(frames[-1], (0, frames[0].height))
    # The colours of lines and lamps are few points among many grey ones, and are kept.
    palette = sheet.quantize(_COLOURS, method=Image.Quantize.MAXCOVERAGE)
    images = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    images[0].save(
        target, save_all=True, append_images=images[1:], duration=round(1000 * _FRAME), loop=0,
        optimize=True,
    )  # fmt: skip
    print(f"{target}: {len(frames)} frames, {target.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
