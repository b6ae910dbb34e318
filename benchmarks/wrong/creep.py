"""A block that should rest, where friction is smoothed or soft: it creeps.

A unit mass is pulled with 0.9 of its threshold for 100 time units. ``python
benchmarks/wrong/creep.py`` needs SciPy; MuJoCo if it is installed.
"""

from __future__ import annotations

from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from table import table, timed, versions

import stickslip as ss

END, PULL = 100.0, 0.9
MODEL = """
<mujoco>
  <option gravity="0 0 0" timestep="{step}" integrator="implicitfast" solver="Newton"
          tolerance="0" iterations="100"/>
  <worldbody>
    <body>
      <joint name="x" type="slide" axis="1 0 0" frictionloss="1" {more}/>
      <geom type="sphere" size="0.1" mass="1" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""


def smoothed(width: float) -> tuple[float, float]:
    """Way of the block under tanh(v/width), and seconds, by Radau."""
    began = perf_counter()

    def field(t: float, y: np.ndarray) -> list[float]:
        return [y[1], PULL - np.tanh(y[1] / width)]

    found = solve_ivp(field, (0.0, END), [0.0, 0.0], method="Radau", rtol=1e-8, atol=1e-12)
    return float(found.y[0, -1]), perf_counter() - began


def mujoco_way(step: float, more: str) -> tuple[float, float]:
    """Way of the block in MuJoCo, and seconds."""
    loaded: Any = import_module("mujoco")
    model = loaded.MjModel.from_xml_string(MODEL.format(step=step, more=more))
    data = loaded.MjData(model)
    data.qfrc_applied[0] = PULL
    began = perf_counter()
    for _ in range(round(END / step)):
        loaded.mj_step(model, data)
    return float(data.qpos[0]), perf_counter() - began


def report() -> str:
    """The table."""
    rows: list[list[object]] = []
    for width in (1e-1, 1e-2, 1e-3, 1e-4, 1e-6):
        way, seconds = smoothed(width)
        law = width * np.arctanh(PULL)
        rows.append(
            [f"tanh(v/{width:g}), Radau", f"{way:.3g}", f"{way / END:.2g}", f"{seconds:.2g}"]
        )
        assert abs(way / (law * END) - 1) < 0.1, "the creep that can be foretold"
    packages = ["scipy"]
    try:
        import_module("mujoco")
    except ImportError:
        rows.append(["MuJoCo is not installed here", "", "", ""])
    else:
        packages.append("mujoco")
        for name, step, more in (
            ("MuJoCo, frictionloss, default settings", 0.002, ""),
            (
                "MuJoCo, stiffer friction",
                0.002,
                'solreffriction="0.004 1" solimpfriction="0.9999 0.9999 0.001"',
            ),
            (
                "MuJoCo, maximum stiffness, short steps",
                0.0002,
                'solreffriction="0.0004 1" solimpfriction="0.9999 0.9999 0.001"',
            ),
        ):
            way, seconds = mujoco_way(step, more)
            rows.append([name, f"{way:.3g}", f"{way / END:.2g}", f"{seconds:.2g}"])
    block = ss.System(
        "block",
        coordinates={"x": ss.Inertial(force=PULL)},
        kinetic="d_x**2/2",
        contacts={"ground": ss.Contact("d_x", 1.0)},
    )
    motion, seconds = timed(lambda: ss.simulate(block, (0.0, END)))
    assert motion.certificate.ok
    rows.append(["**stickslip**", f"{motion.final['x']:g}", "0", f"{seconds:.2g}"])
    head = ["friction", "displacement in 100", "creep speed", "seconds"]
    return table(head, rows) + f"\n\n{versions(*packages)}\n"


if __name__ == "__main__":
    print(report())
