"""A clamped beam with a dry damper, from finite elements."""

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.model import laws
from stickslip.model.system import DefaultSpan, Parameter, System
from stickslip.structures.damping import ModalDamping
from stickslip.structures.structure import Structure
from stickslip.symbolic.formulas import is_finite

_LENGTH, _BENDING, _DENSITY = 2.0, 2.3125e6, 117.45  # m, N m^2, kg/m: 0.1 m x 0.15 m of steel
_RATIO = 0.01  # damping ratio of every mode
_MOST = 200  # elements


def cantilever(n: float = 8, **given: float | str) -> System:
    """Beam clamped at one end and forced at the other, with a dry friction damper in between.

    The structure ``u`` has the deflection and the rotation of every node; ``u[rub]`` is the
    deflection at the damper, three eighths of the length from the clamp, ``u[tip]`` that of the
    free end. Under a small force the damper sticks.

    Parameters
    ----------
    n : int
        Number of Euler-Bernoulli elements, a multiple of 8.
    **given : float or str
        Parameters ``F``, ``omega``, ``F_c``, ``k_d``; free function ``force`` (at the tip, of t).

    References
    ----------
    M. Krack, J. Gross, *Harmonic Balance for Nonlinear Vibration Problems*, Springer (2019),
    example 8 of NLvib: lowest frequency 123.34 rad/s without the damper, 248.97 rad/s if the beam
    is held there.
    """
    if not (is_finite(n) and float(n).is_integer() and n % 8 == 0 and 8 <= n <= _MOST):
        raise DeclarationError(
            "cantilever.n",
            "not a number of elements with a node at three eighths of the length",
            f"Give a multiple of 8, up to {_MOST}",
        )
    mass, stiffness = _matrices(int(n))
    rub, tip = 3 * int(n) // 4 - 2, 2 * int(n) - 2
    beam = Structure(
        mass, stiffness, ModalDamping(_RATIO), names={"rub": rub, "tip": tip}, unit="m"
    )
    held = [i for i in range(2 * int(n)) if i != rub]
    stuck = Structure(mass[np.ix_(held, held)], stiffness[np.ix_(held, held)])
    return System(
        name="cantilever",
        title="Clamped beam with a dry damper",
        source="Krack and Gross 2019",
        parameters={
            "F": Parameter(2000.0, "N", "amplitude of the force at the tip", "[0, inf)"),
            "omega": Parameter(110.0, "rad/s", "angular frequency of the force", "(0, inf)"),
            "F_c": Parameter(300.0, "N", "force at which the damper slides", "(0, inf)"),
            "k_d": Parameter(1.3e6, "N/m", "stiffness of the damper", "(0, inf)"),
        },
        drives={"force": "F*cos(omega*t)"},
        structures={"u": beam},
        forces={"u[tip]": "force"},
        contacts={"damper": laws.jenkins("d_u[rub]", unit="N", F_c="F_c", k="k_d")},
        span=DefaultSpan((0, 1)),
        time_unit="s",
        facts={
            "omega_free": repr(float(beam.frequencies[0])),
            "omega_fixed": repr(float(stuck.frequencies[0])),
        },
    ).configure(given)


def _matrices(n: int) -> tuple[Array, Array]:
    """Mass and stiffness of n equal elements, without the clamped node."""
    h = _LENGTH / n
    heavy = np.array(
        [
            [156.0, 22 * h, 54.0, -13 * h],
            [22 * h, 4 * h * h, 13 * h, -3 * h * h],
            [54.0, 13 * h, 156.0, -22 * h],
            [-13 * h, -3 * h * h, -22 * h, 4 * h * h],
        ]
    )
    ends = np.array([1.0, h / 2.0, -1.0, h / 2.0])  # bending by a force, and by a moment
    turn = np.array([0.0, h / 2.0, 0.0, -h / 2.0])
    stiff = 12.0 * np.outer(ends, ends) + 4.0 * np.outer(turn, turn)
    mass, stiffness = np.zeros((2, 2 * n + 2, 2 * n + 2))
    for first in range(0, 2 * n, 2):
        part = slice(first, first + 4)
        mass[part, part] += _DENSITY * h / 420.0 * heavy
        stiffness[part, part] += _BENDING / h**3 * stiff
    return mass[2:, 2:], stiffness[2:, 2:]
