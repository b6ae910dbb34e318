"""The three motions of the benchmark against end states and switches from sixty-digit arithmetic.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), (3.3), (3.6) and (4.2), solved by ``benchmarks/reference_values.py``, which
knows nothing of the package. The end states after 20 cycles are from its function ``follow`` with
longer spans.
"""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from stickslip import System, Trajectory, catalogue, simulate
from systems import distance

pytestmark = pytest.mark.usefixtures("flow")


def load(path: Path) -> ModuleType:
    """A module outside of the package."""
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[path.stem] = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


PROBLEMS = load(Path(__file__).parents[2] / "benchmarks" / "reference_values.py").PROBLEMS
LATER = {
    "A": (100.0, 40, (0.66441237988450029341, 1.6711146395156348504)),
    "B": (52.0, 41, (-700.25783601470152563, 0.9698035422295977941)),
    "C": (120.0, 80, (-1.3248598760236048525, 0.97767194659859867863, 20.5, 20.0)),
}


def system(name: str) -> System:
    if name == "A":
        p = PROBLEMS["A"].parameters
        return catalogue.spring_slider(
            mu=f"{p['mu_inf']} + {p['mu_1']}*exp(-(alpha - 1)/{p['alpha_mu']})"
        )
    return catalogue.scaled_slider_limit() if name == "B" else catalogue.rocking_toy()


def follow(name: str, until: float, rtol: float = 1e-10) -> Trajectory:
    problem = PROBLEMS[name]
    moving = system(name)
    initial = dict(zip(problem.variables, problem.initial, strict=True))
    values = {key: value for key, value in problem.parameters.items() if key in moving.parameters}
    motion = simulate(moving, (0.0, until), initial=initial, parameters=values, rtol=rtol)
    assert motion.outcome.ok
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


def state(motion: Trajectory, name: str) -> list[float]:
    return [motion.final[variable] for variable in PROBLEMS[name].variables]


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize(("rtol", "within"), [(1e-10, 1e-11), (1e-12, 1e-11), (1e-6, 1e-5)])
def test_end_state(name: str, rtol: float, within: float) -> None:
    motion = follow(name, PROBLEMS[name].span, rtol)
    assert PROBLEMS[name].error(state(motion, name)) < within


@pytest.mark.parametrize("name", PROBLEMS)
def test_switches(name: str) -> None:
    motion = follow(name, PROBLEMS[name].span)
    expected = np.array([float(time) for time in PROBLEMS[name].switches])
    # In (3.6) sliding is a region of a formula; in (4.2) the ramps of H add kinks that are no
    # switches.
    kinds = list(motion.system.contacts) or motion.events["contact"].unique().tolist()
    events = motion.events[motion.events["contact"].isin(kinds)]
    assert len(events) == len(expected) == {"A": 18, "B": 21, "C": 42}[name]
    assert distance(events["time"], expected) < 1e-11


@pytest.mark.parametrize("name", PROBLEMS)
def test_twenty_cycles(name: str) -> None:
    until, count, exact = LATER[name]
    motion = follow(name, until)
    assert (motion.n_kinks if name == "B" else motion.n_switches) == count
    error = np.abs(np.subtract(state(motion, name), exact)) / np.maximum(1.0, np.abs(exact))
    assert error.max() < 1e-9
