"""Systems as files of Python, integrated by SciPy."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import stickslip as ss
from stickslip.cli.app import app


def loaded(system: ss.System, folder: Path) -> ModuleType:
    """The file of a system, run as a module of its own."""
    path = folder / "model.py"
    ss.export(system, path)
    module = ModuleType("model")
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), vars(module))
    return module


def crowded() -> ss.System:
    """Names that mean something in Python, and a title that would end a docstring."""
    return ss.System(
        "crowded",
        title='"""\nraise SystemExit  # \\',
        parameters={
            "np": ss.Parameter(2.0, "", 'a "mass"\n"""'),
            "solve": 3.0,
            "t_": 0.3,
            "mode": 0.1,
        },
        drives={"y": "sin(2*t)"},
        coordinates={"p": ss.Inertial()},
        kinetic="np*d_p**2/2",
        potential="solve*p**2/2 - y*p",
        contacts={"is": ss.Contact("d_p", "t_", kinetic="t_ - mode")},
        span=(0.0, 10.0),
    )


def pieces() -> ss.System:
    """Every function with pieces, and functions of SciPy."""
    return ss.System(
        "pieces",
        coordinates={"x": ss.Inertial(), "z": ss.Viscous()},
        internal={"a": ss.Internal("erf(x) - a + square(2*t)/9")},
        kinetic="d_x**2/2",
        potential="x**2/2 + 5*max(x - 0.5, 0)**2 + (z - x)**2/2 - 0.3*x*triangle(t) - 0.2*a*x",
        viscous="d_z**2/2",
        contacts={
            "ground": ss.Contact("d_x", "0.1 + 0.05*smoothstep(x, 0, 1) + 0.01*sawtooth(t)"),
            "creep": ss.Contact("d_z", 0.15, kinetic="0.1 + 0.02*mod(t, 2)"),
        },
        initial={"x": 1.0, "z": -0.5},
        span=(0.0, 10.0),
    )


SYSTEMS: dict[str, Any] = {
    "belt_block": (ss.catalogue.belt_block, 20.0),
    "forced_oscillator": (ss.catalogue.forced_oscillator, 30.0),
    "block_chain": (ss.catalogue.block_chain, 20.0),
    "cart_pendulum": (ss.catalogue.cart_pendulum, 10.0),
    "spring_slider": (ss.catalogue.spring_slider, 8.0),
    "sliding_base": (ss.catalogue.sliding_base, 10.0),
    "rocking_toy_inertial": (ss.catalogue.rocking_toy_inertial, 10.0),
    "a belt whose speed jumps": (ss.catalogue.stick_slip_actuator, 0.0097),
    "names of Python": (crowded, 10.0),
    "pieces": (pieces, 6.0),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_another_integrator_finds_the_same_motion(name: str, tmp_path: Path) -> None:
    make, length = SYSTEMS[name]
    system = make()
    start, _ = system.span
    span = (start, start + length)
    module = loaded(system, tmp_path)
    assert [*module.STATE] == system.plain.declaration.state
    times, modes, last = module.example(span, max_step=length / 300)
    motion = ss.simulate(system, span)
    assert motion.certificate.ok
    final = motion.final
    size = max(1e-3, *map(abs, final.values()))
    for value, key in zip(last, module.STATE, strict=True):
        # SciPy has 1e-10 a step; where formulas jump, a step may have both sides in it.
        assert value == pytest.approx(final[key], abs=1e-8 * size), key
    # The same switches, at the same times.
    own = motion.events
    switches = own[own["contact"].isin([*module.CONTACTS])]
    assert len(times) == len(modes) > 1
    np.testing.assert_allclose(
        times[1:], np.unique(switches["time"]), atol=1e-6 * (span[1] - span[0])
    )


def test_rates_and_events_are_functions_of_what_is_given(tmp_path: Path) -> None:
    system = ss.catalogue.belt_block()
    module = loaded(system, tmp_path)
    p = {**module.parameters, "k": 4.0, "V": 0.1}
    y = np.array([0.2, -0.3])
    for sign, mode in ((-1, "slip-"), (1, "slip+")):
        field = ss.vector_field(system, {"belt contact": mode})
        rates = field.rates_at({"x": 0.2, "d_x": -0.3, "k": 4.0, "V": 0.1})
        np.testing.assert_allclose(module.rhs(0.0, y, (sign,), p), [*rates.values()], rtol=1e-15)
    assert module.events(0.0, y, (-1,), p)[0] == pytest.approx(0.4, rel=1e-15)
    np.testing.assert_allclose(module.events(0.0, y, (0,), p), [1.8, 0.2], rtol=1e-14)


def test_a_file_needs_numpy_alone_and_holds_no_text_that_runs(tmp_path: Path) -> None:
    ss.export(crowded(), tmp_path / "model.py")
    text = (tmp_path / "model.py").read_text(encoding="utf-8")
    imported = {
        node.module if isinstance(node, ast.ImportFrom) else node.names[0].name
        for node in ast.parse(text).body
        if isinstance(node, ast.Import | ast.ImportFrom)
    }
    assert imported == {"itertools", "typing", "numpy"}
    assert not any(isinstance(node, ast.Raise) for node in ast.parse(text).body)
    ran = subprocess.run(
        [sys.executable, "model.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ran.stdout.splitlines()[0].split()[0] == "0"


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ran = CliRunner().invoke(app, ["export", "belt_block", "--python", "--set", "V=0.2"])
    assert (ran.exit_code, ran.output) == (0, "belt_block.py\n")
    assert "'V': 0.2," in Path("belt_block.py").read_text(encoding="utf-8")


def pulled(by: str) -> dict[str, Any]:
    """A block on dry ground."""
    return {
        "coordinates": {"x": ss.Inertial("m")},
        "kinetic": "d_x**2/2",
        "potential": f"x**2/2 - {by}",
        "contacts": {"ground": ss.Contact("d_x", 0.5)},
    }


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (ss.catalogue.puck, "contacts.table: it is a contact in a plane"),
        (ss.catalogue.bouncing_ball, "contacts.plate: it has a gap"),
        (ss.catalogue.rimless_wheel, "jumps.leg_exchange: it is a jump of the state"),
        (ss.catalogue.rocking_toy, "coordinates.x_R: it is rate-independent"),
        (
            ss.catalogue.two_block_rate_and_state,
            "coordinates.x_1.drag: its rate is defined implicitly",
        ),
        (
            lambda: ss.System("s", **pulled("x"), internal={"n": ss.Sampled(0.1, "x")}),
            "internal.n: it is sampled",
        ),
        (
            lambda: ss.System(
                "s",
                **pulled("F*x"),
                drives={"F": ss.Samples([0.0, 1.0], [0.0, 1.0])},
            ),
            "drives.F: it is a table of samples",
        ),
        (
            lambda: ss.System(
                "s",
                **pulled("f(x)"),
                tables={"f": ss.Table([0.0, 1.0], [0.0, 1.0], outside="linear")},
            ),
            "tables.f: it is a table",
        ),
    ],
)
def test_what_has_no_such_file(make: Any, reason: str, tmp_path: Path) -> None:
    with pytest.raises(ss.DeclarationError, match=reason) as caught:
        ss.export(make(), tmp_path / "a.py")
    assert "Export an FMU" in str(caught.value)
    assert not [*tmp_path.iterdir()]


def test_options_of_others_are_refused(tmp_path: Path) -> None:
    block = ss.catalogue.belt_block()
    with pytest.raises(ss.DeclarationError, match="quantities: a Python file always has"):
        ss.export(block, tmp_path / "a.py", "x")
    with pytest.raises(ss.DeclarationError, match="inputs: a Python file always has"):
        ss.export(block, tmp_path / "a.py", inputs=["V"])
