"""Prepare a release: ``make release VERSION=1.2.3`` makes the commit and the tag; nothing leaves
this machine. With ``--check`` it says whether everything that names the version agrees with it,
as the workflow that publishes a tag asks first."""

from __future__ import annotations

import argparse
import datetime
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
# Files that name the version, and how.
NAMED = {
    "src/stickslip/__init__.py": r'^__version__ = "(.*)"$',
    "CITATION.cff": r"^version: (.*)$",
    "packaging/conda/meta.yaml": r'^\{% set version = "(.*)" %\}$',
    "CHANGELOG.md": r"^## (\S+) \(.*\)$",
}
HEADING = re.compile(r"^## (\S+) \((.*)\)$", re.MULTILINE)
VERSION = re.compile(r"\d+\.\d+\.\d+((a|b|rc)\d+)?\Z")
UNRELEASED = "unreleased"


def disagreements(root: Path, version: str) -> Iterator[str]:
    """What does not agree with a version, and what to do about it."""
    if not VERSION.match(version):
        yield f"'{version}' is not a version. Give one like 1.2.3 or 1.2.3rc1"
    for place, pattern in NAMED.items():
        found = re.search(pattern, (root / place).read_text(encoding="utf-8"), re.MULTILINE)
        if found is None:
            yield f"{place}: no version is named. Expected: {pattern}"
        elif found[1] != version:
            yield f"{place}: version {found[1]}, not {version}. Change it and commit"
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    if "OWNER" in project["tool"]["hatch"]["metadata"]["hooks"]["custom"]["repository"]:
        yield "pyproject.toml: the repository has no owner. Replace OWNER by the account it is on"


def undated(root: Path) -> Iterator[str]:
    """Why the first heading of the changelog is not that of a release."""
    found = HEADING.search((root / "CHANGELOG.md").read_text(encoding="utf-8"))
    if found is None or not re.fullmatch(r"\d{4}-\d{2}-\d{2}", found[2]):
        yield "CHANGELOG.md: the first heading has no date. Run 'make release VERSION=...'"


def unready(root: Path, version: str) -> Iterator[str]:
    """Why the repository cannot be released as it is."""
    if _git(root, "status", "--porcelain"):
        yield "the working tree has changes. Commit them first"
    if _git(root, "tag", "--list", f"v{version}"):
        yield f"the tag v{version} exists. Choose the next version"
    found = HEADING.search((root / "CHANGELOG.md").read_text(encoding="utf-8"))
    if found is not None and found[2] != UNRELEASED:
        yield f"CHANGELOG.md: the first heading says {found[2]}, not {UNRELEASED}"


def release(root: Path, version: str, date: datetime.date) -> None:
    """Date the changelog and the citation, commit, and tag."""
    changes = root / "CHANGELOG.md"
    text = changes.read_text(encoding="utf-8")
    changes.write_text(text.replace(f"({UNRELEASED})", f"({date})", 1), encoding="utf-8")
    citation = root / "CITATION.cff"
    lines = citation.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line.startswith("date-released:")]
    kept.insert(1 + kept.index(f"version: {version}"), f"date-released: {date}")
    citation.write_text("\n".join(kept) + "\n", encoding="utf-8")
    _git(root, "commit", "--quiet", "--message", f"Release {version}", changes.name, citation.name)
    _git(root, "tag", "--annotate", f"v{version}", "--message", f"stickslip {version}")


def _git(root: Path, *arguments: str) -> str:
    command = ["git", "-C", str(root), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def main() -> int:
    """Make the release, or say why not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("version")
    parser.add_argument("--check", action="store_true", help="change nothing")
    given = parser.parse_args()
    version = given.version.removeprefix("v")
    faults = [*disagreements(ROOT, version)]
    faults += undated(ROOT) if given.check else unready(ROOT, version)
    if faults:
        print("\n".join(f"not released: {fault}" for fault in faults), file=sys.stderr)
        return 1
    if not given.check:
        release(ROOT, version, datetime.date.today())
        print(f"Committed and tagged v{version}. To publish it: git push --follow-tags")
    return 0


if __name__ == "__main__":
    sys.exit(main())
