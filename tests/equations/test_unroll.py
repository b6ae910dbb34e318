"""Series written out order by order are the series of the loops."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stickslip.machine_code.kinds import MachineFunction

from stickslip import Internal, Parameter, System, catalogue
from stickslip.equations.codegen import unroll
from stickslip.equations.codegen.generate import generate
from stickslip.equations.codegen.printer import source_of
from stickslip.equations.codegen.unroll import written_out
from stickslip.equations.derive import derive
from stickslip.motion.engine.tables import run_setups
from stickslip.motion.problem import pose
from stickslip.motion.steps.arrays import Constants


def everything() -> System:
    """Every recurrence there is, in one law."""
    law = (
        "exp(-x) + log(2 + x) + sqrt(1 + x**2) + 1/(2 + x) + x/(3 + x)"
        " + sin(x)*cosh(x) + tanh(x) + atan(x) + x**p"
    )
    return System(
        name="everything",
        parameters={"p": Parameter(1.7)},
        internal={"x": Internal(law)},
        initial={"x": 0.4},
    )


def module(folder: Path, name: str, source: str) -> Any:
    path = folder / f"{name}.py"
    path.write_text(source)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


@pytest.mark.parametrize(
    "system", [everything(), catalogue.spring_slider(mu="2/sqrt(alpha)")], ids=lambda s: s.name
)
def test_written_out_series_are_those_of_the_loops(
    system: System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unroll, "ORDERS", (4, 8))
    source = source_of(generate(derive(system.declaration)))
    long = written_out(source)
    assert "for k in range(N)" not in long
    problem = pose(system)
    constants = problem.constants
    y = problem.initial_state({})
    tables = []
    for name, text in (("loops", source), ("long", long)):
        code = module(tmp_path, name, text)
        space = problem.space()
        table = np.array([list(problem.parameters.values())])
        setup = MachineFunction(code.setup.address, "setup")
        run_setups(setup, table, Constants(*(part[None] for part in constants)))
        space.Rz[:] = np.eye(len(space.Rz))
        mode = np.ones(len(problem.rows.u), np.int64)
        region = np.ones(len(problem.rows.kinks), np.int64)
        call = _caller()
        read = []
        for order in (1, 4, 8):
            space.W[:], space.mag[:] = 0.0, 0.0
            space.W[len(y), 1] = 1.0
            assert call(code.jets, 0.3, y, mode, region, constants.K, space, order) == 0
            read += [
                space.W[:, 0].copy(),
                space.W[list(code.KEPT), :order].copy(),
                space.W[: len(y), order].copy(),
            ]
            read += [space.mag.copy()]
        tables.append(read)
    for long_part, loop_part in zip(tables[1], tables[0], strict=True):
        np.testing.assert_allclose(long_part, loop_part, rtol=1e-11, atol=1e-13)


def _caller() -> Any:
    from numba import njit

    @njit
    def call(
        jets: Any, t: float, y: Any, mode: Any, region: Any, K: Any, space: Any, N: int
    ) -> int:
        return jets(
            t, y, mode, region, K, space.Rq, space.Rz, N, space.W, space.A, space.B, space.mag
        )

    return call


def test_what_has_no_products_of_series_keeps_its_loops() -> None:
    for system in (catalogue.forced_oscillator(), catalogue.rocking_toy()):
        source = source_of(generate(derive(system.declaration)))
        assert written_out(source) == source
