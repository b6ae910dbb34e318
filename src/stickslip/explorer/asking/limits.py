"""Limits of the requests of a page, which protect the machine from mistakes and malice."""

from __future__ import annotations

MOST_MESSAGE = 4_000_000  # bytes of a message of a page: a long CSV file
MOST_LEVELS = 8  # levels of nested lists and tables
MOST_TEXT = 200_000  # characters of a model file
MOST_NAMES = 2_000  # values that a page may give
MOST_LANES = 30  # requests of a page that wait
EVENTS_OF_A_PAGE = 200_000  # events of a motion
MOST_MEMORY = 3 * 2**30  # bytes of a worker's data
MOST_PAGES = 60  # pages that are open at the same time
MOST_EXPORT = 60_000_000  # bytes of a file
SECONDS = {"motion": 20.0}  # computing time of a worker for a request …
LONGEST = 300.0  # … for any other request
COMPILING = 3600.0  # … and for the engine's machine code, if the package contains none
