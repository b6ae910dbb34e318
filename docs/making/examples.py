"""The folder of examples: a page each, with the pictures that it draws when the site is built."""

from __future__ import annotations

import ast
import hashlib
import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

import stickslip as ss
from making import docstrings, gallery, markdown

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples"
_SECONDS = 300  # for the pictures of a program
_ONE_AT_A_TIME = Lock()  # drawing in this process


def found() -> dict[str, Path]:
    """Programs and model files, by the names of their pages."""
    models = [path for path in sorted(FOLDER.rglob("*.toml")) if path.name != "pyproject.toml"]
    paths = [*sorted(FOLDER.rglob("*.py")), *models]
    named = {"-".join(p.relative_to(FOLDER).with_suffix("").parts): p for p in paths}
    assert len(named) == len(paths), "two examples of one name"
    return named


def pages() -> dict[str, str]:
    """The page of each; the overview of the gallery lists them (``cards``)."""
    return {f"gallery/examples/{name}.md": _page(name, path) for name, path in found().items()}


def cards() -> str:
    """The cards of all, for the overview."""
    return "\n".join(
        gallery.card(
            f"examples/{name}",
            _title(name, path),
            path.relative_to(FOLDER).as_posix(),
            drawn=bool(_pictures(name)),
        )
        for name, path in found().items()
    )


def _title(name: str, path: Path) -> str:
    if path.suffix == ".toml":
        return _model(path).title
    return name.replace("-", " ").capitalize()


@cache
def _model(path: Path) -> Any:
    evolves = "\ndissipation" in path.read_text(encoding="utf-8")
    return ss.load_evolution(path) if evolves else ss.load(path)


def _page(name: str, path: Path) -> str:
    place, text = path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")
    lines = [f"# {_title(name, path)}\n", _told(path, text) + "\n"]
    for picture in _pictures(name).values():
        lines.append(f"![{_title(name, path)}](../pictures/{picture})\n")
    if path.suffix == ".py":
        lines += [
            markdown.block("text", f"python {place}"),
            "## Program\n",
            markdown.block("python", text.partition('"""\n\n')[2]),
        ]
    else:
        model = _model(path)
        command = "run" if isinstance(model, ss.System) else "evolve"
        lines += [
            markdown.block("text", f"stickslip {command} {place}"),
            "## Equations\n",
            markdown.html(model._repr_html_()),
            "## Model file\n",
            markdown.block("toml", text),
        ]
    return "\n".join([*lines, gallery.checked(re.compile(rf"[\"'/]{_stem(path)}\b"))])


def _stem(path: Path) -> str:
    return re.escape(path.relative_to(FOLDER).with_suffix("").as_posix())


def _told(path: Path, text: str) -> str:
    """What it says of itself: the docstring of a program, the first remark of a model file."""
    if path.suffix == ".py":
        return docstrings.markup(ast.get_docstring(ast.parse(text)) or "")
    remark = re.match(r"(?:#.*\n)+", text)
    lines = [line.removeprefix("#").strip() for line in (remark[0] if remark else "").splitlines()]
    return " ".join(lines).partition(" stickslip ")[0].strip()


# -- pictures --------------------------------------------------------------------------------------


def _pictures(name: str) -> dict[str, str]:
    """Files that an example draws, and where they are put: a program names its own. Jobs take
    minutes, or wait for a reader: tests run them, in a small size."""
    path = found()[name]
    if path.suffix == ".py" and path.relative_to(FOLDER).parts[0] == "jobs":
        return {}
    if path.suffix == ".toml":
        return {"picture.png": f"example-{name}.png"}
    drawn = re.findall(r"[\w-]+\.png", path.read_text(encoding="utf-8"))
    return {picture: f"example-{name}-{picture}" for picture in dict.fromkeys(drawn)}


def pictures(folder: Path) -> None:
    """Draw what is new or has changed; programs are run as a reader would run them, two at once."""
    folder.mkdir(parents=True, exist_ok=True)
    programs = [name for name, path in found().items() if path.suffix == ".py"]
    with ThreadPoolExecutor(2) as pool:
        for _ in pool.map(lambda name: _renew(name, folder), programs):
            pass
    for name in found():
        if name not in programs:  # drawn in this process
            _renew(name, folder)


def _renew(name: str, folder: Path) -> None:
    """The pictures of an example, if it has changed."""
    path = found()[name]
    if not _pictures(name):
        return
    mark = folder / f"example-{name}.made-of"
    now = hashlib.sha256(path.read_bytes() + gallery.code().encode()).hexdigest()
    if mark.exists() and mark.read_text(encoding="utf-8") == now:
        return
    with tempfile.TemporaryDirectory() as place:
        drawn = _run(path, Path(place)) if path.suffix == ".py" else _draw(path, Path(place))
        for picture, put in _pictures(name).items():
            (folder / put).write_bytes((drawn / picture).read_bytes())
    last = folder / list(_pictures(name).values())[-1]
    with _ONE_AT_A_TIME:
        gallery.shrink(last, folder / f"example-{name}-small.png")
    mark.write_text(now, encoding="utf-8")


def _run(path: Path, place: Path) -> Path:
    """The folder into which a program has drawn."""
    (place / "examples").symlink_to(FOLDER, target_is_directory=True)
    ran = subprocess.run(
        [sys.executable, str(Path("examples") / path.relative_to(FOLDER))],
        cwd=place,
        env={**os.environ, "MPLBACKEND": "agg", "PYTHONWARNINGS": "ignore"},
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=_SECONDS,
    )
    assert ran.returncode == 0, ran.stderr
    if not (place / "out").exists():
        return place
    (drawn,) = (place / "out").iterdir()
    return drawn


def _draw(path: Path, place: Path) -> Path:
    """The folder into which what a model file declares was drawn."""
    model = _model(path)
    if isinstance(model, ss.System):
        result: Any = ss.simulate(model)
    else:
        result = ss.evolve(model.problem, steps=model.steps)
    result.plot().savefig(place / "picture.png", dpi=110)
    return place
