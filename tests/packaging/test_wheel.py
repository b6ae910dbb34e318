"""A wheel, built here and installed into an environment of its own outside the checkout, moves a
system with the machine code that came with it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

import stickslip as ss
from stickslip.machine_code import shelf
from stickslip.machine_code.shipping import is_complete

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHON = "Scripts/python.exe" if os.name == "nt" else "bin/python"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, with the machine code that is there: that of this machine."""
    place = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check"]
    options = ["--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", str(place)]
    environment = {**os.environ, "STICKSLIP_SHIPS": "none"}
    subprocess.run([*command, *options, str(ROOT)], env=environment, check=True, cwd=place)
    (found,) = place.glob("stickslip-*.whl")
    return found


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh environment with the wheel in it; what it needs is that of this environment."""
    home = tmp_path_factory.mktemp("fresh") / "environment"
    venv.create(home, symlinks=os.name != "nt")
    python = home / PYTHON
    command = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet"]
    options = ["--no-deps", "--no-index", "--disable-pip-version-check", str(wheel)]
    subprocess.run([*command, *options], check=True, cwd=home.parent)
    code = "import sysconfig; print(sysconfig.get_path('purelib'))"
    own = subprocess.run([python, "-c", code], capture_output=True, text=True, check=True)
    borrowed = Path(own.stdout.strip()) / "borrowed.pth"
    borrowed.write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return python


def environment(cache: Path) -> dict[str, str]:
    """Nothing of this process's paths, and a place for machine code that is empty."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return {**kept, "STICKSLIP_CACHE": str(cache)}


@pytest.mark.skipif(not is_complete(shelf.level()), reason="make machine-code")
def test_a_wheel_moves_a_system_where_nothing_is_compiled(python: Path, tmp_path: Path) -> None:
    script = python.with_name("stickslip.exe" if os.name == "nt" else "stickslip")
    said = subprocess.run(
        [script, "run", "rocking_toy", "--out", "toy"],
        cwd=tmp_path,
        env=environment(tmp_path / "cache"),
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=120,
    )
    assert said.returncode == 0, said.stderr
    assert "certified" in said.stdout
    found = {path.name for path in (tmp_path / "toy").iterdir()}
    assert found == {"trajectory.nc", "events.csv", "summary.json", "overview.png"}
    engine, kept = (
        {path.name.partition(".")[0] for path in place.rglob("*.o")}
        for place in (shelf.SHIPPED, tmp_path / "cache")
    )
    assert engine and not engine & kept, "the engine was compiled again"


def test_the_wheel_is_what_runs(python: Path, tmp_path: Path) -> None:
    code = "import stickslip, stickslip_paper; print(stickslip.__file__, stickslip.__version__)"
    command = [python, "-c", code]
    said = subprocess.run(
        command, cwd=tmp_path, env=environment(tmp_path), capture_output=True, text=True, check=True
    )
    assert Path(said.stdout.split()[0]).is_relative_to(python.parents[1])


def test_the_wheel_is_complete(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        (told,) = [name for name in names if name.endswith(".dist-info/METADATA")]
        metadata = Parser().parsestr(archive.read(told).decode())
    sources = {
        path.relative_to(ROOT / "src").as_posix()
        for path in (ROOT / "src").rglob("*")
        if path.is_file() and path.suffix in (".py", ".typed", ".txt", ".html", ".css")
    }
    assert sources <= names
    assert "stickslip/py.typed" in names
    assert not any(name.startswith(("tests/", "docs/")) for name in names)
    assert metadata["Requires-Python"] == PROJECT["requires-python"]
    assert set(metadata.get_all("Provides-Extra", [])) == set(PROJECT["optional-dependencies"])


def test_what_is_needed_by_all_is_little() -> None:
    core = {re.split(r"[<>=\[]", name)[0].lower() for name in PROJECT["dependencies"]}
    optional = PROJECT["optional-dependencies"]
    heavy = {"matplotlib", "zarr", "pyamg", "clarabel", "distributed", "sympy", "pillow"}
    assert not core & heavy
    everything = " ".join(optional["all"])
    missing = {"plots", "maps", "evolutions", "paper", "cluster"} - set(
        re.findall(r"\w+", everything)
    )
    assert not missing


def test_the_recipe_asks_for_the_same() -> None:
    recipe = (ROOT / "packaging" / "conda" / "meta.yaml").read_text(encoding="utf-8").lower()
    run = recipe.partition("\n  run:\n")[2].partition("\n  run_constrained:")[0]
    wanted = {name.lower().replace(">=", " >=") for name in PROJECT["dependencies"]}
    assert {line.strip("- ") for line in run.splitlines()} == wanted | {"python >=3.11"}
    assert f'version = "{ss.__version__}"' in recipe
