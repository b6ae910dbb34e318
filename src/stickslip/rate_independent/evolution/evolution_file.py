"""Model files of evolutions: an :class:`~stickslip.rate_independent.evolution.model.EvolutionModel`
as TOML and back, key by key, without loss.

The language is that of :mod:`stickslip.model.system_file`. The keys from ``A`` to ``span`` are
those of :class:`~stickslip.rate_independent.evolution.evolution.Evolution`; the dissipation has a
``kind`` and the keys of that kind. Every number may be a formula of the parameters, the load also
of the time ``t`` and of drives (formulas of ``t``, or samples), the dissipation of the phase ``s``.
"""

from __future__ import annotations

from functools import partial
from os import PathLike

from stickslip.arguments import validated
from stickslip.model.formats import toml
from stickslip.model.system import Parameter
from stickslip.model.system_file import drive_entry, plain_or
from stickslip.rate_independent.evolution.model import EvolutionModel

_A_SYSTEM = (
    "this file declares a system, not an evolution",
    "Use stickslip.load, or on the command line: stickslip run FILE",
)
EVOLUTIONS = toml.Language(
    EvolutionModel,
    groups=("name", "parameters", "functions", "A", "dissipation", "epsilon"),
    sections={"parameters": partial(plain_or, Parameter), "drives": drive_entry},
    others=dict.fromkeys(("coordinates", "internal", "contacts"), _A_SYSTEM),
)


@validated
def load_evolution(path: str | PathLike[str]) -> EvolutionModel:
    """Load an evolution from a model file.

    Parameters
    ----------
    path : str or path
        A model file in TOML.

    Raises
    ------
    DeclarationError
        If the file cannot be read or anything in it is wrong; the message names the file, the key,
        the reason and the remedy.
    """
    return EVOLUTIONS.load(path)
