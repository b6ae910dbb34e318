"""Who may come in, and what happens to those who may not, ask too much, or ask nonsense."""

from __future__ import annotations

import asyncio
import json
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import pytest
from bokeh.document import Document
from bokeh.models import Div
from bokeh.server.views.ws import WSHandler
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from explorer.client import Page, get, talk
from stickslip.errors import DeclarationError, StickslipError
from stickslip.explorer.asking.limits import MOST_MESSAGE, SECONDS
from stickslip.explorer.asking.request import PageSetting, read_request, read_state
from stickslip.explorer.explore import listening_explorer
from stickslip.explorer.serving.access import OVERRIDDEN, Guarded, Leaving, QuestionHandler
from stickslip.explorer.serving.server import Explorer


def test_the_page_is_there_for_who_knows_its_address(explorer: Explorer) -> None:
    status, text = get(explorer.address)
    assert status == 200
    assert "stickslip explorer" in text
    parts = urlsplit(explorer.address)
    for name in ("localhost", "127.0.0.1", "[::1]", "LOCALHOST"):
        assert get(explorer.address, Host=f"{name}:{parts.port}")[0] == 200


def test_a_bokeh_that_would_not_be_guarded_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A method of another name would be called in place of ours."""
    own = {
        name for name, value in vars(QuestionHandler).items() if name[:1] == "_" and callable(value)
    }
    assert own - {*vars(object)} == {*OVERRIDDEN[WSHandler]}
    assert {*OVERRIDDEN[next(cls for cls in OVERRIDDEN if cls is not WSHandler)]} - {
        *vars(Guarded)
    } == {"get_sessions"}  # which is called
    monkeypatch.delattr(WSHandler, "_receive")
    with pytest.raises(StickslipError, match="WSHandler has no method _receive"):
        listening_explorer(None, port=0).start()


@pytest.mark.parametrize(
    "name", ["evil.example", "evil.example:5106", "127.0.0.1.evil.example", ""]
)
def test_a_rebound_name_is_refused(explorer: Explorer, name: str) -> None:
    """A name of somebody else that points to this machine: host and origin agree, and neither is on
    the list."""
    assert get(explorer.address, Host=name)[0] == 403
    assert get(explorer.address, Host=name, Origin=f"http://{name}")[0] == 403


def test_another_origin_is_refused(explorer: Explorer) -> None:
    assert get(explorer.address, Origin="https://evil.example")[0] == 403
    assert get(explorer.address, Origin="null")[0] == 403

    async def knock(headers: dict[str, str]) -> int:
        parts = urlsplit(explorer.address)
        request = HTTPRequest(f"ws://{parts.netloc}{parts.path}ws", headers=headers)
        try:
            await websocket_connect(request, subprotocols=["bokeh", "x"])
        except HTTPClientError as error:
            return error.code
        return 0

    assert asyncio.run(knock({"Origin": "http://evil.example"})) == 403
    assert asyncio.run(knock({})) == 403  # a browser always names one


@pytest.mark.parametrize("path", ["/", "/x/", "/static/js/bokeh.min.js", "/ws"])
def test_without_the_token_there_is_nothing(explorer: Explorer, path: str) -> None:
    status, text = get(explorer.address, path)
    assert status == 404
    assert "Bokeh" not in text and "Traceback" not in text


@pytest.mark.parametrize(
    "rest",
    ["metadata", "autoload.js", "static/../../../etc/passwd", "static/js/bokeh.js.map", "static/"],
)
def test_no_route_but_those_of_the_page(explorer: Explorer, rest: str) -> None:
    assert get(explorer.address, urlsplit(explorer.address).path + rest)[0] == 404


def test_a_session_is_signed(explorer: Explorer) -> None:
    """Who makes up a token of a session is not connected."""

    async def knock() -> object:
        parts = urlsplit(explorer.address)
        request = HTTPRequest(
            f"ws://{parts.netloc}{parts.path}ws", headers={"Origin": f"http://{parts.netloc}"}
        )
        forged = "eyJzZXNzaW9uX2lkIjogIngiLCAic2Vzc2lvbl9leHBpcnkiOiA5OTk5OTk5OTk5fQ.AAAA"
        try:
            connection = await websocket_connect(request, subprotocols=["bokeh", forged])
        except HTTPClientError as error:
            return error.code
        said = await asyncio.wait_for(connection.read_message(), 20)
        connection.close()
        await asyncio.sleep(0.1)
        return said

    assert asyncio.run(knock()) in (None, 403)


def test_more_names_by_option() -> None:
    running = listening_explorer(None, port=0, names=("lab.example",)).start()
    try:
        assert get(running.address, Host="lab.example")[0] == 200
        assert get(running.address, Host="other.example")[0] == 403
    finally:
        running.close()


def test_a_message_of_100_mb_ends_the_connection_and_nothing_else(explorer: Explorer) -> None:
    async def flood(page: Page) -> object:
        try:
            await page.say("x" * 100_000_000)
            return await page.connection.read_message()
        except Exception as error:
            return error

    talk(explorer.address, flood)
    assert get(explorer.address)[0] == 200


def test_a_message_that_is_too_long_is_answered(explorer: Explorer) -> None:
    async def long(page: Page) -> list[dict]:
        await page.say("x" * (MOST_MESSAGE + 1))
        return await page.heads()

    (head,) = talk(explorer.address, long)
    assert "characters" in head["refused"]["reason"]


HOSTILE = [
    "__import__('os').system('touch /tmp/owned')",
    "().__class__.__bases__[0].__subclasses__()",
    "(" * 5000 + "x" + ")" * 5000,
    "9**9**9**9",
    "sqrt(-1)*1/0",
    "x" * 4001,
    "\x00",
    "lambda: 0",
]


@pytest.mark.parametrize("formula", HOSTILE)
def test_hostile_formulas_are_refused_by_name(explorer: Explorer, formula: str) -> None:
    async def ask(page: Page) -> list[dict]:
        await page.ask("motion", {"model": "rocking_toy", "values": {"H_R": formula}})
        return await page.answer()

    heads = talk(explorer.address, ask)
    refused = heads[0]["refused"]
    assert refused["reason"]
    assert "internal error" not in refused["reason"]


@pytest.mark.parametrize(
    ("entry", "line"),
    [
        ("drives.a", '{file = "/etc/passwd", time = "t", value = "a"}'),
        ("structures.u", '{mass = "/home/M.mtx", stiffness = "/home/K.mtx"}'),
    ],
)
def test_a_model_from_a_page_reads_no_files(explorer: Explorer, entry: str, line: str) -> None:
    toml = (
        'name = "spy"\ncoordinates.x = {kind = "inertial"}\nkinetic = "d_x**2/2"\n'
        f"{entry} = {line}\n"
    )

    async def ask(page: Page) -> list[dict]:
        await page.ask("motion", {"toml": toml})
        return await page.answer()

    refused = talk(explorer.address, ask)[0]["refused"]
    assert refused["where"] == entry
    assert "cannot read files" in refused["reason"]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        "null",
        '{"serial": -1, "lane": "a", "what": "motion"}',
        '{"serial": 1, "lane": 2, "what": "motion"}',
        '{"serial": 1, "lane": "a", "what": "motion", "setting": []}',
        '{"serial": 1, "lane": "a", "what": "motion", "setting": {"values": {"P": null}}}',
        '{"serial": 1, "lane": "a", "what": "motion", "setting": {"initial": {"x": 1e999}}}',
        '{"serial": 1, "lane": "a", "what": "motion", "setting": {"until": "never"}}',
        '{"serial": 1, "lane": "a", "what": "motion", "setting": {"model": "' + "a" * 100 + '"}}',
        "[" * 100_000,
    ],
)
def test_what_is_no_question_is_refused(text: str) -> None:
    with pytest.raises(DeclarationError):
        read_request(text)


def test_an_evolution_from_a_page_reads_no_files(explorer: Explorer) -> None:
    toml = (
        'name = "spy"\nA = 1\nload = "a"\ndissipation.kind = "weighted l1"\n'
        'dissipation.weights = "1"\ndrives.a = {file = "/etc/passwd", time = "t", value = "a"}\n'
    )

    async def ask(page: Page) -> list[dict]:
        await page.ask("evolution", toml=toml)
        return await page.answer()

    refused = talk(explorer.address, ask)[0]["refused"]
    assert refused["where"] == "drives.a"
    assert "cannot read files" in refused["reason"]


def test_a_measure_is_a_name_and_no_program(explorer: Explorer, tmp_path: Path) -> None:
    """What is a measure for the library, ``file.py:function``, is none for a page."""
    code = tmp_path / "evil.py"
    code.write_text(f"open({str(tmp_path / 'owned')!r}, 'w')\ndef f(motion): return 1.0\n")

    async def ask(page: Page) -> list[dict]:
        await page.ask("map", x="V", y="m", measure=f"{code}:f")
        return await page.answer()

    refused = talk(explorer.address, ask)[0]["refused"]
    assert refused["where"] == "measure" and "amplitude" in refused["remedy"]
    assert not (tmp_path / "owned").exists()


def test_what_ends_a_worker_that_prepares_is_not_prepared_again() -> None:
    """The first motion is computed before a page asks for it; if that ends the worker, the next one
    waits."""
    running = listening_explorer("two_block_rate_and_state?until=3e12", port=0).start()
    try:
        pool = running.pool
        assert pool is not None
        ends = time.monotonic() + 30
        while pool.workers[0].job is None and time.monotonic() < ends:
            time.sleep(0.01)
        job = pool.workers[0].job
        assert job is not None and job.page is None
        assert job.request.setting.until == 3e12
        pool.workers[0].process.kill()
        while not (pool.replaced == 1 and pool.workers[0].ready) and time.monotonic() < ends:
            time.sleep(0.01)
        time.sleep(0.2)
        assert pool.workers[0].job is None
    finally:
        running.close()


def test_an_address_is_read_as_the_page_reads_it() -> None:
    found = read_state(
        "rocking_toy?P=6/5&H_R=H_star*(1%20%2B%20psi)%2F2&psi%40=0.6&until=44&.x=x_R&~a=1&toml=x"
    )
    values = {"P": 1.2, "H_R": "H_star*(1 + psi)/2"}
    assert found == PageSetting("rocking_toy", "", values, {"psi": 0.6}, 44.0)
    assert read_state("") == PageSetting("rocking_toy")
    assert read_state("x?a=1/0&b=nan&=3&c") == PageSetting("x", "", {"a": "1/0", "b": "nan"})


def test_unknown_names_are_refused_by_name(explorer: Explorer) -> None:
    async def ask(page: Page) -> list[dict]:
        await page.ask("motion", {"model": "belt_blok"})
        return await page.answer()

    assert "belt_block" in talk(explorer.address, ask)[0]["refused"]["remedy"]


def test_a_thousand_connections(explorer: Explorer) -> None:
    """Whoever connects and says nothing keeps nobody out."""
    parts = urlsplit(explorer.address)
    with ExitStack() as stack:
        for _ in range(min(1000, _files() // 2 - 100)):
            one = stack.enter_context(socket.socket())
            one.connect((parts.hostname, parts.port))
        assert get(explorer.address)[0] == 200
        codes = [get(explorer.address, "/x/")[0] for _ in range(100)]
        assert set(codes) == {404}
    assert get(explorer.address)[0] == 200


def test_no_more_pages_than_there_is_room_for() -> None:
    """A clear word to the others, and when pages are closed there is room again."""
    running = listening_explorer(None, port=0, most_pages=4).start()
    try:
        with ThreadPoolExecutor(8) as pool:
            codes = [code for code, *_ in pool.map(get, [running.address] * 8)]
        assert set(codes) == {200, 503}
        ends = time.monotonic() + 30
        code = 503
        while code == 503 and time.monotonic() < ends:
            time.sleep(0.5)
            code = get(running.address)[0]
        assert code == 200
    finally:
        running.close()


def _files() -> int:
    """How many files this process may open; the server, in the same process, has the other half."""
    resource = pytest.importorskip("resource")
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


def test_a_killed_worker_is_replaced_and_the_page_told(explorer: Explorer) -> None:
    async def ask(page: Page) -> tuple[list[dict], list[dict]]:
        await page.ask("motion", {"model": "two_block_rate_and_state", "until": 3e12})
        pool = explorer.pool
        assert pool is not None
        busy = []
        while not busy:
            busy = [w for w in pool.workers if w.job is not None and w.job.page is not None]
            await asyncio.sleep(0.01)
        busy[0].process.kill()
        lost = await page.answer()
        await page.ask("motion")
        return lost, await page.answer()

    lost, again = talk(explorer.address, ask)
    assert lost[0]["lost"] and "a new worker" in lost[0]["refused"]["reason"]
    assert again[0]["part"] == "motion"
    assert again[1]["certified"]


def test_who_compiles_the_engine_may_take_long_and_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Without machine code that came with the package the first motion takes longer, once."""
    # Longer than a motion may take; and then what is shipped.
    (tmp_path / "sitecustomize.py").write_text(
        "import time\n"
        "from stickslip.machine_code import shelf\n"
        "shipped, there = shelf.shipped, shelf.SHIPPED\n"
        "def make(library, folder, here):\n"
        "    for tell in shelf.listeners:\n"
        "        tell()\n"
        "    time.sleep(2.0)\n"
        "    return shipped(library, shelf.level(), shelf.source_digest(library))\n"
        "shelf.make, shelf.shipped = make, lambda *_: None\n"
        "shelf._is_readable = lambda: False\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("STICKSLIP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setitem(SECONDS, "motion", 1.5)
    running = listening_explorer("rocking_toy", port=0).start()

    async def ask(page: Page) -> list[dict]:
        await page.ask("motion", {"model": "rocking_toy"})
        await asyncio.sleep(1.0)
        await page.ask("motion", {"model": "belt_block"})
        return await page.answer()

    try:
        heads = talk(running.address, ask)
        assert running.pool is not None and running.pool.replaced == 0
    finally:
        running.close()
    assert heads[0].get("compiling")
    assert [head["part"] for head in heads if "part" in head] == ["motion", "verdict"]


def test_closing_a_page_looks_for_no_garbage(monkeypatch: pytest.MonkeyPatch) -> None:
    """That would take a quarter of a second each, in which nobody is answered."""
    leaving, document = Leaving(), Document()
    leaving.modify_document(document)
    document.add_root(Div(text="page"))
    left: list[object] = []

    def leave(session_context: object) -> None:
        left.append(session_context)

    class Receiver:
        """Of changes, as a session is."""

    session = Receiver()
    document.callbacks.on_change_dispatch_to(session)
    document.on_session_destroyed(leave)
    context: Any = SimpleNamespace(_document=document)
    monkeypatch.setattr("gc.collect", lambda generation=2: pytest.fail("it does"))
    document.destroy(session)
    asyncio.run(leaving.on_session_destroyed(context))
    assert left == [context]


def test_a_page_that_is_closed_stops_its_work(explorer: Explorer) -> None:
    pool = explorer.pool
    assert pool is not None

    async def ask(page: Page) -> None:
        await page.ask("motion", {"model": "two_block_rate_and_state", "until": 3e12})
        while not any(w.job and w.job.page and not w.given_up for w in pool.workers):
            await asyncio.sleep(0.01)

    talk(explorer.address, ask)
    ends = time.monotonic() + 20
    while any(w.job is not None for w in pool.workers) and time.monotonic() < ends:
        time.sleep(0.1)
    assert not any(w.job is not None for w in pool.workers)


def test_a_newer_question_takes_the_place_of_an_older_one(explorer: Explorer) -> None:
    async def ask(page: Page) -> list[dict]:
        await page.ask(
            "motion", {"model": "two_block_rate_and_state", "until": 3e12}, lane="motion"
        )
        await asyncio.sleep(0.2)
        await page.ask("motion", {"model": "belt_block"}, lane="motion")
        return await page.answer()

    heads = talk(explorer.address, ask)
    assert len({head["serial"] for head in heads}) == 1
    assert heads[0]["end"] == 50.0
    assert json.dumps(heads)  # and nothing in it that JSON does not know
