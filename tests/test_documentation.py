"""The pages that are sessions run, and give what is printed there."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = {"tutorial": 30, "by-example": 60, "extending": 12}  # by the least number of statements
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def statements(page: str) -> list[doctest.Example]:
    """What a page of a session types in, one after the other."""
    found = BLOCK.findall((ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8"))
    text = "".join(block for _, block in found)
    return doctest.DocTestParser().get_doctest(text, {}, page, None, None).examples


@pytest.mark.parametrize("page", PAGES)
def test_pages(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every block of a page, one after the other, gives what is printed there."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    session = doctest.DocTest(statements(page), {}, page, None, None, None)
    said: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(session, out=said.append)
    assert result.attempted > PAGES[page]
    assert result.failed == 0, "".join(said)


def test_pages_hold_nothing_else() -> None:
    for page in PAGES:
        found = BLOCK.findall((ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8"))
        assert {language for language, _ in found} == {"pycon"}
