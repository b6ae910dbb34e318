"""The command ``stickslip``."""

from __future__ import annotations

import functools
import io
import sys
import warnings


def main() -> None:
    """Run the command line; never shows a traceback."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without Greek letters shows ? instead
    try:
        from stickslip.cli.app import app
        from stickslip.cli.common.report import warn

        once = functools.cache(warn)
        warnings.showwarning = lambda message, *_, **__: once(str(message))
        app()
    except KeyboardInterrupt:
        print("stickslip: interrupted; nothing new was written", file=sys.stderr)
        sys.exit(130)


__all__ = ["main"]
