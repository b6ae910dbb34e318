"""A friction law fitted to measured points of force against speed.

The points are converted to a record: a surface with prescribed motion passes through all measured
speeds, and the force of the law is compared with the measured ones at these times. So a law is
fitted as systems are, with exact derivatives, several starts, intervals and tests. The points are
in the order of their speeds, so that residuals that are alike in neighbours show a law that does
not fit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from os import PathLike
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.fitting.fit import Fit
from stickslip.fitting.making import fit
from stickslip.fitting.problem import Loss
from stickslip.fitting.unknowns import FreeRange
from stickslip.model.entries.samples import Samples
from stickslip.model.formats.columns import argument_columns, chosen_columns
from stickslip.model.laws import FrictionLaw, by_name
from stickslip.model.system import Formula, Internal, LawContact, Parameter, System

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CONTACT = "law"
_FORCE = "F"  # the column of the forces
_RESTING = "Remove the point, or fix F_s by parameters={'F_s': ...}"
_EASILY = 0.25  # initial Stribeck speed, relative to the median speed
_HELD = 1.05  # initial static friction, relative to the largest force
_VISCOUS = 0.1  # initial viscous force at the largest speed, relative to the largest force


class LawFit(Fit):
    """A friction law fitted to measured points of force against speed.

    It has all attributes of a :class:`Fit`, and:

    Attributes
    ----------
    law : FrictionLaw
    speeds, forces : array, shape (m,)
        The points, sorted by speed.
    """

    KIND: ClassVar[str] = "law fit"

    @property
    def law(self) -> FrictionLaw:
        """The law."""
        return by_name(cast(LawContact, self.declared.contacts[_CONTACT]).law)

    @property
    def speeds(self) -> Array:
        """Speeds of the points, increasing."""
        return cast(Samples, self.declared.drives["v"]).values

    @property
    def forces(self) -> Array:
        """Measured forces."""
        return self.dataset[_FORCE].values

    @validated
    def contact(
        self, direction: str, *, surface_speed: Formula = 0.0, unit: str = "N"
    ) -> LawContact:
        """The law with the estimated parameters, for use as a contact.

        Parameters
        ----------
        direction, surface_speed, unit
            As in a law, such as :data:`stickslip.laws.stribeck`.
        """
        values = {name: self.parameters[name] for name in self.law.known()}
        return self.law(direction, surface_speed=surface_speed, unit=unit, **values)

    def at(self, speeds: ArrayLike) -> Any:
        """Forces of the fitted law at nonzero speeds."""
        v = np.asarray(speeds, float)
        plain = self.declared.plain
        kinetic = plain.dry_contacts[_CONTACT].kinetic
        values = self.parameters
        sizes = [
            plain.evaluate(cast(Formula, kinetic), {**values, "speed": abs(x)}) for x in v.flat
        ]
        found = np.sign(v) * np.reshape(sizes, v.shape)
        return found if found.ndim else float(found)

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot points and law against the speed, and the residuals; no residuals if axes are
        given."""
        from stickslip.figures.fit import plot_law_fit

        return plot_law_fit(self, ax)


@validated
def fit_law(
    points: Any,
    law: FrictionLaw | str,
    free: Mapping[str, FreeRange] | Iterable[str] | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    noise: float | None = None,
    loss: Loss = "linear",
    starts: int = 16,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> LawFit:
    """Fit a friction law to measured points of force against speed by least squares.

    Parameters
    ----------
    points : array, shape (m, 2), pair of arrays, table or path
        Nonzero speeds, of one sign or both, and forces opposing the motion, with the sign of the
        speed. A mapping or a DataFrame has a column named ``v`` or ``speed`` and one named ``F`` or
        ``force``, or exactly two columns; files are read as by :meth:`stickslip.Table.read`.
    law : FrictionLaw or str
        A law whose kinetic friction force depends only on the speed, such as
        :data:`stickslip.laws.stribeck`; Coulomb's with a viscous part is ``ss.laws.coulomb``.
    free : mapping of str to (float, float) or None, or names, optional
        Parameters to fit, with bounds; by default all parameters without given values.
    parameters : mapping of str to float, optional
        Values of the other parameters, and start values of the fitted ones.
    noise : float, optional
        Standard deviation of the forces. By default it is estimated.
    loss : {"linear", "soft_l1", "huber", "cauchy"}
        Robust losses are less sensitive to outliers.
    starts, seed
        As in :func:`fit`.
    progress : callable, optional
        Called with the completed fraction.

    Returns
    -------
    LawFit
        Intervals, profiles, criteria and tests as in a :class:`Fit`; its ``contact(direction)`` is
        the law with the estimates.

    Raises
    ------
    DeclarationError
        If points are not numbers or too few, a speed is zero, forces have the wrong sign, the law
        is not a law of dry friction, or the points do not depend on a fitted parameter.

    Examples
    --------
    >>> import numpy as np
    >>> import stickslip as ss
    >>> v = np.array([-1.0, -0.4, -0.1, 0.1, 0.4, 1.0])
    >>> found = ss.fit_law((v, np.sign(v) * (0.5 + 0.2 * abs(v))), ss.laws.coulomb, starts=2)
    >>> {name: round(value, 6) for name, value in found.estimate.items()}
    {'F_c': 0.5, 'b': 0.2}
    """
    chosen = by_name(law, "law") if isinstance(law, str) else law
    if not chosen.dry or chosen.points:
        raise DeclarationError(
            "law",
            f"the force of '{chosen.name}' is not a function of the speed alone",
            "Choose a law with a kinetic friction force, such as ss.laws.stribeck",
        )
    v, F = _read(points)
    given = dict(parameters or {})
    for name in given:
        if name not in chosen.known():
            reason = f"unknown parameter of '{chosen.name}'"
            raise DeclarationError(f"parameters.{name}", reason, suggestion(name, chosen.known()))
    if free is None:
        free = [name for name in chosen.known() if name not in given]
    system = _moved_through(v, F, chosen, given)
    record = {"t": np.arange(len(v), dtype=float), _FORCE: F}
    found = fit(
        system,
        record,
        free,
        {_FORCE: f"-friction_{_CONTACT}"},
        noise=None if noise is None else {_FORCE: noise},
        loss=loss,
        starts=starts,
        seed=seed,
        progress=progress,
    )
    parts = {field.name: getattr(found, field.name) for field in fields(Fit)}
    return LawFit(**parts)


def _moved_through(v: Array, F: Array, law: FrictionLaw, given: Mapping[str, float]) -> System:
    """A contact with prescribed motion that passes through all speeds."""
    largest, fastest = float(np.max(np.abs(F))), float(np.max(np.abs(v)))
    guesses = {
        "F_s": _HELD * largest,
        "F_c": float(np.median(np.abs(F))),
        "v_s": _EASILY * float(np.median(np.abs(v))),
        "b": _VISCOUS * largest / fastest,
    }
    parameters = {
        name: Parameter(given.get(name, guesses.get(name, p.default)), p.unit, p.meaning, p.range)
        for name, p in law.known().items()
    }
    clock = np.arange(len(v), dtype=float)
    contact = law("0", surface_speed="-v", unit="N", **{name: name for name in parameters})
    return System(
        law.name,
        law.title,
        law.source,
        parameters=parameters,
        drives={"v": Samples(clock, v)},
        internal={"clock": Internal(1.0)},
        contacts={_CONTACT: contact},
        span=(0.0, float(clock[-1])),
    )


def _read(points: Any) -> tuple[Array, Array]:
    """Speeds and forces, in the order of the speeds."""
    v, F = _columns(points)
    if v.shape != F.shape or v.ndim != 1 or len(v) < 2:
        raise DeclarationError(
            "points",
            f"{v.size} speeds and {F.size} forces",
            "Give as many speeds as forces, at least 2, like (v, F)",
        )
    for part, name in ((v, "speed"), (F, "force")):
        if not np.isfinite(part).all():
            k = int(np.argmin(np.isfinite(part)))
            raise DeclarationError(
                f"points[{k}]", f"the {name} is {part[k]}, not a number", "Remove the point"
            )
    if (v == 0.0).any():
        k = int(np.argmax(v == 0.0))
        raise DeclarationError(
            f"points[{k}]", "at speed 0 the friction force is indeterminate", _RESTING
        )
    if float(np.median(np.sign(v) * F)) < 0.0:
        raise DeclarationError(
            "points",
            "most forces have the opposite sign to v",
            "Change the sign: give the force that opposes the motion",
        )
    order = np.argsort(v, kind="stable")
    return v[order], F[order]


def _columns(points: Any) -> tuple[Array, Array]:
    if isinstance(points, str | PathLike):
        columns, *_ = chosen_columns(points, argument_columns((), "", "F"))
        return columns[0], columns[1]
    if isinstance(points, Mapping) or hasattr(points, "columns"):
        table = cast("Mapping[str, Any]", points)
        names = [str(name) for name in table]
        v = next((name for name in ("v", "speed") if name in names), "")
        F = next((name for name in ("F", "force") if name in names), "")
        if not (v and F) and len(names) == 2:
            v = v or next(name for name in names if name != F)
            F = F or next(name for name in names if name != v)
        if not (v and F):
            raise DeclarationError(
                "points",
                "it is ambiguous which columns have the speeds and forces: "
                f"{short(', '.join(names))}",
                "Name them v and F",
            )
        return _numbers(table[v]), _numbers(table[F])
    if isinstance(points, tuple | list) and len(cast("Sequence[Any]", points)) == 2:
        v, F = cast("Sequence[Any]", points)
        if np.ndim(v) == 1 and (np.size(v) != 2 or isinstance(points, tuple)):
            return _numbers(v), _numbers(F)
    array = _numbers(points)
    if array.ndim != 2 or array.shape[1] != 2:
        raise DeclarationError(
            "points", f"the array has shape {array.shape}", "Give (v, F), or rows [v, F]"
        )
    return array[:, 0], array[:, 1]


def _numbers(part: Any) -> Array:
    try:
        return np.array(part, dtype=float)
    except (TypeError, ValueError):
        raise DeclarationError("points", "they are not all numbers", "Give numbers") from None
