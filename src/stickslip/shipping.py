"""The engine's machine code, made before anybody needs it: ``python -m stickslip.shipping``.

A short tour through the library calls every function of the engine that Python calls, and each of
them is compiled where the tour first comes to it; two tours go side by side, each with half of the
way. What is up to date is not made again.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stickslip.machine_code import shelf
from stickslip.machine_code.objects import digest
from stickslip.machine_code.stamps import stamp

if TYPE_CHECKING:
    from stickslip.model.system import System

_COMPLETE = "complete"
_ENVIRONMENT = {
    shelf.FAST: {
        "NUMBA_CPU_NAME": shelf.FAST,
        "NUMBA_CPU_FEATURES": ",".join(f"+{name}" for name in shelf.FEATURES),
    },
    shelf.PORTABLE: {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
}


def ship(levels: Sequence[str]) -> None:
    """Make the engine's machine code for processors of these levels.

    Parameters
    ----------
    levels : sequence of str
        Of :mod:`stickslip.machine_code.shelf`.

    Raises
    ------
    subprocess.CalledProcessError
        If it cannot be made.
    """
    for level in levels:
        place = shelf.SHIPPED / level
        if is_complete(place):
            continue
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        print(
            f"stickslip: compiling the engine for {level} processors, once: a minute or two",
            file=sys.stderr,
        )
        environment = {**os.environ, **_ENVIRONMENT[level]}
        commands = [
            [sys.executable, "-m", "stickslip.shipping", str(place), part] for part in _TOURS
        ]
        tours = [subprocess.Popen(command, env=environment) for command in commands]
        try:
            for tour, command in zip(tours, commands, strict=True):
                if tour.wait():
                    raise subprocess.CalledProcessError(tour.returncode, command)
        finally:
            for tour in tours:
                tour.kill()
        for lock in place.glob("*.lock"):
            lock.unlink()
        (place / _COMPLETE).write_text(_facts(), encoding="utf-8")


def _facts() -> str:
    """What machine code is good for."""
    rooms = [Path(__file__).parent / room for room in ("motion", "orbits", "orbits/fields")]
    tours = Path(__file__).read_text(encoding="utf-8")
    facts = [*map(stamp, rooms), digest(tours), str(shelf.target_of(shelf.level()))]
    return "\n".join([*facts, ""])


def is_complete(place: Path) -> bool:
    """Whether the machine code in a folder is all there, of the sources as they are now."""
    try:
        return (place / _COMPLETE).read_text(encoding="utf-8") == _facts()
    except OSError:
        return False


def _block_on_a_belt() -> System:
    """A motion with affine modes and a cycle."""
    from stickslip import Contact, Inertial, Parameter, System

    return System(
        "block on a belt",
        parameters={"V": Parameter(0.3)},
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"belt": Contact("d_x", threshold="1", surface_speed="V", kinetic="0.6")},
    )


def _blocks_pushed_alike() -> System:
    """A cycle on which events coincide that do not for neighbours."""
    from stickslip import Contact, Inertial, System

    return System(
        "blocks that are pushed alike",
        drives={"push": "2*cos(t/2)"},
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="d_x**2/2 + d_y**2/2",
        potential="x**2/2 + y**2/2 - push*(x + y)",
        contacts={"first": Contact("d_x", threshold="1"), "other": Contact("d_y", threshold="1")},
    )


def _lightly_damped() -> System:
    """A driven motion that takes long to settle."""
    from stickslip import Contact, Inertial, Parameter, System

    return System(
        "lightly damped",
        parameters={"omega": Parameter(1.3)},
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2 - cos(omega*t)*x",
        viscous="0.01*d_x**2",
        contacts={"ground": Contact("d_x", "0.05")},
    )


# Neither way asks early for what the other one is compiling: it would wait for it.


def _first_way() -> None:
    """Closed forms, motions that settle, their derivatives, and what is asked of a motion."""
    import stickslip as ss

    block = _block_on_a_belt()
    motion = ss.simulate(block, (0.0, 20.0))
    ss.simulate(block, (0.0, 1.0), initial={"d_x": 0.3})  # carried along by the belt to the end
    ss.find_cycle(block).extrema  # noqa: B018
    ss.find_cycle(_blocks_pushed_alike())
    motion.at(1.0)
    motion.audit  # noqa: B018
    motion.trace(list(motion.system.initial)[:1], np.array([0.5]), np.array([0]))


def _second_way() -> None:
    """Measures of settled motions, what these are carried on to, and Taylor steps."""
    import stickslip as ss

    block = _block_on_a_belt()
    ss.sweep(block, {"V": [0.3, 0.4]}, ["period", "lyapunov"])
    ss.find_cycle(_lightly_damped())
    ss.simulate(block, (0.0, 3.0), flow="taylor").audit  # noqa: B018


_TOURS: dict[str, Callable[[], None]] = {"one": _first_way, "other": _second_way}


def from_command_line(arguments: Sequence[str]) -> None:
    """Make what is missing for this machine, or for all with ``all``; or go one tour."""
    if len(arguments) == 2:
        with shelf.filled(Path(arguments[0])):
            _TOURS[arguments[1]]()
    else:
        ship([shelf.FAST, shelf.PORTABLE] if list(arguments) == ["all"] else [shelf.level()])


if __name__ == "__main__":
    from_command_line(sys.argv[1:])
