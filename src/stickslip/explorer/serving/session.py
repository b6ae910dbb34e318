"""The session of a page: its requests are passed to workers, and their answers back."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from bokeh.document import Document

from stickslip.arrays import Array
from stickslip.errors import StickslipError
from stickslip.explorer.asking.answer import Answer, refusal
from stickslip.explorer.asking.request import GIVEN, Request, read_request
from stickslip.explorer.serving.pool import Job, WorkerPool
from stickslip.explorer.serving.wire import Wire

_CANCEL = "cancel"
_MOST_WAITING = 200  # largest number of answers that a page has not received yet


class Session:
    """One page.

    Parameters
    ----------
    document : Document
        Bokeh's document, which is synchronised with the page.
    given : str
        The text of the model that the explorer was opened with.
    """

    def __init__(self, document: Document, wire: Wire, pool: WorkerPool, given: str) -> None:
        self._document = document
        self._wire = wire
        self._pool = pool
        self._given = given
        self._waiting: list[dict[str, Any]] = []
        self._arrays: list[dict[str, Any]] = []
        self._closed = False
        wire.on_change("asked", self._asked)
        document.on_session_destroyed(self._close)

    def _asked(self, attribute: str, old: str, new: str) -> None:
        """A question has come."""
        try:
            request = read_request(new)
        except StickslipError as error:
            self._say({**refusal(error).head, "serial": -1, "lane": "", "final": True}, {})
            return
        if request.what == _CANCEL:
            self._pool.drop(self, request.lane)
            return
        if request.setting.model == GIVEN:
            request = request.about(self._given)
        self._pool.ask(Job(self, request, self._reply_to(request), len(new)))

    def _reply_to(self, request: Request) -> Callable[[Answer | None, bool], None]:
        about = {"serial": request.serial, "lane": request.lane, "what": request.what}

        def reply(answer: Answer | None, final: bool) -> None:
            head = dict(answer.head) if answer is not None else {}
            arrays = dict(answer.arrays) if answer is not None else {}
            self._say({**head, **about, "final": final}, arrays)

        return reply

    def _say(self, head: dict[str, Any], arrays: dict[str, Any]) -> None:
        """Send a message to the page, together with others that are ready by then."""
        if self._closed or len(self._waiting) > _MOST_WAITING:
            return
        self._waiting.append(head)
        self._arrays.append(arrays)
        if len(self._waiting) == 1:
            self._document.add_next_tick_callback(self._deliver)

    def _deliver(self) -> None:
        heads, self._waiting = self._waiting, []
        arrays, self._arrays = self._arrays, []
        if self._closed:
            return
        places, data = _packed(arrays)
        for head, own in zip(heads, places, strict=True):
            head["arrays"] = own
        self._wire.update(said=[json.dumps(_plain(heads), ensure_ascii=False), data])

    def _close(self, context: Any) -> None:
        """Close the session and stop its computations when the page is closed."""
        self._closed = True
        self._pool.drop(self)


def _packed(parts: list[dict[str, Array]]) -> tuple[list[dict[str, Any]], Array]:
    """Kind, offset and length of every array, and the bytes of all of them, aligned to eight
    bytes."""
    pieces: list[bytes] = []
    places: list[dict[str, Any]] = []
    at = 0
    for part in parts:
        places.append({})
        for name, values in part.items():
            own = values.tobytes()
            padded = own + bytes(-len(own) % 8)
            places[-1][name] = [values.dtype.str[1:], at, values.size]
            pieces.append(padded)
            at += len(padded)
    return places, np.frombuffer(b"".join(pieces) or bytes(8), np.uint8)


def _plain(value: Any) -> Any:
    """Replace infinite numbers, which JSON does not have."""
    match value:
        case dict():
            return {key: _plain(part) for key, part in value.items()}
        case list() | tuple():
            return [_plain(part) for part in value]
        case float() if not math.isfinite(value):
            return None
        case _:
            return value.item() if hasattr(value, "item") else value
