"""Ask the search field of the built site what newcomers ask: the words of ``making.words``, and the
questions of docs/questions.md, whole and without their small words. The page that is meant has to
be among the first three it finds. ``python docs/check_search.py docs/_build/html``, with a browser.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import urlencode

sys.path.insert(0, str(Path(__file__).parent))

from making import words

FIRST = 3
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
CHROMIUM = next(filter(None, map(shutil.which, NAMES)), None)
DRIVER = shutil.which("chromedriver")
# The pages that Sphinx's search would show, best first.
ASKED = """
const [, ...parsed] = Search._parseQuery(arguments[0]);
const found = Search._performSearch(arguments[0], ...parsed);
return [...new Set(found.toReversed().map(([page]) => page))];
"""


class Silent(SimpleHTTPRequestHandler):
    """It serves files and says nothing."""

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing."""


def asked() -> Iterator[tuple[str, list[str]]]:
    """What is typed in, and the pages that answer."""
    for page in words.WORDS:
        for query in words.of(page):
            yield query, [page]
    for question, pages in words.questions().items():
        yield question, pages
        yield words.keys(question), pages


def answers(site: Path) -> Iterator[tuple[str, list[str], list[str]]]:
    """What is asked, which pages are meant, and the pages that are found, best first."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.support.ui import WebDriverWait

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Silent, directory=str(site)))
    Thread(target=server.serve_forever, daemon=True).start()
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for flag in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
        options.add_argument(flag)
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    try:
        search = f"http://127.0.0.1:{server.server_port}/search.html?{urlencode({'q': 'friction'})}"
        driver.get(search)
        ready = "return typeof Search !== 'undefined' && Search.hasIndex()"
        WebDriverWait(driver, 60).until(lambda page: page.execute_script(ready))
        for query, pages in asked():
            yield query, pages, driver.execute_script(ASKED, query)
    finally:
        driver.quit()
        server.shutdown()


def main() -> None:
    """Print what is not found, and fail if anything is not."""
    if CHROMIUM is None or DRIVER is None:
        print("no search is tried: chromium and chromedriver are not installed")
        return
    count, missed = 0, 0
    for query, pages, found in answers(Path(sys.argv[1])):
        count += 1
        if not set(pages) & set(found[:FIRST]):
            missed += 1
            print(f"{query!r} finds {json.dumps(found[:5])}, not {pages}", file=sys.stderr)
    print(f"{count} searches; {missed or 'none'} in vain")
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
