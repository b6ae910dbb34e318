"""Records of known truth: four systems, each with the noise that is added to its exact motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import stickslip as ss


@dataclass(frozen=True)
class Synthetic:
    """A record, and what it was made with.

    Attributes
    ----------
    system : System
    truth : dict of str to float
    free : dict
    observe : dict of str to str
    noise : dict of str to float
    data : table or Recording
    """

    system: ss.System
    truth: dict[str, float]
    free: dict[str, tuple[float, float]]
    observe: dict[str, str]
    noise: dict[str, float]
    data: Any

    def fit(self, **options: Any) -> ss.Fit:
        return ss.fit(self.system, self.data, self.free, self.observe, noise=self.noise, **options)


def _measured(
    motion: ss.Trajectory,
    t: np.ndarray,
    observe: dict[str, str],
    noise: dict[str, float],
    seed: int,
) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    exact = motion.at(t)
    columns = {
        name: np.asarray(exact[formula]) + noise[name] * rng.standard_normal(len(t))
        for name, formula in observe.items()
    }
    return {"t": t, **columns}


def forced(seed: int) -> Synthetic:
    """The forced Coulomb oscillator: position."""
    system = ss.catalogue.forced_oscillator()
    truth = {"F_c": 0.45, "k": 1.1}
    t = np.linspace(0.0, 40.0, 150)
    noise = {"x": 0.05}
    motion = ss.simulate(system, (0.0, 40.0), parameters=truth)
    data = _measured(motion, t, {"x": "x"}, noise, seed)
    free = {"F_c": (0.1, 0.9), "k": (0.5, 2.0)}
    return Synthetic(system, truth, free, {"x": "x"}, noise, data)


def stribeck(seed: int) -> Synthetic:
    """A block on a belt with Stribeck's curve: position and velocity, from rest."""
    system = ss.catalogue.belt_stribeck()
    truth = {"F_s": 1.1, "F_c": 0.45, "v_s": 0.3}
    t = np.linspace(0.0, 30.0, 300)
    observe = {"position": "x", "velocity": "d_x"}
    noise = {"position": 0.02, "velocity": 0.02}
    motion = ss.simulate(system, (0.0, 30.0), parameters=truth)
    data = _measured(motion, t, observe, noise, seed)
    free = {"F_s": (0.5, 3.0), "F_c": (0.1, 1.0), "v_s": (0.05, 2.0)}
    return Synthetic(system, truth, free, observe, noise, data)


def presliding(seed: int) -> Synthetic:
    """LuGre friction below its threshold: a spring that is driven to and fro, and the force in
    it."""
    system = ss.System(
        name="presliding",
        parameters={
            "sigma_0": ss.Parameter(1e4, "N/m", "stiffness of the bristles", "(0, inf)"),
            "F_c": ss.Parameter(1.0, "N", "kinetic friction", "(0, inf)"),
            "F_s": ss.Parameter(1.5, "N", "static friction", "(0, inf)"),
            "K": ss.Parameter(2e4, "N/m", "stiffness of the drive", "(0, inf)"),
            "m": ss.Parameter(1.0, "kg", "mass", "(0, inf)"),
        },
        coordinates={"x": ss.Inertial("m")},
        drives={"w": "3e-4*sin(2*t) + 1e-4*sin(4.4*t)"},
        kinetic="m*d_x**2/2",
        potential="K*(x - w)**2/2",
        contacts={
            "ground": ss.laws.lugre(
                "d_x",
                F_s="F_s",
                F_c="F_c",
                v_s=0.01,
                sigma_0="sigma_0",
                sigma_1=200.0,
                sigma_2=0.4,
                unit="N",
            )
        },
        time_unit="s",
        span=(0.0, 6.0),
    )
    truth = {"sigma_0": 1.3e4, "F_s": 1.3}
    t = np.linspace(0.0, 6.0, 200)
    noise = {"force": 0.02}
    observe = {"force": "K*(w - x)"}
    motion = ss.simulate(system, (0.0, 6.0), parameters=truth, rtol=1e-9)
    w = 3e-4 * np.sin(2 * t) + 1e-4 * np.sin(4.4 * t)
    force = 2e4 * (w - np.asarray(motion.at(t)["x"]))
    rng = np.random.default_rng(seed)
    data = {"t": t, "force": force + noise["force"] * rng.standard_normal(len(t))}
    free = {"sigma_0": (3e3, 1e5), "F_s": (1.05, 4.0)}
    return Synthetic(system, truth, free, observe, noise, data)


def slips(seed: int) -> Synthetic:
    """A spring slider that is pulled: the times of its slips, and the force in the spring then."""
    system = ss.catalogue.belt_block()
    truth = {"F_s": 1.2, "F_k": 0.7, "V": 0.25}
    motion = ss.simulate(system, (0.0, 80.0), parameters=truth)
    events = motion.events
    onset = np.asarray(events["time"])[np.asarray(events["from"]) == "stick"]
    rng = np.random.default_rng(seed)
    noise = {"onset": 0.02, "force": 0.01}
    force = np.asarray(motion.at(onset, side="left")["x"])
    data = ss.Recording(
        {
            "onset": onset + noise["onset"] * rng.standard_normal(len(onset)),
            "force": force + noise["force"] * rng.standard_normal(len(onset)),
        },
        events=f"{next(iter(system.contacts))} slips",
    )
    free = {"F_s": (0.5, 3.0), "F_k": (0.1, 1.15), "V": (0.05, 1.0)}
    return Synthetic(system, truth, free, {"onset": "t", "force": "k*x"}, noise, data)


ALL = {"forced": forced, "stribeck": stribeck, "presliding": presliding, "slips": slips}
