"""Exported pages: one file, which asks nothing of anybody, with the motions that the library
computes, rounded for the screen."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner

import stickslip as ss
from explorer.browsing import Keys, Screen
from stickslip.cli.app import app
from stickslip.errors import DeclarationError, StickslipError
from stickslip.explorer.offline.curves import LETTERS, needed
from stickslip.explorer.offline.page import export_page

COMMAND = [sys.executable, "-m", "stickslip.cli", "explore"]
OVER = {"V": "0.2:0.4:3", "F_k": [0.6, 0.8]}


def data_of(path: Path) -> dict[str, Any]:
    """What the scripts of a page read."""
    found = re.search(r'id="data">(.*?)</script>', path.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def numbers(text: str, count: int) -> np.ndarray:
    """Numbers between 0 and 1 of so many letters each."""
    digits = np.array([LETTERS.index(letter) for letter in text]).reshape(-1, count)
    return digits @ 64.0 ** np.arange(count - 1, -1, -1) / (64.0**count - 1)


def curve(packed: dict[str, Any], name: str, times: np.ndarray) -> np.ndarray:
    """A stored curve at given times."""
    shape, low, high = packed["q"][name]
    if shape < 0:
        return np.full(len(times), low)
    at, values = packed["shapes"][shape]
    first, last = packed["t"]
    return low + (high - low) * np.interp(
        times, first + (last - first) * numbers(at, 3), numbers(values, 2)
    )


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page over two parameters, written by the public function."""
    path = tmp_path_factory.mktemp("pages") / "belt.html"
    ss.export(ss.catalogue.belt_block(), path, over=OVER)
    return path


def test_the_command_writes_a_page(tmp_path: Path) -> None:
    """The system is set as in an address; nothing is said on stderr if that is no terminal."""
    path = tmp_path / "belt.html"
    words = ["belt_block?V=0.25&x@=0.1&until=20", "--export", str(path), "--over", "F_k=0.8,0.6"]
    done = subprocess.run([*COMMAND, *words], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stderr == ""
    assert done.stdout.startswith(f"{path}: 2 motions, all certified; ")
    found = data_of(path)
    assert [slider["values"] for slider in found["sliders"]] == [[0.6, 0.8]]
    assert {said["name"]: said["declared"] for said in found["others"]} == {
        "m": 1.0, "k": 1.0, "V": 0.25, "F_s": 1.0, "x": 0.1,
    }  # fmt: skip
    assert found["span"] == [0.0, 20.0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["belt_block", "--export", "page.pdf"], "--export: 'page.pdf' does not end in .html"),
        (["belt_block", "--export", "gone/page.html"], "there is no folder gone"),
        (["belt_blok", "--export", "page.html"], "Did you mean 'belt_block'?"),
        (["--export", "page.html"], "the system is missing"),
        (["belt_block", "--over", "V"], "--over: only exported pages"),
        (["belt_block", "--export", "page.html", "--port", "5"], "needs no server"),
        (["own?toml=abc", "--export", "page.html"], "the URL contains a model"),
        (["belt_block?W=3", "--export", "page.html"], "unknown parameter or function 'W'"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["explore", *words], catch_exceptions=False)
    assert done.exit_code == 2, done.output
    assert said in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("over", "said"),
    [
        (["W=1:2:3"], r"over\.W: unknown parameter"),
        (["W"], r"over W: not a parameter, and without values"),
        (["V=-1:1:3"], r"parameters\.V: -1 is outside"),
        (["V", "V=1"], r"over\.V: given twice"),
        (["V=0.1:1:100", "k=1:2:100"], r"over: 10,000 points are too many"),
        (["V", "k", "m", "F_s"], r"over: 4 parameters were given"),
        (["V,k=1:2:3"], r"over\.V,k: a slider is one parameter"),
        ({"V": "a:b"}, r"over\.V: 'a' is not a number"),
    ],
)
def test_values_that_make_no_sliders(over: Any, said: str, tmp_path: Path) -> None:
    with pytest.raises(DeclarationError, match=said):
        ss.export(ss.catalogue.belt_block(), tmp_path / "page.html", over=over)
    assert list(tmp_path.iterdir()) == []


def test_sliders_belong_to_pages(tmp_path: Path) -> None:
    block = ss.catalogue.belt_block()
    with pytest.raises(DeclarationError, match=r"over: only pages have sliders"):
        ss.export(block, tmp_path / "block.py", over=OVER)
    with pytest.raises(DeclarationError, match=r"quantities: a page shows"):
        ss.export(block, tmp_path / "block.html", "x")
    with pytest.raises(DeclarationError, match=r"'\.html' is the format of a system"):
        ss.export(ss.simulate(block), tmp_path / "block.html")


def test_what_is_interrupted_leaves_the_old_page(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.write_text("the old one", encoding="utf-8")
    told = []

    def stop(fraction: float | None, text: str = "") -> None:
        told.append(text)
        if len(told) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_page(ss.catalogue.belt_block(), path, OVER, progress=stop)
    assert told == ["0 of 6", "1 of 6", "2 of 6"]
    assert path.read_text(encoding="utf-8") == "the old one"
    assert list(tmp_path.iterdir()) == [path]


def test_a_page_that_would_be_too_large_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is refused after a few motions, with the number of those that fit."""
    monkeypatch.setattr("stickslip.explorer.offline.points._MOST_BYTES", 10_000)
    with pytest.raises(DeclarationError, match=r"Use fewer values \(about \d+ motions fit\)"):
        ss.export(ss.catalogue.belt_block(), tmp_path / "page.html", over=OVER)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "over"),
    [
        ("belt_block", {"V": [0.2]}),
        ("bouncing_ball", {"A": [0.0]}),
        ("jenkins_oscillator", {"P": [0.8]}),
        ("rocking_toy", {"P": [1.2]}),
        ("puck", {"mu": [0.3]}),
    ],
)
def test_stored_curves_are_those_of_the_motion(
    name: str, over: dict[str, list[float]], tmp_path: Path
) -> None:
    """At any time between switches, up to a fraction of a pixel; stick phases, too."""
    path = tmp_path / "page.html"
    system = ss.catalogue.get(name)
    ss.export(system, path, over=over)
    (record,) = data_of(path)["records"]
    packed = record["motion"]
    motion = ss.simulate(system, parameters={key: values[0] for key, values in over.items()})
    assert packed["certified"] == motion.certificate.ok
    knots = motion.knots.time
    first, last = packed["t"]
    assert (first, last) == (knots[0], knots[-1])
    # The middle of every smooth part, and many other times that are not near a jump.
    times = np.concatenate([(knots[1:] + knots[:-1]) / 2, np.linspace(first, last, 777)])
    far = np.min(np.abs(times[:, None] - knots), axis=1) > 2e-3 * (last - first)
    times = np.sort(times[far])
    values = motion.at(times)
    for state in set(motion.final) & set(packed["q"]):
        reach = np.ptp(values[state]) or 1.0
        drawn = curve(packed, state, times)
        assert_allclose(drawn, values[state], rtol=0, atol=4e-3 * reach, err_msg=state)
    for key, mode in motion.modes.items():
        ends = first + (last - first) * numbers(packed["stick"][key], 3)
        inside = (np.searchsorted(ends, times) % 2).astype(bool)
        sticks = mode[np.searchsorted(knots, times, side="right") - 1] == 0
        assert np.array_equal(inside, sticks), key


def test_samples_are_few_and_near() -> None:
    """An oscillation takes samples in proportion to its periods; a jump takes two."""
    times = np.linspace(0.0, 1.0, 6001)
    wave = 0.5 + 0.5 * np.sin(2 * np.pi * 40 * times)
    kept = needed(times, wave, 1e-3)
    assert 40 * 16 < len(kept) < 40 * 60
    assert np.max(np.abs(np.interp(times, times[kept], wave[kept]) - wave)) <= 1e-3
    step = np.where(times < 0.3, 0.0, 1.0)
    assert len(needed(times, step, 1e-3)) == 4


def test_without_values_each_parameter_varies_in_turn(tmp_path: Path) -> None:
    """All lines pass through the declared values, whose motion is stored once; a point without a
    motion says why."""
    path = tmp_path / "page.html"
    block = replace(ss.catalogue.belt_block(), span=(0.0, 8.0))
    said = export_page(block, path)
    found = data_of(path)
    assert not found["together"]
    assert [slider["name"] for slider in found["sliders"]] == list(block.parameters)
    counts = [len(slider["values"]) for slider in found["sliders"]]
    assert sum(counts) == len(found["points"])
    assert said.motions + said.missing == len(found["records"]) == sum(counts) - len(counts) + 1
    assert 0 < said.certified < said.motions and not said.ok
    assert path.stat().st_size == said.size < 1_000_000


# -- in a browser ----------------------------------------------------------------------------------


@pytest.fixture
def screen(chromium: Any, page: Path) -> Iterator[Screen]:
    """The page, opened as a file; afterwards its console has no errors, and it has asked for
    itself alone."""
    screen = Screen(chromium, page.as_uri())
    screen.open("")
    yield screen
    said, asked = screen.drain()
    assert said == []
    assert [url.partition("#")[0] for url in asked if not url.startswith("about:")] == [
        page.as_uri()
    ]


def drawn(screen: Screen) -> list[str]:
    """The lines of all figures."""
    return screen.js("[...document.querySelectorAll('.figure .curve')].map((c) => c.outerHTML)")


def test_a_slider_moves_between_stored_motions(screen: Screen) -> None:
    """Its value is a stored one, and what is drawn then is the motion of that value."""
    before = drawn(screen)
    scene = screen.js("document.querySelector('#mechanism svg').outerHTML")
    screen.element("#slider-V").send_keys(Keys.ARROW_RIGHT)
    assert screen.js("document.querySelector('[data-name=V] output').textContent") == "0.4 m/s"
    after = drawn(screen)
    assert len(after) == len(before) and all(
        a != b for a, b in zip(after[:2], before[:2], strict=True)
    )
    screen.js("explorer.clock.set(7), 0")
    assert screen.js("document.querySelector('#mechanism svg').outerHTML") != scene
    motion = ss.simulate(ss.catalogue.belt_block(V=0.4))
    t = screen.numbers("explorer.motion.t")
    x = screen.numbers("explorer.motion.q.x")
    assert_allclose(x, motion.at(t)["x"], rtol=0, atol=4e-3 * np.ptp(x))
    text = screen.element("#motion-said").text
    assert f"Motion certified: finished, {motion.n_switches} switches" in text
    assert screen.element("#command").text == "stickslip run belt_block --set V=0.4"
    screen.drag("#slider-V", -400)
    assert screen.js("document.querySelector('[data-name=V] output').textContent") == "0.2 m/s"


def test_one_cycle_and_the_other_axes(screen: Screen) -> None:
    """The rows show one period; the plane shows other quantities; stick is marked in both."""
    screen.press("#show-cycle")
    cycle = ss.find_cycle(ss.catalogue.belt_block())
    first, last = screen.js("explorer.motion.packed.t")
    assert last - first == pytest.approx(cycle.period)
    assert screen.js("document.querySelectorAll('#plane .curve.ink').length") == 1
    assert screen.js("document.querySelectorAll('#row-0 .held').length") >= 1
    screen.js(
        "(() => { const s = document.getElementById('plane-y'); s.value = 'friction_belt_contact';"
        " s.dispatchEvent(new Event('change')) })(), 0"
    )
    assert "friction" in screen.js(
        "document.querySelector('#plane svg').getAttribute('aria-label')"
    )


def test_the_page_says_what_is_stored(screen: Screen) -> None:
    """Version, model, ranges, certificates; on a phone nothing is wider than the screen."""
    screen.js("document.getElementById('what').open = true, 0")
    text = screen.element("footer").text
    for said in (
        f"stickslip {ss.__version__}", "the model belt_block", "Stored: 6 motions (all certified)",
        "0.2 m/s", "0.4 m/s", "All stored motions and cycles are certified",
    ):  # fmt: skip
        assert said in text
    screen.press("#map svg")
    screen.open("", width=390, height=800)
    assert screen.js("document.documentElement.scrollWidth") == 390


def test_texts_of_a_model_are_texts(chromium: Any, tmp_path: Path) -> None:
    """Titles and meanings of a model file by somebody else are no markup and no scripts; the page
    could not send anything."""
    act = "document.title='seen'"
    evil = f'</script><script>{act}</script><img src=x onerror="{act}">'
    block = ss.catalogue.belt_block()
    speed = replace(block.parameters["V"], meaning=evil)
    system = replace(
        block, title=evil, source=evil, parameters={**block.parameters, "V": speed}, span=(0.0, 3.0)
    )
    path = tmp_path / "evil.html"
    ss.export(system, path, over={"V": [0.3, 0.4]})
    assert "default-src 'none'" in path.read_text(encoding="utf-8")
    screen = Screen(chromium, path.as_uri()).open("")
    assert screen.js("document.title") == evil
    assert screen.js("document.querySelector('h1').textContent") == evil
    assert screen.js("document.querySelectorAll('img').length") == 0
    said, asked = screen.drain()
    assert said == [] and len([url for url in asked if not url.startswith("about:")]) == 1


def test_a_folder_is_no_page(tmp_path: Path) -> None:
    place = tmp_path / "page.html"
    place.mkdir()
    with pytest.raises(StickslipError, match="it is a folder"):
        ss.export(ss.catalogue.belt_block(), place, over=OVER)
