"""The jobs of newcomers, each in a small size: a number that matters of each."""

from __future__ import annotations

import html
import importlib.util
import json
import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any
from urllib.request import urlopen

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.examples.installed import installed

import stickslip as ss

JOBS = Path(__file__).parents[2] / "examples" / "jobs"
STICKSLIP = f"{sys.executable} -c 'from stickslip.cli.app import app; app()'"


def job(number: int) -> ModuleType:
    (path,) = JOBS.glob(f"{number:02}-*.py")
    spec = importlib.util.spec_from_file_location(f"job_{number:02}", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def root(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a function is zero."""
    found: Any = brentq(function, low, high, xtol=1e-14)
    return float(found)


def test_01_blade() -> None:
    """Where the contacts stick all the time, the response is that of the linear blade."""
    blade = job(1)
    system = blade.blade(modes=1)
    found = ss.frequency_response(
        system, "omega", (100.0, 105.0), levels={"F": [1.0]}, of="u[tip]", points=2
    )
    M, K = blade.matrices(100)
    assert len(M) == 200
    for name in ("rub1", "rub2", "rub3"):
        row = {"rub1": 58, "rub2": 78, "rub3": 98}[name]
        K[row, row] += system.values["k"]
    force = np.zeros(200)
    force[198] = 1.0
    for omega, amplitude in zip(found["omega"].values, found["amplitude"].values, strict=True):
        expected = abs(np.linalg.solve(K - omega**2 * M, force)[198])
        assert amplitude == pytest.approx(expected, rel=3e-3)  # without damping


def test_03_drill_string() -> None:
    """It sticks where steady drilling is unstable, as the eigenvalues of the matrices say."""
    drill = job(3)
    for string in (drill.drill_string(1), drill.drill_string(3)):
        n = len(string.coordinates)
        found = drill.sticking(string, speeds=3, weights=2)
        k, c, tau = (string.values[name] * (n - 1) for name in ("k", "c", "tau"))
        c, tau = string.values["c"], string.values["tau"]
        link = k * (np.diag([1.0, *[2.0] * (n - 2), 1.0]) - np.eye(n, k=1) - np.eye(n, k=-1))
        M = np.diag([2122.0, *[374.0 / (n - 1)] * (n - 1)])
        K, C = link + np.diag([3000.0, *[0.0] * (n - 1)]), tau * link
        C[0, 0] += 4000.0
        stick = found["stick_fraction"]
        for i, Omega in enumerate(found["Omega"].values):
            for j, W in enumerate(found["W"].values):
                D = C.copy()
                D[-1, -1] += c - (0.048 - 0.032) * W / 2.0 * math.exp(-Omega / 2.0)
                A = np.block(
                    [
                        [np.zeros((n, n)), np.eye(n)],
                        [-np.linalg.solve(M, K), -np.linalg.solve(M, D)],
                    ]
                )
                if np.max(np.linalg.eigvals(A).real) > 0.0:
                    assert stick[i, j] > 0.0
        assert stick[-1, 0] == 0.0
    short = drill.drill_string(1)
    fit = drill.calibrated(short, drill.record(short), starts=2)
    for name, truth in drill.TRUTH.items():
        low, high = fit.interval[name]
        assert low - (high - low) < truth < high + (high - low)


def test_04_rate_and_state() -> None:
    faults = job(4)
    stepped = ss.simulate(faults.sample(faults.SPEEDS))
    slow, fast = stepped.at([199.0, 259.0])["mu"]
    law = faults.LAW
    assert fast - slow == pytest.approx((law["a"] - law["b"]) * math.log(10.0), rel=1e-3)
    assert faults.fitted(starts=2).estimate["a"] == pytest.approx(law["a"], rel=0.1)
    assert len(faults.chained(blocks=10, until=100.0)) > 3


def test_05_crawler() -> None:
    crawler = job(5)
    found = crawler.fastest(iterations=3)
    before = crawler.gait([crawler.crawler.values[name] for name in crawler.NAMES])
    assert -found.fun > before.speed
    assert found.x[0] ** 2 + 4 * found.x[1] ** 2 == pytest.approx(0.26, rel=1e-3)
    cheap = crawler.cheapest(before.speed, iterations=4)
    assert cheap.fun < before.cost_of_transport("2*m*g")


def test_06_lecture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The links of the handout lead to the page that is served; the cells show certified motions.

    What a phone draws behind each link is in tests/explorer.
    """
    pytest.importorskip("bokeh")
    lecture = job(6)
    monkeypatch.chdir(tmp_path)
    page = ss.explore(lecture.STEPS[0].state, port=0, browser=False)
    try:
        assert page.address.endswith(lecture.STEPS[0].state)
        lecture.prepared(page.address)
        handout = Path("lecture.html").read_text(encoding="utf-8")
        links = [html.unescape(link) for link in re.findall(r'href="(.*?)"', handout)]
        assert links == list(lecture.links(page.address).values())
        assert urlopen(links[0]).status == 200
    finally:
        page.close()
    cells = [c["source"] for c in json.loads(Path("lecture.ipynb").read_text())["cells"]]
    assert cells[0] == "import stickslip as ss" and cells[-1].startswith("ss.explore(")
    for cell, step in zip(cells[1:-1], [s for s in lecture.STEPS if not s.panel], strict=True):
        shown = eval(cell.partition("\n")[2], {"ss": ss})
        assert shown.certificate.ok and shown.n_switches == step.motion().n_switches


def test_07_own_friction_of_state() -> None:
    """The Hopf point is where U·|μ'| = 1 + ν."""
    slider = job(7)

    def trace(V: float) -> float:
        def steady(U: float) -> float:
            return U - (0.4 + 1.2 / (1.0 + V * U)) - 0.05 * V

        U = root(steady, 0.1, 3.0)
        return float(U * 1.2 / (1.0 + V * U) ** 2 - 1.05)

    assert slider.hopf().value == pytest.approx(root(trace, 0.02, 1.0), rel=1e-9)
    period, stick = slider.periods([0.001])[0.001]
    assert 0.98 < stick / period < 1.0
    study = slider.averaging(epsilons=(0.4, 0.2), tolerance=1e-2)
    assert study.certificate.ok


def test_08_controllers() -> None:
    """Under PD it stays where the spring of the controller is weaker than friction at rest."""
    loops = job(8)
    error, swing, rest = loops.hunting(ss.simulate(loops.carriage(k_i=0.0, until=10.0)))
    assert 0.0 < error < 1.5 / 40.0 and swing == 0.0 and rest == 1.0
    _, swing, _ = loops.hunting(ss.simulate(loops.carriage()))
    assert 1e3 * swing == pytest.approx(15.81, abs=0.01)


def test_09_records() -> None:
    """Twice the scale and friction are twice the slip: Newmark's block has no length."""
    newmark = job(9)
    slips = newmark.slips(records=3, scales=6)["slip"]
    twice = slips.sel(mu=0.2, scale=4.0).values / slips.sel(mu=0.1, scale=2.0).values
    np.testing.assert_allclose(twice, 2.0, rtol=1e-9)
    moved = newmark.floor()
    assert moved.certificate.ok
    # In the end friction holds it against the slope of the bearings and the last acceleration.
    assert moved.final["d_x"] == moved.final["d_y"] == 0.0
    last = math.hypot(*(newmark.record(seed).values[-1] for seed in (1, 2)))
    p = moved.system.values
    offset = math.hypot(moved.final["x"], moved.final["y"])
    assert 0.0 < offset <= p["mu"] * p["R"] + last * p["R"] / p["g"]


def test_10_bowed_string() -> None:
    """It sounds beyond the least force of the bow."""
    bow = job(10)
    assert bow.pitches([0.2])[0.2] == pytest.approx(161.74, abs=0.01)
    found = bow.schelleng(forces=4, speeds=3)
    for V, sounds in zip(found["V"].values, found["stick_fraction"].values.T, strict=True):
        least = bow.string.evaluate("F_min", {"V": float(V)})
        clear = found["F"].values > 1.5 * least
        assert np.all(sounds[clear] > 0.0)


def test_11_prandtl_tomlinson() -> None:
    """A fast tip feels its damping alone; the map and the cycle say the same."""
    lattice = job(11)
    found = lattice.over_the_plane(speeds=3, slopes=(0, 1 / 3, 1))
    assert found.certificate.ok
    np.testing.assert_allclose(found["mean:pull"].values[-1], 2.0, rtol=2e-3)
    parameters = {"V": 0.01, "q": 1 / 3}
    cycle = ss.find_cycle(lattice.plane, parameters=parameters)
    assert found["mean:pull"].values[0, 1] == pytest.approx(cycle.mean("pull"), rel=1e-9)


def test_12_self_locking() -> None:
    locks = job(12)
    expected = locks.closed_forms()
    for system in (locks.wedge(), locks.screw_jack(), locks.lever_shoe()):
        found = locks.limit(system, "mu", 0.01, 1.0)
        assert found == pytest.approx(expected[system.name], rel=1e-8)
    found = locks.limit(locks.capstan(), "F", 1.5, 2.5, 1e-5)
    assert found == pytest.approx(expected["capstan"], rel=2e-5)


@pytest.mark.skipif(shutil.which("timeout") is None, reason="no timeout here")
def test_13_command_line(tmp_path: Path) -> None:
    program = tmp_path / "bin" / "stickslip"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {STICKSLIP} "$@"\n')
    program.chmod(0o755)
    environment = os.environ | {
        "PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}",
        "POINTS": "20",
        "SECONDS_BEFORE": "20",
    }
    subprocess.run(
        ["sh", str(JOBS / "13-command-line.sh")],
        cwd=tmp_path,
        env=environment,
        check=True,
        capture_output=True,
    )
    assert len((tmp_path / "crate-map.csv").read_text().splitlines()) == 401
    assert (tmp_path / "out" / "crate-branch" / "branch.csv").exists()


def test_14_reopen(tmp_path: Path) -> None:
    said = subprocess.run(
        [sys.executable, str(next(JOBS.glob("14-*.py")))],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    assert said.count("True") == 3 and ss.__version__ in said


def test_15_local_cluster() -> None:
    pytest.importorskip("distributed")
    cluster = job(15)
    found, _ = cluster.on_a_cluster(points=12, kill_after=0.2)
    np.testing.assert_array_equal(found["speed"], cluster.in_threads(12)["speed"])


def test_16_package(tmp_path: Path) -> None:
    """Its law, measure, picture and command are known by their names."""
    place = installed(JOBS / "16-package", tmp_path)
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(place), *filter(None, [os.environ.get("PYTHONPATH")])])
    }
    asked = (
        "import stickslip as ss; from skidding import block; b = block();"
        "assert 'wet' in ss.laws.all_names();"
        "found = ss.sweep(b, {'V': [0.05, 0.1]}, ['longest_stick', 'period']);"
        "longest, period = found['longest_stick'], found['period'];"
        "assert (longest > 0).all() and (longest < period).all();"
        "from stickslip.cli.app import app; app(['skid'])"
    )
    said = subprocess.run(
        [sys.executable, "-c", asked],
        cwd=tmp_path,
        env=environment,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    assert "certified: True" in said and (tmp_path / "skid.png").exists()
