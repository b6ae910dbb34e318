"""The command ``paper``, its page and its data."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from stickslip.cli.app import app
from stickslip.errors import DeclarationError
from stickslip_paper import claims, command, making, report
from stickslip_paper.making import Item, Made, Work, items, make, make_all
from stickslip_paper.sections.claim import Finding, Verdict
from stickslip_paper.typeset import typeset

QUICK = ["jacobian_entry", "trace_formula", "duration_function", "example_phases", "period_is_fast"]


def stickslip(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


class Page(HTMLParser):
    """What the tests ask of the page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.images: list[dict[str, str]] = []
        self.ids: list[str] = []
        self.rows: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.links += [
            given[name] for name in ("src", "href", "srcset", "poster", "data") if name in given
        ]
        self.ids += [given["id"]] if "id" in given else []
        if tag == "img":
            self.images.append(given)
        if tag == "tr" and "data-verdict" in given:
            self.rows.append(given["data-verdict"])
        if tag not in ("meta", "link", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Work, Path]:
    """A page of two figures, a film of one frame and a few claims."""
    folder = tmp_path_factory.mktemp("paper")
    work = Work(
        [Item("figure", "3.2"), Item("figure", "4.3"), *(Item("claim", name) for name in QUICK)]
    )
    work.done = {item: make(item, folder) for item in work.items}
    film = Item("animation", "walking")
    gif = base64.b64decode("R0lGODlhAQABAIAAAAAAAP///yH5BAAAAAAALAAAAAABAAEAAAIBRAA7")
    (folder / "walking.gif").write_bytes(gif)
    work.items.append(film)
    work.done[film] = Made(film, 0.1, files=("walking.gif",))
    report.write_data(work, folder, 1.0)
    report.write_page(work, folder, 1.0)
    return work, folder


def test_page(made: tuple[Work, Path]) -> None:
    _, folder = made
    text = (folder / "index.html").read_text(encoding="utf-8")
    page = Page(text)
    assert not page.open
    assert "<!--" not in text.replace("<!doctype", "")
    assert len(page.images) == 3
    for image in page.images:
        assert image["src"].startswith(("data:image/svg+xml;base64,", "data:image/gif;base64,"))
        assert len(image["alt"]) > 30
    for link in page.links:
        assert link.startswith(("data:", "#")), link[:80]
    assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids)
    assert len(set(page.ids)) == len(page.ids)
    assert sorted(page.rows) == ["corrected", "fails", "holds", "holds", "holds"]
    assert "def draw" in text  # the code of the figures


def test_data(made: tuple[Work, Path]) -> None:
    _, folder = made
    data = json.loads((folder / "claims.json").read_text(encoding="utf-8"))
    assert data["complete"] and data["program"] == "stickslip"
    assert data["verdicts"] == {
        "holds": 3,
        "holds as corrected": 1,
        "holds asymptotically": 0,
        "fails": 1,
    }
    assert {entry["name"] for entry in data["claims"]} == set(QUICK)
    for entry in data["claims"]:
        assert entry["as_expected"] and entry["measured"] and entry["seconds"] >= 0
    assert [entry["key"] for entry in data["figures"]] == ["3.2", "4.3"]
    for entry in data["figures"]:
        assert [Path(file).suffix for file in entry["files"]] == [".svg", ".pdf", ".png"]
        assert all((folder / file).stat().st_size > 5000 for file in entry["files"])


LISTENER = """<script>
const seen = [];
addEventListener("error", e => seen.push(String(e.message || e.target.tagName)), true);
for (const name of ["error", "warn"]) console[name] = (...what) => seen.push(what.join(" "));
addEventListener("securitypolicyviolation", e => seen.push(e.blockedURI));
addEventListener("load", () => {
  document.querySelector('button[data-verdict="corrected"]').click();
  const rows = [...document.querySelectorAll("tr[data-verdict]")];
  const shown = rows.filter(row => row.offsetHeight > 0).length;
  const images = [...document.images];
  const broken = images.filter(image => !(image.complete && image.naturalWidth > 0)).length;
  const names = performance.getEntriesByType("resource").map(e => e.name);
  const asked = names.filter(n => !n.startsWith("data:"));
  const found = {seen, broken, asked, shown, images: document.images.length};
  document.documentElement.dataset.found = encodeURIComponent(JSON.stringify(found));
});
</script>"""


def test_page_in_a_browser(made: tuple[Work, Path], tmp_path: Path) -> None:
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no Chromium on this machine (Debian package chromium)")
    page = (made[1] / "index.html").read_text(encoding="utf-8")
    file = tmp_path / "index.html"
    file.write_text(page.replace("<title>", LISTENER + "<title>"), encoding="utf-8")
    options = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        f"--user-data-dir={tmp_path}/profile",
        "--dump-dom",
    ]
    options += ["--enable-logging=stderr", "--host-resolver-rules=MAP * ~NOTFOUND"]
    run = subprocess.run(
        [browser, *options, file.as_uri()], capture_output=True, text=True, timeout=120, check=True
    )
    from urllib.parse import unquote

    (found,) = re.findall(r'data-found="([^"]*)"', run.stdout)
    assert json.loads(unquote(found)) == {
        "seen": [],
        "broken": 0,
        "asked": [],
        "shown": 1,
        "images": 3,
    }
    assert "CONSOLE" not in run.stderr


def test_only(tmp_path: Path) -> None:
    result = stickslip("paper", "--only", "4.2", "--out", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    assert "figures" in result.output
    data = json.loads((tmp_path / "out" / "claims.json").read_text(encoding="utf-8"))
    assert [entry["key"] for entry in data["figures"]] == ["4.2"]
    assert {entry["place"] for entry in data["claims"]} == {"section 4.2", "(4.2a)", "(4.2b,c)"}
    assert (tmp_path / "out" / "figures" / "figure-4.2.svg").exists()
    # Again into the same folder, but not into anybody else's.
    strange = tmp_path / "mine"
    strange.mkdir()
    (strange / "index.html").write_text("mine")
    refused = stickslip("paper", "--only", "4.2", "--out", str(strange))
    assert refused.exit_code == 2 and "not written by stickslip" in refused.output
    assert (strange / "index.html").read_text() == "mine"


def test_what_only_means() -> None:
    assert {item.kind for item in items("4.4")} == {"figure", "claim"}
    assert items("(3.6)") == items("3.6") != []
    assert [item.key for item in items("speed")] == ["speed"]
    assert len(items()) > 100
    with pytest.raises(DeclarationError, match="there is no"):
        items("7.1")
    assert stickslip("paper", "--only", "7.1").exit_code == 2


@pytest.fixture
def nothing_is_made(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, Made]]:
    """The command without its work; what it is to find can be given."""
    found: dict[str, Made] = {}

    def pretend(work: Work, folder: Path, progress: object) -> None:
        work.done = {item: found.get(item.key) or expected(item) for item in work.items}

    monkeypatch.setattr(making, "make_all", pretend)
    yield found


def expected(item: Item) -> Made:
    if item.kind != "claim":
        return Made(item, 0.0, error="nothing drawn")
    return Made(item, 0.0, Finding(making.claim_named(item.key).expected, "as expected"))


def test_unexpected_verdicts_are_told(nothing_is_made: dict[str, Made], tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    assert stickslip("paper", "--only", "(3.6)", "--out", out).exit_code == 0
    item = Item("claim", "limit_beta_equation")
    nothing_is_made[item.key] = Made(item, 0.0, Finding(Verdict.FAILS, "off by 7"))
    result = stickslip("paper", "--only", "(3.6)", "--out", out)
    assert result.exit_code == 1
    assert "off by 7" in " ".join(result.output.split())
    assert "expected: holds as corrected" in (tmp_path / "out" / "index.html").read_text(
        encoding="utf-8"
    )


def test_pictures_that_fail_are_told(nothing_is_made: dict[str, Made], tmp_path: Path) -> None:
    result = stickslip("paper", "--only", "4.3", "--out", str(tmp_path / "out"))
    assert result.exit_code == 1
    assert "nothing drawn" in " ".join(result.output.split())
    assert "nothing drawn" in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")


def test_interrupted(tmp_path: Path) -> None:
    work = Work([Item("claim", name) for name in QUICK])

    def stop(fraction: float, item: Item) -> None:
        raise KeyboardInterrupt

    make_all(work, tmp_path, stop)
    assert work.interrupted and 1 <= len(work.done) <= len(QUICK)
    data = report.as_data(work, 1.0)
    assert len(data["claims"]) == len(work.done)
    assert data["complete"] is (len(work.done) == len(QUICK))


def test_interrupted_command_keeps_what_is_done(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def stopped(work: Work, folder: Path, progress: object) -> None:
        work.done = {item: expected(item) for item in work.items[:2]}
        work.interrupted = True

    monkeypatch.setattr(making, "make_all", stopped)
    result = stickslip("paper", "--only", "(3.6)", "--out", str(tmp_path / "out"))
    assert result.exit_code == 130
    assert "interrupted; 2 of" in result.output
    assert len(json.loads((tmp_path / "out" / "claims.json").read_text())["claims"]) == 2


def test_a_picture_that_stops_leaves_the_others(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from stickslip_paper.figures import FIGURES

    def broken() -> None:
        raise ValueError("no ink")

    monkeypatch.setitem(FIGURES, "4.3", replace(FIGURES["4.3"], draw=broken))
    found = make(Item("figure", "4.3"), tmp_path)
    assert found.error == "ValueError: no ink" and not found.good(None)


def test_folder_that_cannot_be_made(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    for out in (file, file / "below"):
        result = stickslip("paper", "--only", "(3.6)", "--out", str(out))
        assert result.exit_code == 2, result.output
    assert command.NAMES[0] == "claims.json"


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("z_ε ≤ ρ_min", "z<sub>ε</sub> ≤ ρ<sub>min</sub>"),
        ("ψ̇_k, ∂_ψΦ, χ_{K_av}", "ψ̇<sub>k</sub>, ∂<sub>ψ</sub>Φ, χ<sub>K<sub>av</sub></sub>"),
        ("G_L^+ e^{−T} ε^(3/2)", "G<sub>L</sub><sup>+</sup> e<sup>−T</sup> ε<sup>3/2</sup>"),
        ("find_cycle, a < b", "find_cycle, a &lt; b"),
        (
            "1.5e-12, 1e-09, 0.0e+00, 3e+02",
            "1.5·10<sup>−12</sup>, 10<sup>−9</sup>, 0, 3·10<sup>2</sup>",
        ),
    ],
)
def test_typeset(text: str, html: str) -> None:
    assert typeset(text) == html


def test_nothing_in_the_texts_is_left_unset() -> None:
    for claim in claims():
        for text in (claim.statement, claim.formula, claim.correction, claim.derivation):
            assert not re.search(r"[_^]", re.sub(r"<[^>]*>", "", typeset(text))), (claim.name, text)
