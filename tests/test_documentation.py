"""The pages of the documentation: every block of code on them runs and gives what is printed there,
what is generated is complete, and links lead somewhere."""

from __future__ import annotations

import ast
import doctest
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urldefrag

import pytest
import typer
from scipy.io import mmwrite
from scipy.sparse import csr_array, save_npz

import check_site
import stickslip as ss
import stickslip_paper
from bodies import clamped
from making import (
    command_line,
    docstrings,
    gallery,
    markdown,
    model_files,
    offline_pages,
    pages,
    python_reference,
    sessions,
    tables,
    words,
)
from stickslip.cli.app import app
from stickslip.explorer.offline.plan import read_plan
from stickslip.model import laws, system
from stickslip.motion.outcome import Outcome
from stickslip.sweeps.request.measures import MEASURES
from stickslip.symbolic.formulas import builtins
from test_public_face import private

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
GENERATED = ("_build", "gallery", "reference", "generated", "making")
WRITTEN = {
    path.relative_to(DOCS).as_posix(): path.read_text(encoding="utf-8")
    for path in sorted(DOCS.rglob("*.md"))
    if path.relative_to(DOCS).parts[0] not in GENERATED and path.stem not in ("outcomes", "wrong")
}
BLOCK = re.compile(r"^```(\{?[\w-]*\}?)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
# By the least number of statements.
LEAST = {
    "by-example.md": 60,
    "extending.md": 12,
    "fits-elsewhere.md": 40,
    "tutorials/shaken.md": 15,
    "tutorials/memory.md": 10,
    "tutorials/machines.md": 15,
    "tutorials/impacts.md": 15,
    "tutorials/friction-in-a-plane.md": 15,
    "tutorials/bodies-on-points-faces-and-wheels.md": 30,
    "tutorials/gaits.md": 30,
    "tutorials/record-to-map.md": 15,
}
IMPORTED = re.compile(r"^>>> import (\w+)", re.MULTILINE)
HEAVY = {"pymc"}  # its installation takes a minute: what needs it runs where it is there
ELSEWHERE = ("cluster.md",)  # its Python needs a cluster


def blocks(page: str, *languages: str) -> list[str]:
    """The blocks of a page that are in one of the languages."""
    return [block for language, block in BLOCK.findall(WRITTEN[page]) if language in languages]


SESSIONS = [page for page in WRITTEN if blocks(page, "pycon")]
PROGRAMS = [page for page in WRITTEN if blocks(page, "python") and page not in ELSEWHERE]


def statements(page: str) -> list[doctest.Example]:
    """What a page of a session types in, one after the other."""
    sections = re.split("^## ", WRITTEN[page], flags=re.MULTILINE)
    absent = {name for name in HEAVY if find_spec(name) is None}
    absent |= {"fmpy"} if sys.platform == "darwin" else set()  # FMUs have no library for macOS
    kept = [section for section in sections if not absent & {*IMPORTED.findall(section)}]
    found = (pair for section in kept for pair in BLOCK.findall(section))
    text = "".join(block for language, block in found if language == "pycon")
    return doctest.DocTestParser().get_doctest(text, {}, page, None, None).examples


@pytest.mark.filterwarnings("ignore::FutureWarning:arviz")  # on its import, by PyMC
@pytest.mark.parametrize("page", SESSIONS)
def test_sessions(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every block of a page, one after the other, gives what is printed there."""
    monkeypatch.chdir(tmp_path)
    # What a page declares is not known to later tests.
    monkeypatch.setattr(ss.Dissipation, "kinds", dict(ss.Dissipation.kinds))
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    session = doctest.DocTest(statements(page), {}, page, None, None, None)
    said: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(session, out=said.append)
    assert result.attempted > LEAST.get(page, 0)
    assert result.failed == 0, "".join(said)


@pytest.mark.parametrize("page", PROGRAMS)
def test_programs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks(page, "python"):
        exec(compile(block, page, "exec"), names)


def test_long_pages_are_sessions() -> None:
    for page in LEAST:
        languages = {language for language, _ in BLOCK.findall(WRITTEN[page])}
        assert languages - {"{code-cell}", "toml", "ini"} == {"pycon"}


EXECUTED = [page for page in SESSIONS if WRITTEN[page].startswith("---\nfile_format: mystnb")]


def test_all_tutorials_are_executed() -> None:
    assert {page for page in SESSIONS if page.startswith("tutorials/")} <= set(EXECUTED)


@pytest.mark.parametrize("page", EXECUTED)
def test_sessions_are_executed_when_the_site_is_built(page: str) -> None:
    """Every block of a session has a cell that runs it; the cells that draw know its names."""
    source = [WRITTEN[page]]
    pages.to_the_site(None, page, source)
    cells = [code for language, code in BLOCK.findall(source[0]) if language == "{code-cell}"]
    typed = [code for code in cells if "remove-cell" in code]
    assert len(typed) == len(blocks(page, "pycon")) + 1, "one leads to the data"
    known: set[str] = set()
    for cell in cells:
        code = "\n".join(line for line in cell.splitlines() if not line.startswith(":"))
        statement = sessions.statement(code)
        assert not statement.needs - known, page
        known |= statement.makes
    assert len(cells) > len(typed), "for the sake of pictures"


def test_model_files_on_pages_are_read(tmp_path: Path) -> None:
    prose = (DOCS / "making" / "prose" / "model-files.md").read_text(encoding="utf-8")
    texts = [block for page in WRITTEN for block in blocks(page, "toml")]
    texts += [block for language, block in BLOCK.findall(prose) if language == "toml"]
    assert len(texts) >= 2
    mass, stiffness = clamped(8)
    mmwrite(tmp_path / "M.mtx", mass)
    save_npz(tmp_path / "K.npz", csr_array(stiffness))
    for text in texts:
        (tmp_path / "model.toml").write_text(text, encoding="utf-8")
        assert ss.load(tmp_path / "model.toml").contacts


@pytest.mark.parametrize("page", [page for page in WRITTEN if blocks(page, "{code-cell}")])
def test_cells_know_public_names_alone(page: str) -> None:
    """They are executed when the site is built."""
    for block in blocks(page, "{code-cell}"):
        code = "\n".join(line for line in block.splitlines() if not line.startswith(":"))
        ast.parse(code)
        assert private(code) == []


# -- what is generated -----------------------------------------------------------------------------


@cache
def made_by(make: Callable[[], dict[str, str]]) -> dict[str, str]:
    """Generated pages, made once for all tests."""
    return make()


REFERENCE = made_by(python_reference.pages)


def test_every_public_name_has_its_page() -> None:
    names = [name for name in ss.__all__ if not name.startswith("__")]
    assert {f"reference/python/{name}.rst" for name in names} <= set(REFERENCE)
    placed = [name for group in python_reference.groups().values() for name in group]
    assert len(placed) == len(set(placed))


def test_every_public_name_has_an_example_that_can_be_typed_in_as_it_stands() -> None:
    for place, text in REFERENCE.items():
        if place.endswith(".rst"):
            code = text.partition(".. code-block:: pycon\n")[2].partition("\n.. ")[0]
            known: set[str] = set()
            for example in doctest.DocTestParser().get_examples(code):
                statement = sessions.statement(example.source)
                assert not statement.needs - known, f"{place}: {example.source}"
                known |= statement.makes
            assert known, place


@pytest.mark.parametrize(
    "name", ["load", "Certificate", "HysteresisOperator", "prandtl_ishlinskii"]
)
def test_such_an_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    code = REFERENCE[f"reference/python/{name}.rst"].partition(".. code-block:: pycon\n")[2]
    session = doctest.DocTestParser().get_doctest(code, {}, name, None, None)
    assert doctest.DocTestRunner(verbose=False).run(session).failed == 0


def test_a_new_name_has_its_page_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though nobody has said where it belongs."""
    monkeypatch.setattr(ss, "__all__", [*ss.__all__, "get_me"])
    assert python_reference.groups()["More"][-1] == "get_me"


def test_every_group_names_public_names() -> None:
    grouped = {name for names in python_reference.GROUPS.values() for name in names.split()}
    assert grouped <= set(ss.__all__)


def commands() -> Iterator[tuple[str, Any]]:
    yield from typer.main.get_command(app).commands.items()  # type: ignore[attr-defined]


def test_every_command_and_option_is_told() -> None:
    page = made_by(command_line.pages)["reference/command-line.md"]
    for name, command in commands():
        section = page.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
        for parameter in command.params:
            options = (
                parameter.opts if parameter.param_type_name == "option" else [parameter.metavar]
            )
            assert parameter.hidden or all(str(option) in section for option in options), name


def test_every_key_is_told() -> None:
    page = made_by(model_files.pages)["reference/model-files.md"]
    classes = [c for _, found in model_files.ENTRIES.values() for c in found]
    assert {system.Contact, system.Unilateral, system.Bilateral, system.Jump} < set(classes)
    for cls in (system.System, *classes):
        for row in model_files.keys(cls):
            assert " ".join(row[0].split()) in page
        assert len(model_files.keys(cls)) == len(fields(cls))


def test_every_function_measure_and_outcome_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "embedded", lambda draw: "")  # pictures take their time
    made = tables.pages()
    assert all(f"`{name}(" in made["reference/formulas.md"] for name in builtins())
    assert all(f"`{name}`" in made["reference/measures.md"] for name in MEASURES)
    assert all(f"## {name}\n" in made["reference/laws.md"] for name in laws.all_names())
    assert all(markdown.cell(outcome.message) in made["how-to/outcomes.md"] for outcome in Outcome)


def test_every_system_has_its_page() -> None:
    made = made_by(gallery.pages)
    for name in ss.catalogue.names():
        page = made[f"gallery/{name}.md"]
        assert "<math" in page and "```toml" in page and "## Tests" in page, name


@pytest.mark.parametrize("name", ["belt_block", "puck", "cantilever"])
def test_every_kind_of_system_has_a_thumbnail(name: str) -> None:
    """Of a coordinate, of a path in a plane, of a structure without coordinates."""
    declared = ss.catalogue.get(name)
    start, end = declared.span
    motion = ss.simulate(declared, (start, start + 0.02 * (end - start)))
    (axes,) = gallery.thumbnail(motion).axes
    assert axes.has_data()


def test_the_search_is_asked_for_every_page_that_questions_lead_to() -> None:
    """``make docs`` asks it, in a browser, for the words of ``making.words``."""
    for link in LINK.findall(WRITTEN["questions.md"]):
        assert words.of(urldefrag(link)[0].removesuffix(".md")), link
    asked = words.questions()
    rows = [line for line in WRITTEN["questions.md"].splitlines() if line.startswith("| ")]
    assert len(asked) == len(rows) - 1 and all(asked.values())
    assert asked["What does not certified mean"] == ["how-to/not-certified"]
    every = [word.lower() for page in words.WORDS for word in words.of(page)]
    assert len(every) == len(set(every)), "a word means one page"


def test_words_of_a_question_are_found_one_by_one() -> None:
    assert words.keys("How do I find a periodic motion") == "find periodic motion"
    assert {"find", "periodic", "motion"} <= set(words.single("how-to/branches"))
    assert words.single("no page") == []


def test_words_stand_before_the_title() -> None:
    for text in ("# A\n\nb\n", "---\nc: d\n---\n\n# A\n\nb\n"):
        marked = words.marked("start", text)
        assert "```{index} ! install, ! pip install" in marked
        assert marked.replace(marked[marked.index("```{") : marked.index("# A")], "") == text
    assert words.marked("no page", "# A\n") == "# A\n"


def test_attributes_are_read_off_docstrings() -> None:
    told = docstrings.described(system.Contact)
    assert told["unit"] == ("str", "Unit of the friction force.")
    assert set(told) == {item.name for item in fields(system.Contact)}


# -- numbers that the prose quotes -----------------------------------------------------------------

PROSE = {
    **WRITTEN,
    **{
        name: (ROOT / name).read_text(encoding="utf-8")
        for name in ("README.md", "CHANGELOG.md", "CITATION.cff", "paper/paper.md")
    },
}
TRUTH = (ROOT / "benchmarks" / "results" / "truth.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (\**)([^|*]+)\1 \| (\d+) \| (\d+) \|", re.MULTILINE)
COUNTED = re.compile(r"(\d+)\s+(?:of its |of the paper's )?(?:statements|claims)\b")


def test_the_number_of_claims_is_that_of_the_paper() -> None:
    quoted = {
        (page, int(number)) for page, text in PROSE.items() for number in COUNTED.findall(text)
    }
    number = len(stickslip_paper.claims())
    assert quoted == {("README.md", number), ("project/paper.md", number)}


def test_the_number_of_random_systems_is_that_of_the_report() -> None:
    """Pages say it in words, so that only the report has to change after a run."""
    compared = {
        name: int(number) for bold, name, number, _ in ROW.findall(TRUTH) if bold and name != "all"
    }
    families = {name for bold, name, _, _ in ROW.findall(TRUTH) if not bold}
    assert sum(compared.values()) >= 20_000 and len(families) > 100
    for page, text in PROSE.items():
        for sentence in re.findall(r"[^.|]*\brandom\s+systems\b[^.|]*", text):
            assert not re.search(r"\d{4}|\d,\d{3}", sentence), page
            if "housands" in sentence:
                assert re.search(r"[Tt]ens\s+of\s+thousands", sentence), page


def test_sums_of_the_report_are_those_of_its_tables() -> None:
    seen = 0
    for section in re.split(r"^## ", TRUTH, flags=re.MULTILINE):
        said = re.search(r"(\d+) compared, (\d+) agreed", section)
        rows = [row for row in ROW.findall(section) if row[0] and row[1] != "all"]
        if said and rows:
            sums = [sum(int(row[k]) for row in rows) for k in (2, 3)]
            assert [int(said[1]), int(said[2])] == sums
            seen += 1
    assert seen >= 3


# -- links -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("page", "results"),
    [("how-to/holding.md", "holding"), ("theory/benchmark-problem.md", "cart_pendulum")],
)
def test_tables_of_measurements_are_those_that_were_written(page: str, results: str) -> None:
    text = (ROOT / "benchmarks" / "results" / f"{results}.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) > 10
    assert [row for row in rows if row not in WRITTEN[page].splitlines()] == []


def test_the_size_of_an_installation_is_what_was_measured() -> None:
    told = (ROOT / "benchmarks" / "results" / "installed.md").read_text(encoding="utf-8")
    core, everything = (
        re.search(rf"^\| the core{name} \| \d+ \| (\d+) \|$", told, re.MULTILINE)
        for name in ("", " and `all`")
    )
    assert core is not None and everything is not None
    said = f"the core takes {core[1]} MB of disk space and `stickslip[all]` {everything[1]} MB"
    assert said in WRITTEN["start.md"]


def test_pages_with_sliders_are_of_the_catalogue_and_small() -> None:
    """Their values are admissible, and each has a card in the gallery; the build computes them."""
    assert len({page.system for page in offline_pages.PAGES}) == 6
    overview = made_by(gallery.pages)["gallery/index.md"]
    for page in offline_pages.PAGES:
        plan = read_plan(ss.catalogue.get(page.system), page.over)
        assert 10 <= len(plan.points) <= 100
        assert f":link: pages/{page.system}.html" in overview
        declared = ss.catalogue.get(page.system).values
        # It opens on the declared motion.
        assert all(declared[slider.name] in slider.values for slider in plan.sliders), page.system


def test_links_lead_somewhere() -> None:
    """From page to page; ``make docs`` looks at the built site, and at places on pages, too."""
    generated = {
        place for maker in pages.MAKERS if maker is not tables for place in made_by(maker.pages)
    }
    generated |= {f"reference/{name}.md" for name in ("formulas", "laws", "measures", "index")}
    generated |= {"how-to/outcomes.md", "wrong.md"}
    for page, text in WRITTEN.items():
        for link in LINK.findall(re.sub(r"```.*?```", "", text, flags=re.DOTALL)):
            place = unquote(urldefrag(link)[0])
            if re.match(r"[a-z]+:", place) or not place:
                continue
            target = (DOCS / page).parent / place
            inside = target.resolve()
            known = inside.is_relative_to(DOCS) and inside.relative_to(DOCS).as_posix() in generated
            assert known or target.exists(), f"{page}: {link}"


GOOD = '<link rel="stylesheet" href="a.css"><a href="https://example.org">x</a><p id="here"></p>'
BAD = '<script src="https://example.org/a.js"></script><img src="//example.org/a.png">'


def test_what_asks_the_network_is_found() -> None:
    assert check_site.requests(check_site.Page(GOOD)) == []
    assert len(check_site.requests(check_site.Page(BAD))) == 2
    styled = check_site.Page('<p style="background: url(https://example.org/a.png)"></p>')
    assert check_site.requests(styled) == ["https://example.org/a.png"]


def test_a_broken_link_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check_site, "without_page", lambda site: iter(()))
    (tmp_path / "a.css").write_text("@import '//example.org/b.css';", encoding="utf-8")
    (tmp_path / "a.html").write_text(GOOD + '<a href="#here">y</a>', encoding="utf-8")
    (tmp_path / "b.html").write_text(
        '<a href="a.html#gone">y</a><a href="c.html">z</a>', encoding="utf-8"
    )
    assert list(check_site.faults(tmp_path)) == [
        "b.html: a.html#gone has no such place",
        "b.html: there is no c.html",
        "a.css fetches //example.org/b.css",
    ]


def test_the_site_imports_nothing_that_tests_lack() -> None:
    """Sphinx is needed by two files alone, which the pages do not need."""
    assert not any(name.startswith("making.mathml") for name in sys.modules)
