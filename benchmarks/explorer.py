"""How fast the explorer is, measured in a real browser:

    python benchmarks/explorer.py            # all of it, a few minutes
    python benchmarks/explorer.py --pages 1000

From the event of a slider to the figures drawn anew (a drag, and single moves), for every system of
the catalogue; redraws a second while dragging, and what a redraw takes of a processor in the page,
which says most where others use the machine, too; from the command to its address and to the page
with its first motion; the memory of the server after many pages were opened and closed.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

import stickslip as ss

_ADDRESS = re.compile(r"http://\S+")
_FLAGS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1440,900")
_GAPS = {"drag": 16, "single": 140}  # ms between two events of the pointer

# Notes when each figure has been painted, moves the slider, and says for each answer when the
# pointer moved, when its question went out, when it came, and when the last figure stood.
_DRAG = """
const [name, gap, count, done] = arguments
const paints = []
for (const plot of explorer.plots()) {
  const view = explorer.view(plot)
  if (!view) continue
  const repaint = view.constructor.prototype.repaint
  view.repaint = function () { repaint.call(this); paints.push([performance.now(), plot.name]) }
}
const slider = document.getElementById(`values-${name}-slider`)
const value = Number(slider.value), reach = Math.min(value - slider.min, slider.max - value) * 0.2
explorer.redraws.length = 0
let k = 0
// A pointer keeps its own time, however busy the page is.
const pointer = setInterval(() => {
  slider.value = value + reach * Math.sin(k / 9)
  slider.dispatchEvent(new Event("input", {bubbles: true}))
  if (++k < count) return
  clearInterval(pointer)
  setTimeout(() => {
    slider.value = value
    slider.dispatchEvent(new Event("change", {bubbles: true}))
    done({redraws: explorer.redraws.slice(), paints})
  }, 900)
}, gap)
"""


@contextmanager
def serving(*words: str) -> Iterator[tuple[str, float, subprocess.Popen[str]]]:
    """The command: its address, the seconds until it was printed, and the process."""
    began = time.perf_counter()
    command = [
        sys.executable,
        "-m",
        "stickslip.cli",
        "explore",
        *words,
        "--no-browser",
        "--port",
        "0",
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found = _ADDRESS.search(process.stdout.readline())
        assert found is not None
        try:
            yield found[0], time.perf_counter() - began, process
        finally:
            process.terminate()


@contextmanager
def browser() -> Iterator[webdriver.Chrome]:
    """Chromium without a window."""
    options = webdriver.ChromeOptions()
    for flag in _FLAGS:
        options.add_argument(flag)
    options.binary_location = "/usr/bin/chromium"
    driver = webdriver.Chrome(options=options, service=Service("/usr/bin/chromedriver"))
    driver.set_script_timeout(120)
    try:
        yield driver
    finally:
        driver.quit()


def ready(driver: webdriver.Chrome) -> None:
    """Wait for the first motion."""
    while not driver.execute_script(
        "return window.explorer !== undefined && explorer.motion !== null"
        " && explorer.described !== null"
    ):
        time.sleep(0.005)


def latencies(found: dict[str, Any]) -> tuple[np.ndarray, float]:
    """ms from each event to the last figure that was drawn for it, and redraws a second."""
    if not found["redraws"]:
        return np.array([]), 0.0
    redraws, paints = found["redraws"], np.array([p[0] for p in found["paints"]])
    ends = [r[2] for r in redraws[1:]] + [np.inf]
    times = []
    for (event, _, came), end in zip(redraws, ends, strict=True):
        own = paints[(paints >= came) & (paints < end)]
        if len(own):
            times.append(own.max() - event)
    span = (redraws[-1][2] - redraws[0][2]) / 1000.0 if len(redraws) > 1 else np.nan
    return np.array(times), (len(redraws) - 1) / span


def drags(driver: webdriver.Chrome, address: str, names: list[str]) -> None:
    """The table of all systems."""
    head = ("single move: median, 95 % [ms]", "dragging: median, 95 % [ms]", "redraws/s")
    print("| system |", " | ".join(head), "| of a processor [ms] |")
    print("|---|---|---|---|---|")
    driver.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
    base = address.partition("#")[0]
    for name in names:
        parameters = list(ss.catalogue.get(name).parameters)
        if not parameters:
            continue
        driver.get("about:blank")
        driver.get(f"{base}#{name}")
        ready(driver)
        time.sleep(1.0)
        said = []
        rate = took = np.nan
        for kind in ("single", "drag"):
            count = 40 if kind == "single" else 150
            before = busy(driver)
            found = driver.execute_async_script(_DRAG, parameters[0], _GAPS[kind], count)
            times, rate = latencies(found)
            took = 1000.0 * (busy(driver) - before) / max(len(times), 1)
            some = times if len(times) else np.array([np.nan])
            said.append(f"{np.median(some):.0f}, {np.percentile(some, 95):.0f}")
        print(f"| `{name}` | {said[0]} | {said[1]} | {rate:.0f} | {took:.0f} |", flush=True)


def busy(driver: webdriver.Chrome) -> float:
    """Seconds of a processor that the page has taken."""
    metrics = driver.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    return next(m["value"] for m in metrics if m["name"] == "TaskDuration")


def beginning(driver: webdriver.Chrome, times: int) -> None:
    """From the command to the address, and to the page with its first motion."""
    addresses, pages, others = [], [], []
    for _ in range(times):
        with serving("rocking_toy") as (address, seconds, _process):
            addresses.append(seconds)
            began = time.perf_counter()
            driver.get(address)
            ready(driver)
            pages.append(seconds + time.perf_counter() - began)
            began = time.perf_counter()
            driver.execute_script(
                "explorer.motion = null;"
                "explorer.change('model', () => { explorer.state = explorer.fresh('belt_block') })"
            )
            ready(driver)
            others.append(time.perf_counter() - began)
    print(f"command to address       {np.median(addresses):.2f} s")
    print(f"command to first motion  {np.median(pages):.2f} s")
    print(f"another model's motion   {np.median(others):.2f} s")


def memory(count: int) -> None:
    """The server's memory before and after many pages."""
    with serving("rocking_toy") as (address, _, process):
        status = Path(f"/proc/{process.pid}/status")

        def resident() -> float:
            (line,) = [x for x in status.read_text().splitlines() if x.startswith("VmRSS")]
            return int(line.split()[1]) / 1024.0

        for done in range(count + 1):
            if done in (100, count // 2, count):
                time.sleep(8.0)  # until what is closed has been forgotten
                print(f"memory after {done} pages   {resident():.0f} MB", flush=True)
            if done < count:
                for _ in range(1000):
                    try:
                        urllib.request.urlopen(address.partition("#")[0]).read()
                        break
                    except urllib.error.HTTPError:  # too many are open: wait for some to go
                        time.sleep(0.2)


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("systems", nargs="*", default=ss.catalogue.names())
    parser.add_argument("--pages", type=int, default=0)
    given = parser.parse_args()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    with browser() as driver:
        beginning(driver, 5)
        with serving() as (address, _, _process):
            drags(driver, address, given.systems)
    if given.pages:
        memory(given.pages)


if __name__ == "__main__":
    main()
