"""What newcomers type into the search field, and which page is meant: these words stand in the
index of the site, and ``docs/check_search.py`` types them in."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

WORDS: Mapping[str, str] = {
    "start": "install, pip install, first picture, conda, getting started, extras",
    "is-this-for-me": "scope, limitations, alternatives, comparison, 3-D, contacts 3-D, "
    "speed, delay, noise, collision",
    "questions": "faq, questions",
    "glossary": "glossary, terms",
    "wrong": "regularisation, smooth friction, tanh, sign function, creep",
    "cluster": "dask, cluster, many machines",
    "fits-elsewhere": "own optimiser, sampler, Bayesian, emcee, JAX, lmfit, gradient",
    "tutorials/declare": "declare my own system, own model, units, tutorial",
    "tutorials/shaken": "vibration, shaken friction, effective friction, plate compactor",
    "tutorials/memory": "earthquake, rate and state, fault",
    "tutorials/machines": "brake squeal, squeal, drill string, violin, damper, joint, hunting",
    "tutorials/friction-in-a-plane": "friction in a plane, planar friction, two directions, "
    "2-D friction, puck, turntable, moving surface, along and across, anisotropic friction",
    "tutorials/finite-elements-to-response": "friction damper, "
    "underplatform damper, blade, turbine",
    "tutorials/bodies-on-points-faces-and-wheels": "rigid body, coin, curling, disc, skate, wheel, "
    "snake, rod on two points, plate, three legs, spin, ellipsoid, limit surface",
    "tutorials/controllers": "controller, PID, stiction, sampled data, time delay, quantisation, "
    "dither, measurement noise",
    "how-to/controllers": "co-simulation, stepper, step by step, feedback, control loop",
    "how-to/fmi": "FMI, FMU, Simulink, OpenModelica, Modelica, fmpy, export a model, solve_ivp, "
    "own integrator",
    "tutorials/impacts": "impact, bouncing, lift off, restitution, collision with a stop, Zeno",
    "tutorials/gaits": "walking, gait, locomotion, crawling",
    "tutorials/record-to-map": "record to a map",
    "tutorials/brake": "brake, stability map, measured friction coefficient, friction curve",
    "how-to/own-friction-law": "own friction law, custom friction law, custom law, "
    "asymmetric friction",
    "how-to/measured-drive": "measured load, measured drive, recorded signal, "
    "time series, csv input, base excitation",
    "how-to/tables": "measured curve, lookup table, friction from a table, interpolation, "
    "surface, fitted friction law",
    "how-to/mechanisms": "double pendulum, pendulum, multibody, constraint, chain of blocks",
    "how-to/outputs": "output, sensor, gauge, relative displacement, story drift, load cell, "
    "difference of two coordinates",
    "how-to/frequency-response": "frequency response, harmonic force, resonance, forced response",
    "how-to/ring-down": "ring-down, free decay, free vibration, logarithmic decrement, "
    "damping ratio, amplitude-dependent damping",
    "how-to/backbone": "backbone, nonlinear mode, modal damping, frequency over amplitude",
    "how-to/branches": "find periodic motion, periodic orbit, periodic motion, limit cycle, "
    "bifurcation diagram, "
    "continuation, bifurcation, Hopf",
    "how-to/maps": "parameter map, two parameters, parameter study, parameter sweep, "
    "basin of attraction, basin",
    "how-to/many-records": "accelerograms, ground motion, earthquake records, PEER, AT2, "
    "fragility, incremental dynamic analysis, IDA, many records",
    "how-to/gpu": "GPU, CUDA",
    "how-to/own-measure": "own measure, custom measure",
    "how-to/sensitivities": "derivatives, sensitivity, gradients",
    "how-to/fit": "fit, fit data, parameter estimation, identification, which law, calibrate",
    "how-to/robot-joint": "robot joint, actuator, system identification, frictionloss",
    "how-to/hysteresis": "hysteresis loop, isolator, piezo, Masing",
    "how-to/holding": "hold at rest, robot simulator, MuJoCo, Drake, Genesis, NoSlip",
    "theory/benchmark-problem": "benchmark problem, IFToMM, reference solution",
    "how-to/finite-elements": "finite elements, FEM, membrane",
    "how-to/structures": "structure, beam, matrix, stiffness matrix, modes, Craig-Bampton, Nastran",
    "how-to/data": "export csv, export data, Parquet, WAV, sound, save, pandas, xarray, netCDF, "
    "plot",
    "how-to/explore": "explorer, play in the browser, interactive, slider, GUI, "
    "standalone page, supplement of an article",
    "how-to/notebooks": "notebook, jupyter",
    "how-to/outcomes": "motion stopped, outcome, error message, no bounded rate, did not finish",
    "how-to/not-certified": "not certified, certified",
    "theory/certificates": "accurate, accuracy, tolerance, error bound, certificate, proof",
    "theory/mode-selection": "event detection, mode change, switching",
    "theory/cycles": "multipliers, saltation, Floquet, stability of a cycle",
    "theory/averaging": "averaging, homogenisation",
    "theory/planes": "friction disc, direction of slip",
    "theory/evolutions": "rate-independent, quasistatic, hysteresis",
    "theory/stick-onset": "stick onset, grazing, sliding bifurcation",
    "reference/laws": "friction laws, Stribeck, LuGre, Coulomb, Dahl, Bouc-Wen, Iwan",
    "reference/model-files": "model file, TOML",
    "reference/formulas": "formula, functions, piecewise",
    "reference/measures": "measures, stick fraction",
    "reference/command-line": "command line, command line options, exit code",
    "reference/python": "API, Python",
    "project/citing": "cite, citation",
    "project/roadmap": "roadmap",
    "project/versions": "versions, deprecation, compatibility",
    "generated/security": "security, vulnerability",
    "generated/changelog": "changelog, what is new",
    "generated/benchmarks": "benchmarks, speed of others",
    "generated/contributing": "contributing",
}
"""Pages, and the words for each, with commas between them."""


def of(page: str) -> list[str]:
    """The words for a page."""
    return [word.strip() for word in WORDS.get(page, "").split(",") if word.strip()]


@cache
def questions() -> dict[str, list[str]]:
    """The questions on the page of questions, without their marks, and the pages that answer."""
    asked = {}
    text = (Path(__file__).parents[1] / "questions.md").read_text(encoding="utf-8")
    for row in re.findall(r"^\| (.*\?.*) \|$", text, flags=re.MULTILINE):
        question, _, pages = row.split(" | ")
        links = re.findall(r"\]\(([\w/-]+)\.md", pages)
        asked[re.sub(r"[^\w\s-]", "", question)] = links
    return asked


# Words of questions that nobody types into a search field.
_SMALL = frozenset(
    "a an and any are be by can do does for from get give have how i in is it its my of on or own "
    "than the there they this to use was what where which why with you your".split()
)


def keys(question: str) -> str:
    """What is typed in of a question: its words, without the small ones."""
    return " ".join(word for word in question.lower().split() if word not in _SMALL)


def single(page: str) -> list[str]:
    """Every word of the words for a page, and of the questions that it answers: any of them may be
    typed in, in any order."""
    answered = [keys(question) for question, pages in questions().items() if page in pages]
    return sorted(set(re.findall(r"\w+", " ".join([*of(page), *answered]).lower())))


def marked(page: str, text: str) -> str:
    """The text of a page with its words, and the questions that it answers, in the index; they
    stand before its title."""
    answered = [question for question, pages in questions().items() if page in pages]
    entries = ", ".join(f"! {word}" for word in [*of(page), *answered])
    index = f"```{{index}} {entries}\n```\n\n" if entries else ""
    return re.sub("^# ", f"{index}# ", text, count=1, flags=re.MULTILINE)
