"""The commands ``run``, ``events``, ``equilibria``, ``cycle``, ``branch``, ``response``,
``ring-down``, ``backbone`` and ``basin``: motions of a system, and their long-term behaviour."""

from __future__ import annotations

import time
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any

import typer

from stickslip.cli.common.models import given, load_model, spans
from stickslip.cli.common.options import (
    Accuracy,
    Initial,
    Model,
    ParameterOptions,
    TimeLimit,
    TimeLimitOfEach,
    Until,
    quantity_of,
)
from stickslip.cli.common.present import Files, ResultOptions, ShowProgress, present
from stickslip.errors import DeclarationError, short
from stickslip.model.system import System
from stickslip.storage import named

MOTION_FILES = Files("trajectory.nc", {"events.csv": attrgetter("events")})
EVENT_FILES = Files.with_table("catalogue", "events")
EQUILIBRIA = Files.with_table("equilibria")
CYCLE = Files("cycle.nc", folder="cycle")
BRANCH = Files.with_table("branch")
RESPONSE = Files.with_table("response")
RING_DOWN = Files.with_table("ring-down")
BACKBONE = Files.with_table("backbone")
BASIN = Files("basin.nc", folder="basin")


def run_command(
    model: Model,
    settings: ParameterOptions = None,
    initial: Initial = None,
    until: Until = None,
    rtol: Accuracy = 1e-10,
    time_limit: TimeLimit = None,
    *,
    output: ResultOptions,
) -> None:
    """Compute, certify and store a motion.

    Writes trajectory.nc, events.csv, summary.json and overview.png into the folder DIR.

    Exit code: 0 certified to its end, 1 not, 2 wrong input, 130 interrupted (the results
    so far are kept).
    """
    from stickslip import Trajectory, simulate

    system = load_model(model, settings or [], until)
    start = given(initial)

    def work(progress: ShowProgress) -> Trajectory:
        limits: dict[str, Any] = {"rtol": rtol, "time_limit": time_limit}
        return simulate(system, initial=start, progress=progress, **limits)

    present("moving", system.name, MOTION_FILES, work, output)


def events_command(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A stored motion, such as trajectory.nc.")
    ],
    faster_than: Annotated[
        float | None,
        typer.Option("--faster-than", metavar="RATE", help="Rate above which an event is counted."),
    ] = None,
    above: Annotated[
        list[str] | None,
        typer.Option(
            "--above",
            metavar="QUANTITY=LEVEL",
            help="Output, or another quantity, and the level above which an event is counted; may "
            "be repeated.",
        ),
    ] = None,
    *,
    output: ResultOptions,
) -> None:
    """List the slip events of a stored motion: start, duration, size, energy.

    An event begins with the first slip after all contacts have been sticking, and ends when all
    stick again; with --faster-than, it lasts while some coordinate is faster; with --above, while a
    quantity is above its level. Writes catalogue.nc, catalogue.csv, summary.json and overview.png
    into the folder DIR.

    Exit code: 0 listed and certified, 1 not, 2 wrong input.
    """
    from stickslip import EventCatalogue, Trajectory
    from stickslip import open as open_result

    motion = open_result(file)
    if not isinstance(motion, Trajectory):
        reason = f"contains {named(motion.KIND)}, not a motion"
        raise DeclarationError(str(file), reason, "Give a file written by 'stickslip run'")
    levels = given(above, "--above")

    def work(progress: ShowProgress) -> EventCatalogue:
        return motion.event_catalogue(faster_than=faster_than, above=levels)

    present("events", motion.system.name, EVENT_FILES, work, output)


def equilibria_command(
    model: Model, settings: ParameterOptions = None, *, output: ResultOptions
) -> None:
    """Find the states of rest and of steady sliding, and their stability.

    Writes equilibria.nc, equilibria.csv, summary.json and overview.png into the folder DIR.

    Exit code: 0 found and certified, 1 not, 2 wrong input.
    """
    from stickslip import Equilibria
    from stickslip import equilibria as find

    system = load_model(model, settings or [])

    def work(progress: ShowProgress) -> Equilibria:
        return find(system)

    present(f"equilibria of {system.name}", system.name, EQUILIBRIA, work, output)


def cycle_command(
    model: Model,
    settings: ParameterOptions = None,
    initial: Initial = None,
    until: Until = None,
    time_limit: TimeLimit = None,
    *,
    output: ResultOptions,
) -> None:
    """Find the cycle or gait to which the motion from the initial state converges.

    Writes cycle.nc, summary.json and overview.png into the folder DIR.

    Exit code: 0 certified, 1 not, or no cycle found, 2 wrong input.
    """
    from stickslip import Cycle, find_cycle

    system = load_model(model, settings or [], until)
    start = given(initial)

    def work(progress: ShowProgress) -> Cycle:
        return find_cycle(system, start, time_limit=time_limit)

    present(f"cycle of {system.name}", system.name, CYCLE, work, output)


def branch_command(
    model: Model,
    over: Annotated[
        list[str],
        typer.Option("--over", metavar="NAME=LOW:HIGH", help="The parameter, such as V=0.05:0.4."),
    ],
    settings: ParameterOptions = None,
    initial: Initial = None,
    until: Until = None,
    cycles: Annotated[
        bool,
        typer.Option(
            "--cycle",
            help="Continue a cycle instead of an equilibrium; needed if the system depends on time "
            "or its state jumps.",
        ),
    ] = False,
    time_limit: TimeLimit = None,
    *,
    output: ResultOptions,
) -> None:
    """Continue an equilibrium (or a cycle) in a parameter, and report special points.

    Writes branch.nc, branch.csv, summary.json and overview.png into the folder DIR.

    Exit code: 0 certified, 1 not, or nothing to continue, 2 wrong input, 130 interrupted (the
    results so far are kept).
    """
    from stickslip import Branch, continue_cycle, continue_equilibrium, find_cycle
    from stickslip.equations.derive import derive
    from stickslip.orbits.branches.equilibrium_branch import checked_range

    parameter, (low, high) = _one_range(over)
    start = given(initial)
    system = load_model(model, settings or [], until)
    checked_range(system, parameter, (low, high))
    inside = low <= system.values[parameter] <= high
    at = {} if inside else {parameter: 0.5 * (low + high)}
    # Systems that depend on time have no equilibria.
    equations = derive(system.declaration)
    cycles = cycles or equations.timed or bool(equations.jumps)

    def work(progress: ShowProgress) -> Branch:
        over = parameter, (low, high)
        if not cycles:
            options: dict[str, Any] = {"start": start, "parameters": at}
            return continue_equilibrium(system, *over, time_limit=time_limit, **options)
        began = time.monotonic()
        cycle = find_cycle(system, start, parameters=at, time_limit=time_limit)
        spent = time.monotonic() - began
        left = None if time_limit is None else max(time_limit - spent, 1e-3)
        return continue_cycle(cycle, *over, time_limit=left)

    present(f"branch of {system.name}", system.name, BRANCH, work, output)


def response_command(
    model: Model,
    over: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="NAME=LOW:HIGH",
            help="The frequency, such as omega=0.5:1.5.",
            show_default="the drive frequency, from 0.5 to 1.5 times its value",
        ),
    ] = None,
    level: Annotated[
        list[str] | None,
        typer.Option(
            "--level",
            metavar="NAME=VALUES",
            help="Levels, one line each, such as F=0.1,0.2 or F=log:0.1:1:4.",
        ),
    ] = None,
    of: Annotated[str | None, quantity_of("the response")] = None,
    drive: Annotated[
        str | None,
        typer.Option(
            "--drive",
            metavar="FORMULA",
            help="Reference of the phases: a drive of the model, or a formula of t.",
        ),
    ] = None,
    points: Annotated[
        int,
        typer.Option(
            "--points", metavar="N", help="Number of frequencies of the sweeps up and down."
        ),
    ] = 25,
    settings: ParameterOptions = None,
    initial: Initial = None,
    time_limit: TimeLimit = None,
    *,
    output: ResultOptions,
) -> None:
    """Compute the response to a drive as a function of its frequency: amplitude, phase, stability.

    Writes response.nc, response.csv, summary.json and overview.png into the folder DIR.

    Exit code: 0 certified, 1 not, or no response, 2 wrong input, 130 interrupted (the results
    so far are kept).
    """
    from stickslip import FrequencyResponse, frequency_response

    asked = _one_range(over) if over else None
    start = given(initial)
    system = load_model(model, settings or [])
    parameter, (low, high) = asked or _around_drive(system)

    def work(progress: ShowProgress) -> FrequencyResponse:
        return frequency_response(
            system,
            parameter,
            (low, high),
            levels=level,
            of=of,
            drive=drive,
            initial=start,
            points=points,
            time_limit=time_limit,
        )

    present(f"response of {system.name}", system.name, RESPONSE, work, output)


def _around_drive(system: System) -> tuple[str, tuple[float, float]]:
    """The parameter that changes the frequency of the drive, and a range around its value.

    Raises
    ------
    DeclarationError
        If there is not exactly one.
    """
    from stickslip.equations.derive import derive
    from stickslip.orbits.fields.clock import clock

    values = system.values
    equations = derive(system.declaration)
    found: list[str] = []
    if equations.timed:
        beat = clock(system, equations, values)
        found = [name for name in system.parameters if beat.slope(values, name) != 0.0]
    if len(found) != 1:
        said = f"the frequency of the drive depends on {' and '.join(found)}"
        raise DeclarationError(
            "--over",
            said if found else "no parameter changes the frequency of a drive",
            "Give the parameter, like --over omega=0.5:1.5",
        )
    low, high = sorted((0.5 * values[found[0]], 1.5 * values[found[0]]))
    return found[0], (low, high)


def ring_down_command(
    model: Model,
    of: Annotated[str | None, quantity_of("the vibration")] = None,
    settings: ParameterOptions = None,
    initial: Initial = None,
    until: Until = None,
    rtol: Accuracy = 1e-10,
    time_limit: TimeLimit = None,
    *,
    output: ResultOptions,
) -> None:
    """Analyse a decaying vibration: amplitude, frequency and damping of every half-cycle.

    The model must not be driven: --set force=0 switches off a drive of that name.

    Writes ring-down.nc, ring-down.csv, summary.json and overview.png into the folder DIR.

    Exit code: 0 certified, 1 not, or no vibration, 2 wrong input, 130 interrupted (the results
    so far are kept).
    """
    from stickslip import RingDown, ring_down

    system = load_model(model, settings or [], until)
    start = given(initial)

    def work(progress: ShowProgress) -> RingDown:
        return ring_down(
            system,
            initial=start,
            of=of,
            rtol=rtol,
            time_limit=time_limit,
            progress=progress,
        )

    present(f"ring-down of {system.name}", system.name, RING_DOWN, work, output)


def backbone_command(
    model: Model,
    amplitudes: Annotated[
        str,
        typer.Option(
            "--amplitudes", metavar="LOW:HIGH", help="Range of amplitudes, such as 0.1:10."
        ),
    ],
    of: Annotated[str | None, quantity_of("the amplitude")] = None,
    mode: Annotated[
        int, typer.Option("--mode", metavar="N", help="Linear mode to start from; 1 is the lowest.")
    ] = 1,
    points: Annotated[
        int,
        typer.Option("--points", metavar="N", help="Number of amplitudes, spaced geometrically."),
    ] = 30,
    settings: ParameterOptions = None,
    time_limit: TimeLimit = None,
    *,
    output: ResultOptions,
) -> None:
    """Compute the frequency and damping of a mode as functions of its amplitude, without a drive.

    Writes backbone.nc, backbone.csv, summary.json and overview.png into the folder DIR.

    Exit code: 0 certified at all amplitudes, 1 not, or no cycle, 2 wrong input, 130 interrupted
    (the results so far are kept).
    """
    from stickslip import Backbone, backbone

    try:
        low, high = map(float, amplitudes.split(":"))
    except ValueError:
        raise DeclarationError(
            "--amplitudes", f"'{short(amplitudes)}' is not a range", "Write it as LOW:HIGH"
        ) from None
    system = load_model(model, settings or [])

    def work(progress: ShowProgress) -> Backbone:
        return backbone(
            system,
            (low, high),
            of=of,
            mode=mode,
            points=points,
            time_limit=time_limit,
        )

    present(f"backbone of {system.name}", system.name, BACKBONE, work, output)


def basin_command(
    model: Model,
    over: Annotated[
        list[str],
        typer.Option(
            "--over",
            metavar="NAME=LOW:HIGH:N",
            help="Initial values, such as psi=-2:2:80; twice for a map.",
        ),
    ],
    settings: ParameterOptions = None,
    initial: Initial = None,
    until: Until = None,
    time_limit: TimeLimitOfEach = None,
    *,
    output: ResultOptions,
) -> None:
    """Find the attractor that each of many initial states reaches.

    Writes basin.nc, summary.json and overview.png into the folder DIR.

    Exit code: 0 all settled and certified, 1 not, 2 wrong input, 130 interrupted (the results
    so far are kept).
    """
    from stickslip import Basin
    from stickslip import basin as find

    if len(over) != 2:
        raise DeclarationError(
            "--over", f"{len(over)} initial values were given", "Give two, each with --over"
        )
    start = given(initial)
    system = load_model(model, settings or [], until)

    def work(progress: ShowProgress) -> Basin:
        return find(system, over, initial=start, progress=progress, time_limit=time_limit)

    present(f"basin of {system.name}", system.name, BASIN, work, output)


def _one_range(over: list[str]) -> tuple[str, tuple[float, float]]:
    """The parameter of ``--over NAME=LOW:HIGH``, and its range."""
    ranges = spans(over)
    if len(ranges) != 1:
        raise DeclarationError(
            "--over", f"{len(ranges)} parameters were given", "Give one parameter"
        )
    parameter, (low, high) = next(iter(ranges.items()))
    return parameter, (low, high)
