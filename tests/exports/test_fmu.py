"""Systems as functional mock-up units, run by fmpy: an importer that shares no code."""

from __future__ import annotations

import math
import platform
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from typer.testing import CliRunner

import stickslip as ss
from stickslip.cli.app import app

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import fmpy
    from fmpy import fmi2
    from fmpy.validation import validate_fmu

if platform.system() == "Darwin":
    pytest.skip("pythonfmu has no library for macOS", allow_module_level=True)


def block(force: Any = "1.2*cos(0.7*t)", span: Any = (0.0, 20.0), **others: Any) -> ss.System:
    """A mass on dry ground that a force pulls."""
    return ss.System(
        "pulled block",
        title='Block with a <force> & "friction"',
        parameters={"k": ss.Parameter(1.0, "N/m"), "mu": ss.Parameter(0.3, "N", "friction")},
        drives={"F": force},
        coordinates={"x": ss.Inertial("m", "position")},
        kinetic="d_x**2/2",
        potential="k*x**2/2 - F*x",
        contacts={"ground": ss.Contact("d_x", "mu", unit="N")},
        outputs={"pull": "F*d_x"},
        time_unit="s",
        span=span,
        **others,
    )


SYSTEMS = {
    "belt block": ss.catalogue.belt_block,
    "forced, with an output": block,
    "impacts": ss.catalogue.limit_stops,
    "impacts on a plate that moves": ss.catalogue.bouncing_ball,
    "structure": ss.catalogue.cantilever,
    "friction in a plane": ss.catalogue.puck,
    "sticks and turns in a plane": ss.catalogue.planar_jenkins,
    "without mass": ss.catalogue.spring_slider,
    "jumps of the state": ss.catalogue.rimless_wheel,
    "a law": lambda: ss.catalogue.belt_stribeck(),
}


def written(system: ss.System, folder: Path, **inputs: Any) -> str:
    path = folder / "model.fmu"
    ss.export(system, path, **inputs)
    assert validate_fmu(str(path)) == []
    return str(path)


def moved(path: str, **options: Any) -> Any:
    return fmpy.simulate_fmu(path, **options)


class Running:
    """An instance, its variables by name, and what it logged."""

    def __init__(self, path: str, folder: Path, name: str = "one") -> None:
        self.log: list[str] = []
        about = fmpy.read_model_description(path)
        assert about.coSimulation is not None
        self.references = {v.name: v.valueReference for v in about.modelVariables}
        place = fmpy.extract(path, str(folder / f"of {name}"))
        self.fmu = fmi2.FMU2Slave(
            guid=about.guid,
            unzipDirectory=place,
            modelIdentifier=about.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.callbacks = fmi2.fmi2CallbackFunctions()
        self.callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(
            lambda env, name, status, category, message: self.log.append(message.decode())
        )
        self.callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        self.callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.fmu.instantiate(callbacks=self.callbacks, loggingOn=True)

    def begin(self, time: float = 0.0, **values: float) -> None:
        self.fmu.setupExperiment(startTime=time)
        self.put(**values)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def put(self, **values: float) -> None:
        references = [self.references[name] for name in values]
        self.fmu.setReal(references, [*values.values()])

    def get(self, name: str) -> float:
        return self.fmu.getReal([self.references[name]])[0]

    def whole(self, name: str) -> int:
        return self.fmu.getInteger([self.references[name]])[0]

    def certified(self) -> bool:
        return bool(self.fmu.getBoolean([self.references["certificate.ok"]])[0])

    def step(self, time: float, size: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def is_refused(self, time: float, size: float, reason: str) -> None:
        """A step is not done, changes nothing, and the log says why."""
        before = self.get("x")
        self.log.clear()
        with pytest.raises(Exception, match="discard"):
            self.step(time, size)
        assert reason in " ".join(self.log), self.log
        after = self.get("x")
        assert after == before or math.isnan(after)


@contextmanager
def running(path: str, folder: Path, name: str = "one") -> Iterator[Running]:
    instance = Running(path, folder, name)
    try:
        yield instance
    finally:
        instance.fmu.freeInstance()


@pytest.mark.parametrize("name", SYSTEMS)
def test_an_fmu_moves_as_the_system_does(name: str, tmp_path: Path) -> None:
    system = SYSTEMS[name]()
    path = written(system, tmp_path, inputs=[])
    start = system.span[0]
    end = min(system.span[1], start + 12.0)
    found = moved(path, start_time=start, stop_time=end, output_interval=(end - start) / 97)
    motion = ss.simulate(system, (start, end))
    assert motion.certificate.ok
    assert len(found) == 98 and found["certificate.ok"].all()
    assert np.max(found["certificate.residual"]) < 1e-9
    times = np.minimum(found["time"], end)
    same = motion.at(times)
    shown = [column for column in found.dtype.names if column in same]
    assert set(system.plain.declaration.state) <= set(shown)
    events = motion.events["time"].to_numpy()
    smooth = np.array([np.min(np.abs(events - t), initial=1.0) > 1e-6 for t in times])
    for column in shown:
        size = max(1.0, float(np.max(np.abs(same[column]))))
        apart = np.abs(found[column] - same[column])[smooth] / size
        assert np.max(apart) <= 1e-12, column


def test_inputs_are_held_and_parameters_and_starts_are_set(tmp_path: Path) -> None:
    system = block()
    path = written(system, tmp_path)
    about = fmpy.read_model_description(path)
    assert [v.name for v in about.modelVariables if v.causality == "input"] == ["F"]
    times = np.arange(0.0, 8.0, 0.5)
    values = np.round(2.0 * np.sin(times), 3)
    signals = np.array([*zip(times, values, strict=True)], dtype=[("time", float), ("F", float)])
    with running(path, tmp_path) as fmu:
        fmu.begin(**{"mu": 0.5, "start.x": 1.5})
        for time, value in signals.tolist():
            fmu.put(F=value)
            fmu.step(time, 0.5)
            assert fmu.get("pull") == pytest.approx(value * fmu.get("d_x"), rel=1e-15)
        last = fmu.get("x")
    drive = ss.Samples([*times, 8.0], [*values, values[-1]], kind="hold")
    same = ss.simulate(block(drive, (0.0, 8.0)), parameters={"mu": 0.5}, initial={"x": 1.5})
    assert last == pytest.approx(same.final["x"], abs=1e-12)


def test_a_parameter_may_be_an_input_and_outputs_are_chosen(tmp_path: Path) -> None:
    path = tmp_path / "model.fmu"
    ss.export(block(), path, "x", "mode_ground", inputs=["mu"])
    about = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
    assert [n for n, v in about.items() if v.causality == "input"] == ["mu"]
    outputs = [n for n, v in about.items() if v.causality == "output"]
    assert outputs == ["x", "mode_ground", "certificate.ok", "certificate.residual"]
    assert about["x"].unit == "m" and about["k"].unit == "N/m" and about["start.d_x"].unit == "m/s"
    assert about["mode_ground"].description == "mode of ground: -1 slip-, 0 stick, 1 slip+"


def test_what_changes_nothing_is_no_parameter(tmp_path: Path) -> None:
    """The amplitude and the frequency of a force that is an input."""
    names = {}
    for inputs in (None, []):
        ss.export(ss.catalogue.forced_oscillator(), tmp_path / "model.fmu", inputs=inputs)
        about = fmpy.read_model_description(str(tmp_path / "model.fmu")).modelVariables
        names[inputs is None] = {v.name for v in about if v.causality == "parameter"}
    assert names[False] - names[True] == {"P", "omega"}


def test_a_state_is_saved_and_restored(tmp_path: Path) -> None:
    path = written(block(), tmp_path)
    with running(path, tmp_path) as fmu:
        fmu.begin()
        fmu.put(F=1.0)
        fmu.step(0.0, 1.3)
        state = fmu.fmu.getFMUstate()
        kept = fmu.fmu.serializeFMUstate(state)
        shown = fmu.get("friction_ground"), fmu.whole("mode_ground")

        def go_on(instance: Running) -> list[float]:
            instance.put(F=2.0)
            instance.step(1.3, 1.0)
            instance.put(F=-2.0)
            instance.step(2.3, 4.0)
            return [instance.get(name) for name in ("x", "d_x", "friction_ground")]

        first = go_on(fmu)
        fmu.fmu.setFMUstate(state)
        assert (fmu.get("friction_ground"), fmu.whole("mode_ground")) == shown
        assert go_on(fmu) == first
        fmu.fmu.freeFMUstate(state)
        with running(path, tmp_path, "another") as other:
            other.begin()
            other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(kept))
            assert (other.get("friction_ground"), other.whole("mode_ground")) == shown
            assert go_on(other) == first
            assert other.certified()


def test_what_an_fmu_does_not_do(tmp_path: Path) -> None:
    path = written(block(), tmp_path)
    with running(path, tmp_path) as fmu:
        fmu.begin()
        fmu.step(0.0, 1.0)
        fmu.is_refused(0.5, 0.2, "An FMU cannot step backwards")
        fmu.is_refused(1.0, -0.5, "An FMU cannot step backwards")
        fmu.is_refused(1.0, 0.0, "An FMU cannot step backwards")
        fmu.is_refused(1.0, math.nan, "step: from 1 by nan")
        fmu.is_refused(1.0, math.inf, "step: from 1 by inf")
        fmu.is_refused(1.5, 1.0, "begins at 1.5, but the FMU is at 1")
        for value in (math.nan, math.inf):
            fmu.put(F=value)
            fmu.is_refused(1.0, 1.0, "is not a finite number")
        fmu.put(F=1.0)
        fmu.step(1.0, 1.0)
        assert fmu.certified()
        fmu.put(mu=0.3)  # what it is
        fmu.step(2.0, 1.0)
        fmu.put(mu=0.4)
        fmu.is_refused(3.0, 1.0, "mu: it cannot be set after the initialisation")
        assert not fmu.certified()
        fmu.fmu.terminate()
    with running(path, tmp_path) as fmu:
        fmu.begin()
        fmu.step(0.0, 1.0)
        fmu.fmu.terminate()
        fmu.is_refused(1.0, 1.0, "the FMU was terminated")
        fmu.fmu.reset()
        fmu.begin()
        fmu.step(0.0, 1.0)


@pytest.mark.parametrize("value", [math.nan, -1.0])
def test_a_parameter_that_makes_no_sense(value: float, tmp_path: Path) -> None:
    system = block()
    checked = ss.Parameter(0.3, "N", "friction", "[0, inf)")
    path = written(replace(system, parameters={**system.parameters, "mu": checked}), tmp_path)
    with running(path, tmp_path) as fmu:
        fmu.begin(mu=value)
        assert "parameters.mu" in " ".join(fmu.log)
        assert math.isnan(fmu.get("x")) and math.isnan(fmu.get("friction_ground"))
        assert fmu.whole("mode_ground") == -9
        fmu.is_refused(0.0, 1.0, "parameters.mu")


def test_a_motion_that_ends_keeps_where_it_was(tmp_path: Path) -> None:
    system = ss.System(
        "blows up",
        coordinates={"x": ss.Viscous()},
        viscous="d_x**2/2",
        potential="-x**3/3",
        initial={"x": 1.0},
        span=(0.0, 0.5),
    )
    path = written(system, tmp_path)
    with running(path, tmp_path) as fmu:
        fmu.begin()
        fmu.step(0.0, 0.5)
        fmu.is_refused(0.5, 1.0, "the motion ends at t = 1")
        fmu.step(0.5, 0.25)
        assert fmu.get("x") == pytest.approx(4.0, rel=1e-12)


def test_samples_that_end(tmp_path: Path) -> None:
    record = ss.Samples([0.0, 1.0, 2.0], [0.0, 1.0, 0.0])
    path = written(block(record, (0.0, 2.0)), tmp_path, inputs=[])
    with running(path, tmp_path) as fmu:
        fmu.begin()
        fmu.step(0.0, 2.0)
        fmu.is_refused(2.0, 1.0, "drives.F: the samples cover 0 ... 2")


def test_before_the_first_step(tmp_path: Path) -> None:
    """Outputs are there, as the motion has them at its start."""
    system = block(initial={"x": 2.0, "d_x": -1.0})
    path = written(system, tmp_path, inputs=[])
    first = ss.simulate(system, (1.0, 2.0)).at(1.0)
    with running(path, tmp_path) as fmu:
        fmu.begin(1.0)
        for name in ("x", "d_x", "friction_ground", "slip_speed_ground", "pull", "energy"):
            assert fmu.get(name) == pytest.approx(first[name], rel=1e-12), name
        assert fmu.whole("mode_ground") == first["mode_ground"] == -1


def test_two_models_in_one_process(tmp_path: Path) -> None:
    """Each has its own, also where they have one name."""
    found = []
    for mu in (0.3, 0.9):
        folder = tmp_path / str(mu)
        folder.mkdir()
        path = written(block().configure({"mu": mu}), folder, inputs=[])
        found.append(moved(path, stop_time=5.0)["x"][-1])
    same = [ss.simulate(block(), (0, 5), parameters={"mu": mu}).final["x"] for mu in (0.3, 0.9)]
    assert found == pytest.approx(same, abs=1e-12) and found[0] != found[1]


def test_the_tolerance_makes_it_more_accurate_only(tmp_path: Path) -> None:
    pendulum = ss.System(
        "pendulum",
        coordinates={"phi": ss.Inertial()},
        kinetic="d_phi**2/2",
        potential="-cos(phi)",
        contacts={"pivot": ss.Contact("d_phi", 0.01)},
        initial={"phi": 2.0},
        span=(0.0, 10.0),
    )
    path = written(pendulum, tmp_path)
    usual, loose, tight = (
        moved(path, stop_time=10.0, relative_tolerance=tolerance, output_interval=10.0)["phi"][-1]
        for tolerance in (None, 1e-3, 1e-14)
    )
    assert usual == loose
    assert tight == pytest.approx(ss.simulate(pendulum, rtol=1e-13).final["phi"], abs=1e-12)


@pytest.mark.parametrize(
    ("write", "reason"),
    [
        (lambda p: ss.export(block(), p / "a.fmu", inputs=["G"]), "inputs: 'G' is not a parameter"),
        (lambda p: ss.export(block(), p / "a.fmu", "y"), "unknown output 'y'"),
        (lambda p: ss.export(block(), p / "none" / "a.fmu"), "cannot be written"),
        (lambda p: ss.export(block(), p / "a.csv"), "Simulate it first"),
        (lambda p: ss.export(block(), p / "a.xyz"), "Use .fmu, .py or .html"),
        (lambda p: ss.export(ss.simulate(block()), p / "a.fmu"), "Export the system"),
        (
            lambda p: ss.export(ss.catalogue.spring_slider(), p / "a.fmu", inputs=["ell"]),
            "the rate of 'ell' is used",
        ),
        (
            lambda p: ss.export(ss.catalogue.bouncing_ball(), p / "a.fmu", inputs=["plate"]),
            "the rate of 'plate' is used",
        ),
    ],
)
def test_refusals(write: Any, reason: str, tmp_path: Path) -> None:
    (tmp_path / "a.fmu").write_text("before")
    with pytest.raises(ss.StickslipError, match=reason):
        write(tmp_path)
    assert (tmp_path / "a.fmu").read_text() == "before"


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    def said(*words: str) -> tuple[int, str]:
        ran = CliRunner().invoke(app, ["export", *words], catch_exceptions=False)
        return ran.exit_code, ran.output

    Path("pulled-block.toml").write_text(block().to_toml())
    assert said("pulled-block.toml", "--fmi", "--set", "mu=0.4") == (0, "pulled-block.fmu\n")
    about = fmpy.read_model_description("pulled-block.fmu").modelVariables
    assert {v.name: v.start for v in about}["mu"] == "0.4"
    assert said("belt_block", "--out", "b.fmu", "--no-inputs", "--quantity", "x")[0] == 0
    about = fmpy.read_model_description("b.fmu").modelVariables
    assert not [v for v in about if v.causality == "input"]
    for words, reason in (
        (["belt_block"], "the file to write is not specified"),
        (["belt_block", "--fmi", "--python"], "Use one of them"),
        (["belt_block", "--fmi", "--out", "b.csv"], "Use b.fmu"),
        (["belt_block", "--fmi", "--input", "q"], "is not a parameter or a drive"),
        (["nothing.toml", "--fmi"], "nothing.toml"),
        (["b.nc", "--out", "b.csv", "--set", "k=1"], "a stored result cannot be changed"),
    ):
        code, text = said(*words)
        assert code == 2 and reason in " ".join(text.split()) and "Traceback" not in text


def test_units_are_products_of_those_of_the_si(tmp_path: Path) -> None:
    path = written(block(), tmp_path)
    place = Path(fmpy.extract(path, str(tmp_path / "out")))
    root = ElementTree.parse(place / "modelDescription.xml").getroot()
    units = {u.get("name"): u.find("BaseUnit") for u in root.iterfind("UnitDefinitions/Unit")}
    newton = units["N/m"]
    assert newton is not None and newton.attrib == {"kg": "1", "s": "-2"}
