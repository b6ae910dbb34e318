"""Systems with dry friction: declared by their energy and their dissipation, moved exactly, switch by switch.

>>> import stickslip as ss
>>> system = ss.catalogue.rocking_toy(P=1.2)
>>> trajectory = ss.simulate(system, (0.0, 200.0), initial={"psi": 0.8})
>>> trajectory.certificate.ok
True
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip import catalogue
    from stickslip.errors import ConvergenceError, DeclarationError, StickslipError
    from stickslip.modelfile import load
    from stickslip.motion.batch import simulate_many
    from stickslip.motion.outcome import Outcome
    from stickslip.motion.simulate import simulate
    from stickslip.motion.trajectory import Trajectory, open_trajectory
    from stickslip.orbits.branch import Branch, SpecialPoint, open_branch
    from stickslip.orbits.curves import fold_curve, hopf_curve
    from stickslip.orbits.cycle_branch import continue_cycle
    from stickslip.orbits.cycles import Cycle, find_cycle
    from stickslip.orbits.equilibria import equilibria
    from stickslip.orbits.equilibrium import Equilibria, Equilibrium, EquilibriumSet
    from stickslip.orbits.equilibrium_branch import continue_equilibrium
    from stickslip.orbits.gaits import gait_study, sliding_threshold, walking_threshold
    from stickslip.orbits.hysteresis import HysteresisOperator
    from stickslip.orbits.onset_curve import stick_onset_curve
    from stickslip.rate_independent.dissipation import (
        Dissipation,
        Ellipsoid,
        GroupNorm,
        Polytope,
        Product,
        SupportFunction,
        WeightedL1,
    )
    from stickslip.rate_independent.evolution import Evolution
    from stickslip.rate_independent.evolve import evolve
    from stickslip.rate_independent.history import History, open_history
    from stickslip.rate_independent.play import Play, play
    from stickslip.rate_independent.study import averaging_study
    from stickslip.sweeps.adaptive import Adaptive
    from stickslip.sweeps.basin import basin
    from stickslip.sweeps.chunk import Settings
    from stickslip.sweeps.sweep import open_sweep, sweep
    from stickslip.system import (
        Condition,
        Contact,
        Inertial,
        Internal,
        Parameter,
        RateIndependent,
        System,
        Viscous,
    )

__version__ = "0.1.0"

__all__ = [
    "Adaptive",
    "Branch",
    "Condition",
    "Contact",
    "ConvergenceError",
    "Cycle",
    "DeclarationError",
    "Dissipation",
    "Ellipsoid",
    "Equilibria",
    "Equilibrium",
    "EquilibriumSet",
    "Evolution",
    "GroupNorm",
    "History",
    "HysteresisOperator",
    "Inertial",
    "Internal",
    "Outcome",
    "Parameter",
    "Play",
    "Polytope",
    "Product",
    "RateIndependent",
    "Settings",
    "SpecialPoint",
    "StickslipError",
    "SupportFunction",
    "System",
    "Trajectory",
    "Viscous",
    "WeightedL1",
    "__version__",
    "averaging_study",
    "basin",
    "catalogue",
    "continue_cycle",
    "continue_equilibrium",
    "equilibria",
    "evolve",
    "find_cycle",
    "fold_curve",
    "gait_study",
    "hopf_curve",
    "load",
    "open_branch",
    "open_history",
    "open_sweep",
    "open_trajectory",
    "play",
    "simulate",
    "simulate_many",
    "sliding_threshold",
    "stick_onset_curve",
    "sweep",
    "walking_threshold",
]

# Where each public name lives. Nothing is imported before it is asked for: numba and xarray take seconds.
_HOMES = {
    **dict.fromkeys(["ConvergenceError", "DeclarationError", "StickslipError"], "errors"),
    "load": "modelfile",
    "Outcome": "motion.outcome",
    "simulate": "motion.simulate",
    "simulate_many": "motion.batch",
    "Trajectory": "motion.trajectory",
    "open_trajectory": "motion.trajectory",
    "Evolution": "rate_independent.evolution",
    "evolve": "rate_independent.evolve",
    "History": "rate_independent.history",
    "open_history": "rate_independent.history",
    **dict.fromkeys(["Branch", "SpecialPoint", "open_branch"], "orbits.branch"),
    **dict.fromkeys(["fold_curve", "hopf_curve"], "orbits.curves"),
    **dict.fromkeys(["Equilibria", "Equilibrium", "EquilibriumSet"], "orbits.equilibrium"),
    "equilibria": "orbits.equilibria",
    "continue_equilibrium": "orbits.equilibrium_branch",
    **dict.fromkeys(["Cycle", "find_cycle"], "orbits.cycles"),
    "continue_cycle": "orbits.cycle_branch",
    "stick_onset_curve": "orbits.onset_curve",
    "HysteresisOperator": "orbits.hysteresis",
    **dict.fromkeys(["gait_study", "sliding_threshold", "walking_threshold"], "orbits.gaits"),
    "Adaptive": "sweeps.adaptive",
    "basin": "sweeps.basin",
    "Settings": "sweeps.chunk",
    **dict.fromkeys(["open_sweep", "sweep"], "sweeps.sweep"),
    "Play": "rate_independent.play",
    "play": "rate_independent.play",
    "averaging_study": "rate_independent.study",
    **dict.fromkeys(
        ["Dissipation", "Ellipsoid", "GroupNorm", "Polytope", "Product", "SupportFunction", "WeightedL1"],
        "rate_independent.dissipation",
    ),
    **dict.fromkeys(
        ["Condition", "Contact", "Inertial", "Internal", "Parameter", "RateIndependent", "System", "Viscous"], "system"
    ),
}


def __getattr__(name: str) -> Any:
    if name == "catalogue":
        return import_module("stickslip.catalogue")
    if name not in _HOMES:
        raise AttributeError(f"module 'stickslip' has no attribute '{name}'")
    value = getattr(import_module(f"stickslip.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
