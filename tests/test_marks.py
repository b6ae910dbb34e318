"""Tests of the paper, the explorer, the adversary and attacks have marks, by folder."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

TESTS = Path(__file__).parent
ROOT = TESTS.parent


@pytest.fixture(scope="module")
def conftest() -> ModuleType:
    spec = importlib.util.spec_from_file_location("marks_of_folders", TESTS / "conftest.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_marks_are_declared(conftest: ModuleType) -> None:
    options = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pytest"]
    declared = {text.partition(":")[0] for text in options["ini_options"]["markers"]}
    assert declared == set(conftest.MARKS.values())


def test_every_test_of_a_folder_has_its_mark_and_no_other_has(conftest: ModuleType) -> None:
    for path in TESTS.rglob("test_*.py"):
        folder = path.relative_to(TESTS).parts[0]
        assert conftest.mark_of(path) == conftest.MARKS.get(folder, "")
    assert all([*(TESTS / folder).glob("test_*.py")] for folder in conftest.MARKS)
    assert conftest.mark_of(Path("/somewhere/explorer/test_it.py")) == ""


def test_they_select(conftest: ModuleType) -> None:
    """What has none of the marks is what is outside their folders."""
    files = [min((TESTS / folder).glob("test_*.py")) for folder in conftest.MARKS]
    marks = " or ".join(conftest.MARKS.values())
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-n", "0"]
    options = ["-p", "no:cacheprovider", "-m", f"not ({marks})"]
    places = [str(path) for path in (*files, Path(__file__))]
    # Options of the run that this test belongs to would change what is printed.
    environment = {name: x for name, x in os.environ.items() if name != "PYTEST_ADDOPTS"}
    ran = subprocess.run(
        [*command, *options, *places],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        encoding="utf-8",
    )
    collected = {line.partition("::")[0] for line in ran.stdout.splitlines() if "::" in line}
    assert collected == {"tests/test_marks.py"}, ran.stdout + ran.stderr


def test_the_map_of_the_tests_names_every_folder() -> None:
    text = (TESTS / "README.md").read_text(encoding="utf-8")
    folders = {
        path.parent.relative_to(TESTS).parts[0]
        for path in TESTS.rglob("test_*.py")
        if path.parent != TESTS
    }
    assert {
        folder for folder in folders if f"`{folder}`" not in text and f"`{folder}/`" not in text
    } == set()
