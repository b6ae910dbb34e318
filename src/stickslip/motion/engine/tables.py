"""Compiled loops over tables of parameters: constants of every set."""

from __future__ import annotations

from stickslip.arrays import Many, Matrix
from stickslip.machine_code.functions import entry_point
from stickslip.machine_code.interface import Setup
from stickslip.motion.steps.arrays import Constants


@entry_point()
def run_setups(setup: Setup, table: Matrix, k: Many[Constants]) -> None:
    """Fill the constants of every group (a leading axis) from its row of parameters."""
    for g in range(len(table)):
        setup(table[g], k.K[g], k.M[g], k.C[g], k.J[g], k.omega[g])
