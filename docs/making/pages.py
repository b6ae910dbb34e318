"""All that is generated, written where Sphinx reads it, and what is changed on the way."""

from __future__ import annotations

import doctest
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from making import (
    command_line,
    examples,
    gallery,
    markdown,
    model_files,
    offline_pages,
    python_reference,
    records,
    sessions,
    tables,
    words,
)

if TYPE_CHECKING:
    from docutils import nodes

MAKERS = (python_reference, command_line, model_files, tables, gallery, records)
ROOT = Path(__file__).parents[2]
_OUTSIDE = {
    "../CONTRIBUTING.md": "/generated/contributing.md",
    "../CHANGELOG.md": "/generated/changelog.md",
    "../SECURITY.md": "/generated/security.md",
    "../benchmarks/results/truth.md": "/generated/truth.md",
}


def texts() -> dict[str, str]:
    """Every generated page, by its place in the folder of the documentation."""
    made = {place: text for maker in MAKERS for place, text in maker.pages().items()}
    return made | {"reference/index.md": markdown.filled("reference")}


def write(folder: Path) -> None:
    """Write what is new or has changed; remove what is not generated any more."""
    made = texts()
    for place, text in made.items():
        path = folder / place
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    for room in ("reference", "gallery", "generated"):
        for path in (folder / room).rglob("*.*"):
            if path.suffix in (".md", ".rst") and path.relative_to(folder).as_posix() not in made:
                path.unlink()
    gallery.pictures(folder / "gallery" / "pictures")
    examples.pictures(folder / "gallery" / "pictures")
    offline_pages.write(folder / "_build")


def to_the_site(app: Any, place: str, source: list[str]) -> None:
    """Links to files of the repository go to their pages, words for the search into the index;
    sessions are typed in."""
    for outside, inside in _OUTSIDE.items():
        source[0] = source[0].replace(f"]({outside})", f"]({inside})")
    source[0] = words.marked(place, source[0])
    if source[0].startswith(_EXECUTED):
        source[0] = typed_in(source[0])


def with_keywords(app: Any, document: nodes.document) -> None:
    """The words by which a page is to be found, also those that it does not use itself."""
    from docutils import nodes

    found = words.single(app.env.docname)
    if found:
        document += nodes.meta(name="keywords", content=", ".join(found))


_EXECUTED = "---\nfile_format: mystnb\n"
_DATA = f"import os\nos.symlink({str(ROOT / 'examples')!r}, 'examples', True)\n"


def typed_in(text: str) -> str:
    """A page that is executed: behind each block of a session a cell that is not shown runs it, so
    that the cells which draw know its names, and find the data of the examples."""

    def hidden(code: str) -> str:
        return f"```{{code-cell}} python\n:tags: [remove-cell]\n{code}```\n\n"

    def run(found: re.Match[str]) -> str:
        examples = doctest.DocTestParser().get_examples(found[1])
        return f"{found[0]}\n\n{hidden(''.join(example.source for example in examples))}"

    return sessions.BLOCK.sub(run, text).replace("```pycon\n", hidden(_DATA) + "```pycon\n", 1)


_VERBATIM = re.compile(r"(``.*?``|`[^`]*`)")


def plain_bars(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Bars in docstrings are moduli, no substitutions; a name that ends in _ is no reference."""
    for i, line in enumerate(lines):
        parts = _VERBATIM.split(line)
        parts[::2] = [re.sub(r"\|", r"\\|", part) for part in parts[::2]]
        if not line.lstrip().startswith((">>>", "...")):
            lines[i] = "".join(parts)
