"""The server: it listens, prints its address, and opens the page."""

from __future__ import annotations

import asyncio
import logging
import secrets
import signal
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop, PeriodicCallback
from tornado.netutil import bind_sockets

from stickslip.errors import DeclarationError, StickslipError
from stickslip.explorer.asking.limits import MOST_MESSAGE, MOST_PAGES
from stickslip.explorer.asking.request import GIVEN, Request, read_state
from stickslip.explorer.serving.pool import WorkerPool

if TYPE_CHECKING:
    from socket import socket


HERE = "127.0.0.1"
_WAITING = 4096  # connections that wait for acceptance; the system may allow fewer
_PORT = 5106  # tried first, so that links in a notebook or a lecture stay the same
_KEEP = 4_000  # ms for which the work of a page with a broken connection is kept
_CHECK = 1_500  # ms


@dataclass
class Listening:
    """Address of the explorer, and the first page.

    Attributes
    ----------
    port : int
        0: a free port.
    names : tuple of str
        Additional accepted host names.
    given : str
        The text of the initial model file.
    start : str
        The initial state, as in the fragment of a URL.
    most_pages : int
        Maximum number of open pages.
    """

    host: str = HERE
    port: int | None = None
    names: tuple[str, ...] = ()
    given: str = ""
    start: str = ""
    most_pages: int = MOST_PAGES
    sockets: list[socket] = field(default_factory=list)
    token: str = ""

    def bind(self) -> None:
        """Take the port.

        Raises
        ------
        DeclarationError
            If that is not possible.
        """
        wanted = [_PORT, 0] if self.port is None else [self.port]
        reason = ""
        for port in wanted:
            try:
                self.sockets = bind_sockets(port, self.host, backlog=_WAITING)
                break
            except OSError as error:
                reason = error.strerror or str(error)
                continue
        else:
            raise DeclarationError(
                "--port" if self.port else "--host",
                f"cannot listen on {self.host}:{wanted[-1]} ({reason})",
                "Choose another port, or omit it",
            )
        self.token = secrets.token_urlsafe(16)

    @property
    def first(self) -> Request:
        """First request of the page."""
        setting = read_state(self.start)
        if setting.model == GIVEN:
            setting = replace(setting, model="", toml=self.given)
        return Request(0, "motion", "motion", setting)

    @property
    def address(self) -> str:
        """Address to open."""
        port = self.sockets[0].getsockname()[1]
        anywhere = self.host in ("0.0.0.0", "::", "")
        name = (self.names[0] if self.names else HERE) if anywhere else self.host
        shown = f"[{name}]" if ":" in name else name
        return f"http://{shown}:{port}/{self.token}/" + (f"#{self.start}" if self.start else "")


class Explorer:
    """A running explorer; in a notebook it shows the page."""

    def __init__(self, place: Listening) -> None:
        self.address = place.address
        self._place = place
        self._loop: IOLoop | None = None
        self._ended = threading.Event()
        self._ready = threading.Event()
        self._refused: StickslipError | None = None
        self.pool: WorkerPool | None = None

    def __repr__(self) -> str:
        return f"<Explorer at {self.address}>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe src="{self.address}" title="stickslip explorer" width="100%" height="820" '
            'style="border:1px solid #8884;border-radius:8px"></iframe>'
            f'<p><a href="{self.address}" target="_blank">in a tab of its own</a></p>'
        )

    def serve(self) -> None:
        """Serve pages until :meth:`close` is called, or the program is interrupted."""
        asyncio.run(self._serve())

    def start(self) -> Explorer:
        """Serve pages in the background.

        Raises
        ------
        StickslipError
            If the installed version of bokeh cannot be used.
        """
        threading.Thread(target=self._serve_beside, daemon=True).start()
        self._ready.wait(30.0)
        if self._refused is not None:
            raise self._refused
        return self

    def _serve_beside(self) -> None:
        with suppress(StickslipError):  # raised where it was started
            self.serve()

    def close(self) -> None:
        """End it."""
        loop = self._loop
        if loop is not None and not self._ended.is_set():
            loop.add_callback(self._end)
            self._ended.wait(10.0)

    def wait(self) -> None:
        """Wait until it has ended."""
        self._ended.wait()

    def _end(self) -> None:
        self._over.set()

    async def _serve(self) -> None:
        self._loop = IOLoop.current()
        self._over = asyncio.Event()
        if threading.current_thread() is threading.main_thread():
            for name in ("SIGINT", "SIGTERM"):
                _on_signal(name, self._over.set)
        self.pool = pool = WorkerPool(self._loop.add_callback, first=self._place.first)
        ticks = PeriodicCallback(pool.tick, 1000.0 * pool.tick_every)
        ticks.start()
        try:
            # Bokeh takes most of a second to load; the workers load in parallel.
            server, application = await asyncio.to_thread(_application, self._place, pool)
            server.add_sockets(self._place.sockets)
            application.initialize(self._loop)
            application.start()
            self._ready.set()
            await self._over.wait()
            server.stop()
            application.stop(wait=False)
            await server.close_all_connections()
        except StickslipError as error:
            self._refused = error
            raise
        finally:
            ticks.stop()
            pool.close()
            self._ready.set()
            self._ended.set()


def _on_signal(name: str, act: Callable[[], None]) -> None:
    """Install a handler of a signal, if the operating system has it."""
    with suppress(NotImplementedError, AttributeError):
        asyncio.get_running_loop().add_signal_handler(getattr(signal, name), act)


def _application(place: Listening, pool: WorkerPool):
    """Bokeh's application, and its listening sockets."""
    from bokeh.application import Application
    from bokeh.application.handlers.function import FunctionHandler

    from stickslip.explorer.serving.access import AccessRules, Guarded, Leaving, check_bokeh
    from stickslip.explorer.serving.document import page_maker

    check_bokeh()
    logging.getLogger("bokeh").setLevel(logging.CRITICAL)
    for name in ("tornado.access", "tornado.application", "tornado.general"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    access = AccessRules(_names(place))
    access.token = place.token
    make = page_maker(pool, place.given)
    port = place.sockets[0].getsockname()[1]
    application = Guarded(
        {"/": Application(FunctionHandler(make), Leaving())},
        access=access,
        most_pages=place.most_pages,
        extra_websocket_origins=[f"{name}:{port}" for name in access.names],
        secret_key=secrets.token_bytes(32),
        sign_sessions=True,
        generate_session_ids=True,
        unused_session_lifetime_milliseconds=_KEEP,
        check_unused_sessions_milliseconds=_CHECK,
        websocket_max_message_size_bytes=2 * MOST_MESSAGE,
        use_index=False,
    )
    return HTTPServer(application, max_body_size=100_000), application


def _names(place: Listening) -> Iterable[str]:
    local = place.host in (HERE, "0.0.0.0", "::", "")
    return [*place.names, *([] if local else [place.host])]
