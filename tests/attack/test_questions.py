"""Questions of a page that mean harm: with halves of characters, too large, or of workers that
die."""

from __future__ import annotations

import asyncio
import json
import os
import signal
from contextlib import suppress
from typing import Any

import pytest

from attack.victim import Victim
from explorer.client import Page, talk
from stickslip.explorer.asking.limits import MOST_TEXT

HALF = "\ud800"  # of a character: no text that is written has it
BELT = {"model": "belt_block"}
LONG = {"model": "two_block_rate_and_state", "until": 3e12}  # more than a worker may take
PLACES: dict[str, dict[str, Any]] = {
    "a name of a value": {"what": "motion", "setting": BELT | {"values": {HALF: 1}}},
    "a formula": {"what": "motion", "setting": BELT | {"values": {"mu": HALF}}},
    "a name of a state": {"what": "motion", "setting": BELT | {"initial": {HALF: 1.0}}},
    "a form": {"what": "export", "setting": BELT, "options": {"form": HALF}},
    "a measure": {
        "what": "map",
        "setting": BELT,
        "options": {"x": "V", "y": "m", "measure": HALF},
    },
    "a parameter": {"what": "branch", "setting": BELT, "options": {"over": HALF}},
    "a name of an option": {"what": "measures", "setting": BELT, "options": {HALF: 1}},
}


@pytest.mark.parametrize("place", PLACES)
def test_half_a_character_is_refused_or_ignored(victim: Victim, place: str) -> None:
    async def attack(page: Page) -> None:
        await page.say(json.dumps({"serial": 1, "lane": "a", "options": {}} | PLACES[place]))
        first = (await page.answer())[0]
        assert "internal error" not in str(first)
        assert "refused" in first or place == "a name of an option"
        await page.ask("measures", lane="alive")
        assert "refused" not in (await page.answer())[0]

    talk(victim.address, attack)


def test_large_questions_are_not_collected(victim: Victim) -> None:
    """Each in a lane of its own, with much text, and none is answered soon."""
    before, count = victim.memory, 700

    async def attack(page: Page) -> float:
        for i in range(count):
            question: dict[str, Any] = {"serial": i, "lane": f"lane {i}", "what": "motion"}
            question["setting"] = LONG
            junk = {"junk": "x" * (MOST_TEXT - 1000)}
            await page.say(json.dumps(question | {"options": junk}))
        with suppress(TimeoutError):
            async with asyncio.timeout(10.0):
                while not any(head.get("serial") == count - 1 for head in await page.heads()):
                    pass
        return victim.memory

    assert not talk(victim.address, attack) > before + 60.0
    assert victim.serves()


def test_a_document_that_is_sent_is_not_kept(victim: Victim) -> None:
    before = victim.memory

    async def attack(page: Page) -> float:
        for i in range(25):
            root = {"type": "object", "name": "Div", "id": f"r{i}"}
            root |= {"attributes": {"text": "x" * 3_900_000}}
            await page.send("PATCH-DOC", {"events": [{"kind": "RootAdded", "model": root}]})
            await page.message()
        return victim.memory

    assert not talk(victim.address, attack) > before + 60.0
    assert victim.serves()


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes are not killed like that")
def test_workers_that_are_killed_again_and_again(victim: Victim) -> None:
    """Who asked is told each time, and there are workers again."""
    if not victim.workers:
        pytest.skip("the system does not tell which they are")

    async def attack(page: Page) -> None:
        for i in range(2):
            await page.ask("motion", LONG | {"until": 3e12 + i}, lane="motion")
            answer = asyncio.create_task(page.answer(120.0))
            for seconds in (0.5, 1.0, 2.0, 4.0, 8.0):  # a new one takes a while to be there
                await asyncio.wait({answer}, timeout=seconds)
                if not answer.done():
                    for worker in victim.workers:
                        os.kill(worker, signal.SIGKILL)
            head = (await answer)[0]
            assert head.get("lost") and head["refused"]["reason"]

    talk(victim.address, attack)
    assert victim.serves()
