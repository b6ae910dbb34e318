"""Derivatives through an impact.

Two equal balls on a line collide without loss and exchange their velocities, so that the second
ends at v_0 T + x_1 + 2 r, whose gradient with respect to the initial positions and velocities (x_1,
x_2, v_0, u_0) is (1, 0, 1, 0). The scene is that of keenon/nimblephysics#97 (*Consufing Gradients
on a Simple Scene*, 2022, open), which quotes (0.75, 0.25, 0.91, 0.08). Here the same by
nimblephysics, by products of the derivatives of MuJoCo's steps, with an elastic contact, and by
stickslip.

``python benchmarks/wrong/collision.py``. MuJoCo is used if it is installed. nimblephysics 0.10
stops with a segmentation fault under NumPy 2; STICKSLIP_NIMBLE names a Python that has it, with
NumPy 1 and PyTorch.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib import import_module
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from table import table, timed, versions

import stickslip as ss

RADIUS, START, END = 0.1, (0.0, 0.52, 1.0, 0.0), 1.0
TRUTH = (1.0, 0.0, 1.0, 0.0)

NIMBLE = """
import json, platform, sys, time
from importlib.metadata import version
import nimblephysics as nimble, torch

radius, start, end, steps = json.loads(sys.argv[1])

def ball(world):
    skeleton = nimble.dynamics.Skeleton()
    joint, body = skeleton.createPrismaticJointAndBodyNodePair()
    joint.setAxis([1.0, 0.0, 0.0])
    body.createShapeNode(nimble.dynamics.SphereShape(radius)).createCollisionAspect()
    body.setMass(1.0)
    body.setRestitutionCoeff(1.0)
    body.setFrictionCoeff(0.0)
    world.addSkeleton(skeleton)

found = []
for h in steps:
    world = nimble.simulation.World()
    world.setGravity([0.0, 0.0, 0.0])
    world.setTimeStep(h)
    ball(world)
    ball(world)
    first = torch.tensor(start, dtype=torch.float64, requires_grad=True)
    state, rest = first, torch.zeros(2, dtype=torch.float64)
    begun = time.process_time()
    for _ in range(round(end / h)):
        state = nimble.timestep(world, state, rest)
    state[1].backward()
    spent = time.process_time() - begun
    found.append([h, float(state[1].detach()), first.grad.tolist(), spent])
print(json.dumps([version("nimblephysics"), platform.python_version(), found]))
"""

MODEL = """
<mujoco>
  <option timestep="{step}" gravity="0 0 0" tolerance="0" iterations="100"/>
  <default>
    <geom type="sphere" size="0.1" mass="1" condim="1" solref="-{stiffness} 0"
          solimp="0.9999 0.9999 0.001"/>
  </default>
  <worldbody>
    <body><joint type="slide" axis="1 0 0"/><geom/></body>
    <body><joint type="slide" axis="1 0 0"/><geom/></body>
  </worldbody>
</mujoco>
"""
Row = tuple[str, float, NDArray[np.float64], float]


def ours() -> tuple[float, NDArray[np.float64]]:
    """Final position of the second ball, and its gradient."""
    x, y, d_x, d_y = START
    balls = ss.System(
        "two balls",
        parameters={"r": ss.Parameter(RADIUS, "m", "radius")},
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="d_x**2/2 + d_y**2/2",
        contacts={"balls": ss.Unilateral("y - x - 2*r", restitution=1.0)},
        initial={"x": x, "y": y, "d_x": d_x, "d_y": d_y},
    )
    motion = ss.simulate(balls, (0.0, END))
    assert motion.certificate.ok
    slopes = motion.sensitivity(["x", "y", "d_x", "d_y"], [END], of=["y"])
    return motion.final["y"], slopes["y"].values[:, 0]


def by_mujoco(step: float, stiffness: float) -> Row:
    """The product of the derivatives of all steps, which MuJoCo computes by finite differences; the
    stiffness is that of the relative acceleration, in 1/s²."""
    mujoco: Any = import_module("mujoco")
    model = mujoco.MjModel.from_xml_string(MODEL.format(step=step, stiffness=stiffness))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = START[:2], START[2:]
    product, of_step = np.eye(4), np.zeros((4, 4))
    began = process_time()
    for _ in range(round(END / step)):
        mujoco.mjd_transitionFD(model, data, 1e-6, True, of_step, None, None, None)
        product = of_step @ product
        mujoco.mj_step(model, data)
    spent = process_time() - began
    lasts = np.pi / np.sqrt(stiffness)
    name = f"MuJoCo, elastic contact of {1e3 * lasts:.0f} ms, steps of {step:g}"
    return name, float(data.qpos[1]), product[1], spent


def by_nimble() -> tuple[str, list[Row]]:
    """Versions, and rows; or what is missing."""
    python = os.environ.get("STICKSLIP_NIMBLE", sys.executable)
    given = json.dumps([RADIUS, START, END, [1e-2, 1e-3, 1e-4]])
    told = subprocess.run([python, "-c", NIMBLE, given], capture_output=True, text=True)
    if told.returncode:
        return "nimblephysics does not run here", []
    version, of_python, found = json.loads(told.stdout)
    rows = [
        (f"nimblephysics, steps of {h:g}", end, np.array(slopes), spent)
        for h, end, slopes, spent in found
    ]
    return f"nimblephysics {version} on Python {of_python}", rows


def _line(row: Row) -> list[object]:
    name, end, slopes, spent = row
    gradient = ", ".join(f"{slope:.4g}" if abs(slope) > 5e-5 else "0" for slope in slopes)
    error = float(np.max(np.abs(slopes - TRUTH)))
    return [name, f"{end:.4f}", f"({gradient})", f"{error:.2g}", f"{spent:.2g}"]


def report() -> str:
    """The table."""
    quoted: list[object] = [
        "nimblephysics, as the issue quotes it",
        "",
        "(0.75, 0.25, 0.91, 0.08)",
        "0.25",
        "",
    ]
    rows = [quoted]
    nimble, measured = by_nimble()
    rows += [_line(row) for row in measured] or [[nimble, "", "", "", ""]]
    packages: list[str] = []
    try:
        import_module("mujoco")
    except ImportError:
        rows.append(["MuJoCo is not installed here", "", "", "", ""])
    else:
        packages.append("mujoco")
        rows += [_line(by_mujoco(step, 1e5)) for step in (1e-3, 1e-4, 1e-5)]
    (end, slopes), seconds = timed(ours)
    assert np.max(np.abs(slopes - TRUTH)) < 1e-12
    rows.append(_line(("**stickslip**", end, slopes, seconds)))
    head = ["tool", "x₂ at T = 1", "gradient", "largest error", "seconds"]
    return table(head, rows) + f"\n\n{versions(*packages)}; {nimble}\n"


if __name__ == "__main__":
    print(report())
