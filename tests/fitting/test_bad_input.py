"""What is wrong is named, with what would be right."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss

T = np.linspace(0.0, 10.0, 40)
X = np.sin(T)
SYSTEM = ss.catalogue.forced_oscillator()
FREE = {"F_c": (0.1, 0.9)}


def refused(message: str, data: Any = None, free: Any = None, **options: Any) -> None:
    with pytest.raises(ss.DeclarationError, match=message):
        table = {"t": T, "x": X} if data is None else data
        ss.fit(SYSTEM, table, FREE if free is None else free, **options)


def test_columns() -> None:
    refused("unknown column 'position'.*Known here: t, x", observe={"position": "x"})
    refused("unknown quantity", observe={"x": "position"})
    refused("no column is named 'time' or 't'", {"clock": T, "x": X}, observe={"x": "x"})
    refused("no column has the name of a quantity", {"t": T, "q": X})
    refused("row 3, column 'x'.*'high' is not a number", _table("t,x\n0,1\n1,2\n2,high\n"))
    refused("row 2, column 'x': the value is infinite", _table("t,x\n0,1\n1,inf\n2,3\n"))
    refused("have different lengths", {"t": T, "x": X[:-1]})
    refused("no such file", "nothing.csv")
    refused("is not a table", 7)
    refused("no record was given", [])


def _table(text: str) -> Any:
    import io

    import pandas as pd

    return pd.read_csv(io.StringIO(text))


def test_data_that_say_nothing() -> None:
    refused("all 40 values are 2", {"t": T, "x": np.full(40, 2.0)})
    refused("no row has both a time and a value", {"t": T, "x": np.full(40, np.nan)})
    refused("all rows are at t = 0", {"t": [0.0, 1.0], "x": [1.0, np.nan]})
    one = ss.Recording({"t": [1.0], "x": [1.0]}, begin=0.0)
    refused("2 unknowns and 1 data", one, {"F_c": None, "k": None}, noise={"x": 0.1})


def test_an_idle_unknown_is_named() -> None:
    system = ss.System(
        name="idle",
        parameters={"k": ss.Parameter(1.0, range="(0, inf)"), "unused": ss.Parameter(1.0)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="k*x**2/2",
        contacts={"ground": ss.Contact("d_x", 0.05)},
        initial={"x": 1.0},
    )
    with pytest.raises(ss.DeclarationError, match=r"free\.unused: the data do not depend"):
        ss.fit(system, {"t": T, "x": np.cos(T)}, {"k": (0.5, 2.0), "unused": (0.0, 2.0)})


def test_unknowns_that_only_act_together_are_named() -> None:
    system = ss.System(
        name="together",
        parameters={"a": ss.Parameter(1.0, range="(0, inf)"), "b": ss.Parameter(1.0)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="a*b*x**2/2",
        contacts={"ground": ss.Contact("d_x", 0.05)},
        initial={"x": 1.0},
    )
    x = np.asarray(ss.simulate(system, (0.0, 10.0), parameters={"a": 1.2}).at(T)["x"])
    noisy = x + 0.01 * np.random.default_rng(0).standard_normal(len(T))
    found = ss.fit(system, {"t": T, "x": noisy}, {"a": (0.5, 2.0), "b": (0.5, 2.0)})
    assert found.statistics.undetermined == ("a", "b")
    assert not found.certificate.ok
    assert np.all(np.isinf(found.statistics.error))
    assert np.all(np.isfinite(found.covariance))
    assert "a is not determined" in found.message
    assert found.profile("a").attrs["flat"]


def test_names_and_bounds() -> None:
    refused("there are no unknowns to fit", free={})
    refused("free.mu: unknown parameter or part of the state", free={"mu": None})
    refused("is not a pair of bounds", free={"F_c": (0.9, 0.1)})
    refused("is not a pair of bounds", free={"F_c": 0.5})
    refused("exceed the declared range", free={"k": (-1.0, 2.0)})
    refused("start 2 is outside the bounds 0.1 to 0.9", parameters={"F_c": 2.0})
    refused("x: its value is given by", free={"x": (-1.0, 1.0)}, initial={"x": 0.3})
    refused("its value is given by .* k. Remove", free={"x": (-1.0, 1.0)}, initial={"x": "k"})
    refused("its value is given by", ss.Recording({"t": T, "x": X}, parameters={"F_c": 0.3}))
    refused("unknown loss 'l2'", loss="l2")
    refused("noise.y: unknown column", noise={"y": 0.1})
    refused("standard deviation is not positive", noise={"x": -1.0})
    refused("is not a positive integer", starts=0)
    refused("drives.q: unknown drive", drives={"q": "x"})
    refused("depends on x.*Use parameters only", initial={"d_x": "x"})
    refused(
        "begins at 1, which is later than the first row", ss.Recording({"t": T, "x": X}, begin=1.0)
    )


def test_events() -> None:
    record = ss.Recording({"onset": T}, events="ground glides")
    refused("'ground glides' is not an event", record, observe={"onset": "t"})
    with pytest.raises(ss.ConvergenceError, match=r"has 1 events .* the recording"):
        record = ss.Recording({"onset": T}, events=f"{next(iter(SYSTEM.contacts))} slips")
        ss.fit(SYSTEM, record, FREE, observe={"onset": "t"}, starts=1)
    record = ss.Recording({"force": X}, events="contact slips")
    refused("the duration of the motion is unknown", record, observe={"force": "x"})
    record = ss.Recording({"onset": T}, events="shoe slips")
    refused("unknown contact", record, observe={"onset": "t"})


def test_times_outside_the_drive() -> None:
    system = ss.catalogue.sliding_base()
    drive = next(iter(system.drives))
    from dataclasses import replace

    driven = replace(system, span=(0.0, 5.0), drives={drive: ss.Samples([0.0, 5.0], [0.0, 1.0])})
    name = next(iter(system.coordinates))
    free = dict.fromkeys([next(iter(system.parameters))])
    with pytest.raises(ss.DeclarationError, match="5"):
        ss.fit(driven, {"t": T, name: X}, free)


def test_shape_of_p() -> None:
    problem = ss.fit_problem(SYSTEM, {"t": T, "x": X}, FREE)
    with pytest.raises(ss.DeclarationError, match="Give 1 values: F_c"):
        problem.residuals([0.1, 0.2])
    with pytest.raises(ss.DeclarationError, match="p: F_c: not a number"):
        problem.residuals([np.nan])


def test_a_file_with_gaps_and_blanks(tmp_path: Path) -> None:
    path = tmp_path / "record.txt"
    rows = [
        f"{t:.6f};{x:.6f};{'' if i % 7 else 'nan'}"
        for i, (t, x) in enumerate(zip(T, X, strict=True))
    ]
    path.write_text("# a comment\ntime; x ;d_x\n" + "\n".join(rows) + "\n", encoding="utf-8")
    problem = ss.fit_problem(SYSTEM, path, FREE, {"x": "x"})
    assert len(problem.data) == 40
    with pytest.raises(ss.DeclarationError, match="no row has both a time and a value"):
        ss.fit_problem(SYSTEM, path, FREE, {"d_x": "d_x"})


def test_friction_of_a_rate_without_mass_has_no_derivatives() -> None:
    """It is said before a search begins; with a little mass the same record is fitted."""
    law = ss.laws.rate_and_state("d_x", a="a", b=0.014, D_c=10.0, N=1.0, mu_0=0.6, v_0=1.0)
    light = ss.System(
        "light",
        parameters={"a": ss.Parameter(0.01)},
        coordinates={"x": ss.Viscous()},
        potential="0.005*(60 + 10*t - x)**2",
        contacts={"gouge": law},
        outputs={"mu": "0.01*(60 + 10*t - x)"},
        initial={"theta_gouge": 10.0},
        span=(0.0, 20.0),
    )
    t = np.linspace(0.0, 20.0, 60)
    record = {"t": t, "mu": ss.simulate(light).at(t)["mu"]}
    for function in (ss.fit, ss.fit_problem):
        with pytest.raises(ss.DeclarationError, match="a fit needs derivatives of motions") as e:
            function(light, record, {"a": (0.005, 0.02)}, {"mu": "mu"})
        assert "velocity_step" in str(e.value) and "Declare x inertial" in str(e.value)
    heavy = replace(
        light,
        coordinates={"x": ss.Inertial()},
        kinetic="1e-4*d_x**2/2",
        initial={"theta_gouge": 10.0, "d_x": 1.0},
    )
    fit = ss.fit(heavy, record, {"a": (0.005, 0.02)}, {"mu": "mu"}, starts=2)
    assert fit.estimate["a"] == pytest.approx(0.01, rel=0.01)
