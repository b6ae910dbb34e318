"""Machine code on disk is good only for as long as everything that shapes it stays the same."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import stickslip
from stickslip.machine_code import stamps
from test_house import IMPORTS, MODULES

# What compiled modules import beside each other: nothing of it is compiled into them.
HARMLESS = {
    "stickslip.arrays",
    "stickslip.errors",
    "stickslip.machine_code.functions",
    "stickslip.motion.outcome",
}
COMPILED = sorted(
    name
    for name, found in IMPORTS.items()
    if "stickslip.machine_code.functions" in {i.name for i in found}
    and not name.startswith(("stickslip.machine_code.", "stickslip.sweeps"))
)
SCALE = "FACTOR = {}\n"
USER = """
from {place} import njit
from stickslip.rate_independent.solvers.scale import FACTOR

@njit(cache=True)
def scaled(x):
    return FACTOR * x

print(scaled(1))
"""


@pytest.mark.parametrize("name", COMPILED)
def test_all_that_shapes_a_module_is_looked_at(name: str) -> None:
    looked_at = {path.resolve() for path in stamps.sources(MODULES[name])}
    assert MODULES[name].resolve() in looked_at
    used = {i.name for i in IMPORTS[name] if i.at_once} - HARMLESS
    assert {MODULES[other].resolve() for other in used} <= looked_at, used


def compiled_functions(name: str) -> Iterator[ast.FunctionDef]:
    """The compiled functions of a module."""
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            decorators = {ast.unparse(d).partition("(")[0] for d in node.decorator_list}
            if decorators & {"njit", "entry_point"}:
                yield node


@pytest.mark.parametrize("name", COMPILED)
def test_state_is_passed_by_name(name: str) -> None:
    """No compiled function takes more than ten arguments, or is longer than 80 lines."""
    for node in compiled_functions(name):
        assert len(node.args.args) <= 10, node.name
        lines = (node.end_lineno or 0) - node.lineno + 1
        assert lines <= 80, node.name


@pytest.mark.parametrize("name", COMPILED)
def test_indices_count_from_the_beginning(name: str) -> None:
    """One of several that is negative would be an address outside the array."""
    for function in compiled_functions(name):
        for node in ast.walk(function):
            if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple):
                for index in node.slice.elts:
                    assert not isinstance(index, ast.UnaryOp), f"{function.name}, {node.lineno}"


def test_modes_with_closed_forms_have_numbers_of_64_bits() -> None:
    from stickslip.motion.engine.flights import mode_key
    from stickslip.motion.engine.forms import MOST_SWITCHES

    assert mode_key.py_func(np.full(MOST_SWITCHES, 1, object), np.zeros(0)) < 2**63


@pytest.mark.parametrize(
    ("place", "second"), [("stickslip.machine_code.functions", "3"), ("numba", "2")]
)
def test_what_changes_in_another_file_is_noticed(place: str, second: str, tmp_path: Path) -> None:
    """By our own `njit`; numba's runs on with the old machine code."""
    package = tmp_path / "stickslip"
    shutil.copytree(
        Path(stickslip.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__")
    )
    solvers = package / "rate_independent" / "solvers"
    (solvers / "user.py").write_text(USER.format(place=place))
    told = []
    for factor in (2, 3):
        (solvers / "scale.py").write_text(SCALE.format(factor))
        command = [sys.executable, "-B", "-c", "import stickslip.rate_independent.solvers.user"]
        done = subprocess.run(
            command, env={"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=True
        )
        told.append(done.stdout.strip())
    assert told == ["2", second]


PAIR = """
from typing import NamedTuple
from stickslip.machine_code.functions import njit

class {name}(NamedTuple):
    one: float
    other: float

@njit(cache=True)
def total(pair):
    return pair.one + pair.other

print(total({name}(1.0, {other})))
"""


def test_a_class_that_is_gone_is_no_reason_to_stop(tmp_path: Path) -> None:
    """Machine code on disk names the classes of its arguments; after an update, they may have
    another name."""
    package = tmp_path / "stickslip"
    shutil.copytree(
        Path(stickslip.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__")
    )
    told = []
    for name, other in (("Pair", 1), ("Couple", 2)):
        (package / "rate_independent" / "solvers" / "pair.py").write_text(
            PAIR.format(name=name, other=other)
        )
        command = [sys.executable, "-B", "-c", "import stickslip.rate_independent.solvers.pair"]
        done = subprocess.run(
            command, env={"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=True
        )
        told.append(done.stdout.strip())
    assert told == ["2.0", "3.0"]
