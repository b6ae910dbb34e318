"""``make release``: it commits and tags if everything names the version, and refuses otherwise."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from shutil import copy, which

import pytest

import stickslip as ss

ROOT = Path(__file__).parents[2]
FILES = (
    "src/stickslip/__init__.py",
    "CITATION.cff",
    "packaging/conda/meta.yaml",
    "packaging/release.py",
    "CHANGELOG.md",
    "pyproject.toml",
)
NAMING = FILES[:3]
pytestmark = pytest.mark.skipif(which("git") is None, reason="git is not installed")


def git(root: Path, *arguments: str) -> str:
    identity = ["-c", "user.name=us", "-c", "user.email=us@host.example"]
    command = ["git", "-C", str(root), *identity, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository with what names the version, before its first release."""
    for role in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{role}_NAME", "us")
        monkeypatch.setenv(f"GIT_{role}_EMAIL", "us@host.example")
    for place in FILES:
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        copy(ROOT / place, tmp_path / place)
    change(tmp_path / "pyproject.toml", "/OWNER/", "/us/")
    citation = tmp_path / "CITATION.cff"
    lines = citation.read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith("date-released:")]
    citation.write_text("".join(kept), encoding="utf-8")
    changes = tmp_path / "CHANGELOG.md"
    first = next(x for x in changes.read_text(encoding="utf-8").splitlines() if x[:3] == "## ")
    change(changes, first, f"## {ss.__version__} (unreleased)")
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "--quiet", "--message", "before")
    return tmp_path


def change(path: Path, old: str, new: str) -> None:
    """Replace the first occurrence of a text in a file."""
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def release(root: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(root / "packaging" / "release.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True)


def test_a_release_is_a_commit_and_a_tag(project: Path) -> None:
    done = release(project, ss.__version__)
    assert done.returncode == 0, done.stderr
    assert git(project, "tag", "--list") == f"v{ss.__version__}"
    assert git(project, "log", "-1", "--format=%s") == f"Release {ss.__version__}"
    assert git(project, "status", "--porcelain") == ""
    changed = git(project, "diff", "--name-only", "HEAD~1").splitlines()
    assert changed == ["CHANGELOG.md", "CITATION.cff"]
    text = (project / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## {ss.__version__} (20" in text and "(unreleased)" not in text
    assert "\ndate-released: 20" in (project / "CITATION.cff").read_text(encoding="utf-8")
    assert release(project, "--check", f"v{ss.__version__}").returncode == 0
    again = release(project, ss.__version__)
    assert again.returncode == 1 and "exists" in again.stderr


@pytest.mark.parametrize("place", [*NAMING, "CHANGELOG.md"])
def test_a_version_that_one_file_does_not_name_is_refused(project: Path, place: str) -> None:
    change(project / place, ss.__version__, "7.7.7")
    git(project, "commit", "--quiet", "--all", "--message", "another")
    refused = release(project, ss.__version__)
    assert refused.returncode == 1
    assert f"{place}: version 7.7.7, not {ss.__version__}" in refused.stderr
    assert git(project, "tag", "--list") == ""


def test_what_is_not_ready_is_refused(project: Path) -> None:
    assert "not a version" in release(project, "one").stderr
    assert "has no date" in release(project, "--check", ss.__version__).stderr
    (project / "new.txt").write_text("new", encoding="utf-8")
    assert "has changes" in release(project, ss.__version__).stderr
    (project / "new.txt").unlink()
    change(project / "pyproject.toml", "/us/", "/OWNER/")
    git(project, "commit", "--quiet", "--all", "--message", "no owner")
    assert "Replace OWNER" in release(project, ss.__version__).stderr
    assert git(project, "tag", "--list") == ""


def test_all_files_name_the_same_version_now() -> None:
    refused = release(ROOT, "--check", ss.__version__).stderr
    assert ", not " not in refused and "no version is named" not in refused
