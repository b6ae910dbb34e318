"""Fixtures that several folders share."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

import stickslip
from stickslip.motion import problem, simulate


def pytest_configure() -> None:
    """Forget machine code that is older than any of its sources: numba looks at the file of each function only."""
    package = Path(stickslip.__file__).parent
    motion = [package / "equations" / "codegen" / "series.py", *(package / "motion").rglob("*.py")]
    motion += (package / "sweeps").rglob("*.py")
    evolution = [*(package / "rate_independent").rglob("*.py")]
    for sources in (motion, evolution):
        newest = max(path.stat().st_mtime for path in sources)
        for cached in {cached for path in sources for cached in path.parent.glob("__pycache__/*.nb[ic]")}:
            if cached.stat().st_mtime < newest:
                cached.unlink(missing_ok=True)


@pytest.fixture(params=["closed forms", "Taylor steps"])
def flow(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Which flow `simulate` takes: closed forms where modes are affine, or Taylor steps everywhere."""
    monkeypatch.setattr(simulate, "pose", partial(problem.pose, exact=request.param == "closed forms"))
    return request.param
