"""The play operator with moving thresholds, exact: [M] section 2.2.

Energy ½ a z² − ℓ(t) z, dissipation potential ρ⁺(t) v for v > 0 and ρ⁻(t) |v| for v < 0. With L = (ℓ
− ρ⁺)/a and U = (ℓ + ρ⁻)/a the solution of 0 ∈ ∂Ψ(t, ż) + a z − ℓ stays between L and U and moves
only when it is pushed: where L and U are monotone, z(t) = min(max(z_k, L(t)), U(t)). So the zeros
of L′ and U′ are all that has to be found.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual, within
from stickslip.equations.field import MODE_NAMES
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.model.entries.samples import Samples
from stickslip.motion.simulate import check_span
from stickslip.motion.trajectory import GRID
from stickslip.numerics.levels import CERTIFIED, ENERGY_SCALE, ROUNDING
from stickslip.rate_independent.play.motion import PlayAudit, PlayMotion
from stickslip.rate_independent.play.nodes import Nodes, PlayBounds, panel_edges, play_nodes
from stickslip.rate_independent.signals.reading import INTERPOLATIONS, is_table, read
from stickslip.rate_independent.signals.signal import OF_PHASE, OF_TIME, Signal
from stickslip.rate_independent.signals.sums import WeightedSignals
from stickslip.results import Completion, Result
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import is_finite

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Given = str | float | Expr | Callable[[Any], Any] | tuple[Any, Any] | Signal
# distance from the stable interval, relative to where it is, that counts as rounding
_STABLE = 1e-12
_LONG_NAMES = {
    "z": "position",
    "d_z": "rate of position",
    "load": "load",
    "threshold_plus": "threshold for a motion upward",
    "threshold_minus": "threshold for a motion downward",
    "friction": "friction force",
    "energy": "energy",
    "dissipated_energy": "dissipated energy",
    "supplied_energy": "supplied energy",
}
_FLAGS = {
    "long_name": "mode",
    "flag_values": np.array(list(MODE_NAMES), np.int8),
    "flag_meanings": " ".join(MODE_NAMES.values()),
}


@validated
def play(
    load: Given,
    threshold: Given | tuple[Given, Given],
    t_span: tuple[float, float],
    *,
    initial: float,
    epsilon: float | None = None,
    stiffness: float = 1.0,
    interpolation: str = "linear",
) -> Play:
    """The play operator with moving thresholds: 0 ∈ ρ(t) Sign(ż) + a z − ℓ(t), exact.

    Parameters
    ----------
    load : str, float, callable or (times, values)
        ℓ: a formula in ``t``, a function of t (vectorised functions are faster), or samples.
    threshold : the same, or a pair of them
        ρ >= 0, or (ρ⁺, ρ⁻) for motion upward and downward.
    t_span : (float, float)
        Start and end.
    initial : float
        z at the start, stable: −ρ⁻ <= ℓ − a z <= ρ⁺.
    epsilon : float, optional
        If given, the threshold is a function of the phase s = t/ε with period 1: a formula in
        ``s``, a function of s, or samples from s = 0 to s = 1.
    stiffness : float
        a > 0.
    interpolation : {"linear", "monotone"}
        Interpolation of samples: piecewise linear, or monotone cubics (PCHIP).

    Returns
    -------
    Play

    Raises
    ------
    DeclarationError
        If an argument is wrong, a value is not finite, a threshold is negative somewhere, or the
        initial state is not stable (the distance and the nearest stable value are named).

    Notes
    -----
    Samples are used directly. Formulas and functions are replaced by polynomials that agree with
    them to about 1e-14 of their largest value (and, where they are steep, to the rounding of t
    times the slope); turning points are then resolved unless the excursion between them is smaller
    than that. The kinks of a formula (abs, min, max, clip, piecewise) are found from the formula,
    and the approximation error is bounded, so no feature is too narrow. The kinks of a function are
    found from polynomials that fail to converge; features of a function narrower than about 1/200
    of the span (of the period, if `epsilon` is given) may be missed, and the certificate states the
    number of sample points.

    Examples
    --------
    >>> motion = ss.play("5*t - t**2", "1 + cos(2*pi*s)/2", (0, 5), initial=0.0, epsilon=0.1)
    >>> round(motion.final, 6)
    0.7414
    >>> motion.certificate.ok
    True

    References
    ----------
    A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
    preprint 2405 (2017), section 2.2.
    """
    span = check_span(t_span)
    for name, value in (("stiffness", stiffness), ("epsilon", epsilon)):
        if value is not None and not (is_finite(value) and value > 0.0):
            raise DeclarationError(
                name, f"{value!r} is not a positive number", "Give a positive number"
            )
    if not is_finite(initial):
        raise DeclarationError(
            "initial", f"{initial!r} is not a finite number", "Give a finite number"
        )
    if interpolation not in INTERPOLATIONS:
        raise DeclarationError(
            "interpolation",
            f"unknown interpolation {interpolation!r}",
            f"Choose from {', '.join(INTERPOLATIONS)}",
        )
    declared = {
        "load": load,
        "threshold": threshold,
        "t_span": span,
        "epsilon": epsilon,
        "stiffness": float(stiffness),
        "interpolation": interpolation,
    }
    bounds = _bounds(**declared)
    edges = panel_edges(bounds, *span)
    nodes = play_nodes(bounds, edges, _stable(bounds, edges, float(initial)))
    return Play(bounds, nodes, declared)


def _bounds(
    load: Given,
    threshold: Given | tuple[Given, Given],
    t_span: tuple[float, float],
    epsilon: float | None,
    stiffness: float,
    interpolation: str,
) -> PlayBounds:
    """Read the given load and thresholds.

    Parameters
    ----------
    load, threshold, t_span, epsilon, stiffness, interpolation
        As in :func:`play`.
    """
    ell = read(load, "load", OF_TIME, (), interpolation).panels(t_span)
    clock = OF_TIME if epsilon is None else OF_PHASE
    plus, *rest = (
        read(part, where, clock, (), interpolation).panels(t_span, epsilon)
        for where, part in _parts(threshold).items()
    )
    return PlayBounds(ell, rest[0] if rest else plus, plus, stiffness)


def _parts(threshold: Any) -> dict[str, Any]:
    """A threshold, or both of a pair, by their names in messages."""
    if isinstance(threshold, tuple) and len(threshold) == 2 and not is_table(threshold):
        return {f"threshold[{i}]": part for i, part in enumerate(threshold)}
    return {"threshold": threshold}


def _revived(entry: Any) -> Any:
    """Values restored from JSON."""
    if isinstance(entry, dict) and "samples" in entry:
        return Samples.from_plain(entry["samples"], "load")
    if isinstance(entry, dict) and "sum" in entry:
        parts = [(w, read(_revived(part), "load", OF_TIME, ())) for w, part in entry["sum"]]
        return WeightedSignals(parts, "load", OF_TIME)
    if isinstance(entry, dict):
        return np.array(entry["times"]), np.array(entry["values"])
    return tuple(_revived(part) for part in entry) if isinstance(entry, list) else entry


def _stable(bounds: PlayBounds, edges: Array, z: float) -> float:
    """The initial position, moved onto the stable interval if it is outside by rounding."""
    start = bounds.sample(edges[:1], 0.5 * (edges[:1] + edges[1:2]))
    low, high = float(start.low[0]), float(start.high[0])
    nearest = min(max(z, low), high)
    distance = abs(z - nearest) * bounds.stiffness
    if distance > bounds.stiffness * (_STABLE * max(abs(z), abs(low), abs(high)) + bounds.noise):
        raise DeclarationError(
            "initial",
            f"z = {z:.9g} is not stable: the force ℓ − a z exceeds its threshold by {distance:.6g}",
            f"Choose z between {low:.9g} and {high:.9g}; the nearest stable value is {nearest:.9g}",
        )
    return float(nearest)


@dataclass(frozen=True, eq=False)
class Play(Result):
    """A computed play.

    Attributes
    ----------
    bounds : Bounds
        Load, thresholds and stiffness.
    nodes : Nodes
        Times between which z is constant or follows one bound, positions at these times, and modes
        in between.
    declared : mapping of str to anything
        Load, threshold, span, period, stiffness and interpolation as they were given.
    """

    KIND: ClassVar[str] = "play"

    bounds: PlayBounds
    nodes: Nodes
    declared: Mapping[str, Any]

    def __repr__(self) -> str:
        return f"<Play: t = {self.time[0]:g} ... {self.time[-1]:g}, {self.n_switches} switches>"

    @property
    def time(self) -> Array:
        """Nodes t_k, shape (n + 1,); a repeated time is a jump."""
        return self.nodes.time

    @property
    def z(self) -> Array:
        """Positions at the nodes, shape (n + 1,)."""
        return self.nodes.z

    @property
    def mode(self) -> Array:
        """Mode of z after each node but the last: 1 upward, 0 at rest, −1 downward; shape (n,)."""
        return self.nodes.mode[:-1]

    @property
    def n_switches(self) -> int:
        """Number of changes between rest, motion up and motion down."""
        return int(np.count_nonzero(np.diff(self.mode)))

    @property
    def final(self) -> float:
        """The last position."""
        return float(self.z[-1])

    # -- at any time -------------------------------------------------------------------------------

    @validated
    def position(self, t: ArrayLike, side: str = "right") -> Any:
        """z at given times alone; see :meth:`at`."""
        times, k = self.intervals(t, side)
        z = self.motion.state(times, k).z
        return z[0].item() if np.ndim(t) == 0 else z.reshape(np.shape(t))

    @validated
    def at(self, t: ArrayLike, side: str = "right") -> dict[str, Any]:
        """All quantities at given times, as exact as at the nodes.

        Parameters
        ----------
        t : float or array
            Times within the span.
        side : {"right", "left"}
            Limit to take where something jumps.

        Returns
        -------
        dict of str to float or array
            ``z``, its rate ``d_z``, ``load``, ``threshold_plus``, ``threshold_minus``, ``friction``
            (a z − ℓ), ``mode``, ``energy``, ``dissipated_energy`` and ``supplied_energy`` since the
            start.

        Raises
        ------
        DeclarationError
            If a time is outside the span, or `side` is invalid.
        """
        times, k = self.intervals(t, side)
        values = self._values(times, k)
        return {
            name: v[0].item() if np.ndim(t) == 0 else v.reshape(np.shape(t))
            for name, v in values.items()
        }

    def intervals(self, t: Any, side: str) -> tuple[Array, Array]:
        """Times as a vector, and the index of the interval between nodes that contains each."""
        times = np.ravel(np.asarray(t, dtype=float))
        first, last = self.time[0], self.time[-1]
        if side not in ("left", "right"):
            raise DeclarationError("side", f"{side!r} is not a side", "Use 'left' or 'right'")
        if times.size and not (np.all(times >= first) and np.all(times <= last)):
            raise DeclarationError(
                "t",
                "a time is outside the computed time span",
                f"Use {first:g} <= t <= {last:g}",
            )
        k = np.searchsorted(self.time, times, side=side) - 1
        return times, np.clip(k, 0, len(self.mode) - 1)

    def _values(self, t: Array, k: Array) -> dict[str, Array]:
        z, rate, now = self.motion.state(t, k)
        load, a = now.load.value, self.bounds.stiffness
        dissipated, supplied, *_ = self.motion.integrals(k, t)
        return {
            "z": z,
            "d_z": rate,
            "load": load,
            "threshold_plus": np.maximum(now.plus.value, 0.0),
            "threshold_minus": np.maximum(now.minus.value, 0.0),
            "friction": a * z - load,
            "mode": self.mode[k],
            "energy": self.motion.energy(load, z),
            "dissipated_energy": self.audit.dissipated[k] + dissipated,
            "supplied_energy": self.audit.supplied[k] + supplied,
        }

    # -- work and certificate ----------------------------------------------------------------------

    @cached_property
    def motion(self) -> PlayMotion:
        """Position, rate and signals at any time, and integrals."""
        return PlayMotion(self.bounds, self.time, self.z, self.mode)

    @cached_property
    def audit(self) -> PlayAudit:
        """Energy, work and violations, recomputed from the nodes."""
        return self.motion.audited()

    @property
    def dissipated(self) -> float:
        """∫Ψ(t, ż) dt over the whole span, including the dissipation of jumps."""
        return float(self.audit.dissipated[-1])

    @cached_property
    def certificate(self) -> Certificate:
        """Residuals of the motion, and the verdict.

        The residuals are

        - *energy balance*: (E), largest violation at any time, relative to the energy transferred;
        - *friction law*: (S) in the form of forces: how far ℓ − a z leaves its interval, or a bound
          that it follows, relative to the largest force;
        - *rates*: largest difference between an increment of z and the integral of its rate,
          relative to z;

        and, reported without a limit, *samples*: largest number of times (or phases) at which a
        Python function was evaluated; 0 if load and thresholds are formulas or samples, and so
        known everywhere. The limit is 1e-9 or, if larger, the effect of rounded times on steep
        loads and thresholds.
        """
        audit = self.audit
        balance = audit.energy - audit.energy[0] + audit.dissipated - audit.supplied
        scale = max(float(np.ptp(audit.energy)), audit.dissipated[-1], audit.supplied_modulus)
        # A value that is small relative to the largest force is known only up to rounding errors.
        now = self.at(self.time)
        yielding = float(
            max(np.max(np.abs(now[name])) for name in ("load", "threshold_plus", "threshold_minus"))
        )
        length = ENERGY_SCALE * yielding / self.bounds.stiffness
        scale = max(scale, ENERGY_SCALE * float(np.max(np.abs(audit.energy))), length * yielding)
        size = max(float(np.max(np.abs(self.z))), length)
        gap = max(audit.gap - ROUNDING * yielding / self.bounds.stiffness, 0.0)
        measured = np.array([float(np.max(np.abs(balance))), audit.excess, gap])
        sizes = np.array([scale, audit.force, size])
        relative = np.divide(1.0, sizes, out=np.zeros(3), where=sizes > 0.0)
        energy, stability, defect = (measured * relative).tolist()
        tolerance = max(CERTIFIED, float((np.array(audit.blur) * relative).max()))
        samples = max(signal.samples for signal in self.bounds.signals)
        measured_of = [("energy balance", energy), ("friction law", stability), ("rates", defect)]
        looked = (
            f"as sampled at {samples} points"
            if samples
            else "load and thresholds bounded everywhere"
        )
        return Certificate(
            (*within(tolerance, measured_of), Residual("samples", float(samples))),
            notes=(looked, *self.warnings),
        )

    @cached_property
    def warnings(self) -> list[str]:
        """Parts of the given load and thresholds that the motion omits."""
        given = {"load": self.declared["load"]}
        given |= _parts(self.declared["threshold"]) if self.declared["epsilon"] is None else {}
        tables = {
            where: part
            for where, part in given.items()
            if isinstance(part, Samples | Signal) or is_table(part)
        }
        between = self.declared["interpolation"]
        found = [read(part, w, OF_TIME, (), between) for w, part in tables.items()]
        span = float(self.time[0]), float(self.time[-1])
        return [text for signal in found for text in signal.left_out(*span)]

    # -- data and picture --------------------------------------------------------------------------

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """All quantities at the nodes and on an equidistant grid of times (right limits at
        jumps)."""
        import xarray as xr

        times = np.union1d(self.time, np.linspace(self.time[0], self.time[-1], GRID + 1))
        attributes = {
            name: {"units": "1", "long_name": text} for name, text in _LONG_NAMES.items()
        } | {"mode": _FLAGS}
        values = self._values(*self.intervals(times, "right"))
        return xr.Dataset(
            {name: ("time", v, attributes[name]) for name, v in values.items()},
            {"time": ("time", times, {"units": "1", "long_name": "time"})},
            {"title": "Play operator with moving thresholds", "source": "Mielke 2017, section 2.2"},
        )

    @cached_property
    def events(self) -> pandas.DataFrame:
        """Every change of mode: time, from, to, and z."""
        import pandas as pd

        k = np.flatnonzero(np.diff(self.mode)) + 1
        names = {
            column: [MODE_NAMES[m] for m in self.mode[at].tolist()]
            for column, at in (("from", k - 1), ("to", k))
        }
        return pd.DataFrame({"time": self.time[k], **names, "z": self.z[k]})

    # -- description and summary -------------------------------------------------------------------

    @property
    def title(self) -> str:
        """Title of the play."""
        return "play operator with moving thresholds"

    @property
    def parameters(self) -> dict[str, float]:
        """Stiffness, and the period of the thresholds if they have one."""
        epsilon = self.declared["epsilon"]
        found = {"stiffness": self.bounds.stiffness}
        return found if epsilon is None else {**found, "epsilon": float(epsilon)}

    @property
    def outcome(self) -> Completion:
        """Always finished."""
        return Completion.FINISHED

    @property
    def message(self) -> str:
        """Description of the outcome."""
        return self.outcome.message

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        return {
            "method": "exact play",
            "end": float(self.time[-1]),
            "switches": self.n_switches,
            "final": [self.final],
            "dissipated": self.dissipated,
            "warnings": self.warnings,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        return [
            ("method", "exact play"),
            ("time", f"{self.time[0]:g} to {self.time[-1]:g}"),
            ("switches", str(self.n_switches)),
            ("final state", f"{self.final:.6g}"),
            ("dissipated", f"{self.dissipated:.6g}"),
            *(("warning", text) for text in self.warnings),
        ]

    def overview(self, ax: Axes | None = None) -> Figure:
        """z over time inside the stable region."""
        from stickslip.figures.play import plot_play

        return plot_play(self, ax)

    def stored(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """The dataset, the nodes, and load and thresholds as given."""
        import xarray as xr

        nodes = xr.Dataset(
            {
                "node_time": ("node", self.nodes.time),
                "node_z": ("node", self.nodes.z),
                "node_mode": ("node", self.nodes.mode),
            }
        )
        load, threshold, epsilon, interpolation = (
            self.declared[name] for name in ("load", "threshold", "epsilon", "interpolation")
        )
        clock = OF_TIME if epsilon is None else OF_PHASE
        parts = [
            read(part, where, clock, (), interpolation).plain()
            for where, part in _parts(threshold).items()
        ]
        signals = {
            "load": read(load, "load", OF_TIME, (), interpolation).plain(),
            "threshold": parts if len(parts) > 1 else parts[0],
        }
        return self.dataset.merge(nodes), {"declared": {**self.declared, **signals}}

    @classmethod
    def restored(cls, data: xarray.Dataset, parts: Mapping[str, str], where: str) -> Self:
        """Restore a stored play from its nodes."""
        declared: dict[str, Any] = json.loads(parts["declared"])
        declared["t_span"] = tuple(declared["t_span"])
        declared |= {name: _revived(declared[name]) for name in ("load", "threshold")}
        nodes = Nodes(*(data[f"node_{name}"].values for name in ("time", "z", "mode")))
        return cls(_bounds(**declared), nodes, declared)
