"""Systems as functional mock-up units (FMU): files that other simulators run, FMI 2 for
co-simulation."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from stickslip import storage
from stickslip.errors import need
from stickslip.exports.fmu_model import MODEL_FILE, fmu_model
from stickslip.model.system import System

_SCRIPT = '''"""Loads the model beside this file, by the Python that runs it."""

import ctypes

# With each instance the library of pythonfmu (0.7) gives back a reference to the names of this
# module that it does not own. This one is for that, and is never given back.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))

try:
    from stickslip.exports.fmu_slave import SystemFmu
except ImportError as error:
    message = f"this FMU needs the Python package stickslip {version} ({{error}})"
    raise ImportError(message) from error


class Model(SystemFmu):
    pass
'''


def write_fmu(
    system: System, path: str | Path, inputs: Sequence[str] | None, outputs: Sequence[str]
) -> None:
    """Write a system as an FMU.

    Parameters
    ----------
    inputs : sequence of str, optional
        Parameters and drives; by default all drives that can be held.
    outputs : sequence of str
        All if there are none.

    Raises
    ------
    DeclarationError
        If an input cannot be one, or an output is unknown.
    StickslipError
        If the file cannot be written, or pythonfmu is not installed.
    """
    need("pythonfmu", "fmi")
    from pythonfmu.builder import FmuBuilder

    model = fmu_model(system, inputs, outputs)
    places, modules = list(sys.path), set(sys.modules)
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / f"{model.module}.py"
        script.write_text(_SCRIPT.format(version=model.version), encoding="utf-8")
        resource = Path(folder) / MODEL_FILE
        resource.write_text(model.to_json(), encoding="utf-8")
        requirements = Path(folder) / "requirements.txt"  # for: pythonfmu deploy
        requirements.write_text(f"stickslip=={model.version}\n", encoding="utf-8")
        made = Path(folder) / "model.fmu"
        try:
            FmuBuilder.build_FMU(
                script,
                dest=made,
                project_files=[resource, requirements],
                canGetAndSetFMUstate=True,
                canSerializeFMUstate=True,
            )
        finally:  # it imports the script from there
            sys.path[:] = places
            if model.module not in modules:
                sys.modules.pop(model.module, None)
        with storage.replacing(path) as partial:
            shutil.copyfile(made, partial)
