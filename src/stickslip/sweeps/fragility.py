"""Fragility: the fraction of records that exceed a limit, against their scale.

With J. W. Baker, *Earthquake Spectra* 31 (2015) 579-599, a lognormal distribution of the scale at
which a record reaches the limit is fitted by its likelihood: P(exceeded) = Φ(ln(x/θ)/β), with the
median θ and the dispersion β.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.model.entries.units import with_unit
from stickslip.model.system import System
from stickslip.model.system_file import SYSTEM
from stickslip.results import CERTIFICATE, COMPLETION, PLAIN, Completion, Result, shortened
from stickslip.sweeps.request.measures import MISSING, measures_of
from stickslip.sweeps.request.records import SCALE, record_axis

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.sweeps.map import Map

_LEVEL = 1.959963984540054  # standard deviations that contain 95 %
_GRADIENT = 1e-9  # gradient of the log-likelihood at which BFGS ends
_ITS_OWN = ("share", "low", "high", "records")
_FITTED = ("median", "dispersion")


@dataclass(frozen=True, eq=False, repr=False)
class Fragility(Result):
    """Fraction of records for which a system exceeds a limit, as a function of the scale of the
    records.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
    dataset : xarray.Dataset
        Over the scale and the other axes: ``share``, the fraction of the records that exceed the
        limit, with its 95 % confidence interval from ``low`` to ``high`` (Wilson 1927), and
        ``records``, the number of records with a value. Over the other axes: ``median`` of the
        scale at which the limit is exceeded, and the ``dispersion`` of its logarithm; NaN if the
        fractions do not determine them, such as where they jump from 0 to 1 in one step.
    outcome : Completion
        The outcome of the map.
    certificate : Certificate
        Numbers of motions that are not certified or have no value.
    """

    KIND: ClassVar[str] = "fragility"
    PARTS: ClassVar = {
        "system": SYSTEM,
        "parameters": PLAIN,
        "completion": COMPLETION.of("outcome"),
        "certificate": CERTIFICATE,
    }

    system: System
    parameters: dict[str, float]
    dataset: xarray.Dataset
    outcome: Completion
    certificate: Certificate

    def __repr__(self) -> str:
        return f"<Fragility of {self.title}: {self.message}>"

    @property
    def along(self) -> str:
        """The axis of the scale."""
        return str(self.dataset.attrs["over"])

    @property
    def title(self) -> str:
        """Title of the system."""
        return str(self.dataset.attrs["title"])

    @property
    def table(self) -> pandas.DataFrame:
        """One row per scale and value of the other axes."""
        return self.dataset[list(_ITS_OWN)].to_dataframe().reset_index()

    @property
    def limit(self) -> str:
        """Description of the limit."""
        about = self.dataset.attrs
        return f"{about['measure']} > {with_unit(float(about['limit']), about['units'])}"

    @property
    def message(self) -> str:
        """Number of records and the limit."""
        return f"{self.dataset.attrs['total']} records, {self.limit}"

    def levels(self, named: Callable[[str], str] = str) -> Iterator[tuple[str, xarray.Dataset]]:
        """Curves against the scale for all values of the other axes, with these values.

        Parameters
        ----------
        named : function
            Function that returns the label of a parameter.
        """
        data = self.dataset
        others = [str(d) for d in data["share"].dims if d != self.along]
        for places in product(*(range(data.sizes[d]) for d in others)):
            part = data.isel(dict(zip(others, places, strict=True)))
            fixed = {name: part[name] for name in map(str, part.coords) if not part[name].dims}
            said = [
                f"{named(name)} = {with_unit(float(at), at.attrs.get('units', ''), 4)}"
                for name, at in fixed.items()
            ]
            yield ", ".join(said), part

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        about = self.dataset.attrs
        return {
            **self.system.heading(),
            "measure": str(about["measure"]),
            "limit": float(about["limit"]),
            "records": int(about["total"]),
            "fits": [
                {"at": said, **{name: float(part[name]) for name in _FITTED}}
                for said, part in self.levels()
            ],
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        rows = [("records", str(self.dataset.attrs["total"])), ("limit", self.limit)]
        unit = str(self.dataset[self.along].attrs.get("units", ""))
        fits: list[tuple[str, str]] = []
        for said, part in self.levels():
            median, dispersion = (float(part[name]) for name in _FITTED)
            text = f"median {with_unit(median, unit, 4)}, dispersion {dispersion:.3g}"
            if not math.isfinite(median):
                text = "the median cannot be determined from these fractions"
            fits.append((said or self.along, text))
        return rows + shortened(fits)

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot the fractions against the scale, with their intervals and the fitted curves."""
        from stickslip.figures.fragility import plot_fragility

        return plot_fragility(self, ax)


def fragility_of(found: Map, measure: str, limit: float, over: str | None) -> Fragility:
    """The fragility of a map over records; see :meth:`stickslip.Map.fragility`."""
    data = found.dataset
    records = record_axis(data)
    if not records:
        reason = "the map has no axis of records"
        raise DeclarationError("fragility", reason, "Sweep over ss.Records: {'record': records}")
    if measure not in measures_of(data):
        known = suggestion(measure, measures_of(data))
        raise DeclarationError("measure", f"the map has no measure '{short(measure)}'", known)
    if not math.isfinite(limit):
        raise DeclarationError("limit", f"{limit!r} is not a number", "Give a number")
    along = _scale_axis(found, records, over)
    values = data[measure].load()
    there = values.notnull()
    total, beyond = there.sum(records), (values > limit).sum(records)
    shares = _shares(beyond.values, total.values)
    result = beyond.to_dataset(name="share").assign(
        {name: (beyond.dims, part) for name, part in zip(_ITS_OWN, shares, strict=True)}
    )
    x = data[along].values
    others = tuple(d for d in beyond.dims if d != along)
    flat = [part.transpose(*others, along).values.reshape(-1, len(x)) for part in (beyond, total)]
    fits = np.array([lognormal_fit(x, k, n) for k, n in zip(*flat, strict=True)])
    shape = tuple(data.sizes[d] for d in others)
    result = result.assign(
        {name: (others, fits[:, i].reshape(shape)) for i, name in enumerate(_FITTED)}
    )
    about = {
        **{key: str(data.attrs[key]) for key in ("title", "source")},
        **{"measure": measure, "limit": float(limit), "over": along},
        "units": str(values.attrs.get("units", "")),
        "total": int(data.sizes[records]),
    }
    result["share"].attrs = {
        "units": "1",
        "long_name": f"fraction of records with {measure} > limit",
    }
    result["median"].attrs = {"units": data[along].attrs.get("units", "1")}
    computed = data["outcome"].values >= 0
    bad = (data["lacking"].values != MISSING.index("nothing")) & computed & there.values
    counts = {
        "motions not certified": int(np.count_nonzero(bad)),
        "motions without a value": int(np.count_nonzero(~there.values)),
    }
    certificate = Certificate(
        tuple(Residual(name, float(count), 0.0) for name, count in counts.items()),
        notes=tuple(found.warnings),
    )
    result = result.assign_attrs(about)
    return Fragility(found.system, found.parameters, result, found.outcome, certificate)


def _scale_axis(found: Map, records: str, over: str | None) -> str:
    """Axis of the scale."""
    data = found.dataset
    known = [str(d) for d in data["outcome"].dims if d != records]
    known = [d for d in known if d in data.coords]
    if over is None and SCALE in known:
        return SCALE
    if over is None and len(known) == 1:
        return known[0]
    if over not in known:
        reason = "the axis is ambiguous" if over is None else f"unknown axis '{over}'"
        remedy = suggestion(over or "", known) if known else "Vary a scale of the records"
        raise DeclarationError("over", reason, remedy)
    return over


def _shares(beyond: Array, total: Array) -> tuple[Array, Array, Array, Array]:
    """Fractions with their intervals (Wilson 1927), and sample sizes; NaN for empty samples."""
    n = np.where(total > 0, total, np.nan).astype(float)
    p = beyond / n
    width = 1.0 + _LEVEL**2 / n
    centre = (p + 0.5 * _LEVEL**2 / n) / width
    half = _LEVEL * np.sqrt(p * (1.0 - p) / n + 0.25 * (_LEVEL / n) ** 2) / width
    # At the ends these are 0 and 1, but for rounding errors.
    low = np.where(beyond == 0, 0.0 * n, np.maximum(centre - half, 0.0))
    high = np.where(beyond == total, 1.0 + 0.0 * n, np.minimum(centre + half, 1.0))
    return p, low, high, total


def lognormal_fit(x: Array, beyond: Array, total: Array) -> tuple[float, float]:
    """Maximum-likelihood median and dispersion of a lognormal distribution; NaN if no maximum
    exists.

    Parameters
    ----------
    x : array, shape (levels,)
        Scales; those that are not positive are omitted.
    beyond, total : arrays of int, shape (levels,)
        Number of records that exceed the limit, and of all records.
    """
    from scipy.optimize import minimize
    from scipy.special import log_ndtr

    used = (x > 0.0) & (total > 0)
    logs, k, n = np.log(x[used]), beyond[used].astype(float), total[used].astype(float)
    exceeded, held = logs[k > 0], logs[k < n]
    # Otherwise a step at some scale is more likely than any distribution.
    if not (len(exceeded) and len(held) and np.min(exceeded) < np.max(held)):
        return math.nan, math.nan
    centre, width = float(np.mean(logs)), float(np.std(logs))
    z = (logs - centre) / width

    def surprise(line: Array) -> tuple[float, Array]:
        u = line[0] + line[1] * z
        below, above = log_ndtr(u), log_ndtr(-u)
        density = np.exp(-0.5 * u**2) / math.sqrt(2.0 * math.pi)
        # Derivative of the log-likelihood: φ/Φ and −φ/(1 − Φ), by logarithms without underflow.
        slope = k * density * np.exp(-below) - (n - k) * density * np.exp(-above)
        value = -float(np.sum(k * below + (n - k) * above))
        return value, -np.array([np.sum(slope), np.sum(slope * z)])

    start = np.array([0.0, 1.0])
    a, b = minimize(surprise, start, jac=True, method="BFGS", options={"gtol": _GRADIENT}).x
    if b <= 0.0:  # decreasing: no such distribution
        return math.nan, math.nan
    return math.exp(centre - width * a / b), width / b
