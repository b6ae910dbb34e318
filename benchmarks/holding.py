"""A joint and a block that friction should hold: ``python benchmarks/holding.py [PYTHON]``.

What newton-physics/newton#4255 asks of dry friction in joints: hold below the threshold without
sustained creep, slide with the specified force above it, stop, treat gravity and efforts alike, and
follow changes of the load. The same by MuJoCo with default settings, with stiffer friction, and its
NoSlip pass, and a block on a slope, which is held by a contact. PYTHON is one that has MuJoCo; by
default this one. The tables go to ``benchmarks/results/holding.md``.
"""

from __future__ import annotations

import json
import platform
import subprocess
import sys
from pathlib import Path

import stickslip as ss

RESULTS = Path(__file__).parent / "results" / "holding.md"
INERTIA, WEIGHT, FRICTION = 0.25, 4.905, 5.0  # kg m², N m, N m: 1 kg at 0.5 m
RAMP = 0.1  # N m/s
SPEED = 2.0  # rad/s, of the joint that stops
SLOPE, COEFFICIENT = 0.27, 0.3  # tangents: held by 0.9 of the friction that there may be
LONG = 100.0  # s
OURS = "**stickslip**"

MUJOCO = """
import json, math, mujoco
JOINT = '''<mujoco><option timestep="{step}" integrator="{scheme}" gravity="0 0 {gravity}"
  {option}/><worldbody><body><joint name="q" type="hinge" axis="0 1 0" frictionloss="5" {joint}/>
  <inertial pos="0.5 0 0" mass="1" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody></mujoco>'''
BLOCK = '''<mujoco><option timestep="{step}" integrator="implicitfast" gravity="{along} 0 {down}"
  {option}/><default><geom friction="0.3 0 0"/></default><worldbody>
  <geom type="plane" size="9 9 1"/><body pos="0 0 0.1"><freejoint/>
  <geom type="box" size="0.2 0.2 0.1" mass="1"/></body></worldbody></mujoco>'''

def loaded(text, **given):
    model = mujoco.MjModel.from_xml_string(text.format(**given))
    return model, mujoco.MjData(model)

def follow(model, data, seconds, effort=lambda t: 0.0):
    for _ in range(round(seconds / model.opt.timestep)):
        data.qfrc_applied[0] = effort(data.time)
        mujoco.mj_step(model, data)
    return float(data.qpos[0])

def checks(step, option="", joint="", scheme="implicitfast"):
    given = dict(step=step, option=option, joint=joint, scheme=scheme)
    held = follow(*loaded(JOINT, gravity=-9.81, **given), 100.0)
    pushed = follow(*loaded(JOINT, gravity=0.0, **given), 100.0, lambda t: 4.905)
    turned = follow(
        *loaded(JOINT, gravity=0.0, **given), 100.0, lambda t: math.copysign(4.9, math.sin(t))
    )
    ramped = follow(*loaded(JOINT, gravity=0.0, **given), 49.9, lambda t: 0.1 * t)
    model, data = loaded(JOINT, gravity=0.0, **given)
    data.qvel[0] = 2.0
    stopped = follow(model, data, 0.2)
    return held, pushed, turned, ramped, stopped

def slid(step, option):
    angle = math.atan(0.27)
    down, along = -9.81 * math.cos(angle), 9.81 * math.sin(angle)
    model, data = loaded(BLOCK, step=step, option=option, down=down, along=along)
    follow(model, data, 1.0)
    begun = float(data.qpos[0])
    return follow(model, data, 100.0) - begun

STIFF = 'solreffriction="0.004 1" solimpfriction="0.9999 0.9999 0.001"'
NOSLIP = 'noslip_iterations="10" noslip_tolerance="0"'
joints = {
    "default settings, steps of 2 ms": checks(0.002),
    "discrete integrator, steps of 2 ms": checks(0.002, scheme="discrete"),
    "stiffer friction, steps of 2 ms": checks(0.002, joint=STIFF),
    "NoSlip, steps of 2 ms": checks(0.002, NOSLIP),
    "NoSlip, steps of 0.2 ms": checks(0.0002, NOSLIP),
}
blocks = {
    "default settings": slid(0.002, ""),
    "elliptic cone, impratio 10": slid(0.002, 'cone="elliptic" impratio="10"'),
    "elliptic cone, impratio 10, NoSlip": slid(0.002, f'cone="elliptic" impratio="10" {NOSLIP}'),
}
print(json.dumps([mujoco.__version__, joints, blocks]))
"""


def joint(weight: float = 0.0, effort: str = "0", **initial: float) -> ss.System:
    """The same joint, under its weight and an effort that depends on time."""
    return ss.System(
        "joint",
        coordinates={"q": ss.Inertial(force=effort)},
        kinetic=f"{INERTIA}*d_q**2/2",
        potential=f"-{weight}*sin(q)",
        contacts={"bearing": ss.Contact("d_q", FRICTION)},
        initial=initial,
    )


def final(system: ss.System, until: float) -> float:
    """Where a certified motion ends."""
    motion = ss.simulate(system, (0.0, until))
    assert motion.certificate.ok
    return motion.final[next(iter(system.coordinates))]


def ours() -> tuple[list[float], float]:
    """The same checks, and the block."""
    checks = [
        final(joint(WEIGHT), LONG),
        final(joint(effort=str(WEIGHT)), LONG),
        final(joint(effort="4.9*sign(sin(t))"), LONG),
        final(joint(effort=f"{RAMP}*t"), 49.9),
        final(joint(d_q=SPEED), 0.2),
    ]
    weight = 9.81 / (1.0 + SLOPE**2) ** 0.5
    block = ss.System(
        "block",
        coordinates={"x": ss.Inertial(force=weight * SLOPE)},
        kinetic="d_x**2/2",
        contacts={"slope": ss.Contact("d_x", COEFFICIENT * weight)},
    )
    return checks, final(block, LONG)


def table(headings: list[str], rows: list[list[str]]) -> list[str]:
    """A table of Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return ["| " + " | ".join(line) + " |" for line in lines]


def main() -> None:
    """Run all, print it and keep it."""
    python = sys.argv[1] if len(sys.argv) > 1 else sys.executable
    told = subprocess.run([python, "-c", MUJOCO], capture_output=True, text=True, check=True)
    version, joints, blocks = json.loads(told.stdout)
    checks, slid = ours()
    stops = INERTIA * SPEED**2 / (2.0 * FRICTION)

    def row(name: str, found: list[float]) -> list[str]:
        *still, stopped = found
        return [name, *(f"{x:.2g}" for x in still), f"{stopped - stops:.1g}"]

    rows = [row(f"MuJoCo, {name}", found) for name, found in joints.items()]
    rows.append(row(OURS, checks))
    head = ["displacement in rad", "held for 100 s", "effort in place of the weight"]
    head += ["alternating effort", "effort up to 0.998 of the friction", "error at the stop"]
    lines = ["# Holds at rest", "", f"{platform.machine()}, {platform.system()}", "", "## joint"]
    lines += ["", *table(head, rows), "", "## block", ""]
    contacts = [[f"MuJoCo, {name}", f"{1e3 * x:.2g}"] for name, x in blocks.items()]
    contacts.append([OURS, f"{1e3 * slid:g}"])
    lines += [*table(["a block on a slope", "displacement in 100 s, mm"], contacts), ""]
    lines += [f"MuJoCo {version}, stickslip {ss.__version__}", ""]
    print("\n".join(lines))
    RESULTS.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
