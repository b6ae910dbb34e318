"""Seeds of random tests: the same in every run of the tests, others in the weekly job.

``STICKSLIP_SEED=20261128 STICKSLIP_TIMES=20 pytest -m attack`` takes twenty times as many, and
others.
"""

from __future__ import annotations

import os

FIRST = int(os.environ.get("STICKSLIP_SEED", "0"))
TIMES = int(os.environ.get("STICKSLIP_TIMES", "1"))


def seeds(count: int) -> range:
    """So many seeds, and a multiple of them where more are asked for."""
    return range(FIRST * 10**6, FIRST * 10**6 + count * TIMES)
