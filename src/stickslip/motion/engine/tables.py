"""Compiled loops over tables of parameters: constants of every set."""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.machine_code.functions import entry_point
from stickslip.machine_code.kinds import MachineFunction
from stickslip.motion.steps.arrays import OPTIONS, Constants


@entry_point(**OPTIONS)
def run_setups(setup: MachineFunction, table: Array, k: Constants) -> None:
    """Fill the constants of every group (a leading axis) from its row of parameters."""
    for g in range(len(table)):
        setup(table[g], k.K[g], k.M[g], k.C[g], k.J[g], k.omega[g])
