"""The end of a command: one line on stderr, and an exit code."""

from __future__ import annotations

import errno
from collections.abc import Callable
from functools import wraps
from typing import NoReturn, ParamSpec

import typer

from stickslip.errors import StickslipError

NOT_CERTIFIED = 1
_BAD_INPUT = 2
_OUR_FAULT = 70
EXIT_INTERRUPTED = 130
_P = ParamSpec("_P")


def finish(message: str, code: int) -> NoReturn:
    """End with one line on stderr."""
    typer.echo(f"stickslip: {message}", err=True)
    raise typer.Exit(code)


def guarded(command: Callable[_P, None]) -> Callable[_P, None]:
    """Convert all errors into one line and an exit code."""

    @wraps(command)
    def run(*args: _P.args, **kwargs: _P.kwargs) -> None:
        try:
            command(*args, **kwargs)
        except StickslipError as error:
            finish(str(error), _BAD_INPUT)
        except KeyboardInterrupt:
            finish("interrupted; nothing new was written", EXIT_INTERRUPTED)
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise  # the reader closed the pipe, as in: stickslip show rocking_toy | head
            finish(f"{error.filename or 'file'}: {error.strerror or error}", _BAD_INPUT)
        except typer.Exit:
            raise
        except Exception as error:
            finish(
                f"internal error; please report it ({type(error).__name__}: {error})", _OUR_FAULT
            )

    return run
