"""Without what only extras bring, the core works, and whoever asks for more is told which extra has
it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from stickslip.errors import MissingPackageError, StickslipError, need

WITHOUT = """
import sys

class Absent:
    names = {"matplotlib", "zarr", "pyamg", "clarabel", "distributed", "sympy", "PIL", "pythonfmu"}

    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in self.names:
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Absent())
import importlib.util
found = importlib.util.find_spec
def find_spec(name, package=None):
    return None if name in Absent.names else found(name, package)
importlib.util.find_spec = find_spec
"""
# xarray loads dask if it is installed, and dask loads SciPy.
LEAN = """
Absent.names -= {"matplotlib", "PIL"}
Absent.names |= {"dask"}
"""
CORE = """
import stickslip as ss
block = ss.catalogue.belt_block()
motion = ss.simulate(block)
assert motion.certificate.ok
motion.save("block.nc")
assert ss.open("block.nc").certificate.ok
assert ss.find_cycle(block).stable
assert "stickslip[plots]" in motion._repr_html_()
assert ss.play("5*t - t**2", 1.0, (0, 5), initial=0.0).certificate.ok
problem = ss.Evolution([[1.0]], ["t"], ss.WeightedL1(["1"]), [0.0], span=(0, 2))
assert ss.evolve(problem, steps=10).certificate.ok
for ask, extra in (
    (lambda: motion.plot(), "plots"),
    (lambda: ss.figures, "plots"),
    (lambda: ss.sweep(block, {"V": [0.1, 0.2]}, ["period"]), "maps"),
    (lambda: ss.export(block, "block.fmu"), "fmi"),
):
    try:
        ask()
    except ss.StickslipError as error:
        assert f"stickslip[{extra}]" in str(error), error
    else:
        raise AssertionError(extra)
print("all is as it should be")
"""
COMMAND = """
from stickslip.cli import main
sys.argv = ["stickslip", *sys.argv[1:]]
main()
"""


def run(code: str, place: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A process in which these packages cannot be imported."""
    command = [sys.executable, "-c", WITHOUT + code, *arguments]
    return subprocess.run(command, cwd=place, capture_output=True, text=True, encoding="utf-8")


def test_the_core_is_enough_for_motions_and_cycles(tmp_path: Path) -> None:
    said = run(CORE, tmp_path)
    assert said.stdout == "all is as it should be\n", said.stderr


def loaded(code: str, place: Path) -> set[str]:
    """Packages that a process has loaded at its end, and those of ours, but none of Python."""
    told = "\nprint(*(name for name in sys.modules if name not in before))"
    ran = run(f"before = set(sys.modules)\n{code}{told}", place)
    assert ran.returncode == 0, ran.stderr
    names = ran.stdout.splitlines()[-1].split()
    ours = {".".join(name.split(".")[:2]) for name in names if name.startswith("stickslip.")}
    others = {name.partition(".")[0] for name in names} - sys.stdlib_module_names
    return ours | {name for name in others if not name.startswith(("_", "cython"))}


ENDED = """
from stickslip.cli.app import app
try:
    app({words!r})
except SystemExit as end:
    assert end.code == 0
"""


def test_an_import_loads_itself_alone(tmp_path: Path) -> None:
    assert loaded("import stickslip", tmp_path) == {"stickslip"}


def test_help_computes_nothing(tmp_path: Path) -> None:
    found = loaded(ENDED.format(words=["--help"]), tmp_path)
    assert {"stickslip", "stickslip.cli", "typer"} <= found
    computing = {"motion", "equations", "machine_code", "orbits", "sweeps", "figures", "explorer"}
    assert not found & {f"stickslip.{name}" for name in computing}
    assert not found & {"numpy", "llvmlite", "xarray", "pandas", "scipy", "pydantic"}


def test_a_motion_and_its_picture_load_nothing_of_later_packages(tmp_path: Path) -> None:
    """Nor SciPy, which takes longer to import than the motion takes to be computed."""
    import stickslip as ss

    ss.simulate(ss.catalogue.belt_block())  # who compiles the engine loads all of it
    words = ["run", "belt_block", "--out", "block"]
    found = loaded(LEAN + ENDED.format(words=words), tmp_path)
    assert (tmp_path / "block" / "overview.png").is_file()
    later = {"rate_independent", "orbits", "sweeps", "fitting", "explorer", "exports"}
    assert not found & {f"stickslip.{name}" for name in later}
    # Each is a part of the core or of matplotlib: what else is there is not looked for.
    assert {"numpy", "llvmlite", "xarray", "matplotlib"} <= found
    assert not found & {"scipy", "bokeh", "zarr", "clarabel", "pyamg", "pythonfmu"}


def test_a_command_says_which_extra_it_needs(tmp_path: Path) -> None:
    ran = run(COMMAND, tmp_path, "run", "belt_block")
    assert ran.returncode == 0, ran.stderr
    assert "stickslip[plots]" in " ".join(ran.stderr.split())
    swept = run(
        COMMAND, tmp_path, "sweep", "belt_block", "--over", "V=0.1,0.2", "--measure", "period"
    )
    assert swept.returncode == 2
    assert "stickslip[maps]" in swept.stderr and "Traceback" not in swept.stderr


def test_what_is_missing_is_named() -> None:
    need("numpy", "never")
    with pytest.raises(MissingPackageError, match=r'"stickslip\[maps\]"') as caught:
        need("a_package_that_nobody_has", "maps")
    assert isinstance(caught.value, StickslipError) and isinstance(caught.value, ImportError)
