"""The named measures of long-term motions, one row each.

The command line lists these names, so nothing is imported here.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

UnitKind = Literal[
    "1", "angle", "component", "energy", "force", "growth", "quantity", "rate", "resistance", "time"
]


class Measurable(NamedTuple):
    """A named measure.

    Attributes
    ----------
    meaning : str
        For labels.
    unit : str
        The kind of its unit, a key of :data:`stickslip.model.quantities.UNITS`.
    of : str
        What it may be taken of: a component, a contact, a force, a quantity, a weight; empty:
        nothing.
    said : str
        The meaning in full; if empty, `meaning`.
    least, most : float, optional
        Its bounds, where they are known.
    of_a_span : bool
        Whether it exists if the drive is known for a limited time, as an earthquake record is: the
        declared span is measured then.
    of_any : bool
        Whether that of a formula exists for every outcome, also at rest and if the motion has not
        converged; otherwise only for cycles and steady sliding.
    """

    meaning: str
    unit: UnitKind
    of: str = ""
    said: str = ""
    least: float | None = None
    most: float | None = None
    of_a_span: bool = False
    of_any: bool = False


MEASURABLE: dict[str, Measurable] = {
    "period": Measurable("period", "time", least=0.0),
    "amplitude": Measurable(
        "amplitude", "component", "component", "half the range",
        least=0.0, of_a_span=True, of_any=True,
    ),
    "speed": Measurable(
        "mean speed", "rate", "component", "mean speed along the translation, or of a component",
        of_a_span=True, of_any=True,
    ),
    "stick_fraction": Measurable(
        "stick fraction", "1", "contact",
        "fraction of the time in which all contacts stick, or the given one",
        least=0.0, most=1.0, of_a_span=True,
    ),
    "energy_per_cycle": Measurable(
        "energy dissipated per cycle", "energy", "contact",
        "energy dissipated per cycle by all contacts, or by the given one", least=0.0,
    ),
    "peak_force": Measurable(
        "largest friction force", "force", "contact",
        "largest modulus of the friction force over all contacts, or of the given one",
        least=0.0, of_a_span=True,
    ),
    "mean_force": Measurable(
        "mean friction force", "force", "force",
        "mean friction force of the first contact, or of the given one", of_a_span=True,
    ),
    "switches": Measurable("switches per cycle", "1", least=0.0),
    "lyapunov": Measurable("largest Lyapunov exponent", "growth"),
    "low": Measurable("smallest value", "component", "component", of_a_span=True, of_any=True),
    "high": Measurable("largest value", "component", "component", of_a_span=True, of_any=True),
    "shift": Measurable(
        "shift over the measured time", "component", "component", "change over the measured part",
        of_a_span=True, of_any=True,
    ),
    "state": Measurable(
        "state at which the motion has converged", "component", "component",
        "value at the beginning of the measured part", of_a_span=True, of_any=True,
    ),
    "time": Measurable(
        "time of that state", "time", said="beginning of the measured part", of_a_span=True
    ),
    "duration": Measurable(
        "duration of the measurement", "time", said="duration of the measured part",
        least=0.0, of_a_span=True,
    ),
    "mean": Measurable(
        "mean", "quantity", "quantity", "time average", of_a_span=True, of_any=True
    ),
    "rms": Measurable(
        "root mean square", "quantity", "quantity", least=0.0, of_a_span=True, of_any=True
    ),
    "crest": Measurable(
        "crest factor", "1", "quantity",
        "crest factor: largest absolute value divided by the root mean square",
        least=1.0, of_a_span=True, of_any=True,
    ),
    "harmonic": Measurable(
        "amplitude of the first harmonic", "quantity", "quantity",
        "amplitude of the first harmonic, at the frequency of the drives, or of the cycle if there "
        "are none",
        least=0.0,
    ),
    "phase": Measurable(
        "phase of the first harmonic", "angle", "quantity",
        "phase of the first harmonic, as in amplitude·cos(ωt + phase)",
        least=-math.pi, most=math.pi,
    ),
    "relative_phase": Measurable(
        "phase relative to the drive", "angle", "quantity",
        "phase of the first harmonic relative to the drive, negative for a lag",
        least=-1.5 * math.pi, most=0.5 * math.pi,
    ),
    "energy_per_distance": Measurable(
        "energy dissipated per distance", "resistance", "component",
        "energy dissipated per distance along the translation, or along a component",
    ),
    "cost_of_transport": Measurable(
        "energy per distance and weight", "1", "weight",
        "energy dissipated per distance, divided by a weight",
    ),
}  # fmt: skip
"""The named measures. One more is a row here and a rule in
:mod:`stickslip.sweeps.request.one_period`, or, if the engine sums it up, in
:mod:`stickslip.sweeps.request.measures`."""
