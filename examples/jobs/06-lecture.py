"""A lecture with the explorer: links to its steps, a page of these links for the audience, and a
notebook of the same motions.

The script computes each step before the lecture and checks its certificate. It then opens the
explorer at the first step, until Ctrl-C, and writes `lecture.html` with the links to all steps. The
page suits large screens and phones, follows the dark or light mode of the device, and can be
operated by keyboard.

For phones in the same network start the explorer with

    stickslip explore --host 0.0.0.0 --allow lab.example

and run this script again with the URL that is printed, with the name of the machine in it:

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
    """A title, and the motion and panel that are shown with it."""

    title: str
    system: str  # a name of the catalogue
    parameters: dict[str, float]
    until: float
    panel: str = ""  # of the page, behind the phase plane

    @property
    def state(self):
        """The part of the URL after the #."""
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
    """The URL of each step."""
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
    """Write the page of links and the notebook, and print the certificate of every step."""
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
        print("Press Ctrl-C to stop the explorer.")
        page.wait()
