"""Fixtures that several folders share."""

from __future__ import annotations

from functools import partial

import pytest

from stickslip.motion import problem, simulate


@pytest.fixture(params=["closed forms", "Taylor steps"])
def flow(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Which flow `simulate` takes: closed forms where modes are affine, or Taylor steps
    everywhere."""
    monkeypatch.setattr(
        simulate, "pose", partial(problem.pose, exact=request.param == "closed forms")
    )
    return request.param
