"""Names that an error message lists are accepted where they are listed."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import stickslip as ss
from bodies import chain
from stickslip.errors import DeclarationError
from stickslip.explorer.offline.plan import read_plan
from stickslip.sweeps.request.user_measures import offered_measures, read_measures

UNKNOWN = "qq_99"  # close to no name
BRIEF = 0.05  # seconds, in which what is accepted has begun
SHORT = ss.Settings(max_time=0.5)


def system_of_structure(modes: int | None) -> ss.System:
    """A chain with two names, as it is or reduced to its ends and some modes."""
    body = ss.Structure(*chain(4), ss.ModalDamping(0.02), names={"tip": 3, "inner": 1})
    body = body if modes is None else body.reduced(keep=[0, 3], modes=modes)
    return ss.System(
        "chain",
        structures={"u": body},
        forces={"u[tip]": "F*cos(omega*t)"},
        contacts={
            "joint": ss.laws.jenkins("d_u[0]", F_c=0.2, k=1.0),
            "rub": ss.Contact("d_u[inner]", 0.05),
        },
        outputs={"bend": "u[tip] - u[0]", "bent": "abs(u[tip])", "pull": "friction_rub"},
        **DRIVEN,
    )


DRIVEN: dict[str, Any] = {"parameters": {"F": 0.5, "omega": 0.6}, "span": (0.0, 20.0)}
START = {"chain": {"r_joint": 0.1}, "reduced": {"r_joint": 0.1}}


@cache
def system_of(kind: str) -> ss.System:
    """Systems with names of all kinds."""
    match kind:
        case "chain":
            return system_of_structure(None)
        case "reduced":
            return system_of_structure(1)
        case "mixed":
            return ss.System(
                "mixed",
                functions={"soft(a)": "a + a**3/9", "level": "F/2"},
                drives={"ell": "0.1*F*sin(omega*t)"},
                coordinates={
                    "x": ss.Inertial(force="F*cos(omega*t)"),
                    "z": ss.Viscous(),
                    "r": ss.RateIndependent(),
                },
                internal={"a": ss.Internal("x - a")},
                kinetic="d_x**2/2",
                potential="x**2/2 + (z - x)**2/2 + (r - ell)**2/2",
                viscous="d_z**2/2 + 0.1*d_x**2",
                contacts={"wet": ss.Contact("d_z", 0.05), "dry": ss.Contact("d_r", 0.02)},
                outputs={"gauge": "x - z", "kinky": "abs(x)", "slow": "d_z + a"},
                **DRIVEN,
            )
        case "ball":
            return ss.System(
                "ball",
                coordinates={"x": ss.Inertial(), "y": ss.Inertial(force="F*cos(omega*t)")},
                kinetic="(d_x**2 + d_y**2)/2",
                potential="x**2/2 + y",
                viscous="0.1*d_x**2/2",
                contacts={"floor": ss.Unilateral("y", "d_x", 0.2, restitution=0.5)},
                initial={"y": 0.3},
                **DRIVEN,
            )
        case "plane":
            return ss.System(
                "plane",
                coordinates={
                    "x": ss.Inertial(force="F*cos(omega*t)"),
                    "y": ss.Inertial(),
                    "s": ss.Inertial(),
                },
                kinetic="(d_x**2 + d_y**2 + d_s**2)/2",
                potential="(x**2 + y**2)/2",
                viscous="0.1*(d_x**2 + d_y**2 + d_s**2)/2",
                contacts={"table": ss.Contact(("d_x", "d_y"), 0.1)},
                translation={"s": 1.0},
                **DRIVEN,
            )
    raise ValueError(kind)


KINDS = ("chain", "reduced", "mixed", "ball", "plane")


@cache
def motion_of(kind: str) -> ss.Trajectory:
    """Its motion over a short time."""
    return ss.simulate(system_of(kind), (0.0, 1.0))


def problem(kind: str, free: str, observe: str = "energy", **given: Any) -> ss.FitProblem:
    """A fit to a record of one quantity."""
    t = np.linspace(0.0, 1.0, 40)
    data = {"t": t, "v": motion_of(kind).at(t)["energy"] + t}
    return ss.fit_problem(system_of(kind), data, [free], {"v": observe}, **given)


def swept(kind: str, over: Any, measure: str = "time", **given: Any) -> ss.Map:
    """A map of a short time."""
    return ss.sweep(system_of(kind), over, [measure], settings=SHORT, **given)


def redeclared(kind: str, **parts: Any) -> ss.System:
    """The system with other parts, and no symmetry that these might break."""
    return replace(system_of(kind), translation={}, **parts)


def values(kind: str) -> dict[str, float]:
    """A number for everything that a formula may depend on."""
    names = system_of(kind).declaration.scope.names
    return {name: 0.5 for name, e in names.items() if e.symbols == {name}}


def still(kind: str) -> ss.System:
    """The system without drive."""
    free = system_of(kind).with_parameters(F=0.0)
    return free.configure({"ell": 0.0}) if "ell" in free.drives else free


DOORS: dict[str, Callable[[str, str], Any]] = {
    "initial": lambda kind, name: ss.simulate(system_of(kind), (0.0, 0.1), initial={name: 0.01}),
    "parameters": lambda kind, name: ss.simulate(
        system_of(kind), (0.0, 0.1), parameters={name: 0.4}
    ),
    "configure": lambda kind, name: system_of(kind).configure({name: 0.4}),
    "over": lambda kind, name: swept(kind, {name: [0.41, 0.42]}),
    "initial of a map": lambda kind, name: swept(kind, {"F": [0.1]}, initial={name: 0.01}),
    "measure": lambda kind, name: swept(kind, {"F": [0.1]}, name),
    "formula of measures": lambda kind, name: read_measures(system_of(kind), [f"one = 2*{name}"]),
    "over of a basin": lambda kind, name: ss.basin(still(kind), {name: [0.01, 0.02]}),
    "sensitivity": lambda kind, name: motion_of(kind).sensitivity([name], [0.5]),
    "of of a sensitivity": lambda kind, name: motion_of(kind).sensitivity(["F"], [0.5], of=[name]),
    "free": lambda kind, name: problem(kind, name),
    "initial of a fit": lambda kind, name: problem(kind, "F", initial={name: 0.01}),
    "observe": lambda kind, name: problem(kind, "F", name),
    "of of a ring-down": lambda kind, name: ss.ring_down(still(kind), (0.0, 0.5), of=name),
    "of of a backbone": lambda kind, name: ss.backbone(
        still(kind), (0.1, 0.2), of=name, points=2, time_limit=BRIEF
    ),
    "of of a response": lambda kind, name: ss.frequency_response(
        system_of(kind), "omega", (0.5, 0.6), of=name, points=2, time_limit=BRIEF
    ),
    "level of a response": lambda kind, name: ss.frequency_response(
        system_of(kind),
        "omega",
        (0.5, 0.6),
        levels={name: [0.3]},
        drive="cos(omega*t)",
        points=2,
        time_limit=BRIEF,
    ),
    "result": lambda kind, name: motion_of(kind)[name],
    "evaluate": lambda kind, name: system_of(kind).evaluate(name, values(kind)),
    "declared initial": lambda kind, name: redeclared(kind, initial={name: 0.01}),
    "output": lambda kind, name: redeclared(kind, outputs={"more": name}),
    "fact": lambda kind, name: redeclared(kind, facts={"more": name}),
    "guard": lambda kind, name: redeclared(
        kind, jumps={"hop": ss.Jump(name, START.get(kind, {"x": 0.1}), "rising")}
    ),
    "jump": lambda kind, name: redeclared(
        kind, jumps={"hop": ss.Jump("t - 1", {name: 0.3}, "rising")}
    ),
}


def modes(kind: str, name: str, mode: str = "slip+") -> ss.VectorField:
    """The equations in slip, with one more contact."""
    contacts = [c.name for c in system_of(kind).declaration.contacts]
    return ss.vector_field(system_of(kind), {**dict.fromkeys(contacts, "slip+"), name: mode})


@cache
def map_of(kind: str) -> ss.Map:
    """Measures over an axis."""
    return ss.sweep(system_of(kind), {"F": [0.1, 0.2]}, ["time", "low"], settings=SHORT)


def autonomous(kind: str) -> ss.System:
    """The system without forces that depend on time."""
    system = system_of(kind)
    free = {
        name: replace(c, force=0) if isinstance(c, ss.Inertial) else c
        for name, c in system.coordinates.items()
    }
    return replace(system, coordinates=free, forces={}, drives=dict.fromkeys(system.drives, "0"))


DOORS |= {
    "box": lambda kind, name: ss.equilibria(autonomous(kind), box={name: (-0.1, 0.1)}),
    "modes": modes,
    "inputs": lambda kind, name: ss.Stepper(system_of(kind), inputs=[name]),
    "adaptive": lambda kind, name: ss.sweep(
        system_of(kind), {"F": "0.1:0.2:3"}, ["time"], adaptive=ss.Adaptive((name,), 0.5),
        settings=SHORT,
    ),
    "slider": lambda kind, name: read_plan(system_of(kind), [name]),
    "parameter of a branch": lambda kind, name: ss.continue_equilibrium(
        autonomous(kind), name, (0.0, 1.0), time_limit=BRIEF
    ),
    "dissipation": lambda kind, name: ss.dissipation_of(
        system_of(kind), name, values(kind) | ({"normal_floor": 1.0} if kind == "ball" else {})
    ),
    "coordinates of a plot": lambda kind, name: motion_of(kind).plot(coordinates=[name]),
    "plot of a map": lambda kind, name: map_of(kind).plot(name),
    "carry": lambda kind, name: swept(
        kind, {"F": [0.1, 0.2], next(iter(system_of(kind).starts)): [0.0, 0.01]}, carry=name
    ),
}  # fmt: skip
SOME: dict[str, Callable[[str, str], Any]] = {
    "drive": lambda kind, name: ss.fit_problem(
        system_of(kind), {"t": [0.0, 1.0], "v": [0.0, 1.0]}, ["F"], {"v": "energy"},
        drives={name: "v"},
    ),
    "contact in a plane": lambda kind, name: ss.figures.path_in_plane(
        Figure().add_subplot(), motion_of(kind), name
    ),
}  # fmt: skip
"""Of what not all systems have."""
OF = ("amplitude", "speed", "state", "mean", "harmonic", "relative_phase", "energy_per_distance")
OF += ("stick_fraction", "energy_per_cycle", "peak_force", "mean_force")


def listed(text: str) -> list[str]:
    """Names that a message lists."""
    match = re.search(r"Known here: (.*)$", text)
    if match is None or match[1] == "none":
        return []
    return [name for name in match[1].split(", ") if name != "..."]


def check(door: Callable[[str], Any]) -> list[str]:
    """What a door lists, if it accepts that."""
    with pytest.raises(DeclarationError) as refused:
        door(UNKNOWN)
    names = listed(str(refused.value))
    for name in names:
        with suppress(ss.ConvergenceError):  # the name is not at fault
            door(name)
    return names


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("door", DOORS)
def test_names_that_are_listed_are_accepted(door: str, kind: str) -> None:
    assert check(lambda name: DOORS[door](kind, name))


@pytest.mark.parametrize("door", SOME)
def test_names_of_some_systems_are_accepted(door: str) -> None:
    assert any([check(lambda name, kind=kind: SOME[door](kind, name)) for kind in KINDS])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("measure", OF)
def test_what_is_listed_can_be_measured(measure: str, kind: str) -> None:
    check(lambda name: read_measures(system_of(kind), [f"{measure}:{name}"]))


@pytest.mark.parametrize("kind", KINDS)
def test_measures_that_the_explorer_offers_are_accepted(kind: str) -> None:
    system = system_of(kind)
    assert read_measures(system, [*offered_measures(system)])


def test_unknowns_of_structures_are_listed() -> None:
    def refused(door: str, name: str = UNKNOWN) -> list[str]:
        with pytest.raises(DeclarationError) as error:
            DOORS[door]("chain", name)
        return listed(str(error.value))

    starts = ["u[tip]", "u[inner]", "d_u[tip]", "d_u[inner]"]
    assert refused("initial", "u[-1]")[:4] == starts
    for door in ("over", "sensitivity", "free"):
        assert refused(door)[2:6] == starts
    for door in ("of of a ring-down", "of of a backbone", "of of a response", "observe", "guard"):
        assert {*starts} <= {*refused(door)}


def test_phases_of_structures_have_a_default() -> None:
    measures = ["relative_phase", "relative_phase:u_mode_1", "phase", "phase:u_mode_1"]
    found = ss.sweep(system_of("reduced"), {"omega": [0.6]}, measures)
    for short, full in (measures[:2], measures[2:]):
        assert np.isfinite(found[short].values).all()
        assert found[short].values == found[full].values
