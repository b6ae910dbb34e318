"""Comparison of several systems with the same data, by information criteria.

Akaike weights exp(−ΔAICc/2) estimate the probability that each model is the best predictor. If the
best has a weight below 0.95, the data do not discriminate between the models.

References
----------
K. P. Burnham, D. R. Anderson, *Model Selection and Multimodel Inference*, 2nd ed., Springer 2002,
chapters 2 and 6.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from stickslip.arguments import validated
from stickslip.certificates import Certificate, worst
from stickslip.errors import DeclarationError
from stickslip.fitting.fit import Fit, criteria
from stickslip.fitting.making import fit
from stickslip.model.system import System
from stickslip.progress import reporting
from stickslip.results import Completion, Result

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.fitting.unknowns import FreeRange

_DECIDED = 0.95
_LOOSE = 0.5  # relative standard error above which a profile is computed
Free = Mapping[str, "FreeRange"] | Iterable[str]


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """Fits of several systems to the same data, with their comparison.

    Attributes
    ----------
    fits : tuple of Fit
    dataset : xarray.Dataset
        Over ``model``: ``unknowns``, ``log_likelihood``, ``aicc``, ``difference`` (of AICc from the
        smallest), ``weight`` (Akaike's), ``bic``, all with the same effective fraction of the data.
    flat : dict of str to tuple of str
        For each model, the unknowns that the data do not determine.
    """

    KIND: ClassVar[str] = "comparison"

    fits: tuple[Fit, ...]
    dataset: xarray.Dataset
    flat: dict[str, tuple[str, ...]]

    def __repr__(self) -> str:
        return f"<Comparison of {len(self.fits)} models: {self.verdict}>"

    @property
    def along(self) -> str:
        """Dimension of the table."""
        return "model"

    @property
    def names(self) -> list[str]:
        """Names of the models."""
        return [str(name) for name in self.dataset["model"].values]

    @property
    def best(self) -> Fit:
        """The fit with the smallest AICc."""
        return self.fits[int(np.argmin(self.dataset["aicc"].values))]

    @property
    def decided(self) -> bool:
        """Whether the data discriminate: the best model has at least 0.95 of the weight."""
        return bool(np.max(self.dataset["weight"].values) >= _DECIDED)

    @property
    def verdict(self) -> str:
        """Conclusion of the comparison."""
        i = int(np.argmin(self.dataset["aicc"].values))
        share = float(self.dataset["weight"].values[i])
        if self.decided:
            return f"the data prefer {self.names[i]} (weight {share:.3g})"
        beside = [
            name
            for j, name in enumerate(self.names)
            if j != i and self.dataset["weight"].values[j] > 1.0 - _DECIDED
        ]
        others = " and ".join(beside) or "the others combined"
        return (
            f"the data do not discriminate: {self.names[i]} has weight {share:.3g}, compared "
            f"with {others}"
        )

    # -- description and summary -------------------------------------------------------------------

    @property
    def title(self) -> str:
        """Names of the compared systems."""
        return "Comparison of " + ", ".join(self.names)

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the best fit."""
        return self.best.parameters

    @property
    def outcome(self) -> Completion:
        """Whether all fits were completed."""
        complete = all(f.complete for f in self.fits)
        return Completion.FINISHED if complete else Completion.INTERRUPTED

    @property
    def message(self) -> str:
        """The verdict, and the parameters that the data do not determine."""
        flat = [
            f"{model}: the data do not determine {', '.join(names)}"
            for model, names in self.flat.items()
            if names
        ]
        return "\n".join([self.verdict, *flat])

    @property
    def certificate(self) -> Certificate:
        """The largest value of every residual over all fits."""
        return worst([f.certificate for f in self.fits])

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        return {
            "models": self.table.to_dict("list"),
            "decided": self.decided,
            "verdict": self.verdict,
            "flat": {model: list(names) for model, names in self.flat.items()},
            "fits": [f.facts() for f in self.fits],
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        rows = [("verdict", line) for line in self.message.splitlines()]
        data = self.dataset
        for i, name in enumerate(self.names):
            row = data.isel(model=i)
            text = f"ΔAICc {float(row['difference']):.4g}, weight {float(row['weight']):.3g}"
            rows.append(
                (name, f"{text}, BIC {float(row['bic']):.6g}, {int(row['unknowns'])} unknowns")
            )
            rows += [("  unknown", said) for said in self.fits[i].unknowns_in_words()]
        return rows

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot the data with all fitted motions, and their residuals."""
        from stickslip.figures.fit import plot_comparison

        return plot_comparison(self, ax)

    def stored(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """All numbers; those of the fits have the number of the fit as a prefix."""
        import xarray as xr

        parts: dict[str, Any] = {}
        whole = [self.dataset]
        for i, found in enumerate(self.fits):
            data, own = found.stored()
            renamed = {str(name): f"{i}: {name}" for name in [*data.variables, *data.dims]}
            whole.append(data.rename(renamed).drop_attrs(deep=False))
            parts[f"fit_{i}"] = own | {"attributes": dict(data.attrs)}
        merged = xr.merge(whole, combine_attrs="override")
        flat = {model: list(names) for model, names in self.flat.items()}
        return merged, {**parts, "count": len(self.fits), "flat": flat}

    @classmethod
    def restored(cls, data: xarray.Dataset, parts: Mapping[str, str], where: str) -> Self:
        """Restore a stored comparison."""
        fits = []
        for i in range(json.loads(parts["count"])):
            own = json.loads(parts[f"fit_{i}"])
            prefix = f"{i}: "
            names = [str(n) for n in data.variables if str(n).startswith(prefix)]
            part = data[names]
            every = [str(n) for n in [*part.variables, *part.dims]]
            part = part.rename({n: n.removeprefix(prefix) for n in every if n.startswith(prefix)})
            part.attrs = own.pop("attributes")
            texts = {k: v if isinstance(v, str) else json.dumps(v) for k, v in own.items()}
            fits.append(Fit.restored(part, texts, f"{where}, fit {i + 1}"))
        names = [str(n) for n in data.variables if not str(n).partition(": ")[0].isdigit()]
        flat = {model: tuple(found) for model, found in json.loads(parts["flat"]).items()}
        return cls(tuple(fits), data[names], flat)


@validated
def compare_systems(
    systems: Mapping[str, System] | Sequence[System],
    data: Any,
    free: Free | Mapping[str, Free] | Sequence[Free],
    observe: Any = None,
    *,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Comparison:
    """Fit several systems to the same data and compare the fits.

    Parameters
    ----------
    systems : mapping of str to System, or sequence of System
        A mapping of names to systems, or a sequence of systems, which use their own names.
    data : table, Recording, or sequence of these
    free : as in :func:`fit`; or one for each system, in a sequence or by name
    observe : as in :func:`fit`; or one for each system, likewise
    progress : callable, optional
        Called with the completed fraction.
    **options
        Of :func:`fit`: ``noise``, ``loss``, ``parameters``, ``initial``, ``drives``, ``time``,
        ``starts``, ``seed``, ``rtol``; ``parameters`` and ``initial`` may be one for each system in
        a sequence.

    Returns
    -------
    Comparison

    Raises
    ------
    DeclarationError
        If there are fewer than two systems, two have the same name, or an argument of a fit is
        wrong.

    Examples
    --------
    >>> import numpy as np
    >>> import stickslip as ss
    >>> t = np.linspace(0.0, 30.0, 120)
    >>> system = ss.catalogue.forced_oscillator()
    >>> x = ss.simulate(system, (0, 30), parameters={"F_c": 0.4}).at(t)["x"]
    >>> noisy = {"t": t, "x": x + 0.01 * np.random.default_rng(0).standard_normal(120)}
    >>> without = {"with friction": system, "soft": system.with_parameters(k=0.9)}
    >>> found = ss.compare(without, noisy, {"F_c": (0.01, 0.9)}, starts=2)
    >>> found.decided
    True
    """
    table = _named(systems)
    known = set(table)
    fits: list[Fit] = []
    with reporting(progress, "comparing") as show:
        for i, (name, system) in enumerate(table.items()):
            own = {key: _own(value, i, name, known) for key, value in options.items()}
            chosen = _own(free, i, name, known), _own(observe, i, name, known)
            fits.append(fit(system, data, *chosen, progress=_nothing, **own))
            show((i + 1) / len(table))
    return _compared(list(table), fits)


def _nothing(_: float) -> None:
    """No progress: it is reported by the comparison."""


def _named(systems: Mapping[str, System] | Sequence[System]) -> dict[str, System]:
    if isinstance(systems, Mapping):
        table = dict(systems)
    else:
        names = [s.name for s in systems]
        table = {}
        for i, system in enumerate(systems):
            many = names.count(system.name) > 1
            table[f"{system.name} {i + 1}" if many else system.name] = system
    if len(table) < 2:
        raise DeclarationError("systems", f"{len(table)} systems to compare", "Give at least two")
    return table


def _own(value: Any, i: int, name: str, known: set[str]) -> Any:
    """The entry of one system in a sequence, or in a mapping by names of systems."""
    if isinstance(value, Mapping):
        return value[name] if known <= set(value) else value
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    if is_list and value and not all(isinstance(item, str) for item in value):
        if i >= len(value):
            raise DeclarationError(
                "free",
                f"the number of entries, {len(value)}, differs from the number of systems",
                "Give one entry for each system",
            )
        return value[i]
    return value


def _compared(names: list[str], fits: list[Fit]) -> Comparison:
    import xarray as xr

    # One effective number of data for all fits, that of the best: otherwise it would decide the
    # comparison.
    best = max(fits, key=lambda f: f.log_likelihood)
    share = best.statistics.weight
    pairs = [criteria(f.log_likelihood, f.free, f.count, share) for f in fits]
    aicc = np.array([pair[0] for pair in pairs])
    difference = aicc - np.min(aicc)
    weight = np.exp(-0.5 * difference)
    columns = {
        "unknowns": np.array([len(f.names) for f in fits]),
        "log_likelihood": np.array([f.log_likelihood for f in fits]),
        "aicc": aicc,
        "difference": difference,
        "weight": weight / np.sum(weight),
        "bic": np.array([pair[1] for pair in pairs]),
    }
    data = xr.Dataset(
        {name: ("model", column) for name, column in columns.items()},
        {"model": ("model", names)},
        {"fraction of the data that counts": share},
    )
    flat = {name: _flat(f) for name, f in zip(names, fits, strict=True)}
    return Comparison(tuple(fits), data, flat)


def _flat(found: Fit) -> tuple[str, ...]:
    """Unknowns that the data do not bound on both sides; profiles of well-determined unknowns are
    not computed."""
    loose = []
    for j, name in enumerate(found.names):
        error, value = float(found.statistics.error[j]), abs(float(found.values[j]))
        if error > _LOOSE * value and found.profile(name).attrs["flat"]:
            loose.append(name)
    return tuple(loose)
