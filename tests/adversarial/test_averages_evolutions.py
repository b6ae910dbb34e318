"""A few dozen random averages, evolutions and plays against their references. Long: ``python -m
tests.adversarial``."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from adversarial import dense_steps
from adversarial.families import curves
from adversarial.kinds import averages, evolutions
from adversarial.verdict import AGREED, NOT_CERTIFIED, WRONG

ROOT = Path(__file__).parents[2]
QUICK = {name: (0, 1, 2, 3) for name in averages.FAMILIES} | {
    "ellipse that breathes": (0, 1),
    "ellipse with a narrow waist": (0, 1),
    "polygon that turns": (2, 12),
    "half spaces that turn": (4,),
}
STEPPED = {
    "play with a pulse": (0, 1, 2, 3, 6, 10, 2003),
    "play with a threshold that oscillates": (0, 1, 5, 7),
    "one component with a pulse": (1, 2),
    "components with a pulse": (0, 1),
    "thresholds with dips": (0, 2),
    "groups with a pulse": (1,),
    "ellipse with a pulse": (0,),
    "parallelogram with a pulse": (0,),
    "averaged thresholds": (0, 1),
}


@pytest.mark.parametrize(("family", "seed"), [(f, s) for f, seeds in QUICK.items() for s in seeds])
def test_average(family: str, seed: int) -> None:
    verdict = averages.judge(case := averages.draw(family, seed))
    assert verdict.kind == AGREED, f"{verdict}\n{averages.reproduction(case)}"


@pytest.mark.parametrize(
    ("family", "seed"), [(f, s) for f, seeds in STEPPED.items() for s in seeds]
)
def test_evolution(family: str, seed: int) -> None:
    verdict = evolutions.judge(case := evolutions.draw(family, seed))
    assert verdict.kind == AGREED, f"{verdict}\n{evolutions.reproduction(case)}"


def test_a_function_is_certified_as_sampled() -> None:
    verdict = evolutions.judge(evolutions.draw("pulse of a function", 0))
    assert verdict.kind == NOT_CERTIFIED and verdict.note.startswith("as sampled")


@pytest.mark.parametrize("kind", curves.WELLS)
@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6, 1e-8])
def test_a_well_of_any_width_is_found(
    kind: str, width: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The reference that searches knows where to look; the library does not."""
    rng = np.random.default_rng(int(-np.log10(width)))
    curve = curves.with_a_well(rng, 0.25, kind)
    place, own = curve.narrow[0]
    narrow = replace(curve, text=curve.text.replace(repr(np.pi * own), repr(float(np.pi * width))))
    case = averages.Case(
        "", 0, "", lambda V: 0.25 * abs(float(V[0])), np.ones((1, 1)), 3e-14 / width, 1.0, None
    )
    verdict = averages.judge(replace(case, made=averages.ss.WeightedL1([narrow.text])))
    assert verdict.kind in (AGREED, NOT_CERTIFIED), verdict
    assert verdict.numbers["difference"] <= 1e-12 + 3e-14 / width, (place, verdict)


# -- the judges ------------------------------------------------------------------------------------


def test_a_wrong_average_is_called_wrong() -> None:
    case = averages.draw("turning ellipse", 0)
    right = case.reference
    assert averages.judge(replace(case, reference=lambda V: right(V) * (1.0 + 1e-6))).kind == WRONG


@pytest.mark.parametrize(
    ("family", "off"), [("play with a pulse", 1e-5), ("one component with a pulse", 0.3)]
)
def test_wrong_states_are_called_wrong(family: str, off: float) -> None:
    case = evolutions.draw(family, 1)

    def wrong(at: Any) -> Any:
        states, error = case.states(at)
        return states + off * case.size, error

    assert evolutions.judge(replace(case, states=wrong)).kind == WRONG


def test_a_dip_between_two_steps_is_in_the_error_of_z() -> None:
    """The force overshoots by 4e-4 in a dip of width 2e-6, within the tolerance, and z misses
    that."""
    verdict = evolutions.judge(evolutions.draw("thresholds with dips", 105))
    assert verdict.kind == AGREED, verdict


# -- dense steps -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kernels", [name for name in dense_steps.KERNELS if name])
def test_dense_steps_to_rounding_with_all_kernels(kernels: str) -> None:
    environment = os.environ | {"OPENBLAS_CORETYPE": kernels}
    program = (
        "from adversarial import dense_steps as d; "
        "print(max(d.step(k).residual for k in range(70)))"
    )
    path = os.pathsep.join(str(ROOT / part) for part in ("src", "tests"))
    environment |= {"PYTHONPATH": path}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, check=True, capture_output=True, text=True
    )
    assert float(done.stdout) <= 1e-11


def test_dense_steps_to_rounding() -> None:
    assert max(dense_steps.step(k).residual for k in range(70, 210)) <= 1e-11
