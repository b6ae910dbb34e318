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
    motion = [package / "equations" / "series.py", *(package / "motion").glob("*.py")]
    motion += (package / "sweeps").glob("*.py")
    evolution = [*(package / "rate_independent").rglob("*.py")]
    for sources in (motion, evolution):
        newest = max(path.stat().st_mtime for path in sources)
        for cached in {cached for path in sources for cached in path.parent.glob("__pycache__/*.nb[ic]")}:
            if cached.stat().st_mtime < newest:
                cached.unlink(missing_ok=True)


# What is slow to compile and used in a few places only: one process compiles it while another gets on with the rest.
ALONE = {
    "maps": ("sweeps/", "adversarial/test_maps.py", "orbits/test_pictures.py"),
    "evolutions": ("rate_independent/", "adversarial/test_averages_evolutions.py", "test_evolution"),
}


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep such tests together where tests are distributed by group."""
    if config.pluginmanager.hasplugin("xdist"):
        here = Path(__file__).parent
        for item in items:
            place = item.path.relative_to(here).as_posix() if item.path.is_relative_to(here) else ""
            group = next((name for name, places in ALONE.items() if place.startswith(places)), None)
            if group:
                item.add_marker(pytest.mark.xdist_group(group))


@pytest.fixture(params=["closed forms", "Taylor steps"])
def flow(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Which flow `simulate` takes: closed forms where modes are affine, or Taylor steps everywhere."""
    monkeypatch.setattr(simulate, "pose", partial(problem.pose, exact=request.param == "closed forms"))
    return request.param
