"""What an index of packages and a journal are told of the project: addresses, a description whose
links work without the repository, versions that were tried, and the paper."""

from __future__ import annotations

import importlib.util
import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
BUILD = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = BUILD["project"]
REPOSITORY = BUILD["tool"]["hatch"]["metadata"]["hooks"]["custom"]["repository"]
WORKFLOW = (ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


@pytest.fixture(scope="module")
def hooks() -> ModuleType:
    """The build's hooks."""
    pytest.importorskip("hatchling")
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["hatch_build"] = module
    spec.loader.exec_module(module)
    return module


def test_the_repository_is_named_in_one_place(hooks: ModuleType) -> None:
    """All other addresses follow from it."""
    assert REPOSITORY.count("/") == 4 and not REPOSITORY.endswith("/")
    owner = REPOSITORY.split("/")[3]
    others = [
        path.relative_to(ROOT).as_posix()
        for pattern in ("*.md", "*.toml", "*.cff", ".github/**/*.*", "docs/**/*.md", "src/**/*.py")
        for path in ROOT.glob(pattern)
        if f"{owner}/stickslip" in path.read_text(encoding="utf-8")
    ]
    assert others == ["pyproject.toml"]
    found = hooks.urls(REPOSITORY)
    assert {"Homepage", "Documentation", "Source", "Issues", "Changelog"} <= set(found)
    assert all(address.startswith("https://") for address in found.values())


def test_the_description_needs_no_repository(hooks: ModuleType) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = hooks.with_absolute_links(text, "https://host.example/us/it", "v1.2.3")
    before, after = LINK.findall(text), LINK.findall(shown)
    assert len(before) == len(after) > 10
    assert all(link.startswith("https://") for link in after)
    assert (
        "![The block sticks and slips](https://host.example/us/it/raw/v1.2.3/docs/images/block.png)"
        in shown
    )
    assert "](https://host.example/us/it/blob/v1.2.3/docs/start.md)" in shown
    assert "](https://host.example/us/it/tree/v1.2.3/benchmarks/results)" in shown
    for link in before:
        assert link.startswith("https://") or (ROOT / link).exists(), link


def test_only_links_of_the_repository_are_changed(hooks: ModuleType) -> None:
    text = "[a](https://a.example/b) [c](#d) `x[i](t)` ![e](mailto:f)"
    kept = hooks.with_absolute_links(text.replace("`x[i](t)` ", ""), "https://g", "v1")
    assert kept == text.replace("`x[i](t)` ", "")


def test_dependencies_have_lower_bounds_alone() -> None:
    extras = PROJECT["optional-dependencies"].values()
    for text in [*PROJECT["dependencies"], *(text for own in extras for text in own)]:
        needed = text.partition(";")[0]
        assert needed.startswith("stickslip[") or re.fullmatch(
            r"[\w.-]+(\[[\w,]+\])?>=[\w.]+", needed.strip()
        ), text


def test_what_is_declared_is_tried() -> None:
    """Of every Python version of the classifiers, the workflow runs the tests."""
    (matrix,) = re.findall(r"^ +python: \[(.*)\]$", WORKFLOW, flags=re.MULTILINE)
    tried = set(re.findall(r'"([\d.]+)"', matrix))
    said = {x.rpartition(" ")[2] for x in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", x)}
    assert said <= tried
    assert min(tried, key=lambda x: int(x[2:])) == PROJECT["requires-python"].removeprefix(">=")


def test_lowest_versions_are_those_of_the_project() -> None:
    spec = importlib.util.spec_from_file_location("lowest", ROOT / "packaging" / "lowest.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found = module.lowest()
    for text in PROJECT["dependencies"]:
        name, bound = text.split(">=")
        assert found[name] == bound
    assert "bokeh" in found and "pytest" not in found


# -- the paper -------------------------------------------------------------------------------------

PAPER = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
SECTIONS = (
    "Summary",
    "Statement of need",
    "State of the field",
    "Functionality",
    "Software design",
    "Research impact statement",
    "AI usage disclosure",
    "Acknowledgements",
    "References",
)


def entries() -> dict[str, str]:
    """The bibliography, by key."""
    text = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
    return {key: body for key, body in re.findall(r"^@\w+\{(\w+),\n(.*?)^\}", text, re.M | re.S)}


def test_the_paper_has_what_the_journal_asks_for() -> None:
    assert tuple(re.findall(r"^# (.*)$", PAPER, flags=re.MULTILINE)) == SECTIONS
    body = PAPER.split("---\n", 2)[2]
    assert 750 <= len(body.split()) <= 1750
    for place in re.findall(r"\]\((\.\./[^)]+)\)", PAPER):
        assert (ROOT / "paper" / place).exists()


def test_all_that_the_paper_cites_is_listed_with_its_doi() -> None:
    cited = set(re.findall(r"@([A-Z]\w+\d{4})", PAPER))
    known = entries()
    assert cited == set(known)
    without = {key for key, body in known.items() if not re.search(r"doi = \{10\.\d+/\S+\}", body)}
    assert all("institution" in known[key] and "url = " in known[key] for key in without)
