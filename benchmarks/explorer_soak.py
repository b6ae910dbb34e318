"""Soak the explorer: random clicks, drags, keys and models by script, a worker killed every minute,
hostile messages in between.

    python benchmarks/explorer_soak.py --minutes 60

At the end there must be no error in the browser's console, nothing on the server's error stream,
and no growth of its memory.
"""

from __future__ import annotations

import argparse
import random
import re
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from selenium import webdriver
from selenium.common.exceptions import JavascriptException

import stickslip as ss
from explorer import browser, ready

_EVOLUTIONS = Path(__file__).parents[1] / "examples" / "evolution"
_ADDRESS = re.compile(r"http://\S+")
_HOSTILE = (
    '""',
    '"x".repeat(3000000)',
    '"[".repeat(100000)',
    "JSON.stringify({serial: -1, lane: 'a', what: 'motion', setting: {}})",
    "JSON.stringify({serial: 7, lane: 'x', what: '__import__', setting: {}})",
    "JSON.stringify({serial: 7, lane: 'x', what: 'motion', setting: {model: '../etc/passwd'}})",
    "JSON.stringify({serial: 7, lane: 'x', what: 'motion', setting: {model: 'rocking_toy',"
    " values: {H_R: '().__class__'}}})",
    "JSON.stringify({serial: 7, lane: 'x', what: 'map', setting: {model: 'rocking_toy'},"
    " options: {x: 1, y: []}})",
)
_ACTS = {
    "drag": """
      const sliders = [...document.querySelectorAll("#controls input[type=range]")]
      const slider = sliders[Math.floor(Math.random() * sliders.length)]
      if (!slider) return
      for (let k = 0; k < 12; k++) {
        const share = Math.random()
        slider.value = Number(slider.min) + share * (slider.max - slider.min)
        slider.dispatchEvent(new Event("input", {bubbles: true}))
      }
      slider.dispatchEvent(new Event("change", {bubbles: true}))""",
    "tab": """
      const tabs = [...document.querySelectorAll(".tabs [role=tab]")].filter((t) => t.offsetParent)
      tabs[Math.floor(Math.random() * tabs.length)]?.click()""",
    "go": """
      const buttons = [...document.querySelectorAll(".shown .go, .chip, .toggle")]
        .filter((b) => b.offsetParent)
      buttons[Math.floor(Math.random() * buttons.length)]?.click()""",
    "click": """
      const [x, y] = [innerWidth * Math.random(), innerHeight * Math.random()]
      const place = document.elementFromPoint(x, y)
      if (!place || place.closest(".top, dialog, #lost")) return
      const at = place.getBoundingClientRect()
      const where = {bubbles: true, clientX: at.x + at.width * Math.random(),
                     clientY: at.y + at.height * Math.random(), pointerId: 1}
      for (const kind of ["pointermove", "pointerdown", "pointerup"]) {
        place.dispatchEvent(new PointerEvent(kind, where))
      }""",
    "keys": """
      const keys = [" ", "ArrowRight", "ArrowLeft"]
      document.body.dispatchEvent(new KeyboardEvent("keydown",
        {key: keys[Math.floor(Math.random() * 3)], bubbles: true}))""",
    "history": 'document.getElementById(Math.random() < 0.6 ? "undo" : "redo").click()',
    "zoom": """
      const range = explorer.model("time"), width = range.end - range.start
      const closer = {start: range.start + 0.2 * width, end: range.end - 0.3 * width}
      if (Math.random() < 0.5) range.setv(closer)
      else document.getElementById("unzoom").click()""",
    "theme": 'document.getElementById("theme").click()',
}
_COUNT = """
  explorer.answers = 0
  explorer.wire.change.connect(() => { explorer.answers += 1 })"""


def memory_of(pid: int) -> float:
    """MB."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024.0
    return 0.0


def workers_of(pid: int) -> list[int]:
    """The processes of a server's workers."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return list(map(int, children))


def act(driver: webdriver.Chrome, chance: random.Random) -> None:
    """Do something."""
    kind = chance.choice([*_ACTS, "drag", "drag", "model", "hostile", "evolution"])
    if kind == "model":
        name = chance.choice(ss.catalogue.names())
        driver.execute_script(
            f"explorer.change('model', () => {{ explorer.state = {{...explorer.fresh('{name}'),"
            " panel: explorer.state.panel}})"
        )
    elif kind == "evolution":
        text = chance.choice(sorted(_EVOLUTIONS.glob("*.toml"))).read_text(encoding="utf-8")
        driver.execute_script("explorer.useToml(arguments[0])", text)
    elif kind == "hostile":
        driver.execute_script(f"explorer.wire.asked = {chance.choice(_HOSTILE)}")
    else:
        driver.execute_script(_ACTS[kind])


def main() -> int:
    """Soak, and say what was seen."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    chance = random.Random(given.seed)
    command = [sys.executable, "-m", "stickslip.cli", "explore", "rocking_toy", "--no-browser"]
    with (
        subprocess.Popen(
            [*command, "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as server,
        browser() as driver,
        ExitStack() as stack,
    ):
        assert server.stdout is not None and server.stderr is not None
        found = _ADDRESS.search(server.stdout.readline())
        assert found is not None
        stack.callback(server.terminate)
        driver.get(found[0])
        ready(driver)
        # A page that hears nothing any more makes no errors, and takes no memory.
        driver.execute_script(_COUNT)
        began = time.monotonic()
        killed = acts = 0
        errors: list[str] = []
        sizes: list[float] = []
        answers: list[int] = []
        while (now := time.monotonic() - began) < 60.0 * given.minutes:
            if now > 60.0 * (killed + 0.5) and (workers := workers_of(server.pid)):
                subprocess.run(["kill", "-9", str(chance.choice(workers))], check=False)
                killed += 1
            try:
                act(driver, chance)
            except JavascriptException as error:
                errors.append(str(error.msg))
            acts += 1
            time.sleep(chance.uniform(0.02, 0.5))
            if acts % 50 == 0:
                entries = driver.get_log("browser")
                errors += [e["message"] for e in entries if e["level"] == "SEVERE"]
                sizes.append(memory_of(server.pid))
                answers.append(driver.execute_script("return explorer.answers"))
                if driver.execute_script("return !document.getElementById('lost').hidden"):
                    errors.append("the connection is lost")
        driver.execute_script("explorer.wire.asked = ''")
        server.terminate()
        said = server.stderr.read()
    print(f"{acts} acts in {given.minutes:g} minutes, {killed} workers killed")
    print(f"errors of the console: {len(errors)}", *sorted(set(errors))[:10], sep="\n  ")
    print(f"server's error stream: {said.strip() or 'empty'}")
    came = [part.sum() for part in np.array_split(np.diff([0, *answers]), 8) if len(part)]
    print(f"messages to and fro in eighths of the time: {', '.join(map(str, came))}")
    # A cache that fills levels off; what is lost does not.
    parts = [part for part in np.array_split(sizes, 8) if len(part)]
    told = ", ".join(f"{np.mean(part):.0f}" for part in parts)
    print(f"memory of the server in eighths of the time: {told} MB")
    return 1 if errors or said.strip() else 0


if __name__ == "__main__":
    sys.exit(main())
