"""Stored damage: random damage to every kind of stored result.

What is right is known: the result is read as it was, in every bit, or the damage is answered by the
name of the file; points of a map whose files are missing count as not computed. Anything else is a
finding: other values, a certificate for them, an exception that is not the library's.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
import warnings
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import stickslip as ss

from ..registry import in_turn
from ..verdict import AGREED, NOT_CERTIFIED, REFUSED, WRONG, Verdict

STORE = "store of a map"
RESUMED = "resumed map"
OVER = {"P": "0.6:1.4:16", "delta": "log:0.02:0.1:6"}  # two chunks


def _sweep(out: Path | None = None) -> ss.Map:
    toy = ss.catalogue.rocking_toy()
    return ss.sweep(toy, OVER, ["speed", "stick_fraction"], out, workers=1)


def _evolution() -> ss.History:
    weights = ss.WeightedL1(["1 + cos(2*pi*s)/2", "1"])
    loads = ["3*sin(t)", "2*t"]
    matrix = [[2.0, -1.0], [-1.0, 2.0]]
    problem = ss.Evolution(matrix, loads, weights, [0.0, 0.0], epsilon=0.5, span=(0.0, 2.0))
    return ss.evolve(problem, steps=40)


def _fit() -> ss.Fit:
    system = ss.catalogue.forced_oscillator()
    t = np.linspace(0.0, 20.0, 80)
    x = ss.simulate(system, (0.0, 20.0), parameters={"F_c": 0.3}).at(t)["x"]
    noise = 0.01 * np.random.default_rng(0).standard_normal(80)
    return ss.fit(system, {"t": t, "x": x + noise}, {"F_c": (0.1, 0.9)}, starts=1)


def _study() -> ss.AveragingStudy:
    weights = ss.WeightedL1(["1 + cos(2*pi*s)/2"])
    problem = ss.Evolution([[1.0]], ["2*t"], weights, [0.0], 0.5, (0.0, 2.0))
    return ss.averaging_study(problem, [0.5, 0.25])


def _slider() -> ss.System:
    return ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)


MAKERS: dict[str, Callable[[], Any]] = {
    "trajectory": lambda: ss.simulate(ss.catalogue.belt_block(V=0.3), (0.0, 30.0)),
    "ensemble": lambda: ss.simulate_many(
        ss.catalogue.belt_block(), (0.0, 2.0), parameters={"V": [0.1, 0.2]}
    ),
    "event catalogue": lambda: ss.simulate(
        ss.catalogue.belt_block(), (0.0, 60.0)
    ).event_catalogue(),
    "evolution": _evolution,
    "play": lambda: ss.play("sin(t)", 0.5, (0.0, 10.0), initial=0.0),
    "averaging study": _study,
    "equilibria": lambda: ss.equilibria(_slider(), parameters={"V": 0.3}),
    "cycle": lambda: ss.find_cycle(ss.catalogue.belt_block(V=0.3)),
    "branch": lambda: ss.continue_equilibrium(_slider(), "V", (0.1, 0.3)),
    "gait study": lambda: ss.gait_study(
        ss.catalogue.rocking_toy(P=1.2), "P", [0.4, 1.2], initial={"psi": 0.8}
    ),
    "frequency response": lambda: ss.frequency_response(
        ss.catalogue.forced_oscillator(F_c=0.3), "omega", (1.2, 1.3), points=2
    ),
    "ring-down": lambda: ss.ring_down(
        ss.catalogue.jenkins_oscillator(force="0"), initial={"x": 3.0, "r_damper": 2.5}
    ),
    "backbone": lambda: ss.backbone(ss.catalogue.jenkins_oscillator(force=0), (0.4, 0.8), points=2),
    "file of a map": _sweep,
    "fit": _fit,
    "basin": lambda: ss.basin(ss.catalogue.rocking_toy(P=1.2), {"psi": "0:1:2", "d_psi": "0:1:2"}),
}
FAMILIES = (*MAKERS, STORE, RESUMED)


@dataclass(frozen=True)
class Case:
    """A stored result, and what happens to it."""

    family: str
    seed: int


def draw(family: str, seed: int) -> Case:
    """The case of a family with a seed."""
    return Case(family, seed)


def cases(seed: int, count: int) -> Iterator[Case]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


@cache
def folder() -> Path:
    """Of this process, for as long as it lives."""
    found = Path(tempfile.mkdtemp(prefix="stored"))
    atexit.register(shutil.rmtree, found, ignore_errors=True)
    return found


@cache
def original(family: str) -> tuple[Path, dict[str, Any]]:
    """A stored result, and what is read of it."""
    path = folder() / f"{family}.whole"
    if family in (STORE, RESUMED):
        _sweep(path)
    else:
        MAKERS[family]().save(path)
    return path, read(ss.open(path))


def read(result: Any) -> dict[str, Any]:
    """All that a stored result says."""
    return {
        "values": {str(k): np.asarray(v.values) for k, v in result.dataset.variables.items()},
        "attributes": {k: v for k, v in result.dataset.attrs.items()},
        "summary": result.summary().data,
        "certified": result.certificate.ok,
        "complete": result.outcome.ok,
    }


def damage(content: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    """Bytes of a file, damaged, and how."""
    raw, size = bytearray(content), len(content)
    how = str(rng.choice(["flip", "cut", "noise", "zeros", "flips"], p=[0.5, 0.15, 0.1, 0.1, 0.15]))
    if size == 0 or how == "cut":
        return how, bytes(raw[: rng.integers(size + 1)])
    if how in ("flip", "flips"):
        for _ in range(1 if how == "flip" else 8):
            bit = int(rng.integers(8 * size))
            raw[bit // 8] ^= 1 << (bit % 8)
        return how, bytes(raw)
    start = int(rng.integers(size))
    block = raw[start : start + int(rng.integers(1, 4096))]
    new = rng.bytes(len(block)) if how == "noise" else bytes(len(block))
    raw[start : start + len(block)] = new
    return how, bytes(raw)


def damaged(case: Case) -> tuple[Path, str]:
    """A damaged copy of what is stored, and how it was damaged."""
    rng = np.random.default_rng([zlib.crc32(case.family.encode()), case.seed])
    whole, _ = original(case.family)
    path = folder() / f"{case.family} {case.seed}"
    if whole.is_file():
        how, content = damage(whole.read_bytes(), rng)
        path.write_bytes(content)
        return path, how
    shutil.copytree(whole, path)
    files = sorted(file.relative_to(path) for file in path.rglob("*") if file.is_file())
    name = files[int(rng.integers(len(files)))]
    if rng.random() < 0.2:
        (path / name).unlink()
        return path, f"{name} removed"
    if rng.random() < 0.1:
        first, *rest = name.parts
        shutil.rmtree(path / first) if rest else (path / first).unlink()
        return path, f"{first} removed"
    chunks = [file for file in files if "c" in file.parts]
    if rng.random() < 0.15:
        source, target = (chunks[i] for i in rng.choice(len(chunks), 2, replace=False))
        shutil.copyfile(path / source, path / target)
        return path, f"{source} in the place of {target}"
    how, content = damage((path / name).read_bytes(), rng)
    (path / name).write_bytes(content)
    return path, f"{how} of {name}"


def differing(found: dict[str, Any], right: dict[str, Any]) -> list[str]:
    """What is not the same in every bit; of an unfinished map, at the points that it has."""
    values, expected = found["values"], right["values"]
    names = [] if [*values] == [*expected] else ["names of the variables"]
    outcome: Any = values.get("outcome")
    part = not found["complete"] and "speed" in values
    for name in expected.keys() & values.keys():
        old, new = expected[name], values[name]
        if part and new.shape == old.shape == outcome.shape:
            old, new = old[outcome >= 0], new[outcome >= 0]
        equal = new.shape == old.shape and new.dtype == old.dtype
        if not equal or (new.tolist() != old.tolist() and new.tobytes() != old.tobytes()):
            names.append(name)
    if str(found["attributes"]) != str(right["attributes"]):
        names.append("attributes")
    if not part and str(found["summary"]) != str(right["summary"]):
        names.append("summary")
    return names


def judge(case: Case) -> Verdict:
    """Read what was damaged."""
    _, right = original(case.family)
    path, how = damaged(case)
    numbers = {"how": how}
    try:
        with warnings.catch_warnings(action="ignore"):
            found = read(_sweep(path) if case.family == RESUMED else ss.open(path))
    except ss.StickslipError as error:
        named = str(path) in str(error)
        return Verdict(AGREED if named else REFUSED, "" if named else f"no name: {error}", numbers)
    except Exception as error:
        return Verdict(REFUSED, f"raises {type(error).__name__}", numbers)
    finally:
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    names = differing(found, right)
    if not names:
        return Verdict(AGREED, "", numbers)
    certified = found["certified"] and found["complete"]
    return Verdict(WRONG if certified else NOT_CERTIFIED, f"other {', '.join(names)}", numbers)


def reproduction(case: Case) -> str:
    """A script that repeats what the library did."""
    return (
        "from tests.adversarial import stored\n"
        f"path, how = stored.damaged(stored.draw({case.family!r}, {case.seed}))\n"
        "print(how)\nstored.ss.open(path)"
    )
