"""A package of the examples as if it were installed: its module, and the entry points that it
declares."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path


def installed(package: Path, into: Path) -> Path:
    """Put modules and entry points of a package into a folder for sys.path, which is returned."""
    project = tomllib.loads((package / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for module in package.glob("*.py"):
        shutil.copy(module, into)
    about = into / f"{project['name']}-{project['version']}.dist-info"
    about.mkdir()
    said = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    (about / "METADATA").write_text(said, encoding="utf-8")
    groups = [
        f"[{group}]\n" + "".join(f"{name} = {place}\n" for name, place in places.items())
        for group, places in project["entry-points"].items()
    ]
    (about / "entry_points.txt").write_text("\n".join(groups), encoding="utf-8")
    return into
