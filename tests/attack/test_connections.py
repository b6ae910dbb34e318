"""Connections of pages whose bytes no browser sends, and many of them."""

from __future__ import annotations

import asyncio
import os
import random
import time
import zlib

import pytest

from attack.victim import BINARY, CONTINUED, TEXT, Line, Victim
from explorer.client import Page, get, in_time
from seeds import seeds


def altered(token: str) -> dict[str, str]:
    """Tokens that are not the one that the server has signed."""
    payload, _, signature = token.rpartition(".")
    return {
        "another end": token[:-3] + ("AAA" if token[-3:] != "AAA" else "BBB"),
        "another payload": f"{payload[::-1]}.{signature}",
        "no signature": payload,
        "nothing": "x",
    }


def test_a_token_that_was_changed_opens_nothing(victim: Victim) -> None:
    token = victim.token
    for name, other in altered(token).items():
        with victim.connected(other) as line:
            assert not line.is_greeted(), name
    with victim.connected(token) as line:
        assert line.is_greeted()


def pieces(line: Line) -> None:
    """12 MB in frames that are each short."""
    for i in range(400):
        line.send(b"x" * 30_000, kind=CONTINUED if i else TEXT, last=False)


def parts(line: Line) -> None:
    """A message with more parts than anybody waits for."""
    line.send(b'{"msgid": "1", "msgtype": "PATCH-DOC", "num_buffers": 1000000000}')
    line.send(b"{}")
    line.send(b"{}")
    for _ in range(200):
        line.send(b"y" * 60_000)


def binary(line: Line) -> None:
    """Bytes in the place of text."""
    line.send(os.urandom(300), kind=BINARY)


def not_text(line: Line) -> None:
    """Text that is not UTF-8."""
    line.send(b"\xff\xfe\x00")


@pytest.mark.parametrize("attack", [pieces, parts, binary, not_text])
def test_what_is_no_message_ends_the_connection(victim: Victim, attack: object) -> None:
    assert callable(attack)
    before = victim.memory
    with victim.connected() as line:
        try:
            attack(line)
            assert line.ends()
        except ConnectionError:
            pass  # it has ended already
    assert not victim.memory > before + 60.0
    assert victim.serves()


def test_a_message_that_unpacks_to_much_is_not_unpacked(victim: Victim) -> None:
    """100 MB of zeros, in 100 kB; who asks for compression may be told that there is none."""
    before = victim.memory
    packer = zlib.compressobj(wbits=-15)
    packed = packer.compress(b"\0" * 100_000_000) + packer.flush(zlib.Z_SYNC_FLUSH)
    with victim.connected(extensions="permessage-deflate") as line:
        line.send(packed.removesuffix(b"\0\0\xff\xff"), deflated=True)
        assert line.ends()
    assert not victim.memory > before + 60.0
    assert victim.serves()


def test_random_frames(victim: Victim) -> None:
    """Whatever comes over a connection, other pages are answered."""
    for seed in seeds(12):
        rng = random.Random(seed)
        with victim.connected() as line:
            try:
                for _ in range(rng.randrange(1, 6)):
                    data = rng.choice(
                        [rng.randbytes(rng.randrange(200)), b"{}", b"[", b"null", b""]
                    )
                    kind = rng.choice([TEXT, TEXT, BINARY, CONTINUED, 3, 8, 9, 10])
                    line.send(data, kind, last=rng.random() < 0.8, deflated=rng.random() < 0.1)
            except ConnectionError:
                pass
    assert victim.process.poll() is None
    assert victim.serves()


def test_pages_that_leave_together_keep_nobody_waiting(victim: Victim) -> None:
    async def whole() -> float:
        pages = [await Page(victim.address).open() for _ in range(6)]
        for page in pages:
            await page.close()
        longest = 0.0
        ends = time.monotonic() + 6.0  # their sessions end within
        while time.monotonic() < ends:
            begun = time.monotonic()
            await asyncio.to_thread(get, victim.address, "/")
            longest = max(longest, time.monotonic() - begun)
            await asyncio.sleep(0.1)
        return longest

    assert in_time(whole()) < 3.0
