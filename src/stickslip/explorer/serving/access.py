"""Access control: requests need the token and an accepted host name, and must not come from other
pages.

A foreign page in a local browser could send requests to this machine: from another origin, or by a
host name that resolves to 127.0.0.1 (DNS rebinding), in which case origin and host agree. So both
are compared with one list, and every URL contains a random token.
"""

from __future__ import annotations

import gc
import hmac
import re
import secrets
import time
from collections.abc import Iterable
from functools import partial
from typing import Any
from urllib.parse import urlsplit
from weakref import WeakSet, WeakValueDictionary

from bokeh.application.handlers.document_lifecycle import DocumentLifecycleHandler
from bokeh.document import Document
from bokeh.protocol.message import Message
from bokeh.server.tornado import BokehTornado
from bokeh.server.views.ws import WSHandler
from bokeh.util.token import get_session_id
from tornado.httputil import HTTPServerRequest
from tornado.web import RequestHandler

from stickslip.errors import StickslipError
from stickslip.explorer.asking.limits import MOST_MESSAGE
from stickslip.explorer.serving.wire import WIRE

LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
_ROUTES = re.compile(r"(/|/ws|/static/js/bokeh[a-z-]*\.min\.js|/favicon\.ico)\Z")
_FULL = "Too many pages are open. Close some of them and reload this one."
# characters of a message: a quoted request and its envelope
_MOST_RECEIVED = 2 * MOST_MESSAGE + 10_000
_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8">
<meta name="viewport" content="width=device-width"><title>stickslip</title>
<style>body{{font:16px/1.5 system-ui,sans-serif;max-width:34em;margin:18vh auto;padding:0 1.5em}}
@media (prefers-color-scheme:dark){{body{{background:#14171a;color:#dfe3e6}}}}</style>
<h1>{title}</h1><p>{reason}</p></html>"""


# Overridden methods that are not part of Bokeh's documented interface.
OVERRIDDEN = {
    WSHandler: ("_async_open", "_receive", "_handle", "_internal_error", "_protocol_error"),
    BokehTornado: ("find_handler", "get_handler_delegate", "get_sessions", "log_request"),
}


def check_bokeh() -> None:
    """Reject a version of Bokeh that lacks a method overridden here: it would call a method of
    another name, which is not guarded.

    Raises
    ------
    StickslipError
    """
    for cls, names in OVERRIDDEN.items():
        for name in names:
            if not hasattr(cls, name):
                raise StickslipError(
                    f"the explorer cannot enforce access control with this version of bokeh: "
                    f"{cls.__name__} has no method {name}. Install an older version"
                )


class AccessRules:
    """The rules.

    Parameters
    ----------
    names : iterable of str
        Additional accepted host names.
    """

    def __init__(self, names: Iterable[str] = ()) -> None:
        self.names = frozenset([*LOOPBACK, *(name.lower() for name in names)])
        self.token = secrets.token_urlsafe(16)

    def refusal(self, request: HTTPServerRequest, room: bool) -> tuple[int, str] | None:
        """Reason for the refusal of a request, with its HTTP status; None if it is accepted.

        Parameters
        ----------
        room : bool
            Whether another page may be opened.
        """
        if host_of(f"//{request.host}") not in self.names:
            return 403, (
                "The explorer does not accept requests under this host name. Add it with --allow."
            )
        origin = request.headers.get("Origin")
        upgrade = request.headers.get("Upgrade", "").lower() == "websocket"
        if (origin is not None and host_of(origin) not in self.names) or (upgrade and not origin):
            return 403, "Requests from other pages are not allowed."
        _, token, rest = (*request.path.split("/", 2), "", "")[:3]
        if not hmac.compare_digest(token.encode(), self.token.encode()):
            return 404, (
                "This address is not valid or has expired. Open the address that the program "
                "printed last; the part after # can be appended to it."
            )
        if not _ROUTES.match(f"/{rest}"):
            return 404, "Page not found."
        if request.method != "GET":
            return 405, "Only GET requests are allowed."
        if rest == "" and not room:
            return 503, _FULL
        return None


def host_of(address: str) -> str:
    """The host name in a URL, without the port; empty if there is none."""
    try:
        parts = urlsplit(address)
        name = parts.hostname or ""
        _ = parts.port
    except ValueError:
        return ""
    return f"[{name}]" if ":" in name else name


class Refused(RequestHandler):
    """Handler that reports a refused request."""

    def initialize(self, status: int, reason: str) -> None:
        """Store the message."""
        self.status = status
        self.reason = reason

    def prepare(self) -> None:
        """Send the message for any request."""
        self.set_status(self.status)
        title = "Not found" if self.status == 404 else "Request refused"
        self.finish(_PAGE.format(title=title, reason=self.reason))

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        """Send only the status code."""
        self.finish(_PAGE.format(title="Request refused", reason=str(status_code)))


class QuestionHandler(WSHandler):
    """A connection that accepts only questions of a page.

    Bokeh's protocol allows a page to change its document on the server: it could create objects,
    some of which read files, or exhaust the memory. Here only the text of a question is accepted.

    Messages are sent without delay (TCP_NODELAY). Otherwise the second fragment of a message waits
    for the delayed acknowledgement of the first: 40 ms for every answer.
    """

    _received = 0  # characters and bytes since the last complete message

    def open(self) -> None:
        """Begin."""
        self.set_nodelay(True)
        super().open()

    async def _async_open(self, token: str) -> None:
        """Begin the session, unless the page has left long ago or there is no room."""
        assert isinstance(self.application, Guarded)
        reason = self.application.entry(get_session_id(token), self)
        if reason:
            self.close(4000, reason)
        else:
            await super()._async_open(token)

    async def _receive(self, fragment: str | bytes) -> Message[Any] | None:
        """A message, if this piece completes it."""
        self._received += len(fragment)
        if self._received > _MOST_RECEIVED or isinstance(fragment, bytes):
            self._protocol_error("")
            return None
        message = await super()._receive(fragment)
        self._received = 0 if message else self._received
        return message

    async def _handle(self, message: Message[Any]) -> Message[Any] | None:
        """Reply to a message."""
        connection = self.connection
        assert connection is not None
        if message.msgtype == "PATCH-DOC":
            document = connection.session.document
            message.content = {"events": questions_in(message.content, document)}
            if not message.content["events"]:
                return connection.ok(message)  # ranges are not needed here
        elif message.msgtype not in ("PULL-DOC-REQ", "SERVER-INFO-REQ"):
            return connection.error(message, "This kind of message is not supported.")
        reply = await super()._handle(message)
        if reply is not None and reply.msgtype == "ERROR":
            return connection.error(message, "This message cannot be read.")
        return reply

    def _internal_error(self, message: str) -> None:
        """End the connection without sending the reason to the page."""
        self.close(4001, "This message cannot be processed.")

    def _protocol_error(self, message: str) -> None:
        """End the connection."""
        self.close(4002, "This message cannot be read.")


def questions_in(content: Any, document: Document) -> list[dict[str, Any]]:
    """The changes of the request text among those that a page sends.

    Parameters
    ----------
    content : object
        Of a message, as it came.
    """
    wire = document.get_model_by_name(WIRE)
    assert wire is not None
    found = list[dict[str, Any]]()
    events = content.get("events") if isinstance(content, dict) else None
    asked = {"kind": "ModelChanged", "model": {"id": wire.id}, "attr": "asked"}
    for event in events if isinstance(events, list) else []:
        if isinstance(event, dict) and isinstance(event.get("new"), str):
            found += [event] if event == asked | {"new": event["new"]} else []
    return found


class Leaving(DocumentLifecycleHandler):
    """Clean-up when a page is closed, without the garbage collections of Bokeh, which would block
    the server."""

    def __init__(self) -> None:
        super().__init__()
        self._on_session_destroyed = _leave

    def modify_document(self, doc: Document) -> None:
        """Set up a new document without this clean-up."""
        super().modify_document(doc)
        vars(doc)["destroy"] = partial(_destroy, doc)


def _destroy(document: Document, session: Any) -> None:
    collect, gc.collect = gc.collect, lambda generation=2: 0
    try:
        Document.destroy(document, session)
    finally:
        gc.collect = collect


def _leave(context: Any) -> None:
    document = context._document
    callbacks, document.session_destroyed_callbacks = document.session_destroyed_callbacks, set()
    for callback in callbacks:
        callback(context)


class Guarded(BokehTornado):
    """Bokeh's application with access control."""

    def __init__(self, *args: Any, access: AccessRules, most_pages: int, **kwargs: Any) -> None:
        super().__init__(*args, prefix=access.token, **kwargs)
        self.access = access
        self.most_pages = most_pages
        # Requests of pages that are being made: their sessions do not exist yet.
        self._opening = WeakSet[HTTPServerRequest]()
        # The connection of each page.
        self._connected = WeakValueDictionary[str, WSHandler]()
        # When pages connected, as long as their tokens are valid.
        self._entered = dict[str, float]()

    @property
    def has_room(self) -> bool:
        """Whether another page may be opened."""
        return len(self._sessions()) + len(self._opening) < self.most_pages

    def _sessions(self) -> set[str]:
        return {x.id for path in self.app_paths for x in self.get_sessions(path)}

    def entry(self, session: str, connection: WSHandler) -> str:
        """Reason why a page may not connect; empty if it may. A token is valid once: a request for
        a session that has ended, or that is still connected, must reload the page. A page that has
        lost its connection may reconnect.

        Parameters
        ----------
        session : str
            Name of the session of the page.
        """
        other = self._connected.get(session)
        if other is not None and other.ws_connection is not None:
            return "This page is open elsewhere. Reload it to use it here."
        now = time.monotonic()
        valid = self.session_token_expiration
        self._entered = {x: t for x, t in self._entered.items() if now - t < valid}
        if session not in self._sessions():
            if session in self._entered:
                return "This page was closed. Reload it."
            if not self.has_room:
                return _FULL
        self._entered[session] = now
        self._connected[session] = connection
        return ""

    def find_handler(self, request: HTTPServerRequest, **kwargs: Any) -> Any:
        """The handler of a request; all requests pass here."""
        refused = self.access.refusal(request, self.has_room)
        if refused is not None:
            status, reason = refused
            return self.get_handler_delegate(request, Refused, {"status": status, "reason": reason})
        if "/" not in request.path.strip("/"):
            self._opening.add(request)
        return super().find_handler(request, **kwargs)

    def get_handler_delegate(
        self, request: HTTPServerRequest, target_class: type[RequestHandler], *args: Any, **kw: Any
    ) -> Any:
        """The delegate through which a handler answers a request."""
        chosen = QuestionHandler if target_class is WSHandler else target_class
        return super().get_handler_delegate(request, chosen, *args, **kw)

    def log_request(self, handler: RequestHandler) -> None:
        """Called when a request is answered. Requests are not logged, for privacy."""
        self._opening.discard(handler.request)
