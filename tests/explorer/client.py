"""Somebody who talks to the explorer without a browser: well-behaved, or not."""

from __future__ import annotations

import asyncio
import http.client
import json
import re
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit

from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClientConnection, websocket_connect

TOKEN = re.compile(r'"token":\s*"([^"]+)"')


def get(address: str, path: str = "", **headers: str) -> tuple[int, str]:
    """Status and text of a page; headers as they are given, ``Host`` too."""
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port or 80, timeout=20)
    try:
        connection.putrequest("GET", path or parts.path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.read().decode("utf-8", "replace")
    finally:
        connection.close()


class Page:
    """A page as the server sees it."""

    def __init__(self, address: str) -> None:
        self.address = address.partition("#")[0]
        self.wire = ""
        self.serial = 0
        self._connection: WebSocketClientConnection | None = None

    async def open(self, origin: str | None = None, token: str = "") -> Page:
        """Load the page unless its token is known, connect, and find the wire."""
        if not token:
            _, text = await asyncio.to_thread(get, self.address)
            found = TOKEN.search(text)
            assert found is not None, "the page has no token"
            token = found[1]
        parts = urlsplit(self.address)
        request = HTTPRequest(
            f"ws://{parts.netloc}{parts.path}ws",
            headers={"Origin": origin or f"http://{parts.netloc}"},
            connect_timeout=90.0,  # of a machine that is busy with other tests
            request_timeout=90.0,
        )
        self._connection = await websocket_connect(
            request, subprotocols=["bokeh", token], max_message_size=10**9
        )
        await self.message()  # ACK
        await self.send("PULL-DOC-REQ", {})
        _, content, _ = await self.message()
        (self.wire,) = re.findall(r"wire\.Wire\",\s*\"id\":\s*\"([^\"]+)\"", content)
        return self

    @property
    def connection(self) -> WebSocketClientConnection:
        """The open connection."""
        assert self._connection is not None
        return self._connection

    async def close(self) -> None:
        """Leave, and wait until the connection is closed."""
        self.connection.close()
        with suppress(TimeoutError):
            async with asyncio.timeout(5.0):
                while (
                    self.connection.close_code is None
                    and await self.connection.read_message() is not None
                ):
                    pass

    async def send(self, kind: str, content: Any) -> None:
        """One message of the protocol."""
        self.serial += 1
        for part in ({"msgid": str(self.serial), "msgtype": kind}, {}, content):
            await self.connection.write_message(json.dumps(part))

    async def message(self) -> tuple[dict[str, Any], str, list[bytes]]:
        """The next message, and what comes with it in bytes."""
        header = json.loads(await self._text())
        await self._text()
        content = await self._text()
        buffers = []
        for _ in range(header.get("num_buffers", 0)):
            await self._text()
            data = await self.connection.read_message()
            assert isinstance(data, bytes)
            buffers.append(data)
        return header, content, buffers

    async def _text(self) -> str:
        text = await asyncio.wait_for(self.connection.read_message(), 60.0)
        if text is None:
            raise ConnectionError("closed")
        return text.decode() if isinstance(text, bytes) else text

    async def say(self, text: str) -> None:
        """Let the page ask this, whatever it is."""
        event = {
            "kind": "ModelChanged",
            "model": {"id": self.wire},
            "attr": "asked",
            "new": text,
        }
        await self.send("PATCH-DOC", {"events": [event]})

    async def ask(self, what: str, setting: Any = None, lane: str = "", **options: Any) -> None:
        """Ask something."""
        self.serial += 1
        question = {
            "serial": self.serial,
            "lane": lane or what,
            "what": what,
            "setting": {"model": "belt_block"} if setting is None else setting,
            "options": options,
        }
        await self.say(json.dumps(question))

    async def heads(self) -> list[dict[str, Any]]:
        """The next answers."""
        while True:
            header, content, _ = await self.message()
            if header["msgtype"] != "PATCH-DOC":
                continue
            (said,) = (e for e in json.loads(content)["events"] if e.get("attr") == "said")
            return json.loads(said["new"][0])

    async def answer(self, seconds: float = 60.0) -> list[dict[str, Any]]:
        """All parts of one answer."""
        found: list[dict[str, Any]] = []

        async def collect() -> None:
            while not (found and found[-1]["final"]):
                found.extend(await self.heads())

        await asyncio.wait_for(collect(), seconds)
        return found


def talk(address: str, conversation: Callable[[Page], Coroutine[Any, Any, Any]]) -> Any:
    """Open a page, talk, and close it."""

    async def whole() -> Any:
        page = await Page(address).open()
        try:
            return await conversation(page)
        finally:
            await page.close()

    return in_time(whole())


def in_time(conversation: Coroutine[Any, Any, Any], seconds: float = 240.0) -> Any:
    """What a conversation gives, unless something is waited for that does not come."""

    async def whole() -> Any:
        async with asyncio.timeout(seconds):
            return await conversation

    return asyncio.run(whole())
