"""Look at the pages that were built: every link inside leads somewhere, nothing asks the network,
every public name has its page. ``python docs/check_site.py docs/_build/html``"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

# What a browser fetches by itself, by tag and attribute; an ``a`` waits for a click.
_FETCHED = {
    ("link", "href"),
    ("script", "src"),
    ("img", "src"),
    ("img", "srcset"),
    ("source", "src"),
    ("iframe", "src"),
    ("video", "src"),
    ("object", "data"),
    ("embed", "src"),
    ("use", "href"),
}
_HARMLESS_LINKS = {"canonical", "author", "license"}
_ELSEWHERE = re.compile(r"^(?:[a-z][a-z0-9+.-]*:)?//", re.IGNORECASE)
_IN_STYLES = re.compile(r"(?:url\(\s*['\"]?|@import\s+['\"])((?:https?:)?//[^'\")\s]+)")


class Page(HTMLParser):
    """What a page refers to, and what may be referred to in it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.anchors: set[str] = set()
        self.words = 0
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {key: value or "" for key, value in attrs}
        self.anchors |= {given[key] for key in ("id", "name") if given.get(key)}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if tag == "link" and set(given.get("rel", "").split()) & _HARMLESS_LINKS:
            return
        for key, value in given.items():
            if (tag, key) in _FETCHED and value:
                self.fetched.append(value)
        self.fetched += _IN_STYLES.findall(given.get("style", ""))


def requests(page: Page) -> list[str]:
    """What a page would fetch from another machine."""
    return [place for place in page.fetched if _ELSEWHERE.match(place)]


def faults(site: Path) -> Iterator[str]:
    """Everything that is wrong."""
    pages = {
        p.resolve(): Page(p.read_text(encoding="utf-8"))
        for p in sorted(site.rglob("*.html"))
        if "_static" not in p.parts
    }
    for path, page in pages.items():
        name = path.relative_to(site.resolve())
        yield from (f"{name} fetches {place}" for place in requests(page))
        local = [place for place in page.fetched if not _ELSEWHERE.match(place)]
        for link in dict.fromkeys([*page.links, *local]):
            if re.match(r"[a-z][a-z0-9+.-]*:", link, re.IGNORECASE) or link.startswith("//"):
                continue
            place, anchor = urldefrag(link)
            target = (path.parent / unquote(place.partition("?")[0])).resolve() if place else path
            if not target.exists():
                yield f"{name}: there is no {link}"
            elif anchor and target in pages and unquote(anchor) not in pages[target].anchors:
                yield f"{name}: {link} has no such place"
    for path in sorted(site.rglob("*.css")):
        for place in _IN_STYLES.findall(path.read_text(encoding="utf-8")):
            yield f"{path.relative_to(site)} fetches {place}"
    yield from without_page(site)


def without_page(site: Path) -> Iterator[str]:
    """Public names, commands and systems that have no page."""
    import stickslip as ss

    for name in ss.__all__:
        page = site / "reference" / "python" / f"{name}.html"
        if not name.startswith("__") and not page.exists():
            yield f"the public name {name} has no page"
    for name in ss.catalogue.names():
        if not (site / "gallery" / f"{name}.html").exists():
            yield f"the system {name} has no page"


def main() -> None:
    """Print what is wrong, and fail if anything is."""
    site = Path(sys.argv[1])
    found = list(faults(site))
    for fault in found:
        print(fault, file=sys.stderr)
    count = sum(1 for _ in site.rglob("*.html"))
    print(f"{count} pages; {len(found) or 'no'} faults")
    print(f"Open {site / 'index.html'}")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
