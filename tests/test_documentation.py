"""Every block of docs/tutorial.md, one after the other, gives what is printed there."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial.md"


def test_blocks() -> None:
    text = TUTORIAL.read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 12 and {language for language, _ in blocks} == {"pycon"}
    session = doctest.DocTestParser().get_doctest(
        "".join(block for _, block in blocks), {}, "tutorial", None, None
    )
    said: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(session, out=said.append)
    assert result.attempted > 30
    assert result.failed == 0, "".join(said)
