"""Source text -> machine code, kept on disk: a second run starts at once."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

from platformdirs import user_cache_path

from stickslip.equations.codegen.generate import Layout, generate
from stickslip.equations.codegen.unroll import written_out
from stickslip.equations.derive import MotionEquations, derive
from stickslip.machine_code import stamp
from stickslip.model.declaration import Declaration
from stickslip.model.system import System


@dataclass(frozen=True)
class CompiledSystem:
    """A system's machine code with the layout of its rows."""

    equations: MotionEquations
    layout: Layout
    setup: Callable[..., Any]
    jets: Callable[..., Any]
    residual: Callable[..., Any]
    powers: Callable[..., Any]


_compiled: WeakKeyDictionary[Declaration, CompiledSystem] = WeakKeyDictionary()
_modules: dict[str, Any] = {}


def cache_folder() -> Path:
    """Folder of generated code: ``$STICKSLIP_CACHE``, else the user's cache folder, else a
    temporary one."""
    given = os.environ.get("STICKSLIP_CACHE")
    folder = Path(given) / "stickslip" if given else user_cache_path("stickslip")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="stickslip-"))


_announced = False


@contextmanager
def announced() -> Iterator[None]:
    """Say once what takes its time: the first use of the engine on a machine, or after it has
    changed."""
    global _announced
    if _announced:
        yield
        return
    mark = cache_folder() / f"engine_{_key(str(Path(__file__).parent))}.ready"
    if not mark.exists() and sys.stderr.isatty():
        print(
            "stickslip: compiling the engine once for this machine, less than a minute ...",
            file=sys.stderr,
        )
    yield
    _announced = True
    with suppress(OSError):
        mark.touch()


def compile_system(system: System) -> CompiledSystem:
    """Machine code of a system, from this process, from disk, or new."""
    if system.declaration not in _compiled:
        _compiled[system.declaration] = _compile(system.declaration)
    return _compiled[system.declaration]


def _compile(declaration: Declaration) -> CompiledSystem:
    """Systems that say the same, as parameters with other defaults do, have the same machine
    code."""
    equations = derive(declaration)
    generated = generate(equations)
    key = _key(generated.source)
    if key not in _modules:
        _modules[key] = _load(f"model_{key}", generated.source)
    code = _modules[key]
    return CompiledSystem(
        equations, generated.layout, code.setup, code.jets, code.residual, code.powers
    )


def _key(text: str) -> str:
    """A name for what text becomes in this version of Python and of the sources that shape machine
    code."""
    return hashlib.sha256(f"{stamp(__file__)}\n{sys.version}\n{text}".encode()).hexdigest()[:24]


def _load(name: str, source: str) -> Any:
    path = cache_folder() / f"{name}.py"
    fresh = not path.exists()
    if fresh:
        partial = path.with_suffix(f".{os.getpid()}.tmp")
        partial.write_text(written_out(source))
        partial.replace(path)
        if sys.stderr.isatty():
            print("stickslip: compiling this system once ...", file=sys.stderr)
    spec = importlib.util.spec_from_file_location(f"stickslip_generated.{name}", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
