"""A lecture with the explorer: links that show its steps, a page of these links for the audience,
and a notebook of the same motions.

Each step is computed before the lecture, and its certificate looked at. Then the explorer opens at
the first step, until Ctrl-C, and `lecture.html` has the links to all of them, for a big screen as
for a phone; the page takes the look of the device, dark or light, and goes by keyboard.

For phones in the same network start it as

    stickslip explore --host 0.0.0.0 --allow lab.example

and run this script with the address that this prints, once more with the name of the machine:

    python 06-lecture.py http://lab.example:5106/TOKEN/
"""

import html
import json
import sys
from dataclasses import dataclass
from pathlib import Path

import stickslip as ss


@dataclass(frozen=True)
class Step:
    """What is said, and what is shown meanwhile."""

    title: str
    system: str  # a name of the catalogue
    parameters: dict[str, float]
    until: float
    panel: str = ""  # of the page, behind the phase plane

    @property
    def state(self):
        """What stands behind the # of an address."""
        values = "".join(f"{name}={value:g}&" for name, value in self.parameters.items())
        panel = f"&.panel={self.panel}" if self.panel else ""
        return f"{self.system}?{values}until={self.until:g}{panel}"

    def motion(self):
        """The same in Python."""
        system = ss.catalogue.get(self.system)
        return ss.simulate(system, (0.0, self.until), parameters=self.parameters)


STEPS = [
    Step("A block on a slow belt sticks and slips", "belt_block", {"V": 0.2}, 60.0),
    Step("On a fast belt it swings and never sticks", "belt_block", {"V": 1.5}, 60.0),
    Step("Which amplitude at which speed?", "belt_block", {"V": 0.5}, 60.0, "branch"),
    Step("A toy that is pulled walks", "rocking_toy", {"P": 1.2}, 80.0),
    Step("For which pulls does it, and how fast?", "rocking_toy", {"P": 1.2}, 80.0, "map"),
]


def links(address):
    """The address of each step."""
    page = address.partition("#")[0]
    return {step.title: f"{page}#{step.state}" for step in STEPS}


def handout(address):
    """A page of links, for the audience."""
    items = "\n".join(
        f'<li><a href="{html.escape(link)}">{html.escape(title)}</a></li>'
        for title, link in links(address).items()
    )
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Stick and slip</title>
<meta name="viewport" content="width=device-width">
<style>:root {{ color-scheme: light dark }}
body {{ font: 1.2em/1.8 sans-serif; max-width: 36em; margin: 2em auto; padding: 0 1em }}</style>
</head><body><h1>Stick and slip</h1><ol>
{items}
</ol></body></html>
"""


def notebook():
    """The motions as cells of a notebook, and the explorer in the last one."""
    cells = ["import stickslip as ss"]
    for step in STEPS:
        if not step.panel:
            given = f"(0.0, {step.until}), parameters={step.parameters}"
            cells.append(f"# {step.title}\nss.simulate(ss.catalogue.{step.system}(), {given})")
    cells.append(f'ss.explore("{STEPS[0].state}")')
    return {
        "nbformat": 4,
        "nbformat_minor": 5,
        "metadata": {"kernelspec": {"name": "python3", "display_name": "Python 3"}},
        "cells": [
            {
                "id": f"step-{i}",
                "cell_type": "code",
                "source": source,
                "metadata": {},
                "outputs": [],
                "execution_count": None,
            }
            for i, source in enumerate(cells)
        ],
    }


def prepared(address):
    """The page of links and the notebook are written; every step is certified."""
    Path("lecture.html").write_text(handout(address), encoding="utf-8")
    Path("lecture.ipynb").write_text(json.dumps(notebook(), indent=1), encoding="utf-8")
    for step in STEPS:
        motion = step.motion()
        print(f"{step.title}: {motion.n_switches} switches, certified: {motion.certificate.ok}")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        prepared(sys.argv[1])
    else:
        page = ss.explore(STEPS[0].state)
        prepared(page.address)
        print("\n".join(links(page.address).values()))
        print("Ctrl-C ends it.")
        page.wait()
