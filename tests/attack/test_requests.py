"""Requests that no browser sends by itself: other names, addresses, methods and sizes."""

from __future__ import annotations

import socket
import time
from contextlib import ExitStack

import pytest

from attack.victim import Victim
from explorer.client import get

REFUSED = {
    "Host": (
        "0.0.0.0",
        "127.0.0.2",
        "127.1",
        "2130706433",
        "0x7f000001",
        "localhost.",
        "127.0.0.1:99999",
        "127.0.0.1:x",
        "127.0.0.1#evil.example",
        "127.0.0.1/evil.example",
        "127.0.0.1\\@evil.example",
        "[::ffff:127.0.0.1]",
        "::1",
        "evil.example#@127.0.0.1",
        "127.0.0.1, evil.example",
        "\u00e2\u0093\u009bocalhost",  # a letter that some fold to l, in bytes
    ),
    "Origin": (
        "",
        "file://",
        "chrome-extension://abc",
        "http://127.0.0.1.evil.example",
        "http://evil.example/127.0.0.1",
        "http://127.0.0.1@evil.example",
        "http://evil.example#127.0.0.1",
        "http://[::1",
        "http://127.0.0.1:99999",
        "javascript:127.0.0.1",
        "http://localhost\\.evil.example",
        "http://LOCALHOST.evil.example",
    ),
}


@pytest.mark.parametrize("header", REFUSED)
def test_no_name_that_looks_like_ours(victim: Victim, header: str) -> None:
    found = {name: get(victim.address, **{header: name})[0] for name in REFUSED[header]}
    assert set(found.values()) <= {400, 403}, found


# TOKEN is that of the address; the last number is what answers, 0 for a connection that ends.
ADDRESSES = {
    "//": 404,
    "/token/": 404,
    "/TOKENx/": 404,
    "/x/../TOKEN/": 404,
    "/./TOKEN/": 404,
    "/TOKEN//": 404,
    "/TOKEN/static/../../etc/passwd": 404,
    "/TOKEN/static/js/..%2f..%2fserver.py": 404,
    "/TOKEN/static/js/bokeh.min.js%00": 404,
    "/TOKEN/static/js/bokeh-.min.js": 404,
    "/TOKEN/favicon.ico/../x": 404,
    "/TOKEN/ws": 400,  # no upgrade
    "http://evil.example/TOKEN/": 404,
    "*": 404,
}


def test_no_address_that_looks_like_ours(victim: Victim) -> None:
    token = victim.path.strip("/")
    swapped = token.swapcase()
    found = {
        shape: victim.status_of(shape.replace("TOKEN", token).replace("token", swapped))
        for shape in ADDRESSES
    }
    assert found == ADDRESSES
    zero = f"GET /{token}/\0 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode()
    assert b" 200 " not in victim.said_to(zero).partition(b"\r\n")[0]


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "PROPFIND"])
def test_no_other_method(victim: Victim, method: str) -> None:
    assert victim.status_of(victim.path, method) in (400, 405)
    assert victim.status_of(victim.path, method, body=b"a" * 1000) in (400, 405)


def test_what_is_too_long_is_not_kept(victim: Victim) -> None:
    """Headers, addresses and bodies that are announced, or come, beyond what a page sends."""
    before = victim.memory
    assert victim.status_of(victim.path, more=f"X: {'a' * 60_000}\r\n") == 200
    assert victim.status_of(victim.path, more=f"X: {'a' * 1_000_000}\r\n") in (0, 400, 431)
    assert victim.status_of(f"{victim.path}?x={'a' * 1_000_000}") in (0, 400, 414, 431)
    announced = f"Content-Length: {10**12}\r\n"
    assert victim.status_of(victim.path, "POST", announced) in (0, 400, 405, 413)
    for _ in range(10):
        victim.status_of(victim.path, "POST", body=b"a" * 1_000_000)
    assert not victim.memory > before + 30.0
    assert victim.serves()


def test_requests_that_never_end_keep_nobody_out(victim: Victim) -> None:
    with ExitStack() as stack:
        lines = [
            stack.enter_context(socket.create_connection(victim.place, 10.0)) for _ in range(150)
        ]
        for line in lines:
            line.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ")
        for _ in range(3):
            for line in lines:
                line.sendall(b"a")
            time.sleep(0.05)
        assert get(victim.address)[0] == 200
        assert victim.serves()
