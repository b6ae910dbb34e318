"""Messages that no page of this program sends: a page may ask questions, and nothing else."""

from __future__ import annotations

import asyncio
import json
import os
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tornado.iostream import StreamClosedError
from tornado.websocket import WebSocketClosedError

from explorer.client import TOKEN, Page, get, in_time, talk
from seeds import seeds
from stickslip.explorer.asking.limits import MOST_LANES, MOST_LEVELS
from stickslip.explorer.explore import listening_explorer
from stickslip.explorer.serving import server
from stickslip.explorer.serving.server import Explorer


@pytest.fixture(scope="module")
def explorer() -> Iterator[Explorer]:
    running = listening_explorer(None, port=0).start()
    yield running
    running.close()


async def alive(page: Page) -> bool:
    """Whether questions are still answered."""
    await page.ask("measures", lane="alive")
    return "refused" not in (await page.answer())[0]


def icon(path: Path) -> dict[str, Any]:
    """A model of Bokeh's that reads a file when it is made."""
    return {"type": "object", "name": "CustomAction", "attributes": {"icon": str(path)}}


@pytest.mark.parametrize("attribute", ["tags", "said", "asked"])
def test_a_page_makes_no_objects(explorer: Explorer, tmp_path: Path, attribute: str) -> None:
    """One that would read from a pipe would block the server."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    async def attack(page: Page) -> None:
        event = {"kind": "ModelChanged", "model": {"id": page.wire}, "attr": attribute}
        await page.send("PATCH-DOC", {"events": [event | {"new": [icon(pipe)]}]})
        assert (await page.message())[0]["msgtype"] == "OK"
        await page.send("PULL-DOC-REQ", {})
        assert "CustomAction" not in (await page.message())[1]
        assert await alive(page)

    talk(explorer.address, attack)


def test_a_document_does_not_grow(explorer: Explorer) -> None:
    async def attack(page: Page) -> None:
        root = {"type": "object", "name": "Div", "id": "root", "attributes": {"text": "grown"}}
        await page.send("PATCH-DOC", {"events": [{"kind": "RootAdded", "model": root}]})
        await page.message()
        await page.send("PUSH-DOC", {"doc": {"title": "", "roots": [root], "version": "3.0.0"}})
        header, content, _ = await page.message()
        assert header["msgtype"] == "ERROR"
        assert json.loads(content) == {
            "text": "This kind of message is not supported.",
            "traceback": None,
        }
        await page.send("PULL-DOC-REQ", {})
        assert "grown" not in (await page.message())[1]
        assert await alive(page)

    talk(explorer.address, attack)


@pytest.mark.parametrize("depth", [MOST_LEVELS, 50, 850, 990, 5000])
@pytest.mark.parametrize("what", ["measures", "motion"])
def test_nested_questions_stop_no_worker(explorer: Explorer, depth: int, what: str) -> None:
    async def attack(page: Page) -> None:
        question = {"serial": 1, "lane": "deep", "what": what, "setting": {}, "options": {"x": 0}}
        text = json.dumps(question).replace("0}}", "[" * depth + "]" * depth + "}}")
        await page.say(text)
        assert "refused" in (await page.answer())[0]
        assert await alive(page)

    talk(explorer.address, attack)


@pytest.mark.parametrize("place", ["lane", "what", "model", "toml", "title"])
def test_half_a_character_is_refused(explorer: Explorer, place: str) -> None:
    async def attack(page: Page) -> None:
        half = "\ud800"
        question: dict[str, Any] = {"serial": 1, "lane": "a", "what": "model", "options": {}}
        question["setting"] = {"model": "belt_block"}
        if place in question:
            question[place] = half
        elif place == "title":
            question["setting"] = {"toml": f'name = "s"\ntitle = "{half}"'}
        else:
            question["setting"] = {place: half}
        await page.say(json.dumps(question))
        assert "refused" in (await page.answer())[0]
        assert await alive(page)

    talk(explorer.address, attack)


def test_many_questions_of_one_page(explorer: Explorer) -> None:
    """They wait up to a number, and do not keep another page waiting for long."""

    async def attack(page: Page) -> None:
        setting = {"model": "belt_block", "until": 1e9}  # up to the limit of switches: a second
        for i in range(MOST_LANES + 20):
            await page.ask("motion", setting, lane=f"lane {i}")
        heads = list[dict[str, Any]]()
        while not any("refused" in head for head in heads):
            heads += await page.heads()
        (reason,) = {head["refused"]["reason"] for head in heads if "refused" in head}
        assert "too many requests" in reason
        other = await Page(explorer.address).open()
        await other.ask("motion", {"model": "belt_block"})
        assert await other.answer()
        await other.close()

    talk(explorer.address, attack)


def test_a_token_serves_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who kept tokens gets no more pages than there is room for, and none after it was left."""
    monkeypatch.setattr(server, "_KEEP", 1_000)
    monkeypatch.setattr(server, "_CHECK", 250)
    running = listening_explorer(None, port=0, most_pages=2).start()

    async def room() -> str:
        while True:
            code, text = await asyncio.to_thread(get, running.address)
            if code == 200:
                return TOKEN.findall(text)[0]
            await asyncio.sleep(0.5)

    async def enters(token: str) -> Page | None:
        page = Page(running.address)
        try:
            return await page.open(token=token)
        except (ConnectionError, StreamClosedError):
            await page.close()
            return None

    async def whole() -> None:
        pages = [await enters(token) for token in [await room() for _ in range(4)]]
        entered = [page for page in pages if page is not None]
        assert len(entered) == 2
        for page in entered:
            assert await alive(page)
            await page.close()
        last = await room()  # the others are gone
        page = await enters(last)
        assert page is not None
        assert await enters(last) is None  # beside it
        assert await alive(page)
        await page.close()
        page = await enters(last)  # at once, as a page does whose connection was lost
        assert page is not None
        await page.close()
        await room()
        await asyncio.sleep(2.0)
        assert await enters(last) is None

    try:
        in_time(whole())
    finally:
        running.close()


def random_message(rng: random.Random, wire: str) -> tuple[str, Any]:
    """The type and content of a message: about like those of a page, or not at all."""
    junk: list[Any] = [
        None,
        0,
        -1,
        1e308,
        "",
        "\ud800",
        [],
        {},
        [[]],
        {"id": wire},
        icon(Path("/")),
    ]

    def thing(depth: int = 0) -> Any:
        kind = rng.randrange(8)
        if kind == 0 and depth < 4:
            return [thing(depth + 1) for _ in range(rng.randrange(4))]
        if kind == 1 and depth < 4:
            names = ["kind", "model", "attr", "new", "id", "type", "name", "events", "attributes"]
            return {rng.choice(names): thing(depth + 1) for _ in range(rng.randrange(4))}
        return rng.choice(junk)

    event: dict[str, Any] = {"kind": "ModelChanged", "model": {"id": wire}, "attr": "asked"}
    event["new"] = json.dumps({"serial": 1, "lane": "a", "what": "measures", "setting": thing()})
    kinds = ["ModelChanged", "RootAdded", "RootRemoved", "TitleChanged", "MessageSent"]
    kinds += ["ColumnDataChanged", "ColumnsStreamed", "ColumnsPatched", "???"]
    for _ in range(rng.randrange(4)):
        event[rng.choice([*event])] = thing()
    if rng.random() < 0.5:
        event["kind"] = rng.choice(kinds)
    content = rng.choice(
        [{"events": [event]}, {"events": [event, thing()]}, thing(), {"doc": thing()}]
    )
    types = ["PATCH-DOC"] * 5 + [
        "PUSH-DOC",
        "PULL-DOC-REQ",
        "SERVER-INFO-REQ",
        "OK",
        "ACK",
        "nothing",
    ]
    return rng.choice(types), content


def survived(address: str, seeds: range) -> int:
    """How many random messages end neither the server nor another page, of whose documents they
    change nothing."""
    good = 0

    async def whole() -> int:
        nonlocal good
        other = await Page(address).open()
        page = await Page(address).open()
        await page.send("PULL-DOC-REQ", {})
        before = await _pulled(page)
        for seed in seeds:
            kind, content = random_message(random.Random(seed), page.wire)
            try:
                await page.send(kind, content)
                if seed % 10 == 9:
                    await page.send("PULL-DOC-REQ", {})
                    assert await _pulled(page) == before, (seed, kind, content)
            except (ConnectionError, WebSocketClosedError):  # closed with a sentence
                reason = page.connection.close_reason or ""
                assert "/" not in reason and "Error" not in reason, (seed, reason)
                await page.close()
                page = await Page(address).open()
                await page.send("PULL-DOC-REQ", {})
                before = await _pulled(page)
            good += 1
            if seed % 50 == 0:
                assert await alive(other)
        assert await alive(other)
        await page.close()
        await other.close()
        return good

    return in_time(whole(), 240.0 + len(seeds))


async def _pulled(page: Page) -> int:
    """How long the document is, without what is asked and said."""
    while True:
        header, content, _ = await page.message()
        assert "Traceback" not in content
        if header["msgtype"] == "PULL-DOC-REPLY":
            return content.count('"type":"object"')


def test_random_messages(explorer: Explorer) -> None:
    drawn = seeds(100)
    assert survived(explorer.address, drawn) == len(drawn)
