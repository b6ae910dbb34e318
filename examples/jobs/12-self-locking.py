"""Self-locking of a capstan, a wedge, a lever shoe and a screw jack: how large the load may be for a
holding force, or from which friction on nothing moves, beside the closed forms.

Prints each limit and its closed form.
"""

import math

import numpy as np

import stickslip as ss


def threshold(system, name, low, high, moved="x", tolerance=1e-9):
    """The value of a parameter between which the system holds and moves, by bisection."""

    def moves(value):
        motion = ss.simulate(system, parameters={name: value})
        return abs(motion.final[moved] - system.start[moved]) > 1e-9

    first = moves(low)
    while high - low > tolerance * high:
        middle = (low + high) / 2
        low, high = (middle, high) if moves(middle) == first else (low, middle)
    return (low + high) / 2
