"""Python source of a system, and what numba makes of it: for a GPU, and as the oracle of the
machine code."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
from typing import Any

from stickslip.equations.codegen.generate import Generated
from stickslip.equations.codegen.printer import source_of
from stickslip.equations.codegen.unroll import written_out
from stickslip.machine_code.objects import cache_folder
from stickslip.machine_code.stamps import stamp

_modules: dict[str, Any] = {}


def source_module(generated: Generated) -> Any:
    """The functions of a system, compiled by numba: from this process, from disk, or new."""
    source = source_of(generated)
    key = _key(source)
    if key not in _modules:
        _modules[key] = _load(f"model_{key}", source)
    return _modules[key]


def _key(text: str) -> str:
    """A name for what text becomes in this version of Python and of the sources that shape machine
    code."""
    return hashlib.sha256(f"{stamp(__file__)}\n{sys.version}\n{text}".encode()).hexdigest()[:24]


def _load(name: str, source: str) -> Any:
    path = cache_folder() / f"{name}.py"
    if not path.exists():
        partial = path.with_suffix(f".{os.getpid()}.tmp")
        partial.write_text(written_out(source))
        partial.replace(path)
    spec = importlib.util.spec_from_file_location(f"stickslip_generated.{name}", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
