"""Blades on a disc, with dry dampers between neighbours."""

import math

import numpy as np

from stickslip.errors import DeclarationError
from stickslip.model import laws
from stickslip.model.system import Parameter, System
from stickslip.structures.damping import ModalDamping
from stickslip.structures.structure import Structure
from stickslip.symbolic.formulas import is_finite

_BLADE, _SECTOR = 0.3, 1.0  # kg
_ROOT, _GROUND, _RIM = 4.3e5, 4.0e6, 1.0e6  # N/m: blade on disc, disc on shaft, between sectors
_RATIO = 0.002  # damping ratio of every mode
_MOST = 100  # blades


def bladed_disk(
    n: float = 4, order: float = 1, mistuning: float = 0.02, **given: float | str
) -> System:
    """n sectors in a ring, each with a blade, under an engine-order excitation, with dry friction
    dampers between neighbouring blades.

    The structure ``u`` has the degrees of freedom ``u[disc_1]``, ..., ``u[blade_1]``, ... A tuned
    disc responds with a travelling wave: every blade moves like the previous one, with a delay of
    order/n of a period. Mistuned blades, which differ slightly, share the energy unevenly.

    Parameters
    ----------
    n : int
        Number of sectors, at least 3.
    order : int
        Engine order: number of periods of the force on a blade per revolution of the disc.
    mistuning : float
        Largest relative deviation of the stiffness of a blade.
    **given : float or str
        Parameters ``F``, ``omega``, ``F_c``, ``k_d``.

    References
    ----------
    J. H. Griffin, A. Sinha, *The interaction between mistuning and friction in the forced response
    of bladed disk assemblies*, J. Eng. Gas Turbines Power 107 (1985) 205-211, for the model; the
    parameter values are our own.
    """
    whole = [is_finite(x) and float(x).is_integer() for x in (n, order)]
    if not (whole[0] and 3 <= n <= _MOST):
        raise DeclarationError(
            "bladed_disk.n", "not a number of sectors", f"Give an integer from 3 to {_MOST}"
        )
    if not (whole[1] and 0 <= order < n):
        raise DeclarationError(
            "bladed_disk.order",
            "not an engine order",
            f"Give an integer from 0 to {int(n) - 1}",
        )
    if not (is_finite(mistuning) and 0.0 <= mistuning < 1.0):
        raise DeclarationError(
            "bladed_disk.mistuning", "not a relative deviation", "Give a number from 0 to below 1"
        )
    n, order = int(n), int(order)
    one = np.eye(n)
    ring = 2.0 * one - np.roll(one, 1, axis=0) - np.roll(one, -1, axis=0)
    # neither periodic nor symmetric
    root = _ROOT * np.diag(1.0 + mistuning * np.cos(2.4 * np.arange(n) ** 2))
    stiffness = np.block([[_GROUND * one + _RIM * ring + root, -root], [-root, root]])
    parts = [f"{part}_{i}" for part in ("disc", "blade") for i in range(1, n + 1)]
    disk = Structure(
        np.diag([_SECTOR] * n + [_BLADE] * n),
        stiffness,
        ModalDamping(_RATIO),
        names=parts,
        unit="m",
    )
    blades = [f"u[blade_{i}]" for i in range(1, n + 1)]
    later = [2.0 * math.pi * order * i / n for i in range(n)]
    return System(
        name="bladed_disk",
        title="Blades on a disc with dry dampers between them",
        source="Griffin and Sinha 1985",
        parameters={
            "F": Parameter(10.0, "N", "amplitude of the force on a blade", "[0, inf)"),
            "omega": Parameter(1190.0, "rad/s", "angular frequency of the force", "(0, inf)"),
            "F_c": Parameter(2.0, "N", "force at which a damper slides", "(0, inf)"),
            "k_d": Parameter(2.0e4, "N/m", "stiffness of a damper", "(0, inf)"),
        },
        structures={"u": disk},
        forces={b: f"F*cos(omega*t - {phase!r})" for b, phase in zip(blades, later, strict=True)},
        contacts={
            f"damper {i}": laws.jenkins(
                f"d_{blades[i % n]} - d_{blades[i - 1]}", unit="N", F_c="F_c", k="k_d"
            )
            for i in range(1, n + 1)
        },
        span=(0, 0.3),
        time_unit="s",
    ).configure(given)
