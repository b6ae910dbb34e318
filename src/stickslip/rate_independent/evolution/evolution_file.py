"""Model files of evolutions: an :class:`EvolutionModel` as TOML and back, key by key, without loss.

The language is that of :mod:`stickslip.model.system_file`. The keys from ``A`` to ``span`` are
those of :class:`~stickslip.rate_independent.evolution.evolution.Evolution`; the dissipation has a
``kind`` and the keys of that kind. Every number may be a formula of the parameters, the load also
of the time ``t``, the dissipation of the phase ``s``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from difflib import get_close_matches
from functools import cached_property
from os import PathLike
from typing import Any

from stickslip.errors import DeclarationError, short
from stickslip.model import toml
from stickslip.model.declaration import parse_range
from stickslip.model.schema import check_shape, entry_key, wrong_kind
from stickslip.model.system import Formula, Parameter
from stickslip.model.units import check_unit
from stickslip.rate_independent.dissipation import (
    Dissipation,
    WeightedL1,
)
from stickslip.rate_independent.evolution.evolution import Evolution, UnstableStart
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.formulas import Definition, Scope, check_name, is_finite, parse_signature

KINDS = Dissipation.kinds
GROUPS = ("name", "parameters", "functions", "A", "dissipation", "epsilon")
"""Keys before which a file has an empty line."""
EXAMPLES = {
    "A": "A = [[2, 0], [0, 1]]",
    "load": 'load = ["sin(t)", "2*t"]',
    "dissipation": 'dissipation = {kind = "weighted l1", weights = ["2 + cos(2*pi*s)", "1"]}',
    "weights": 'weights = ["2 + cos(2*pi*s)", "1"]',
    "radii": 'radii = ["2 + cos(2*pi*s)"]',
    "shape": "shape = [[4, 0], [0, 1]]",
}
CLOCK = "t"
PHASE = "s"
VECTORS = {"weights", "lower", "radii"}  # for which one formula stands for a list of one
MOST_SHOWN = 8  # components of a state in a message


@dataclass(frozen=True)
class EvolutionModel:
    """A rate-independent evolution, or a dissipation potential alone, as texts and numbers.

    Attributes
    ----------
    name, title, source : str
        Short name, one line of description, and the literature.
    parameters : mapping of str to Parameter
    functions : mapping of str to formula
        Functions used in formulas, such as ``{"rho(s)": "1 + cos(2*pi*s)/2"}``.
    A : matrix of formulas
        (n, n), of the parameters; a single one if n = 1. May be left out, with the load, where only
        the dissipation is meant.
    load : list of formulas
        n formulas of ``t``; a single one if n = 1.
    dissipation : mapping
        ``kind``, a key of :data:`KINDS`, and what that kind takes, formulas of ``s``.
    initial : list of formulas
        By default 0.
    epsilon : formula
        Period of the dissipation in the units of time.
    span : (formula, formula)
    steps : int or None
        Steps of equal length; adaptive if None.

    Raises
    ------
    DeclarationError
        If anything is wrong; the message names the key, the reason and the remedy.
    """

    name: str
    title: str = ""
    source: str = ""
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    functions: Mapping[str, Formula] = field(default_factory=dict)
    A: Any = ()
    load: Any = ()
    dissipation: Mapping[str, Any] = field(default_factory=dict)
    initial: Any = ()
    epsilon: Formula = 1.0
    span: Any = (0.0, 1.0)
    steps: int | None = None

    def __post_init__(self) -> None:
        for item in fields(self):
            object.__setattr__(self, item.name, _frozen(getattr(self, item.name)))
        for key in ("name", "title", "source"):
            if not isinstance(getattr(self, key), str):
                raise wrong_kind(getattr(self, key), "str", key)
        if not self.name.strip():
            raise DeclarationError("name", "the model has no name", "Give it a short name")
        for name in self._definitions:
            self._scope(CLOCK, PHASE).check(name)
        _ = self.potential
        if self.is_evolution:
            _ = self.problem
        self._check_steps()

    @property
    def is_evolution(self) -> bool:
        """Whether there is more than a dissipation potential."""
        return self.A != () or self.load != ()

    @property
    def is_play(self) -> bool:
        """Whether it is a scalar play, which is computed exactly."""
        return isinstance(self.potential, WeightedL1) and self.potential.dimension == 1

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters."""
        return {name: float(parameter.default) for name, parameter in self.parameters.items()}

    @cached_property
    def potential(self) -> Dissipation:
        """The dissipation potential."""
        given = dict(toml.mapping(self.dissipation, "dissipation"))
        if not given:
            raise _missing("dissipation", "dissipation")
        cls = _kind(given.pop("kind", None))
        known = {item.name: item.default is MISSING for item in fields(cls) if item.init}  # type: ignore[arg-type]
        for key in given:
            if key not in known:
                raise DeclarationError(
                    f"dissipation.{short(key)}", "unknown key", _suggestion(key, known)
                )
        for key, required in known.items():
            if required and key not in given:
                raise _missing(f"dissipation.{key}", key)
        scope = self._scope(PHASE)
        texts = {
            key: value if key == "size" else _written(scope, value, f"dissipation.{key}")
            for key, value in given.items()
        }
        texts |= {
            key: [texts[key]] for key in VECTORS & texts.keys() if not isinstance(texts[key], list)
        }
        try:
            return cls(**texts)
        except DeclarationError as error:
            where = "dissipation" if error.where == cls.__name__ else f"dissipation.{error.where}"
            raise DeclarationError(where, error.reason, error.remedy) from None

    @cached_property
    def problem(self) -> Evolution:
        """The evolution.

        Raises
        ------
        DeclarationError
            If the model is a dissipation potential alone, or the evolution makes no sense.
        """
        for key in ("A", "load"):
            if getattr(self, key) == ():
                raise _missing(key, key)
        loads = _written(self._scope(CLOCK), self.load, "load")
        n = self.potential.dimension
        return with_nearest_start(
            lambda: Evolution(
                A=self._numbers("A"),
                load=loads if isinstance(loads, list) else [loads],
                dissipation=self.potential,
                initial=[0.0] * n if self.initial == () else self._numbers("initial"),
                epsilon=self._numbers("epsilon"),
                span=self._numbers("span"),
            )
        )

    def configure(self, given: Mapping[str, Formula]) -> EvolutionModel:
        """The same model with other parameter values (numbers) and functions (formulas).

        Raises
        ------
        DeclarationError
            If a name is neither, or a value is not admissible.
        """
        parameters, functions = dict(self.parameters), dict(self.functions)
        signatures = {parse_signature(key, "functions")[0]: key for key in functions}
        for name, value in given.items():
            if name in parameters:
                if not is_finite(value):
                    reason = f"'{short(str(value))}' is not a finite number"
                    raise DeclarationError(f"parameters.{name}", reason, "Give a number")
                parameters[name] = replace(parameters[name], default=float(value))
            elif name in signatures:
                functions[signatures[name]] = value
            else:
                reason = f"there is no parameter or function '{short(name)}'"
                raise DeclarationError(
                    self.name, reason, _suggestion(name, [*parameters, *signatures])
                )
        return replace(self, parameters=parameters, functions=functions)

    @cached_property
    def _definitions(self) -> dict[str, Definition]:
        """Functions, and the derivatives of those of one argument."""
        taken: set[str] = set()

        def claim(name: str, where: str) -> None:
            if name == PHASE:
                raise DeclarationError(where, "'s' is the phase", "Choose another name")
            check_name(name, where, taken)
            taken.add(name)

        for name, parameter in toml.mapping(self.parameters, "parameters").items():
            where = entry_key("parameters", name)
            check_shape(parameter, where)
            claim(name, where)
            check_unit(parameter.unit, f"{where}.unit")
            _check_value(parameter, where)
        declared, derivatives = dict[str, Definition](), dict[str, Definition]()
        for key, text in toml.mapping(self.functions, "functions").items():
            where = entry_key("functions", key)
            name, arguments = parse_signature(key, where)
            claim(name, where)
            declared[name] = Definition(where, arguments, text)
            if len(arguments) == 1:
                derivatives[f"d_{name}"] = Definition(where, arguments, text, arguments[0])
        return declared | {name: d for name, d in derivatives.items() if name not in taken}

    def _scope(self, *variables: str) -> Scope:
        """Parameters stand for their values."""
        names = {name: ex.num(value) for name, value in self.values.items()}
        allowed = ", ".join([*variables, "parameters"]).replace(", parameters", " and parameters")
        forbidden = {
            name: f"Only {allowed} may stand here"
            for name in (CLOCK, PHASE)
            if name not in variables
        }
        return Scope(
            names | {name: ex.sym(name) for name in variables}, self._definitions, forbidden
        )

    def _numbers(self, key: str) -> Any:
        return _evaluated(self._scope(), getattr(self, key), key)

    def _check_steps(self) -> None:
        if self.steps is None:
            return
        if isinstance(self.steps, bool) or not isinstance(self.steps, int) or self.steps < 1:
            raise DeclarationError(
                "steps", f"{short(repr(self.steps))} steps", "Give a positive whole number"
            )
        if self.is_play:
            raise DeclarationError(
                "steps", "a scalar play is computed exactly, without steps", "Leave it out"
            )


def with_nearest_start(make: Callable[[], Evolution]) -> Evolution:
    """An evolution; if it starts outside the stable set, the message gives the nearest stable
    state."""
    from stickslip.rate_independent.evolution.evolve import settle

    try:
        return make()
    except UnstableStart as unstable:
        nearest = settle(unstable.problem)
        numbers = ", ".join(f"{x:.6g}" for x in nearest[:MOST_SHOWN])
        more = ", ..." if len(nearest) > MOST_SHOWN else ""
        remedy = f"The nearest stable state is initial = [{numbers}{more}]"
        raise DeclarationError(unstable.where, unstable.reason, remedy) from None


def load(path: str | PathLike[str]) -> EvolutionModel:
    """The evolution that a model file declares.

    Raises
    ------
    DeclarationError
        If the file cannot be read or anything in it is wrong; the message names the file, the key,
        the reason and the remedy.
    """
    return loads(toml.read_text(path), str(path))


def loads(text: str, where: str = "model") -> EvolutionModel:
    """The evolution that the text of a model file declares; `where` names the text in messages.

    Raises
    ------
    DeclarationError
        If anything in it is wrong.
    """
    with toml.said_of(where):
        return _model(toml.parse(text))


def dumps(model: EvolutionModel) -> str:
    """The model as the text of a model file; :func:`loads` gives it back, equal.

    What has its default value is left out, except the default of a parameter.
    """
    return toml.written(model, GROUPS)


def _model(table: dict[str, Any]) -> EvolutionModel:
    for key in ("coordinates", "internal", "contacts"):
        if key in table:
            raise DeclarationError(
                key, "this file declares a system, not an evolution", "Use: stickslip run FILE"
            )
    given = toml.known_keys(EvolutionModel, table, "")
    if "parameters" in given:
        given["parameters"] = {
            name: toml.entry(Parameter, value, entry_key("parameters", name))
            for name, value in toml.mapping(given["parameters"], "parameters").items()
        }
    return EvolutionModel(**given)


def _frozen(value: Any) -> Any:
    """Lists as tuples, so that nobody changes a model."""
    if isinstance(value, Mapping):
        return {key: _frozen(item) for key, item in value.items()}
    return tuple(map(_frozen, value)) if isinstance(value, list | tuple) else value


def _written(scope: Scope, value: Any, where: str) -> Any:
    """Formulas in nested tuples as texts of their variables alone, or numbers, in nested lists."""
    if isinstance(value, tuple):
        return [_written(scope, item, f"{where}[{i}]") for i, item in enumerate(value)]
    expression = scope.parse(value, where)
    if not expression.symbols:
        return ex.evaluate(expression, {})
    text = ex.to_text(expression)
    if "..." in text:
        raise DeclarationError(
            where, "the formula is too long once its functions are inserted", "Simplify it"
        )
    return text


def _evaluated(scope: Scope, value: Any, where: str) -> Any:
    """Numbers of formulas in nested tuples."""
    if isinstance(value, tuple):
        return [_evaluated(scope, item, f"{where}[{i}]") for i, item in enumerate(value)]
    return ex.evaluate(scope.parse(value, where), {})


def _check_value(parameter: Parameter, where: str) -> None:
    admissible = parse_range(parameter.range, f"{where}.range")
    if not is_finite(parameter.default):
        raise DeclarationError(where, "its value is not a finite number", "Give a number")
    if parameter.default not in admissible:
        reason = f"{parameter.default:g} is outside the admissible range {admissible.text}"
        raise DeclarationError(where, reason, "Choose a value inside")


def _kind(given: Any) -> type[Dissipation]:
    kinds = ", ".join(f'"{kind}"' for kind in KINDS)
    if given is None:
        raise DeclarationError(
            "dissipation.kind", "the kind of the dissipation is missing", f"Give one of {kinds}"
        )
    if not isinstance(given, str):
        raise wrong_kind(given, "str", "dissipation.kind")
    if given not in KINDS:
        close = get_close_matches(given, KINDS, 1)
        remedy = f'Did you mean "{close[0]}"?' if close else f"Give one of {kinds}"
        raise DeclarationError("dissipation.kind", f"there is no kind '{short(given)}'", remedy)
    return KINDS[given]


def _missing(where: str, key: str) -> DeclarationError:
    return DeclarationError(where, "this key is missing", f"Add it, as in: {EXAMPLES[key]}")


def _suggestion(name: str, known: Iterable[str]) -> str:
    close = get_close_matches(name, known, 1)
    return f"Did you mean '{close[0]}'?" if close else f"Known here: {', '.join(known)}"
