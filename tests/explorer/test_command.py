"""The command ``explore``, and ``ss.explore``: what they begin with, and how they end."""

from __future__ import annotations

import base64
import re
import signal
import socket
import subprocess
import sys
import time
import zlib
from pathlib import Path
from urllib.parse import parse_qsl

import pytest

import stickslip as ss
from explorer.client import Page, get, talk
from stickslip.errors import DeclarationError
from stickslip.explorer.explore import listening_explorer

COMMAND = [sys.executable, "-m", "stickslip.cli", "explore", "--no-browser"]


def test_it_says_where_it_is_and_ends_with_ctrl_c() -> None:
    """The address opens the page; Ctrl-C ends server and workers, and nothing is complained of."""
    with subprocess.Popen(
        [*COMMAND, "rocking_toy?P=1.2", "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        try:
            found = re.search(r"http://127\.0\.0\.1:\d+/\S+", process.stdout.readline())
            assert found is not None
            assert found[0].endswith("#rocking_toy?P=1.2")
            assert get(found[0])[0] == 200
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
        finally:
            process.kill()
        assert process.stderr.read() == ""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["rocking_to"], "Did you mean 'rocking_toy'?"),
        (["nowhere.toml"], "nowhere.toml"),
        (["--host", "203.0.113.7"], "cannot listen on"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(words: list[str], said: str) -> None:
    done = subprocess.run([*COMMAND, *words], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert said in done.stderr and "Traceback" not in done.stderr


def test_a_port_that_is_taken(tmp_path: Path) -> None:
    """A port that was asked for is refused if it is taken; the usual one gives way to another."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(DeclarationError, match="--port"):
            listening_explorer(None, port=port)


def test_an_evolution_stands_in_the_address(tmp_path: Path) -> None:
    """The text of its model file, as the page packs it; what is wrong with it is said."""
    path = Path(__file__).parents[2] / "examples" / "evolution" / "two-phases.toml"
    explorer = listening_explorer(str(path), port=0)
    try:
        model, _, query = explorer.address.partition("#")[2].partition("?")
        assert model == "rocking_toy"
        state = dict(parse_qsl(query))
        assert state[".panel"] == "friction"
        code = state["evolution"] + "=" * (-len(state["evolution"]) % 4)
        text = zlib.decompress(base64.urlsafe_b64decode(code), wbits=-zlib.MAX_WBITS).decode()
        assert text == ss.load_evolution(path).to_toml()
    finally:
        for one in explorer._place.sockets:
            one.close()
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(path.read_text(encoding="utf-8").replace('"weighted l1"', '"weigthed l1"'))
    with pytest.raises(DeclarationError, match=r"wrong\.toml: dissipation\.kind"):
        listening_explorer(str(wrong), port=0)


def test_from_python_with_a_system_of_ones_own() -> None:
    """The page begins with the system that is given, whatever it is called."""
    system = ss.catalogue.belt_block(V=0.35)
    with_samples = ss.explore(system, port=0, browser=False)
    try:
        assert with_samples.address.endswith("#given")

        async def ask(page: Page) -> list[dict]:
            await page.ask("model", {"model": "given"})
            return await page.answer()

        (described, *_) = talk(with_samples.address, ask)
        values = {p["name"]: p["value"] for p in described["parameters"]}
        assert values["V"] == 0.35
    finally:
        with_samples.close()
    time.sleep(0.2)
    pool = with_samples.pool
    assert pool is not None
    assert all(worker.process.poll() is not None for worker in pool.workers)
