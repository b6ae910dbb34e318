"""The declaration of a rate-independent evolution by formulas and numbers, as in a model file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from numbers import Real
from typing import Any, cast

from stickslip import page
from stickslip.errors import DeclarationError, short
from stickslip.kept import cached_property
from stickslip.model.entries.declared import Entries
from stickslip.model.formats import toml
from stickslip.model.names import DeclaredNames, check_covered, measured_drives, reconfigured
from stickslip.model.schema import check_shape
from stickslip.model.system import DefaultSpan, Drive, Formula, Parameter, hold_plain
from stickslip.rate_independent.dissipation import Dissipation
from stickslip.rate_independent.evolution.evolution import Evolution, UnstableStart
from stickslip.rate_independent.signals.reading import read
from stickslip.rate_independent.signals.signal import OF_TIME
from stickslip.rate_independent.signals.sums import WeightedSignals
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.formulas import Definition, Scope, TimeFunction

_CLOCK = "t"
_PHASE = "s"
_MOST_SHOWN = 8  # components of a state in a message
FormulaTable = Any
"""A formula, or lists of formulas: a vector, or the rows of a matrix."""


_SPAN = DefaultSpan((0.0, 1.0))


@dataclass(frozen=True)
class EvolutionModel:
    """Declaration of a rate-independent evolution, or of a dissipation potential, by formulas and
    numbers.

    Attributes
    ----------
    name, title, source : str
        Short name, one line of description, and the literature.
    parameters : mapping of str to Parameter or float
    functions : mapping of str to formula
        Functions used in formulas, such as ``{"rho(s)": "1 + cos(2*pi*s)/2"}``.
    drives : mapping of str to formula or Samples
        Functions of time for use in the load, such as ``{"ell": "V*t"}``, or measured ones.
        Measured drives may be multiplied by numbers and added.
    A : matrix of formulas
        Shape (n, n), formulas of the parameters; a single formula if n = 1. Optional, with the
        load, if only the dissipation is declared.
    load : list of formulas
        n formulas of ``t``; a single formula if n = 1.
    dissipation : mapping
        ``kind``, one of ``Dissipation.kinds``, and the fields of this kind, formulas of ``s``.
    initial : list of formulas
        By default 0.
    epsilon : formula
        Period of the dissipation in the units of time.
    span : (formula, formula)
        By default from 0 to 1 or, if drives are samples that end, the span that all of them cover.
    steps : int or None
        Number of equal steps; adaptive if None.

    Raises
    ------
    DeclarationError
        If anything in the declaration is wrong; the message names the key, the reason and the
        remedy.
    """

    name: str
    title: str = ""
    source: str = ""
    parameters: Entries[Parameter] = Entries(Parameter, Real)  # noqa: RUF009 (a descriptor)
    functions: Mapping[str, Formula] = field(default_factory=dict[str, Formula])
    drives: Mapping[str, Drive] = field(default_factory=dict[str, Drive])
    A: FormulaTable = ()
    load: FormulaTable = ()
    dissipation: Mapping[str, Any] = field(default_factory=dict[str, Any])
    initial: FormulaTable = ()
    epsilon: Formula = 1.0
    span: tuple[Formula, Formula] = _SPAN
    steps: int | None = None

    def __post_init__(self) -> None:
        default = self.span if isinstance(self.span, DefaultSpan) else None
        hold_plain(self)
        if default is not None:
            object.__setattr__(self, "span", default.under(self.drives))
        check_shape(self)
        if not self.name.strip():
            raise DeclarationError(
                "name", "the name of the model is missing", "Give the model a short name"
            )
        for name in self._definitions:
            self._scope(_CLOCK, _PHASE).check(name)
        _ = self.potential
        if self.is_evolution:
            _ = self.problem
        self._check_steps()

    @property
    def is_evolution(self) -> bool:
        """Whether the model has a load, and not only a dissipation potential."""
        return not (_absent(self.A) and _absent(self.load))

    @property
    def is_play(self) -> bool:
        """Whether it is a scalar play, which is computed exactly."""
        return self.potential.thresholds is not None

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters."""
        return {name: float(parameter.default) for name, parameter in self.parameters.items()}

    @cached_property
    def potential(self) -> Dissipation:
        """The dissipation potential."""
        given = dict(self.dissipation)
        if not given:
            raise toml.missing("", "dissipation")
        cls: Any = toml.named_kind(given, Dissipation.kinds, "dissipation")
        given = toml.known_keys(cls, given, "dissipation")
        variables = cls.variables(given)
        for name in variables:
            if name in self.values:
                raise DeclarationError(
                    f"parameters.{name}",
                    f"'{name}' is a component of the motion in dissipation.formula",
                    "Choose another name",
                )
        scope = self._scope(_PHASE, *variables)
        for item in fields(cls):
            # A whole number is not a formula.
            plain = item.metadata.get("plain") or getattr(item.type, "__name__", item.type) == "int"
            if item.name in given and not plain:
                given[item.name] = _trees(scope, given[item.name], f"dissipation.{item.name}")
        try:
            return cls(**given)
        except DeclarationError as error:
            where = "dissipation" if error.where == cls.__name__ else f"dissipation.{error.where}"
            raise DeclarationError(where, error.reason, error.remedy) from None

    @cached_property
    def problem(self) -> Evolution:
        """The evolution.

        Raises
        ------
        DeclarationError
            If the model is only a dissipation potential, or the evolution is invalid.
        """
        for key in ("A", "load"):
            if _absent(getattr(self, key)):
                raise toml.missing("", key)
        n = self.potential.dimension
        start, stop = self._numbers("span")
        check_covered(measured_drives(self.drives), start, stop)
        return with_nearest_start(
            lambda: Evolution(
                A=self._numbers("A"),
                load=self._loads(),
                dissipation=self.potential,
                initial=[0.0] * n if _absent(self.initial) else self._numbers("initial"),
                epsilon=self._numbers("epsilon"),
                span=(start, stop),
            )
        )

    def configure(self, given: Mapping[str, Drive]) -> EvolutionModel:
        """The same model with other parameter values (numbers), functions and drives (formulas, or
        samples of drives).

        Raises
        ------
        DeclarationError
            If a name is neither, or a value is not admissible.
        """
        return reconfigured(self, given, ("functions", "drives"))

    def _repr_html_(self) -> str:
        shown = {
            **{f"function {name}": text for name, text in self.functions.items()},
            **{f"drive {name}": str(drive) for name, drive in self.drives.items()},
            "load": self.load,
            "A": self.A,
            "dissipation": self.dissipation,
            "period ε": self.epsilon,
            "span": self.span,
        }
        rows = [
            (name, short(toml.text_of(value)))
            for name, value in shown.items()
            if not _absent(value)
        ]
        return page.whole(
            page.headline(self.title or self.name, self.source),
            page.tabled(rows),
            page.parameters(self.values, self.parameters),
        )

    def to_toml(self) -> str:
        """The declaration as a model file."""
        from stickslip.rate_independent.evolution.evolution_file import EVOLUTIONS

        return EVOLUTIONS.dumps(self)

    @cached_property
    def _definitions(self) -> dict[str, Definition]:
        """Functions, and the derivatives of those of one argument."""
        names = DeclaredNames(reserved={_PHASE: "the phase"})
        names.parameters(self.parameters)
        names.functions("functions", self.functions)
        given = measured_drives(self.drives)
        for name in given:
            names.claim(name, f"drives.{name}")
        formulas = {name: drive for name, drive in self.drives.items() if name not in given}
        names.functions("drives", formulas, clock=_CLOCK)
        return names.with_derivatives()

    def _scope(self, *variables: str) -> Scope:
        """Scope of formulas, with values for parameters."""
        names = {name: ex.num(value) for name, value in self.values.items()}
        allowed = ", ".join([*variables, "parameters"]).replace(", parameters", " and parameters")
        drives = measured_drives(self.drives)
        forbidden = {
            name: f"Use {allowed} only"
            for name in (_CLOCK, _PHASE, *drives)
            if name not in variables
        } | {f"d_{name}": "A measured drive has no rate here" for name in drives}
        return Scope(
            names | {name: ex.sym(name) for name in variables}, self._definitions, forbidden
        )

    def _loads(self) -> list[Any]:
        """Every component of the load: an expression in t, samples, or a sum with samples."""
        given = measured_drives(self.drives)
        trees = _trees(self._scope(_CLOCK, *given), self.load, "load")
        if not isinstance(trees, list):
            return [with_samples(trees, given, "load")]
        parts = enumerate(cast(list[Any], trees))
        return [with_samples(tree, given, f"load[{i}]") for i, tree in parts]

    def _numbers(self, key: str) -> Any:
        return _evaluated(self._scope(), getattr(self, key), key)

    def _check_steps(self) -> None:
        if self.steps is None:
            return
        if self.steps < 1:
            raise DeclarationError(
                "steps", f"{short(repr(self.steps))} steps", "Give a positive integer"
            )
        if self.is_play:
            raise DeclarationError(
                "steps", "a scalar play is computed exactly, without steps", "Remove it"
            )


def with_nearest_start(make: Callable[[], Evolution]) -> Evolution:
    """An evolution; if it starts outside the stable set, the message gives the nearest stable
    state."""
    from stickslip.rate_independent.evolution.evolve import nearest_stable

    try:
        return make()
    except UnstableStart as unstable:
        nearest = nearest_stable(unstable.problem)
        numbers = ", ".join(f"{x:.6g}" for x in nearest[:_MOST_SHOWN])
        more = ", ..." if len(nearest) > _MOST_SHOWN else ""
        remedy = f"The nearest stable state is initial = [{numbers}{more}]"
        raise DeclarationError(unstable.where, unstable.reason, remedy) from None


def with_samples(tree: Any, given: Mapping[str, TimeFunction], where: str) -> Any:
    """An expression in the time and measured drives, as input of a signal.

    Raises
    ------
    DeclarationError
        If a measured drive is not just multiplied by a number.
    """
    used = [name for name in given if isinstance(tree, ex.Expr) and name in tree.symbols]
    if not used:
        return tree
    slopes = {name: ex.derivative(tree, name) for name in used}
    rest = ex.substitute(tree, {name: ex.ZERO for name in used})
    weights = {name: ex.number(w) for name, w in slopes.items() if ex.is_number(w)}
    if ex.add((rest, 1.0), *((ex.sym(name), w) for name, w in weights.items())) is not tree:
        names = " and ".join(f"'{name}'" for name in used)
        raise DeclarationError(
            where,
            f"the measured drive {names} may only be multiplied by a number",
            "Declare the samples of the load as a separate drive",
        )
    if list(weights.values()) == [1.0] and ex.is_number(rest, 0.0):
        return given[used[0]]
    parts = [(w, read(given[name], where, OF_TIME, ())) for name, w in weights.items()]
    return WeightedSignals([*parts, (1.0, read(rest, where, OF_TIME, ()))], where, OF_TIME)


def _trees(scope: Scope, value: Any, where: str) -> Any:
    """Formulas in nested tuples as expressions in the variables alone, in nested lists."""
    if isinstance(value, tuple):
        items = cast(tuple[Any, ...], value)
        return [_trees(scope, item, f"{where}[{i}]") for i, item in enumerate(items)]
    return scope.parse(value, where)


def _evaluated(scope: Scope, value: Any, where: str) -> Any:
    """Numbers of formulas in nested tuples."""
    if isinstance(value, tuple):
        items = cast(tuple[Any, ...], value)
        return [_evaluated(scope, item, f"{where}[{i}]") for i, item in enumerate(items)]
    return ex.evaluate(scope.parse(value, where), {})


def _absent(table: object) -> bool:
    """Return whether a table was omitted; a NumPy number cannot be compared with ()."""
    return isinstance(table, tuple) and not table
