"""Systems with dry friction: declared by their energy and their dissipation potential, simulated
exactly, event by event.

>>> import stickslip as ss
>>> system = ss.catalogue.rocking_toy(P=1.2)
>>> trajectory = ss.simulate(system, (0.0, 200.0), initial={"psi": 0.8})
>>> trajectory.certificate.ok
True
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip import catalogue, figures
    from stickslip.equations.vector_field import VectorField, vector_field
    from stickslip.errors import ConvergenceError, DeclarationError, StickslipError
    from stickslip.explorer.explore import explore
    from stickslip.exports.export import export
    from stickslip.figures.drawing import style
    from stickslip.fitting.band import Band
    from stickslip.fitting.comparing import Comparison
    from stickslip.fitting.comparing import compare_systems as compare
    from stickslip.fitting.fit import Fit
    from stickslip.fitting.making import fit
    from stickslip.fitting.points.fit_law import LawFit, fit_law
    from stickslip.fitting.problem import FitProblem, fit_problem
    from stickslip.fitting.recording import Recording
    from stickslip.model import laws
    from stickslip.model.entries.samples import Samples, noise
    from stickslip.model.entries.tables import Table
    from stickslip.model.system import (
        Bilateral,
        Condition,
        Contact,
        Inertial,
        Internal,
        Jump,
        Output,
        Parameter,
        RateIndependent,
        Sampled,
        System,
        Unilateral,
        Viscous,
    )
    from stickslip.model.system_file import load
    from stickslip.motion.event_catalogue import EventCatalogue
    from stickslip.motion.outcome import Outcome
    from stickslip.motion.simulate import simulate
    from stickslip.motion.simulate_many import Ensemble, simulate_many
    from stickslip.motion.stepper import Stepper, StepperState
    from stickslip.motion.trajectory import Trajectory
    from stickslip.orbits.branches.cycle_branch import continue_cycle
    from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
    from stickslip.orbits.branches.equilibrium_curves import fold_curve, hopf_curve
    from stickslip.orbits.branches.onset_curve import stick_onset_curve
    from stickslip.orbits.continuation.branch import Branch, SpecialPoint
    from stickslip.orbits.continuation.path import StepControl
    from stickslip.orbits.cycles.cycle import Cycle
    from stickslip.orbits.cycles.find_cycle import find_cycle
    from stickslip.orbits.equilibria.equilibrium import Equilibria, Equilibrium, EquilibriumSet
    from stickslip.orbits.equilibria.finding import equilibria
    from stickslip.orbits.settling.motions import Settings
    from stickslip.orbits.studies.backbone import Backbone, backbone
    from stickslip.orbits.studies.gaits import (
        GaitStudy,
        gait_study,
        sliding_threshold,
        walking_threshold,
    )
    from stickslip.orbits.studies.hysteresis import HysteresisOperator
    from stickslip.orbits.studies.ring_down import RingDown, ring_down
    from stickslip.rate_independent.averaging.semi_infinite import Intersection
    from stickslip.rate_independent.dissipation import (
        Dissipation,
        Ellipsoid,
        GroupNorm,
        Polytope,
        Product,
        SupportFormula,
        SupportFunction,
        WeightedL1,
    )
    from stickslip.rate_independent.evolution.averaging_study import AveragingStudy, averaging_study
    from stickslip.rate_independent.evolution.evolution import Evolution
    from stickslip.rate_independent.evolution.evolution_file import load_evolution
    from stickslip.rate_independent.evolution.evolve import evolve
    from stickslip.rate_independent.evolution.history import History
    from stickslip.rate_independent.evolution.model import EvolutionModel
    from stickslip.rate_independent.of_contacts import dissipation_of
    from stickslip.rate_independent.play.clamp import prandtl_ishlinskii
    from stickslip.rate_independent.play.operator import Play, play
    from stickslip.structures.damping import ModalDamping, ProportionalDamping
    from stickslip.structures.structure import Structure
    from stickslip.sweeps.adaptive import Adaptive
    from stickslip.sweeps.basin import basin
    from stickslip.sweeps.fragility import Fragility
    from stickslip.sweeps.lines import frequency_response
    from stickslip.sweeps.map import Basin, Map
    from stickslip.sweeps.request.records import Records
    from stickslip.sweeps.response import FrequencyResponse
    from stickslip.sweeps.sweep import sweep

__version__ = "0.1.0"

__all__ = [
    "Adaptive",
    "AveragingStudy",
    "Backbone",
    "Band",
    "Basin",
    "Bilateral",
    "Branch",
    "Comparison",
    "Condition",
    "Contact",
    "ConvergenceError",
    "Cycle",
    "DeclarationError",
    "Dissipation",
    "Ellipsoid",
    "Ensemble",
    "Equilibria",
    "Equilibrium",
    "EquilibriumSet",
    "EventCatalogue",
    "Evolution",
    "EvolutionModel",
    "Fit",
    "FitProblem",
    "Fragility",
    "FrequencyResponse",
    "GaitStudy",
    "GroupNorm",
    "History",
    "HysteresisOperator",
    "Inertial",
    "Internal",
    "Intersection",
    "Jump",
    "LawFit",
    "Map",
    "ModalDamping",
    "Outcome",
    "Output",
    "Parameter",
    "Play",
    "Polytope",
    "Product",
    "ProportionalDamping",
    "RateIndependent",
    "Recording",
    "Records",
    "RingDown",
    "Sampled",
    "Samples",
    "Settings",
    "SpecialPoint",
    "StepControl",
    "Stepper",
    "StepperState",
    "StickslipError",
    "Structure",
    "SupportFormula",
    "SupportFunction",
    "System",
    "Table",
    "Trajectory",
    "Unilateral",
    "VectorField",
    "Viscous",
    "WeightedL1",
    "__version__",
    "averaging_study",
    "backbone",
    "basin",
    "catalogue",
    "compare",
    "continue_cycle",
    "continue_equilibrium",
    "dissipation_of",
    "equilibria",
    "evolve",
    "explore",
    "export",
    "figures",
    "find_cycle",
    "fit",
    "fit_law",
    "fit_problem",
    "fold_curve",
    "frequency_response",
    "gait_study",
    "hopf_curve",
    "laws",
    "load",
    "load_evolution",
    "noise",
    "open",
    "play",
    "prandtl_ishlinskii",
    "ring_down",
    "simulate",
    "simulate_many",
    "sliding_threshold",
    "stick_onset_curve",
    "style",
    "sweep",
    "vector_field",
    "walking_threshold",
]

# Modules whose names are public, too.
_MODULES = {
    "catalogue": "catalogue",
    "figures": "figures",
    "laws": "model.laws",
    "style": "figures.drawing.style",
}
# Module of each public name, with its name there if that is different. Imports are deferred until
# first use: xarray takes half a second.
_HOMES = {
    **dict.fromkeys(["VectorField", "vector_field"], "equations.vector_field"),
    **dict.fromkeys(["ConvergenceError", "DeclarationError", "StickslipError"], "errors"),
    "load": "model.system_file",
    "Outcome": "motion.outcome",
    "simulate": "motion.simulate",
    **dict.fromkeys(["Ensemble", "simulate_many"], "motion.simulate_many"),
    **dict.fromkeys(["Stepper", "StepperState"], "motion.stepper"),
    "Trajectory": "motion.trajectory",
    "EventCatalogue": "motion.event_catalogue",
    "Evolution": "rate_independent.evolution.evolution",
    "EvolutionModel": "rate_independent.evolution.model",
    "load_evolution": "rate_independent.evolution.evolution_file",
    "evolve": "rate_independent.evolution.evolve",
    "explore": "explorer.explore",
    "export": "exports.export",
    "History": "rate_independent.evolution.history",
    **dict.fromkeys(["Branch", "SpecialPoint"], "orbits.continuation.branch"),
    **dict.fromkeys(["fold_curve", "hopf_curve"], "orbits.branches.equilibrium_curves"),
    **dict.fromkeys(
        ["Equilibria", "Equilibrium", "EquilibriumSet"], "orbits.equilibria.equilibrium"
    ),
    "equilibria": "orbits.equilibria.finding",
    "continue_equilibrium": "orbits.branches.equilibrium_branch",
    "Cycle": "orbits.cycles.cycle",
    "find_cycle": "orbits.cycles.find_cycle",
    "continue_cycle": "orbits.branches.cycle_branch",
    "stick_onset_curve": "orbits.branches.onset_curve",
    **dict.fromkeys(["Backbone", "backbone"], "orbits.studies.backbone"),
    "HysteresisOperator": "orbits.studies.hysteresis",
    **dict.fromkeys(["RingDown", "ring_down"], "orbits.studies.ring_down"),
    **dict.fromkeys(
        ["GaitStudy", "gait_study", "sliding_threshold", "walking_threshold"],
        "orbits.studies.gaits",
    ),
    "Adaptive": "sweeps.adaptive",
    "basin": "sweeps.basin",
    "Settings": "orbits.settling.motions",
    "StepControl": "orbits.continuation.arclength",
    "Intersection": "rate_independent.averaging.semi_infinite",
    **dict.fromkeys(["Basin", "Map"], "sweeps.map"),
    "Fragility": "sweeps.fragility",
    "Records": "sweeps.request.records",
    "sweep": "sweeps.sweep",
    "FrequencyResponse": "sweeps.response",
    "frequency_response": "sweeps.lines",
    "Play": "rate_independent.play.operator",
    "play": "rate_independent.play.operator",
    "prandtl_ishlinskii": "rate_independent.play.clamp",
    **dict.fromkeys(["Samples", "noise"], "model.entries.samples"),
    **dict.fromkeys(["ModalDamping", "ProportionalDamping"], "structures.damping"),
    "Structure": "structures.structure",
    "Band": "fitting.band",
    "Comparison": "fitting.comparing",
    "compare": "fitting.comparing:compare_systems",
    "Fit": "fitting.fit",
    "fit": "fitting.making",
    **dict.fromkeys(["LawFit", "fit_law"], "fitting.points.fit_law"),
    **dict.fromkeys(["FitProblem", "fit_problem"], "fitting.problem"),
    "Recording": "fitting.recording",
    "Table": "model.entries.tables",
    **dict.fromkeys(
        ["AveragingStudy", "averaging_study"], "rate_independent.evolution.averaging_study"
    ),
    "dissipation_of": "rate_independent.of_contacts",
    **dict.fromkeys(
        [
            "Dissipation",
            "Ellipsoid",
            "GroupNorm",
            "Polytope",
            "Product",
            "SupportFormula",
            "SupportFunction",
            "WeightedL1",
        ],
        "rate_independent.dissipation",
    ),
    **dict.fromkeys(
        [
            "Bilateral",
            "Condition",
            "Contact",
            "Inertial",
            "Internal",
            "Jump",
            "Output",
            "Parameter",
            "RateIndependent",
            "Sampled",
            "System",
            "Unilateral",
            "Viscous",
        ],
        "model.system",
    ),
}


# The class of each kind of stored result.
_KINDS = {
    "averaging study": "AveragingStudy",
    "backbone": "Backbone",
    "band": "Band",
    "basin": "Basin",
    "branch": "Branch",
    "comparison": "Comparison",
    "cycle": "Cycle",
    "ensemble": "Ensemble",
    "equilibria": "Equilibria",
    "event catalogue": "EventCatalogue",
    "evolution": "History",
    "fit": "Fit",
    "fragility": "Fragility",
    "frequency response": "FrequencyResponse",
    "gait study": "GaitStudy",
    "law fit": "LawFit",
    "play": "Play",
    "ring-down": "RingDown",
    "sweep": "Map",
    "trajectory": "Trajectory",
}


def open(path: str | Path) -> Any:
    """Open a stored result of any kind: a file written by ``save``, or the store of a map.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Trajectory, EventCatalogue, Ensemble, History, Play, AveragingStudy, Equilibria, Cycle, Branch,
    GaitStudy, FrequencyResponse, RingDown, Backbone, Fit, LawFit, Comparison, Band, Map, Fragility
    or Basin
        The stored result; nothing is recomputed until needed.

    Raises
    ------
    StickslipError
        If the file does not exist, is not a result, or has an unsupported format.
    """
    from stickslip import storage

    return __getattr__(_KINDS[storage.kind_of(path, _KINDS)]).open(path)


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        value: Any = import_module(f"stickslip.{_MODULES[name]}")
    elif name in _HOMES:
        home, _, known_as = _HOMES[name].partition(":")
        value = getattr(import_module(f"stickslip.{home}"), known_as or name)
    else:
        raise AttributeError(f"module 'stickslip' has no attribute '{name}'")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
