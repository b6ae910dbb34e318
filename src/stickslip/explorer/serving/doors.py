"""Who may come in: whoever knows the token, under a name that is on the list, and no other page.

A page of somebody else could send requests to this machine from a browser here: by another origin,
or by a name of its own that it lets point to 127.0.0.1 (DNS rebinding), where its origin and the
host are the same. So both are compared with one list, and every address holds a random token.
"""

from __future__ import annotations

import hmac
import re
import secrets
from collections.abc import Iterable
from typing import Any
from urllib.parse import urlsplit
from weakref import WeakSet

from bokeh.server.tornado import BokehTornado
from bokeh.server.views.ws import WSHandler
from tornado.httputil import HTTPServerRequest
from tornado.web import RequestHandler

LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
_ROUTES = re.compile(r"(/|/ws|/static/js/bokeh[a-z-]*\.min\.js|/favicon\.ico)\Z")
_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8">
<meta name="viewport" content="width=device-width"><title>stickslip</title>
<style>body{{font:16px/1.5 system-ui,sans-serif;max-width:34em;margin:18vh auto;padding:0 1.5em}}
@media (prefers-color-scheme:dark){{body{{background:#14171a;color:#dfe3e6}}}}</style>
<h1>{title}</h1><p>{reason}</p></html>"""


class Doors:
    """The rules.

    Parameters
    ----------
    names : iterable of str
        Host names under which the page may be asked for, beside those of this machine alone.
    """

    def __init__(self, names: Iterable[str] = ()) -> None:
        self.names = frozenset([*LOOPBACK, *(name.lower() for name in names)])
        self.token = secrets.token_urlsafe(16)

    def refusal(self, request: HTTPServerRequest, room: bool) -> tuple[int, str] | None:
        """Why a request is refused, with the number that HTTP has for it; None if it is not.

        Parameters
        ----------
        request : HTTPServerRequest
        room : bool
            Whether one more page may be opened.
        """
        if host_of(f"//{request.host}") not in self.names:
            return 403, "This name is not on the list of those under which the explorer is asked."
        origin = request.headers.get("Origin")
        upgrade = request.headers.get("Upgrade", "").lower() == "websocket"
        if (origin is not None and host_of(origin) not in self.names) or (upgrade and not origin):
            return 403, "Another page may not ask this one."
        _, token, rest = (*request.path.split("/", 2), "", "")[:3]
        if not hmac.compare_digest(token.encode(), self.token.encode()):
            return 404, (
                "This address is not valid, or no longer. Open the one that the program has "
                "printed last; what stands behind # can be put behind that."
            )
        if not _ROUTES.match(f"/{rest}"):
            return 404, "There is nothing here."
        if request.method != "GET":
            return 405, "There is nothing to be sent here."
        if rest == "" and not room:
            return 503, "Too many pages are open. Close some of them, and reload this one."
        return None


def host_of(address: str) -> str:
    """The name in an address, without the port; empty if there is none."""
    try:
        parts = urlsplit(address)
        name = parts.hostname or ""
        _ = parts.port
    except ValueError:
        return ""
    return f"[{name}]" if ":" in name else name


class Refused(RequestHandler):
    """Says what was wrong."""

    def initialize(self, status: int, reason: str) -> None:
        """Take what is to be said."""
        self.status = status
        self.reason = reason

    def prepare(self) -> None:
        """Say it, whatever was asked for."""
        self.set_status(self.status)
        title = "Not here" if self.status == 404 else "Not possible"
        self.finish(_PAGE.format(title=title, reason=self.reason))

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        """Say no more than the number."""
        self.finish(_PAGE.format(title="Not possible", reason=str(status_code)))


class Prompt(WSHandler):
    """A connection whose messages go out at once.

    Otherwise the second of the small pieces that a message has waits until the first is
    acknowledged, for which the other end takes its time: 40 ms for every answer.
    """

    def open(self) -> None:
        """Begin."""
        self.set_nodelay(True)
        super().open()


class Guarded(BokehTornado):
    """Bokeh's application behind the doors."""

    def __init__(self, *args: Any, doors: Doors, most_pages: int, **kwargs: Any) -> None:
        super().__init__(*args, prefix=doors.token, **kwargs)
        self.doors = doors
        self.most_pages = most_pages
        # Requests of pages that are being made: their sessions do not exist yet.
        self._opening = WeakSet[HTTPServerRequest]()

    def find_handler(self, request: HTTPServerRequest, **kwargs: Any) -> Any:
        """Who answers a request: every one passes here."""
        pages = sum(map(len, map(self.get_sessions, self.app_paths))) + len(self._opening)
        refused = self.doors.refusal(request, pages < self.most_pages)
        if refused is not None:
            status, reason = refused
            return self.get_handler_delegate(request, Refused, {"status": status, "reason": reason})
        if "/" not in request.path.strip("/"):
            self._opening.add(request)
        return super().find_handler(request, **kwargs)

    def get_handler_delegate(
        self, request: HTTPServerRequest, target_class: type[RequestHandler], *args: Any, **kw: Any
    ) -> Any:
        """What lets a request be answered by a handler."""
        chosen = Prompt if target_class is WSHandler else target_class
        return super().get_handler_delegate(request, chosen, *args, **kw)

    def log_request(self, handler: RequestHandler) -> None:
        """Called when a request is answered. Nothing is logged: requests are nobody's business."""
        self._opening.discard(handler.request)
