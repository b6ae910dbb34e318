"""The loop of a worker: one request at a time, which can be cancelled."""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import IO, Any

from stickslip.errors import StickslipError
from stickslip.explorer.asking.answer import (
    Answer,
    Compiling,
    Ready,
    WorkerMessage,
    receive_frame,
    refusal,
    send_frame,
)
from stickslip.explorer.asking.limits import MOST_MEMORY
from stickslip.explorer.asking.request import Request
from stickslip.machine_code import shelf

_ROOM = "stickslip.explorer.work"
# Handlers of requests; a module is imported at its first request.
TASKS = {
    "model": "model:describe_model",
    "motion": "motion:move",
    "plane": "plane:long_run_in_plane",
    "branch": "branches:follow_branches",
    "map": "maps:fill_map",
    "measures": "maps:offer_measures",
    "friction": "friction:effective_friction",
    "evolution": "evolution:follow_evolution",
    "data": "data:compare_data",
    "export": "export:exported_page",
    "gallery": "gallery:draw_gallery",
}


class Cancelled(Exception):
    """The answer is no longer needed."""


class Cancellation:
    """Test of whether an answer is still needed, called periodically by long computations."""

    def __init__(self) -> None:
        self._over = threading.Event()
        self.tell: Callable[[Answer], None] = lambda answer: None

    def renew(self) -> None:
        """Somebody waits."""
        self._over.clear()

    def end(self) -> None:
        """Nobody does."""
        self._over.set()

    def check(self, *_: object) -> None:
        """Progress listener that stops a computation whose answer is no longer needed.

        Raises
        ------
        Cancelled
        """
        if self._over.is_set():
            raise Cancelled

    def progress(self, head: Mapping[str, object]) -> None:
        """Report the progress of a long answer.

        Raises
        ------
        Cancelled
        """
        self.check()
        self.tell(Answer(head))

    def pause(self, seconds: float) -> None:
        """Wait briefly for a newer question, which takes precedence.

        Raises
        ------
        Cancelled
        """
        if self._over.wait(seconds):
            raise Cancelled


Answerer = Callable[[Request, Cancellation], Iterator[Answer]]


def serve_pipe() -> None:
    """Answer until the pipe is closed."""
    source, sink = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # Other output is redirected, so that it does not mix with the answers.
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which closes the pipe
    warnings.simplefilter("ignore")
    limit_memory()
    cancellation = Cancellation()
    questions: queue.SimpleQueue[Request | None] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(source, questions, cancellation), daemon=True).start()
    import_module(f"{_ROOM}.motion")
    shelf.listeners.append(lambda: send_frame(sink, Compiling()))
    send_frame(sink, Ready())
    while (request := questions.get()) is not None:
        cancellation.renew()
        serial = request.serial
        cancellation.tell = lambda answer, serial=serial: send_frame(
            sink, WorkerMessage(serial, answer)
        )
        for answer in answers(request, cancellation):
            send_frame(sink, WorkerMessage(request.serial, answer))
        send_frame(sink, WorkerMessage(request.serial, None, final=True))
    os._exit(0)  # not waiting for anything


def answers(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """The parts of an answer, or an error message; never an exception."""
    try:
        if request.what not in TASKS:
            yield Answer({"refused": {"where": "", "reason": "unknown request", "remedy": ""}})
            return
        module, _, name = TASKS[request.what].partition(":")
        work: Answerer = getattr(import_module(f"{_ROOM}.{module}"), name)
        for answer in work(request, cancellation):
            yield answer
            cancellation.check()
    except Cancelled:
        return
    except StickslipError as error:
        yield refusal(error)
    except MemoryError:
        yield refusal(StickslipError("the computation needs too much memory"))
    except RecursionError:
        yield refusal(StickslipError("a formula is nested too deeply"))
    except Exception as error:
        print(repr(error), file=sys.stderr)
        yield refusal(
            StickslipError(f"internal error; please report it ({type(error).__name__}: {error})")
        )


def limit_memory() -> None:
    """Limit the memory of this process, if the operating system supports it."""
    try:
        import resource
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY, MOST_MEMORY))


def _listen(
    source: IO[bytes], questions: queue.SimpleQueue[Any], cancellation: Cancellation
) -> None:
    """Read questions from the pipe; None cancels the last one."""
    try:
        while True:
            said = receive_frame(source)
            if said is None:
                cancellation.end()
            else:
                questions.put(said)
    except (EOFError, OSError):
        cancellation.end()
        questions.put(None)
