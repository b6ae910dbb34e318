"""Compiled loops over tables of parameters: constants of every set, and probes of every mode that
is asked for."""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.machine_code.functions import entry_point
from stickslip.machine_code.kinds import MachineFunction
from stickslip.motion.engine import flights
from stickslip.motion.engine.event_loop import probe
from stickslip.motion.engine.forms import SMOOTH, ClosedForms, slots_of
from stickslip.motion.steps.arrays import OPTIONS, Constants, Flow, Machine, flow_of


@entry_point(**OPTIONS)
def run_setups(setup: MachineFunction, table: Array, k: Constants) -> None:
    """Fill the constants of every group (a leading axis) from its row of parameters."""
    for g in range(len(table)):
        setup(table[g], k.K[g], k.M[g], k.C[g], k.J[g], k.omega[g])


@entry_point(**OPTIONS)
def claim(T: ClosedForms, group: Array, mode: Array, region: Array, place: Array) -> None:
    """Give every mode that is asked for the next slot of its group; −1 where it has been asked for
    before.

    Parameters
    ----------
    T : ClosedForms
        Receives the numbers of the modes.
    group : array of int, shape (modes,)
    mode, region : arrays of int, shapes (modes, contacts), (modes, kinks)
    place : array of int, shape (modes,)
        Receives the slots.
    """
    slots = slots_of(T)
    for i in range(len(group)):
        g = group[i]
        key = flights.mode_key(mode[i], region[i])
        place[i] = -1
        if flights.find(T.key, T.own, g * slots, int(T.used[g]), key) < 0:
            place[i] = g * slots + T.used[g]
            T.key[place[i]], T.status[place[i]] = key, SMOOTH
            T.used[g] += 1


@entry_point(**OPTIONS)
def probe_modes(
    machine: Machine,
    flow: Flow,
    group: Array,
    mode: Array,
    region: Array,
    times: Array,
    states: Array,
    out: Array,
    hold: Array,
    found: Array,
) -> None:
    """Probe many modes, as :func:`.event_loop.probe` does one; `found` receives whether all values
    are finite.

    Parameters
    ----------
    machine : Machine
    flow : Flow
        Constants by group (a leading axis).
    group : array of int, shape (modes,)
    mode, region : arrays of int, shapes (modes, contacts), (modes, kinks)
    times : array, shape (modes, points)
    states : array, shape (points, n)
        The same for all modes.
    out, hold : arrays
        As of :func:`.event_loop.probe`, with a leading axis.
    found : array of bool, shape (modes,)
    """
    for i in range(len(group)):
        own = flow_of(flow, group[i])
        found[i] = probe(machine, own, mode[i], region[i], times[i], states, out[i], hold[i])
