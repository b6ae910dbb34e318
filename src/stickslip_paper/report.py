"""The report: claims.json, and a self-contained page."""

from __future__ import annotations

import base64
import json
import math
from collections import Counter
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from stickslip import __version__
from stickslip_paper import claims
from stickslip_paper.making import Made, Work, source_of
from stickslip_paper.sections.claim import Claim, Verdict
from stickslip_paper.typeset import typeset

_INLINE = 1_500_000  # bytes of a vector figure above which the page shows its PNG
_TYPES = {".svg": "image/svg+xml", ".png": "image/png", ".gif": "image/gif"}


def unexpected(work: Work) -> list[Made]:
    """Unexpected results."""
    known = {claim.name: claim for claim in claims()}
    return [made for made in work.done.values() if not made.good(known.get(made.item.key))]


def checked(work: Work) -> list[tuple[Claim, Made]]:
    """The claims that were checked, in the order of the paper."""
    done = {item.key: made for item, made in work.done.items() if item.kind == "claim"}
    return [(claim, done[claim.name]) for claim in claims() if claim.name in done]


def pictures(work: Work, kind: str) -> list[tuple[Any, Made]]:
    """The figures or the animations that were made, in the order of the paper."""
    from stickslip_paper.figures import FIGURES
    from stickslip_paper.moving.animations import ANIMATIONS

    done = {item.key: made for item, made in work.done.items() if item.kind == kind}
    entries: dict[str, Any] = {**(FIGURES if kind == "figure" else ANIMATIONS)}
    return [(entry, done[key]) for key, entry in entries.items() if key in done]


def counts(work: Work) -> dict[str, int]:
    """Number of claims by verdict."""
    found = Counter(made.finding.verdict for _, made in checked(work) if made.finding)
    return {verdict.value: found[verdict] for verdict in Verdict}


def as_data(work: Work, seconds: float) -> dict[str, Any]:
    """Contents of ``claims.json``."""
    return {
        "program": "stickslip",
        "version": __version__,
        "complete": len(work.done) == len(work.items),
        "seconds": round(seconds, 2),
        "verdicts": counts(work),
        "claims": [_claim_data(claim, made) for claim, made in checked(work)],
        "figures": [_picture_data(*pair) for pair in pictures(work, "figure")],
        "animations": [_picture_data(*pair) for pair in pictures(work, "animation")],
    }


def _claim_data(claim: Claim, made: Made) -> dict[str, Any]:
    assert made.finding is not None
    return {
        "place": claim.place,
        "name": claim.name,
        "statement": claim.statement,
        "formula": claim.formula,
        "how": claim.how,
        "measured": made.finding.measured,
        "numbers": dict(made.finding.numbers),
        "verdict": made.finding.verdict.value,
        "expected": claim.expected.value,
        "as_expected": made.good(claim),
        "correction": claim.correction,
        "derivation": claim.derivation,
        "seconds": round(made.seconds, 3),
    }


def _picture_data(entry: Any, made: Made) -> dict[str, Any]:
    return {
        "key": entry.key,
        "title": entry.title,
        "caption": entry.caption,
        "files": list(made.files),
        "error": made.error,
        "seconds": round(made.seconds, 3),
    }


def write_data(work: Work, folder: Path, seconds: float) -> None:
    """Write ``claims.json``."""
    text = json.dumps(_plain(as_data(work, seconds)), indent=2, ensure_ascii=False)
    (folder / "claims.json").write_text(text + "\n", encoding="utf-8")


def _plain(value: Any) -> Any:
    """Data for JSON, which has neither NaN nor infinity."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_page(work: Work, folder: Path, seconds: float) -> None:
    """Write ``index.html``."""
    page = files("stickslip_paper").joinpath("page.html").read_text(encoding="utf-8")
    parts = {
        "summary": _summary(work, seconds),
        "contents": _contents(work),
        "figures": "".join(
            _picture(entry, made, folder) for entry, made in pictures(work, "figure")
        ),
        "animations": "".join(
            _picture(entry, made, folder) for entry, made in pictures(work, "animation")
        ),
        "filters": _filters(work),
        "claims": "".join(_row(claim, made) for claim, made in checked(work)),
    }
    for name, text in parts.items():
        page = page.replace(f"<!--{name}-->", text)
    (folder / "index.html").write_text(page, encoding="utf-8")


# -- parts of the page -----------------------------------------------------------------------------


def _summary(work: Work, seconds: float) -> str:
    shown = [f"{verdict} {count}" for verdict, count in counts(work).items() if count]
    bad = len(unexpected(work))
    missing = len(work.items) - len(work.done)
    text = f"{len(checked(work))} claims checked in {seconds:.0f} s: {', '.join(shown) or 'none'}."
    text += (
        " Every verdict is the expected one."
        if not bad
        else f" {bad} did not come out as expected."
    )
    text += f" Interrupted: {missing} of {len(work.items)} items are missing." if missing else ""
    return f'<p class="summary">{escape(text)} stickslip {escape(__version__)}.</p>'


def _contents(work: Work) -> str:
    links = [(f"figure-{entry.key}", _label(entry.key)) for entry, _ in pictures(work, "figure")]
    links += [(f"animation-{entry.key}", entry.title) for entry, _ in pictures(work, "animation")]
    links += [("claims", "Claims")] if checked(work) else []
    return "".join(f'<a href="#{escape(target)}">{escape(text)}</a>' for target, text in links)


def _label(key: str) -> str:
    return f"Figure {key}" if key[:1].isdigit() else key.capitalize()


def _picture(entry: Any, made: Made, folder: Path) -> str:
    moves = made.item.kind == "animation"
    name = entry.title if moves else f"{_label(entry.key)}. {entry.title}"
    shown = _shown(made, folder)
    alt = escape(f"{entry.title}: {entry.caption}")
    image = (
        f'<img src="{shown}" alt="{alt}">'
        if shown
        else f'<p class="bad">{escape(made.error or "no picture")}</p>'
    )
    code = source_of(entry.make if moves else entry.draw)
    also = f"<p class='files'>{escape(', '.join(made.files))}</p>" if made.files else ""
    return (
        f'<figure id="{made.item.kind}-{escape(entry.key)}">{image}'
        f"<figcaption><b>{typeset(name)}</b> {typeset(entry.caption)}{also}"
        f"<details><summary>code</summary><pre><code>{escape(code)}</code></pre></details></figcaption></figure>\n"
    )


def _shown(made: Made, folder: Path) -> str:
    """The figure as a data URI: the vector graphic unless it is too large."""
    for file in (folder / name for name in sorted(made.files, key=_preference)):
        if file.suffix in _TYPES and (file.suffix != ".svg" or file.stat().st_size <= _INLINE):
            return (
                f"data:{_TYPES[file.suffix]};base64,{base64.b64encode(file.read_bytes()).decode()}"
            )
    return ""


def _preference(name: str) -> int:
    return (*_TYPES, Path(name).suffix).index(Path(name).suffix)


def _filters(work: Work) -> str:
    shown = [("all", "all", len(checked(work)))]
    shown += [
        (v.name.lower(), v.value, counts(work)[v.value]) for v in Verdict if counts(work)[v.value]
    ]
    return "".join(
        f'<button type="button" data-verdict="{key}" '
        f'aria-pressed="{str(key == "all").lower()}">{text} {count}</button>'
        for key, text, count in shown
    )


def _row(claim: Claim, made: Made) -> str:
    assert made.finding is not None
    verdict = made.finding.verdict
    note = (
        ""
        if made.good(claim)
        else f'<br><span class="bad">expected: {escape(claim.expected.value)}</span>'
    )
    return (
        f'<tr data-verdict="{verdict.name.lower()}" id="{claim.name}">'
        f'<td class="place">{escape(claim.place)}</td>'
        f"<td>{typeset(claim.statement)}<div "
        f'class="formula">{typeset(claim.formula)}</div>{_correction(claim)}</td>'
        f'<td class="how">{typeset(claim.how)}</td>'
        f"<td>{typeset(made.finding.measured)}</td>"
        '<td><span class="verdict '
        f'{verdict.name.lower()}">{escape(verdict.value)}</span>{note}</td></tr>\n'
    )


def _correction(claim: Claim) -> str:
    parts: Iterable[tuple[str, str]] = (
        ("Correction", claim.correction),
        ("Because", claim.derivation),
    )
    return "".join(
        f'<div class="correction"><b>{name}:</b> {typeset(text)}</div>'
        for name, text in parts
        if text
    )
