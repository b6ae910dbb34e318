"""The server that is attacked, and what an attacker has who needs no client: a socket."""

from __future__ import annotations

import base64
import os
import re
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

from explorer.client import TOKEN, Page, get, talk

_COMMAND = [sys.executable, "-m", "stickslip.cli", "explore", "belt_block", "--no-browser"]
TEXT, BINARY, CONTINUED = 1, 2, 0  # kinds of frames
_FIN, _DEFLATED, _MASKED = 0x80, 0x40, 0x80


class Victim:
    """An explorer that listens on 127.0.0.1 alone."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [*_COMMAND, "--port", "0"],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            encoding="utf-8",
        )
        assert self.process.stdout is not None
        found = re.search(r"http://127\.0\.0\.1:\d+/\S+/", self.process.stdout.readline())
        assert found is not None
        self.address = found[0]
        parts = urlsplit(self.address)
        self.place = (parts.hostname or "", parts.port or 0)
        self.path = parts.path

    def end(self) -> int:
        """Stop it; its exit code."""
        with self.process:
            self.process.terminate()
            try:
                return self.process.wait(20.0)
            finally:
                self.process.kill()

    @property
    def memory(self) -> float:
        """MB that it holds; NaN where nobody tells."""
        status = Path(f"/proc/{self.process.pid}/status")
        if not status.exists():
            return float("nan")
        found = re.search(r"VmRSS:\s*(\d+)", status.read_text())
        assert found is not None
        return int(found[1]) / 1024.0

    @property
    def workers(self) -> list[int]:
        """Processes that it has started, where the system tells."""
        found = list[int]()
        for place in Path("/proc").glob("[0-9]*/stat"):
            try:
                told = place.read_text().rpartition(")")[2].split()
            except OSError:
                continue  # it has just ended
            if int(told[1]) == self.process.pid:
                found.append(int(place.parent.name))
        return found

    def serves(self) -> bool:
        """Whether another page is opened and answered, soon."""

        async def ask(page: Page) -> list[dict[str, object]]:
            await page.ask("motion")
            return await page.answer(30.0)

        begun = time.monotonic()
        answer = talk(self.address, ask)
        return "part" in answer[0] and time.monotonic() - begun < 20.0

    def said_to(self, data: bytes, seconds: float = 5.0) -> bytes:
        """What comes back for some bytes, whatever they are."""
        with socket.create_connection(self.place, seconds) as line:
            line.sendall(data)
            found = b""
            try:
                while piece := line.recv(65536):
                    found += piece
                    if b"\r\n\r\n" in found:
                        break
            except (TimeoutError, ConnectionError):
                pass
            return found

    def status_of(self, target: str, method: str = "GET", more: str = "", body: bytes = b"") -> int:
        """The number that answers a request line, which is sent as it is; 0 if none does."""
        head = f"{method} {target} HTTP/1.1\r\nHost: 127.0.0.1:{self.place[1]}\r\n"
        length = f"Content-Length: {len(body)}\r\n" if body else ""
        said = self.said_to(f"{head}{more}{length}\r\n".encode("latin-1") + body)
        found = re.match(rb"HTTP/1\.1 (\d+)", said)
        return int(found[1]) if found else 0

    @property
    def token(self) -> str:
        """That of a page which is loaded now."""
        status, text = get(self.address)
        assert status == 200
        return TOKEN.findall(text)[0]

    @contextmanager
    def connected(self, token: str = "", extensions: str = "") -> Iterator[Line]:
        """A page's connection, byte by byte."""
        head = {
            "Host": f"127.0.0.1:{self.place[1]}",
            "Origin": f"http://127.0.0.1:{self.place[1]}",
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode(),
            "Sec-WebSocket-Protocol": f"bokeh, {token or self.token}",
        }
        if extensions:
            head["Sec-WebSocket-Extensions"] = extensions
        lines = "".join(f"{name}: {value}\r\n" for name, value in head.items())
        with socket.create_connection(self.place, 10.0) as line:
            line.sendall(f"GET {self.path}ws HTTP/1.1\r\n{lines}\r\n".encode())
            said = b""
            while b"\r\n\r\n" not in said:
                said += line.recv(1)
            assert said.startswith(b"HTTP/1.1 101"), said
            yield Line(line)


class Line:
    """Frames of a connection."""

    def __init__(self, line: socket.socket) -> None:
        self.line = line

    def is_greeted(self) -> bool:
        """Whether the first that comes is a text, not the end."""
        return self.line.recv(1) == bytes([_FIN | TEXT])

    def send(
        self, data: bytes, kind: int = TEXT, last: bool = True, deflated: bool = False
    ) -> None:
        """One frame."""
        first = kind | (_FIN if last else 0) | (_DEFLATED if deflated else 0)
        size = len(data)
        if size < 126:
            head = struct.pack("!BB", first, _MASKED | size)
        elif size < 2**16:
            head = struct.pack("!BBH", first, _MASKED | 126, size)
        else:
            head = struct.pack("!BBQ", first, _MASKED | 127, size)
        self.line.sendall(head + b"\0\0\0\0" + data)  # a mask of zeros changes nothing

    def ends(self, seconds: float = 20.0) -> bool:
        """Whether the server ends the connection."""
        self.line.settimeout(seconds)
        try:
            while self.line.recv(65536):
                pass
        except TimeoutError:
            return False
        except ConnectionError:
            pass
        return True
