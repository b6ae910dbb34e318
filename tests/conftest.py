"""Fixtures that several folders share."""

from __future__ import annotations

import signal
from inspect import unwrap

import pytest

from stickslip import simulate

# What a shell starts in the background ignores Ctrl-C, and so does all that it starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(params=["closed forms", "Taylor steps"])
def flow(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Which flow `simulate` takes where none is asked for: closed forms where modes are affine, or
    Taylor steps everywhere."""
    chosen = "auto" if request.param == "closed forms" else "taylor"
    defaults = unwrap(simulate).__kwdefaults__
    assert defaults is not None
    monkeypatch.setitem(defaults, "flow", chosen)
    return request.param
