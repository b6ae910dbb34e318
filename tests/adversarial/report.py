"""What a run found: a table by family, and every reason with a reproduction."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any

from .verdict import AGREED, KINDS, NO_REFERENCE, NOT_CERTIFIED, REFUSED, WRONG

Row = Mapping[str, Any]
COLUMNS = ("compared", *KINDS)


def counts(rows: Iterable[Row]) -> Counter[str]:
    """How often each verdict; compared is everything for which there is a reference."""
    found = Counter(row["verdict"] for row in rows)
    found["compared"] = sum(found.values()) - found[NO_REFERENCE]
    return found


def table(rows: Sequence[Row]) -> str:
    """Counts by kind and family, as Markdown."""
    lines = [f"| family | {' | '.join(COLUMNS)} |", "|---|" + "---:|" * len(COLUMNS)]
    for kind, own in grouped(rows, "kind").items():
        lines.append(_line(f"**{kind}**", own))
        lines += [_line(family, some) for family, some in grouped(own, "family").items()]
    return "\n".join(lines)


def _line(name: str, rows: Sequence[Row]) -> str:
    found = counts(rows)
    return f"| {name} | {' | '.join(str(found[column]) for column in COLUMNS)} |"


def grouped(rows: Iterable[Row], key: str) -> dict[str, list[Row]]:
    """Rows by an entry, in the order in which its values came first."""
    groups: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        groups[row[key]].append(row)
    return dict(groups)


def reasons(rows: Sequence[Row]) -> str:
    """Every reason of everything that did not agree: how often, in which families, and its smallest
    reproduction."""
    parts = []
    for verdict in (WRONG, NOT_CERTIFIED, REFUSED, NO_REFERENCE):
        own = [row for row in rows if row["verdict"] == verdict]
        if not own:
            continue
        parts.append(f"## {verdict[0].upper()}{verdict[1:]}: {len(own)}")
        for note, some in sorted(grouped(own, "note").items(), key=lambda item: -len(item[1])):
            parts += [f"### {note}: {len(some)}", _example(some)]
    return "\n\n".join(parts)


def _example(rows: Sequence[Row]) -> str:
    families = ", ".join(f"{name} ({len(own)})" for name, own in grouped(rows, "family").items())
    least = min(rows, key=lambda row: len(row.get("reproduction", "")))
    numbers = "\n".join(f"# {name}: {value}" for name, value in least["numbers"].items())
    script = (
        f"# {least['family']}, seed {least['seed']}\n{least.get('reproduction', '')}\n{numbers}"
    )
    return f"Families: {families}.\n\n```python\n{script}\n```"


def summary(rows: Sequence[Row]) -> str:
    """The whole report, as Markdown."""
    off = [
        row["numbers"]["difference"]
        for row in rows
        if row["verdict"] == AGREED and "difference" in row["numbers"]
    ]
    found = counts(rows)
    head = [f"{len(rows)} cases: " + ", ".join(f"{found[name]} {name}" for name in COLUMNS) + "."]
    if off:
        head.append(
            f"Where both agree, the median of the largest relative difference is {median(off):.1e}."
        )
    return "\n\n".join(["\n".join(head), table(rows), reasons(rows)]) + "\n"
