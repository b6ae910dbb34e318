"""The data of a page at each point: the motion, the cycle to which it converges, and the
certificates of both."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, StickslipError
from stickslip.explorer.asking.limits import EVENTS_OF_A_PAGE, SECONDS
from stickslip.explorer.drawings.draw import scene_of
from stickslip.explorer.offline.curves import Shapes, short_number
from stickslip.explorer.offline.plan import Plan
from stickslip.explorer.subject.pixels import seen_times
from stickslip.explorer.subject.results import verdict
from stickslip.explorer.work.motion import lines_of, stick_phases
from stickslip.model.system import System
from stickslip.orbits.cycles.find_cycle import find_cycle

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory
    from stickslip.progress import Show

_ROWS = 4  # rows over time
_MOST_LINES = 6  # largest number of lines in a row
# largest number of curves of a motion with its animation; with more, the animation is omitted
_MOST_SHAPES = 24
# error relative to the range of a curve: an eighth of a pixel of a figure, or half a pixel
_NEAR = (6e-4, 2e-3)
_ROUGH = 1.5e-2  # error relative to the range of the curves of the animation
_MOST_BYTES = 3_000_000  # largest number of bytes of all motions of a page
_SMALL = 1_000_000  # number of bytes up to which curves are stored with the smaller error
_FIRST = 6  # number of motions after which the size of the page is estimated
_SECONDS = 5.0  # computing time for a cycle


@dataclass
class Stored:
    """The motions of a page.

    Attributes
    ----------
    points : list of int
        Index of the record of each point of the plan.
    records : list of dict
        Stored values, as data for JSON.
    lines : dict
        Plotted quantities, with their labels: ``rows``, ``symbols``, ``units``.
    scenes : list of dict
        Animations, without the positions of their parts.
    """

    points: list[int] = field(default_factory=list)
    records: list[dict[str, Any]] = field(default_factory=list)
    lines: dict[str, Any] = field(default_factory=dict)
    scenes: list[dict[str, Any]] = field(default_factory=list)

    def certified(self, kind: str) -> tuple[int, int]:
        """Number of certified motions or cycles, and of all."""
        found = [record[kind]["certified"] for record in self.records if kind in record]
        return sum(found), len(found)


def stored_motions(system: System, plan: Plan, show: Show) -> Stored:
    """Compute all motions of a plan.

    Raises
    ------
    DeclarationError
        If the page becomes too large.
    KeyboardInterrupt
    """
    writer = _Writer(system)
    stored = writer.stored
    known: dict[frozenset[tuple[str, float]], int] = {}
    points = plan.points
    size = 0
    for number, given in enumerate(points):
        show(number / len(points), f"{number} of {len(points)}")
        # If one parameter varies at a time, all lines pass through the declared values.
        key = frozenset({**system.values, **system.initial, **given}.items())
        if key not in known:
            known[key] = len(stored.records)
            record = writer.point(given)
            if number == 0 and len(json.dumps(record)) * len(points) > _SMALL:
                writer.near = _NEAR[1]
                record = writer.point(given)
            stored.records.append(record)
            size += len(json.dumps(stored.records[-1]))
            _check_size(size, len(stored.records), len(points))
        stored.points.append(known[key])
    return stored


def _check_size(size: int, done: int, points: int) -> None:
    """Reject a page that is, or would become, too large."""
    expected = size * points / done if done >= _FIRST else size
    # Some motions are shorter than the first ones.
    if size > _MOST_BYTES or expected > 3 * _MOST_BYTES:
        raise DeclarationError(
            "over",
            f"a page with {points} such motions has more than {_MOST_BYTES / 1e6:g} MB",
            f"Use fewer values (about {max(int(_MOST_BYTES * done / size), 1)} motions fit), or an "
            "earlier end",
        )


class _Writer:
    """Common data of the points of a page."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.stored = Stored()
        self.near = _NEAR[0]

    def point(self, given: Mapping[str, float]) -> dict[str, Any]:
        """The motion at a point, and its cycle; or the reason why there is none."""
        from stickslip.motion.simulate import simulate

        system = self.system
        values = {name: v for name, v in given.items() if name in system.parameters}
        initial = {name: v for name, v in given.items() if name not in values}
        try:
            motion = simulate(
                system,
                parameters=values,
                initial=initial,
                max_events=EVENTS_OF_A_PAGE,
                time_limit=SECONDS["motion"],
            )
        except StickslipError as error:
            return {"refused": _reason(error, system)}
        if motion.outcome.interrupted:
            raise KeyboardInterrupt
        said = verdict(motion)
        found: dict[str, Any] = {
            "motion": {
                **self.curves(motion),
                "certified": said["certified"],
                "word": said["verdict"],
                "text": f"{said['outcome']}, {_counted(motion.n_switches)}",
            }
        }
        try:
            start = motion if motion.outcome.ok else None
            cycle = find_cycle(system, start, parameters=values, time_limit=_SECONDS)
        except StickslipError as error:
            return {**found, "no cycle": _reason(error, system)}
        rows = dict(cycle.summary().rows)
        facts = [f"{name} {rows[name]}" for name in ("period", "drift") if name in rows]
        found["cycle"] = {
            **self.curves(cycle.trajectory),
            "certified": bool(cycle.certificate.ok),
            "word": cycle.certificate.verdict,
            "text": ", ".join([*facts, rows.get("stability", "")]).rstrip(", "),
        }
        return found

    def curves(self, motion: Trajectory) -> dict[str, Any]:
        """Curves of a motion."""
        about = lines_of(motion.system, tuple(motion.final), tuple(motion.modes))
        times, index, values = seen_times(motion, list(about["symbols"]), None)
        modes = {key: mode[index].astype(np.int32) for key, mode in motion.modes.items()}
        if not self.stored.lines:
            self.stored.lines = _lines(about, tuple(modes), values)
        shapes = Shapes(times)
        drawn = {name: shapes.add(values[name], self.near) for name in self.stored.lines["names"]}
        scene = self.scene(motion, {**values, **_named(modes)}, shapes)
        phases = stick_phases(motion)
        del phases["switches"]
        return {
            "t": [float(times[0]), float(times[-1])],
            "shapes": shapes.packed(),
            "q": drawn,
            "modes": {key: shapes.changes(mode) for key, mode in modes.items()},
            "stick": {key.partition(":")[2]: shapes.spans(ends) for key, ends in phases.items()},
            **scene,
        }

    def scene(
        self, motion: Trajectory, values: Mapping[str, Array], shapes: Shapes
    ) -> dict[str, Any]:
        """The animation, if its parts have only a few independent curves."""
        head, arrays = scene_of(motion, shapes.times, values).packed()
        before = len(shapes.curves)
        curves = {name: shapes.add(curve.astype(float), _ROUGH) for name, curve in arrays.items()}
        if len(shapes.curves) > _MOST_SHAPES:
            del shapes.curves[before:], shapes.near[before:]
            return {}

        def placed(value: float | str) -> float | list[float]:
            return curves[value] if isinstance(value, str) else short_number(value)

        places = [placed(head.pop("follow"))]
        for part in head["parts"]:
            places += [placed(value) for value in part["values"].values()]
            part["values"] = list(part["values"])
            if "points" in part:
                part["points"] = [[*map(short_number, point)] for point in part["points"]]
        if head not in self.stored.scenes:
            self.stored.scenes.append(head)
        return {"scene": self.stored.scenes.index(head), "places": places}


def _lines(
    about: Mapping[str, Any], contacts: Sequence[str], values: Mapping[str, Array]
) -> dict[str, Any]:
    """Quantities plotted over time, with their symbols; forces that are not zero throughout come
    first."""
    of: dict[str, list[dict[str, Any]]] = {}
    for group in about["groups"]:
        of.setdefault(group["kind"], []).append(group)
    first = of.get("coordinate", [])[:2]
    rows = [*first, *of.get("internal", [])[: 2 - len(first)], *of.get("rate", [])[:1]][:3]
    forces = sorted(of.get("friction", []), key=lambda group: not np.any(values[group["names"][0]]))
    rows += forces[: _ROWS - len(rows)]
    rows = [{**row, "names": row["names"][:_MOST_LINES]} for row in rows]
    names = list(dict.fromkeys(name for row in rows for name in row["names"]))
    return {
        "rows": rows,
        "names": names,
        "symbols": {name: about["symbols"][name] for name in names},
        "units": {name: about["units"][name] for name in names},
        "plain": {name: about["plain"][name] for name in names},
        "time_unit": about["time_unit"],
        "contacts": list(contacts),
    }


def _named(modes: Mapping[str, Array]) -> dict[str, Array]:
    return {f"mode_{key}": mode for key, mode in modes.items()}


def _counted(switches: int) -> str:
    return "1 switch" if switches == 1 else f"{switches:,} switches"


def _reason(error: StickslipError, system: System) -> str:
    """Short reason why something could not be computed."""
    text = str(error).removeprefix(f"a cycle of {system.name}: ")
    return shorten(text, 200, placeholder=" ...")
