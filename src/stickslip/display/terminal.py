"""Tables and line breaks of formulas for a terminal."""

from __future__ import annotations

from stickslip.display.symbols import width

_COLUMNS = 100
_OPERATORS = (" + ", " − ", " = ", " ∋ ", "; ")


def pad(text: str, columns: int) -> str:
    """Fill with blanks to the given width."""
    return text + " " * (columns - width(text))


def text_table(rows: list[list[str]]) -> list[str]:
    """Format rows as a table; empty columns are omitted, the last column is wrapped."""
    columns = [column for column in zip(*rows, strict=True) if any(column)]
    if not columns:
        return []
    widths = [max(map(width, column)) for column in columns[:-1]]
    left = sum(w + 3 for w in widths)
    lines = []
    for *cells, last in zip(*columns, strict=True):
        start = "".join(pad(cell, w + 3) for cell, w in zip(cells, widths, strict=True))
        first, *more = wrap_words(last, max(20, _COLUMNS - 2 - left)) or [""]
        lines += [(start + first).rstrip(), *(" " * left + line for line in more)]
    return lines


def wrap_words(text: str, columns: int) -> list[str]:
    """Words in lines of at most the given width."""
    lines: list[str] = []
    for word in text.split(" "):
        if lines and width(lines[-1]) + 1 + width(word) <= columns:
            lines[-1] += " " + word
        else:
            lines.append(word)
    return lines


def wrap(text: str, breaks: tuple[str, ...] = _OPERATORS, columns: int = _COLUMNS - 4) -> list[str]:
    """Break a formula before an operator, as far outside of brackets as possible."""
    lines = []
    rest = text
    indent = ""
    while width(indent + rest) > columns:
        depth = 0
        best = (99, 0)
        for i, c in enumerate(rest):
            if width(indent + rest[:i]) > columns:
                break
            depth += (c in "([{") - (c in ")]}")
            if i > 12 and any(rest.startswith(b, i) for b in breaks) and depth <= best[0]:
                best = (depth, i + (1 if rest[i] == " " else 2))
        if best[1] == 0:
            break
        lines.append(indent + rest[: best[1]].rstrip())
        rest = rest[best[1] :].lstrip()
        indent = "    "
    return [*lines, indent + rest]
