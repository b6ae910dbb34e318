"""A chain of blocks on a belt: the model of Burridge and Knopoff."""

from itertools import pairwise

from stickslip.errors import DeclarationError
from stickslip.model.system import Condition, Contact, DefaultSpan, Inertial, Parameter, System
from stickslip.symbolic.formulas import is_finite

_MOST = 20_000
"""More blocks than this would take minutes to declare."""


def block_chain(N: float = 3, **given: float | str) -> System:
    """N blocks in a row on a moving belt, each held by a spring and connected to its neighbours by
    springs.

    Parameters
    ----------
    N : int
        Number of blocks x_1, ..., x_N.
    **given : float or str
        Parameters ``m``, ``k``, ``k_c``, ``V``, ``F_s``, ``F_k``; free function ``belt`` (speed of
        the belt, of t).

    References
    ----------
    R. Burridge, L. Knopoff, *Model and theoretical seismicity*, Bull. Seismol. Soc. Am. 57 (1967)
    341-371, with static above kinetic friction.
    """
    if not (is_finite(N) and float(N).is_integer() and 1 <= N <= _MOST):
        raise DeclarationError(
            "block_chain.N", "not a number of blocks", f"Give an integer from 1 to {_MOST}"
        )
    blocks = [f"x_{i}" for i in range(1, int(N) + 1)]
    joints = [f"({right} - {left})**2" for left, right in pairwise(blocks)]
    return System(
        name="block_chain",
        title=f"Chain of {len(blocks)} blocks on a belt",
        source="Burridge and Knopoff 1967",
        parameters={
            "m": Parameter(1.0, "kg", "mass of a block", "(0, inf)"),
            "k": Parameter(1.0, "N/m", "stiffness of the spring that holds a block", "[0, inf)"),
            "k_c": Parameter(0.5, "N/m", "stiffness of the spring between two blocks", "[0, inf)"),
            "V": Parameter(0.1, "m/s", "speed of the belt"),
            "F_s": Parameter(1.0, "N", "static friction", "[0, inf)"),
            "F_k": Parameter(0.6, "N", "kinetic friction", "[0, inf)"),
        },
        drives={"belt": "V"},
        coordinates={x: Inertial("m", f"position of block {i}") for i, x in enumerate(blocks, 1)},
        kinetic=f"m/2*({' + '.join(f'd_{x}**2' for x in blocks)})",
        potential=" + ".join(
            [
                f"k/2*({' + '.join(f'{x}**2' for x in blocks)})",
                *([f"k_c/2*({' + '.join(joints)})"] if joints else []),
            ]
        ),
        contacts={
            f"block {i}": Contact(
                f"d_{x}", threshold="F_s", surface_speed="belt", kinetic="F_k", unit="N"
            )
            for i, x in enumerate(blocks, 1)
        },
        # Blocks with equal initial values would move as one.
        initial={x: 0.2 * (i * i % 5) for i, x in enumerate(blocks)},
        span=DefaultSpan((0, 100)),
        time_unit="s",
        conditions={"stick-slip": Condition("F_s > F_k", "static and kinetic friction are equal")},
    ).configure(given)
