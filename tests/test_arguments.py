"""Wrong arguments of public functions and classes: a sentence of the library, and nothing else."""

from __future__ import annotations

import random
import warnings
from collections.abc import Callable, Iterator
from dataclasses import fields
from decimal import Decimal
from fractions import Fraction
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.arguments import validated
from stickslip.errors import DeclarationError, StickslipError

Call = tuple[Callable[..., Any], dict[str, Any]]

BELT = ss.catalogue.belt_block(V=0.3)
TOY = ss.catalogue.rocking_toy(P=1.2)
SLIDER = ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)
OSCILLATOR = ss.catalogue.forced_oscillator()


def record() -> dict[str, Any]:
    t = np.linspace(0.0, 3.0, 12)
    return {"t": t, "x": np.cos(t)}


def spring() -> ss.System:
    return ss.System(
        "spring",
        parameters={"k": ss.Parameter(1.0)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="k*x**2/2",
        initial={"x": 1.0},
        span=(0.0, 3.0),
    )


@cache
def made(name: str) -> Any:
    """Results whose methods are called, and what functions take."""
    match name:
        case "motion":
            return ss.simulate(BELT, (0.0, 8.0))
        case "cycle":
            return ss.find_cycle(BELT)
        case "branch":
            return ss.continue_equilibrium(SLIDER, "V", (0.1, 0.3))
        case "fit":
            return ss.fit(spring(), record(), ["k"], {"x": "x"}, starts=1)
        case "evolution":
            weights = ss.WeightedL1(["1 + cos(2*pi*s)/2"])
            return ss.Evolution([[1.0]], ["2*t"], weights, [0.0], 0.5, (0.0, 1.0))
        case "play":
            return ss.play("sin(t)", 0.5, (0.0, 3.0), initial=0.0)
        case "field":
            return ss.vector_field(BELT, {"belt contact": "slip+"})
    raise KeyError(name)


def declared(part: str, **given: Any) -> ss.System:
    """A small system with one of its parts as given."""
    parts: dict[str, Any] = {
        "parameters": {"k": ss.Parameter(1.0)},
        "coordinates": {"x": ss.Inertial()},
        "kinetic": "d_x**2/2",
        "potential": "k*x**2/2",
    }
    match part:
        case "System":
            parts |= given
        case "Parameter":
            parts["parameters"] = {"k": ss.Parameter(**given)}
        case "Inertial":
            parts["coordinates"] = {"x": ss.Inertial(**given)}
        case "Viscous" | "RateIndependent":
            parts |= {"coordinates": {"x": getattr(ss, part)(**given)}, "kinetic": 0.0}
            parts |= {"viscous": "d_x**2/2"} if part == "Viscous" else {}
            parts |= {} if part == "Viscous" else {"contacts": {"c": ss.Contact("d_x", 1.0)}}
        case "Internal":
            parts["internal"] = {"s": ss.Internal(**given)}
        case "Jump":
            parts["jumps"] = {"j": ss.Jump(**given)}
        case "Condition":
            parts["conditions"] = {"c": ss.Condition(**given)}
        case _:
            parts["contacts"] = {"c": getattr(ss, part)(**given)}
    return ss.System(**{"name": "s", **parts})


DECLARED: dict[str, dict[str, Any]] = {
    "System": {
        "name": "s",
        "title": "t",
        "parameters": {"k": ss.Parameter(1.0)},
        "functions": {"f": "2*k"},
        "drives": {"a": "sin(t)"},
        "coordinates": {"x": ss.Inertial()},
        "internal": {"s": ss.Internal("-s")},
        "kinetic": "d_x**2/2",
        "potential": "k*x**2/2",
        "viscous": 0.0,
        "contacts": {},
        "jumps": {},
        "translation": {},
        "initial": {"x": 1.0},
        "span": (0.0, 3.0),
        "time_unit": "s",
        "conditions": {},
        "facts": {"g": "k"},
    },
    "Parameter": {"default": 1.0, "unit": "N/m", "meaning": "stiffness", "range": "[0, inf)"},
    "Inertial": {"unit": "m", "meaning": "place", "drag": 0.0, "force": "sin(t)"},
    "Viscous": {"unit": "m", "meaning": "place", "drag": 0.0, "force": "sin(t)"},
    "RateIndependent": {"unit": "m", "meaning": "place", "force": "sin(t)"},
    "Internal": {"law": "-s", "unit": "", "meaning": "age"},
    "Jump": {"when": "x", "to": {"d_x": "-d_x"}, "direction": "falling"},
    "Condition": {"formula": "k > 3", "otherwise": "k is small"},
    "Contact": {
        "direction": "d_x",
        "threshold": 1.0,
        "surface_speed": 0.1,
        "kinetic": 0.5,
        "unit": "N",
        "axes": (1.0, 1.0),
    },
    "Unilateral": {"gap": "x + 2", "mu": 0.0, "restitution": 0.5, "unit": "N"},
    "Bilateral": {"constraint": "x", "mu": 0.0, "unit": "N"},
}


def calls() -> Iterator[tuple[str, Call]]:
    """Of every public function and class: a call that is right, and takes a moment."""
    yield (
        "simulate",
        (
            ss.simulate,
            {
                "system": BELT,
                "t_span": (0.0, 2.0),
                "initial": {"x": 0.1},
                "parameters": {"V": 0.2},
                "rtol": 1e-10,
                "atol": 1e-12,
                "max_events": 1000,
                "flow": "auto",
                "progress": None,
            },
        ),
    )
    yield (
        "simulate_many",
        (
            ss.simulate_many,
            {
                "system": BELT,
                "t_span": (0.0, 2.0),
                "initial": {"x": [0.1]},
                "parameters": {"V": [0.2, 0.3]},
                "rtol": 1e-10,
                "max_events": 1000,
                "workers": 1,
            },
        ),
    )
    yield (
        "sweep",
        (
            ss.sweep,
            {
                "system": TOY,
                "over": {"P": [1.1, 1.2]},
                "measure": ["speed"],
                "out": None,
                "initial": {"psi": 0.8},
                "settings": None,
                "seed": 0,
                "carry": None,
                "adaptive": None,
                "scheduler": "threads",
                "workers": 1,
                "device": "cpu",
                "extend": False,
                "overwrite": False,
                "repair": False,
                "progress": None,
            },
        ),
    )
    yield (
        "basin",
        (
            ss.basin,
            {
                "system": TOY,
                "over": {"psi": [0.7, 0.8], "d_psi": [0.0, 0.1]},
                "initial": None,
                "parameters": {"P": 1.2},
                "settings": None,
                "workers": 1,
                "progress": None,
            },
        ),
    )
    yield "find_cycle", (ss.find_cycle, {"system": BELT, "start": None, "parameters": {"V": 0.3}})
    yield "equilibria", (ss.equilibria, {"system": SLIDER, "parameters": {"V": 0.3}, "box": None})
    yield (
        "continue_equilibrium",
        (
            ss.continue_equilibrium,
            {
                "system": SLIDER,
                "parameter": "V",
                "span": (0.29, 0.31),
                "start": None,
                "parameters": {"nu": 0.05},
                "steps": None,
                "progress": None,
            },
        ),
    )
    yield (
        "continue_cycle",
        (
            ss.continue_cycle,
            {"cycle": made("cycle"), "parameter": "V", "span": (0.29, 0.31), "steps": None},
        ),
    )
    for name in ("hopf_curve", "fold_curve", "stick_onset_curve"):
        yield (
            name,
            (
                getattr(ss, name),
                {
                    "system": SLIDER,
                    "point": made("branch").special[0] if made("branch").special else None,
                    "first": "V",
                    "second": "nu",
                    "ranges": {"V": (0.2, 0.3), "nu": (0.04, 0.06)},
                    "steps": None,
                },
            ),
        )
    yield (
        "frequency_response",
        (
            ss.frequency_response,
            {
                "system": OSCILLATOR,
                "parameter": "omega",
                "span": (1.2, 1.21),
                "levels": None,
                "of": None,
                "drive": None,
                "parameters": {"F_c": 0.3},
                "initial": None,
                "points": 2,
                "steps": None,
            },
        ),
    )
    yield (
        "ring_down",
        (
            ss.ring_down,
            {
                "system": ss.catalogue.jenkins_oscillator(force="0"),
                "initial": {"d_x": 3.0},
                "of": "x",
                "span": (0.0, 20.0),
                "parameters": {"c": 0.0},
                "rtol": 1e-10,
                "atol": 1e-12,
                "max_events": 1000,
                "time_limit": None,
            },
        ),
    )
    yield (
        "backbone",
        (
            ss.backbone,
            {
                "system": ss.catalogue.jenkins_oscillator(force=0),
                "amplitudes": (0.4, 0.8),
                "of": None,
                "mode": 1,
                "parameters": {"F_c": 0.3},
                "points": 2,
            },
        ),
    )
    yield (
        "gait_study",
        (
            ss.gait_study,
            {
                "system": TOY,
                "parameter": "P",
                "values": [1.2],
                "initial": {"psi": 0.8},
                "parameters": None,
                "progress": None,
            },
        ),
    )
    for name in ("walking_threshold", "sliding_threshold"):
        yield (
            name,
            (
                getattr(ss, name),
                {
                    "system": TOY,
                    "parameter": "P",
                    "span": (0.7, 1.2),
                    "initial": {"psi": 0.8},
                    "parameters": None,
                    "tolerance": 0.1,
                },
            ),
        )
    fitted = {
        "system": spring(),
        "data": record(),
        "free": ["k"],
        "observe": {"x": "x"},
        "noise": None,
        "loss": "linear",
        "parameters": None,
        "initial": None,
        "drives": None,
        "time": "t",
        "rtol": 1e-9,
    }
    yield "fit", (ss.fit, {**fitted, "starts": 1, "seed": 0, "progress": None})
    yield "fit_problem", (ss.fit_problem, fitted)
    yield (
        "compare",
        (
            ss.compare,
            {
                "systems": [spring(), spring()],
                "data": record(),
                "free": ["k"],
                "observe": {"x": "x"},
            },
        ),
    )
    yield (
        "Recording",
        (
            ss.Recording,
            {"data": record(), "parameters": {"k": 1.0}, "initial": {}, "time": "t", "begin": 0.0},
        ),
    )
    yield (
        "evolve",
        (
            ss.evolve,
            {
                "problem": made("evolution"),
                "times": None,
                "steps": 4,
                "output": None,
                "observables": None,
                "tolerance": 1e-3,
                "kkt": 1e-8,
                "solver": None,
                "start": None,
                "progress": None,
            },
        ),
    )
    yield (
        "averaging_study",
        (
            ss.averaging_study,
            {"problem": made("evolution"), "epsilons": [0.5], "tolerance": 1e-2, "progress": None},
        ),
    )
    yield (
        "Evolution",
        (
            ss.Evolution,
            {
                "A": [[1.0]],
                "load": ["2*t"],
                "dissipation": ss.WeightedL1(["1"]),
                "initial": [0.0],
                "epsilon": 0.5,
                "span": (0.0, 1.0),
            },
        ),
    )
    yield (
        "play",
        (
            ss.play,
            {
                "load": "sin(t)",
                "threshold": 0.5,
                "t_span": (0.0, 3.0),
                "initial": 0.0,
                "epsilon": None,
                "stiffness": 1.0,
                "interpolation": "linear",
            },
        ),
    )
    yield (
        "prandtl_ishlinskii",
        (
            ss.prandtl_ishlinskii,
            {"load": [0.0, 1.0, 0.5], "radii": [0.1, 0.2], "weights": [1.0, 1.0], "initial": 0.0},
        ),
    )
    yield "WeightedL1", (ss.WeightedL1, {"weights": ["1", 2.0], "lower": None})
    yield "Ellipsoid", (ss.Ellipsoid, {"shape": [["4", "0"], ["0", "1"]]})
    yield "GroupNorm", (ss.GroupNorm, {"radii": ["1"], "size": 2})
    yield "Polytope", (ss.Polytope, {"normals": [[1.0], [-1.0]], "offsets": [1.0, 1.0]})
    yield "Polytope.vertices", (ss.Polytope, {"vertices": [[1.0], [-1.0]]})
    yield "Product", (ss.Product, {"factors": [ss.WeightedL1(["1"])]})
    yield (
        "SupportFormula",
        (ss.SupportFormula, {"formula": "mu*abs(v1)", "dimension": 1, "parameters": {"mu": 1.0}}),
    )
    yield (
        "SupportFunction",
        (
            ss.SupportFunction,
            {"function": lambda s, v: abs(v[0]), "dimension": 1, "depends_on_phase": False},
        ),
    )
    for name in ("value", "support", "contains", "project", "distance", "gauge", "prox", "average"):
        given = {
            "value": {"s": 0.0, "v": [1.0]},
            "support": {"v": [1.0], "s": 0.0},
            "contains": {"xi": [1.0], "s": 0.0, "tolerance": 1e-12},
            "project": {"xi": [1.0], "s": 0.0, "metric": None},
            "distance": {"xi": [1.0], "s": 0.0},
            "gauge": {"xi": [1.0], "s": 0.0},
            "prox": {"v": [1.0], "s": 0.0, "step": 1.0},
            "average": {"tolerance": 1e-8},
        }[name]
        yield f"WeightedL1.{name}", (getattr(ss.WeightedL1(["1"]), name), given)
    yield (
        "vector_field",
        (
            ss.vector_field,
            {"system": BELT, "modes": {"belt contact": "slip+"}, "at": None},
        ),
    )
    yield "VectorField.rates_at", (made("field").rates_at, {"values": {"x": 0.1, "d_x": 1.0}})
    yield (
        "VectorField.jacobian_at",
        (
            made("field").jacobian_at,
            {"values": {"x": 0.1, "d_x": 1.0}},
        ),
    )
    yield "open", (ss.open, {"path": "none.nc"})
    yield "load", (ss.load, {"path": "none.toml"})
    yield "load_evolution", (ss.load_evolution, {"path": "none.toml"})
    yield (
        "Samples",
        (
            ss.Samples,
            {"times": [0.0, 1.0], "values": [0.0, 1.0], "kind": "linear", "periodic": False},
        ),
    )
    yield (
        "Samples.read",
        (
            ss.Samples.read,
            {"file": "none.csv", "time": "t", "value": "a", "kind": "linear", "periodic": False},
        ),
    )
    for name in ("StepControl", "Settings", "Adaptive"):
        made_by = getattr(ss, name)
        yield name, (made_by, {f.name: getattr(made_by(), f.name) for f in fields(made_by)})
    yield "HysteresisOperator.of", (ss.HysteresisOperator.of, {"system": TOY})
    yield "catalogue.get", (ss.catalogue.get, {"name": "belt_block", "V": 0.3})
    yield "catalogue.block_chain", (ss.catalogue.block_chain, {"N": 3})
    for part, given in DECLARED.items():
        yield part, (partial(declared, part), given)
    yield (
        "EvolutionModel",
        (
            ss.EvolutionModel,
            {
                "name": "m",
                "A": ((1.0,),),
                "load": ("2*t",),
                "dissipation": {"kind": "weighted l1", "weights": ("1",)},
                "initial": (0.0,),
                "epsilon": 0.5,
                "span": (0.0, 1.0),
            },
        ),
    )
    yield "Trajectory.at", (made("motion").at, {"t": 1.0, "side": "right"})
    yield (
        "Trajectory.sensitivity",
        (
            made("motion").sensitivity,
            {"names": ["V"], "times": [1.0], "of": None, "second_opinion": False},
        ),
    )
    yield "Trajectory.event_catalogue", (made("motion").event_catalogue, {"energy": True})
    yield "Trajectory.save", (made("motion").save, {"path": "/nowhere/motion.nc"})
    yield "Trajectory.__getitem__", (made("motion").__getitem__, {"name": "x"})
    yield "Cycle.mean", (made("cycle").mean, {"formula": "x"})
    yield "Cycle.sensitivity", (made("cycle").sensitivity, {"names": ["V"]})
    yield "Cycle.cost_of_transport", (made("cycle").cost_of_transport, {"weight": 1.0})
    yield "Branch.of_kind", (made("branch").of_kind, {"kind": "fold"})
    yield "Fit.draws", (made("fit").draws, {"count": 3, "seed": 0})
    yield "Fit.profile", (made("fit").profile, {"name": "k"})
    yield "Fit.continue_cycle", (made("fit").continue_cycle, {"parameter": "k", "span": (0.9, 1.1)})
    yield "Play.position", (made("play").position, {"t": [0.1, 0.2]})
    yield "System.evaluate", (BELT.evaluate, {"formula": "2*V", "values": {"V": 0.3}})
    yield "System.configure", (BELT.configure, {"given": {"V": 0.3}})
    yield "System.with_parameters", (BELT.with_parameters, {"V": 0.3})


CALLS = dict(calls())
NO_ANSWER = (
    "no such file",
    "cannot be written",
    "expected a special point of kind",
    "moves at both ends of the range",
    "no fitted parameter",
)


class Odd:
    """An object of no kind that is expected anywhere."""


WRONG: tuple[Any, ...] = (
    None,
    True,
    "rocking_toy",
    "",
    "x",
    b"x",
    "\0",
    -1,
    0,
    2**63,
    10**400,
    -(10**400),
    0.5,
    float("nan"),
    float("inf"),
    -float("inf"),
    1e-300,
    1e300,
    1j,
    Fraction(1, 3),
    Decimal("0.5"),
    np.float32(0.5),
    np.int8(3),
    np.bool_(True),
    [],
    (),
    [1.0, 0.0],
    ["x", 1],
    [[1.0], [2.0, 3.0]],
    [None],
    {},
    {"x": "y"},
    {"x": None},
    {"V": float("nan")},
    {"V": 10**400},
    {"x": [1.0, "y"]},
    {1: 2.0},
    {"nonsense": 1.0},
    (1.0, 0.0),
    (0.0, float("inf")),
    (0.0, 1.0, 2.0),
    ("a", "b"),
    np.array(["a"]),
    np.array([1.0, np.nan]),
    np.zeros((2, 2, 2)),
    np.array(None),
    np.array([1 + 1j]),
    {1.0, 2.0},
    range(3),
    lambda: None,
    lambda *given: "text",
    int,
    Odd(),
    Odd,
    np,
    Path("nowhere"),
    Path("/"),
    BELT,
    ss.Settings(),
)


def outcome(name: str, argument: str, wrong: Any) -> str:
    """What a call says with one wrong argument: nothing that is ours, or the exception that is
    not."""
    function, given = CALLS[name]
    try:
        with warnings.catch_warnings(action="ignore"):
            function(**{**given, argument: wrong})
    except StickslipError as error:
        return "" if str(error).strip() else "an empty sentence"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:100]}"
    return ""


@pytest.mark.parametrize("name", CALLS)
def test_a_call_that_is_right(name: str) -> None:
    """The calls that are changed below are right, but some have nothing to find."""
    function, given = CALLS[name]
    try:
        function(**given)
    except StickslipError as error:
        assert any(word in str(error) for word in NO_ANSWER), error


@pytest.mark.parametrize("name", CALLS)
def test_wrong_arguments_are_answered_by_a_sentence(name: str) -> None:
    drawn = random.Random(name)
    _, given = CALLS[name]
    cases = [(argument, wrong) for argument in given for wrong in WRONG]
    for argument, wrong in drawn.sample(cases, min(len(cases), 15)):
        found = outcome(name, argument, wrong)
        assert not found, f"{name}({argument}={wrong!r}): {found}"


def test_arguments_after_the_last_named_one_are_checked() -> None:
    @validated
    def picture(path: str, *names: str, step: float | None = None) -> tuple[str, ...]:
        return names

    assert picture("a", "b", "c", "d", step=1.0) == ("b", "c", "d")
    with pytest.raises(DeclarationError, match="names"):
        picture("a", "b", 3)  # type: ignore[arg-type]
