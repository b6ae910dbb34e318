"""Puts the engine's machine code into the wheel, where it is built."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SOURCE = Path(__file__).parent / "src"


class MachineCode(BuildHookInterface):
    """Compiles the engine for all processors before a wheel is packed, unless ``$STICKSLIP_SHIPS``
    is ``none``: then what is there is packed. An editable installation compiles it for its own
    processor when it first needs it."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make what is missing."""
        levels = os.environ.get("STICKSLIP_SHIPS", "all")
        if version == "standard" and levels != "none":
            paths = [str(SOURCE), *filter(None, [os.environ.get("PYTHONPATH")])]
            subprocess.run(
                [sys.executable, "-m", "stickslip.machine_code.shipping", levels],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
                check=True,
            )
