"""Random functions of the language, compiled and run by Python: ``--help``."""

from __future__ import annotations

import argparse
import itertools
import os
import random
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from .judging import by_python, differences, module_of


class Tuple(NamedTuple):
    """The kind of a tuple: the name of its class, its fields, their kinds."""

    name: str
    fields: tuple[str, ...]
    parts: tuple[Any, ...]


PAIR = Tuple("Pair", ("a", "b"), ("float", "int"))
DEEP = Tuple("Deep", ("pair", "s", "x", "yes"), (PAIR, "float", "f8:1", "bool"))
SHARED = """
class Pair(NamedTuple):
    a: float
    b: int

class Deep(NamedTuple):
    pair: Pair
    s: float
    x: Vector
    yes: bool

N, HALF, UNIT, BOTH = 3, 0.5, 1j, (2, -1.5)
TABLE, SIGNS = np.array([[0.5, -2.0, 3.0], [1e-3, 0.0, -0.0]]), np.array([1, -1, 7], np.int8)
"""
PARAMETERS: dict[str, tuple[Any, str]] = {
    "i": ("int", "int"),
    "x": ("float", "float"),
    "y": ("float", "float"),
    "yes": ("bool", "bool"),
    "v": ("f8:1", "Vector"),
    "m": ("f8:2", "Matrix"),
    "k": ("i8:1", "IntVector"),
    "w": ("b1:1", "BoolVector"),
    "c": ("c16:1", "ComplexVector"),
    "deep": (DEEP, "Deep"),
}
"""Of an entry: kinds and annotations. `v` and `m`, which stay what they are, have some entries."""
ENTRIES = {"f8:1": "float", "i8:1": "int", "b1:1": "bool", "c16:1": "complex"}
NUMBERS = ("int", "float", "bool", "complex", "any")
"""Kinds of numbers; ``any`` is whole in one place and real in another."""
LITERALS = {
    "int": "0 1 2 -1 3 7 -5 100 N SIGNS[1] BOTH[0] len(TABLE)".split(),
    "float": "0.0 1.0 -0.0 0.5 -1.5 2.0 3.25 1e-3 HALF TABLE[1,0] BOTH[1] math.pi".split(),
    "bool": ["True", "False"],
    "complex": ["1j", "(0.5-2j)", "0j", "UNIT", "(-1.25+0.0j)"],
}
# What is made of what: {i} is a whole number, {x} a real one, {n} one that is not large, {b} a
# truth value, {z} a complex number, {any} whole or real, {v} an array, {in f8:1} an entry of one.
WAYS = {
    "int": """(({i} + {i}) % 1009); (({i} - {i}) % 499); ({i} * {i} % 1009); ({i} & {i})
        ({i} | {i}); ({i} ^ {i}); (({i} << ({i} & 7)) % 997); ({i} >> ({i} & 7))
        ({i} // (abs({i}) + 1)); ({i} // min({i}, -2)); ({i} % min({i}, -1)); ({i} % 7)
        (-{i}); (+{i}); abs({i}); min({i}, {i}); max({i}, {i}, 2)
        int({n}); int({b}); ({b} + {b}); ({i} * {b}); (-{b}); math.floor({n}); math.ceil({n})
        len({v}); {m}.shape[0]; {m}.shape[-1]; {in i8:1}; math.frexp({n})[1]; ({b} | {i})""",
    "float": """({x} + {x}); ({x} - {x}); ({x} * {x}); ({x} / max(abs({x}), 0.25)); ({i} / 3)
        ({x} / min({x}, -0.5)); ({x} + {i}); ({i} * {x}); ({any} - {x}); ({x} * {any}); (-{x})
        ({x} // max({x}, 0.25)); ({x} // min(-0.25, {x})); ({x} % max({x}, 1e-3)); (+{x})
        ({x} % min({x}, -1.5)); ({x} % (abs({i}) + 1)); (({x}) ** 2); (({x}) ** 3); (({n}) ** -2)
        (({x}) ** 7); (({x}) ** 0); (({x}) ** -1); math.pow(abs({n}), 1.5); abs({x}); min({x}, {x})
        max({x}, {x}, 0.5); float({i}); float({b}); {z}.real; {z}.imag; abs({z}); math.sin({n})
        math.cos({n}); math.tan({n}); math.atan({x}); math.exp({n}); math.tanh({x}); math.erf({x})
        math.sqrt(abs({x})); math.log(abs({n}) + 0.25); math.log1p(abs({n})); math.fabs({x})
        math.atan2({x}, {x}); math.copysign({x}, {n}); np.floor({x}); np.ceil({x}); math.sinh({n})
        math.fmod({n}, max({x}, 0.5)); math.ldexp({n}, {i} & 7); math.frexp({x})[0]; ({b} * {x})
        fma({n}, {n}, {i}); {in f8:1}; {in f8:2}; float({any}); float(({any} + {any}))""",
    "bool": """({i} < {i}); ({x} <= {x}); ({i} > {x}); ({x} >= {i}); ({i} == {i}); ({x} != {x})
        ({any} < {any}); (0 < {i} <= 5); ({x} > 0.25 != 2.0); (-1 < {x} < {n1}); ({b} and {b})
        ({b} or {b}); (not {b}); ({b} and {b} or {x} > {x}); ({b} == {b}); ({b} | {b}); ({b} & {b})
        ({b} ^ {b}); ({i} in ({i}, 2, -1)); ({i} not in (0, {i})); ({z} == {z}); ({z} != {x})
        bool({i}); bool({x}); math.isfinite({x}); math.isnan({x}); {in b1:1}; (not {i})""",
    "complex": """({z} + {z}); ({z} - {x}); ({z} * {z}); ({x} * {z}); ({z} / (abs({x}) + 0.5))
        (-{z}); ({i} + {z}); ({z} / (1.5 - 2j)); ({z}).conjugate(); complex({x}, {x})
        complex({i}, {b})
        cmath.exp(complex({n}, {n})); {in c16:1}; complex({x}); complex({z})""",
}
FEW = 25  # programs of a module
LETTERS = {"i": "int", "x": "float", "b": "bool", "z": "complex", "any": "any", "m": "f8:2"}


def parts_of(name: str, own: Any, kind: Any) -> Iterator[str]:
    """What of a variable is of a kind: itself, or parts of it."""
    if own == kind:
        yield name
    if isinstance(own, Tuple):
        for k, (field, part) in enumerate(zip(own.fields, own.parts, strict=True)):
            yield from parts_of(f"{name}.{field}" if own.name else f"{name}[{k}]", part, kind)


def indented(lines: list[str]) -> list[str]:
    """The lines of a block."""
    return [f"    {line}" for line in lines]


class Writer:
    """Writes functions at random.

    Parameters
    ----------
    seed : str
        From it follows what is written.
    """

    def __init__(self, seed: str) -> None:
        self.random = random.Random(seed)
        self.pick = self.random.choice
        self.name = f"f{re.sub('[^0-9]', '_', seed)}"
        self.helpers: list[tuple[str, list[Any], Any]] = []

    # -- functions ---------------------------------------------------------------------------------

    def program(self) -> str:
        """Some functions that call each other, and an entry."""
        helpers = [self.helper(f"{self.name}_{k}") for k in range(self.random.randrange(4))]
        self.begin({name: kind for name, (kind, _) in PARAMETERS.items()}, "float", nested=3)
        self.kept = {"v", "m"}
        given = ", ".join(f"{name}: {note}" for name, (_, note) in PARAMETERS.items())
        head = f"@entry_point()\ndef {self.name}({given}) -> float:"
        return "\n".join([*helpers, head, *self.body(self.random.randint(3, 9)), ""])

    def begin(self, scope: dict[str, Any], result: Any, nested: int) -> None:
        """Begin a function."""
        self.scope = dict(scope)  # what has a value here
        self.known = dict(scope)  # what has a value somewhere
        self.kept = set[str]()  # what is not assigned to
        self.result = result
        self.left = nested  # how deep statements may still be nested
        self.loops = 0  # around this place

    def body(self, count: int) -> list[str]:
        """Statements, and a result."""
        return indented([*self.block(count), f"return {self.value(self.result)}"])

    def helper(self, name: str) -> str:
        """A function that others call."""
        kinds = [self.kind() for _ in range(self.pick((1, 2, 2, 3)))]
        scope = {f"p{k}": kind for k, kind in enumerate([*kinds, *ENTRIES, "f8:2"])}
        kinds = list(scope.values())
        result = self.pick([*NUMBERS, self.tuple_kind(), self.tuple_kind()])
        self.begin(scope, result, nested=1)
        lines = self.body(self.random.randint(0, 5))
        given = [x + self.pick(("", ": float")) * (kind == "any") for x, kind in scope.items()]
        note = " -> float" if result == "any" and self.pick((True, False)) else ""
        self.helpers.append((name, kinds, result))
        head = f"@compiled({self.pick(['', 'inline=True'])})\ndef {name}({', '.join(given)}){note}:"
        return "\n".join([head, *lines, ""])

    def kind(self) -> Any:
        """Some kind of value."""
        return self.pick([*NUMBERS, *NUMBERS, *ENTRIES, "f8:2", *[self.tuple_kind()] * 5])

    def tuple_kind(self, depth: int = 1) -> Tuple:
        """Some kind of tuple."""
        if self.random.random() < 0.3:
            return self.pick((PAIR, DEEP))
        kinds = [*NUMBERS, *NUMBERS, "f8:1", "i8:1", PAIR]
        kinds += [self.tuple_kind(depth - 1)] * (2 * depth)
        parts = tuple(self.pick(kinds) for _ in range(self.pick((1, 2, 2, 3, 5))))
        return Tuple("", parts, parts)

    # -- statements --------------------------------------------------------------------------------

    def block(self, count: int) -> list[str]:
        """Some statements."""
        return [line for _ in range(count) for line in self.statement()] or ["pass"]

    def statement(self) -> list[str]:
        """A statement, as lines."""
        ways = [self.assignment] * 6 + [self.swap, self.unpacking, self.augmented, self.writing]
        if self.left:
            ways += [self.choice] * 3 + [self.leaving] * (1 + self.loops)
            ways += [self.over_range, self.counted, self.over_array, self.over_tuple]
        return self.pick(ways)()

    @contextmanager
    def inside(self, loop: bool) -> Iterator[None]:
        """Within a statement; what gets a value there has none after it."""
        before = dict(self.scope), set(self.kept), self.left, self.loops
        self.left -= 1
        self.loops += loop
        yield
        self.scope, self.kept, self.left, self.loops = before

    def free(self, kind: Any) -> list[str]:
        """Variables of a kind that may change."""
        return [x for x, own in self.known.items() if own == kind and x not in self.kept]

    def target(self, kind: Any) -> str:
        """A variable that is given a value."""
        name = self.pick([*self.free(kind), f"a{len(self.known)}"])
        self.scope[name] = self.known[name] = kind
        return name

    def assignment(self) -> list[str]:
        """``a = b = value``."""
        kind = self.kind()
        value = self.value(kind)
        names = [self.target(kind) for _ in range(self.pick((1, 1, 1, 2)))]
        return [f"{' = '.join(names)} = {value}"]

    def swap(self) -> list[str]:
        """``a, b = b, a``."""
        names = [x for x in self.free(self.pick(list(self.scope.values()))) if x in self.scope]
        if len(names) < 2:
            return self.assignment()
        several = self.random.sample(names, min(len(names), self.pick((2, 2, 3))))
        return [f"{', '.join(several)} = {', '.join([*several[1:], several[0]])}"]

    def unpacking(self) -> list[str]:
        """``a, b = tuple``."""
        kind = self.tuple_kind()
        value = self.value(kind)
        return [f"{', '.join(self.target(part) for part in kind.parts)}, = {value}"]

    def augmented(self) -> list[str]:
        """``a += value``."""
        kind = self.pick(("int", "float", "complex", "any"))
        names = [x for x in self.free(kind) if x in self.scope]
        if not names:
            return self.writing()
        name = self.pick(names)
        line = f"{name} {self.pick('+-*' if kind == 'float' else '+-')}= {self.value(kind)}"
        return [line, f"{name} %= 1009"] if kind == "int" else [line]

    def writing(self) -> list[str]:
        """To an entry of an array."""
        array = self.pick([*ENTRIES, "f8:2"])
        kind = ENTRIES.get(array, "float")
        into = self.value(array, 1)
        sign = "=" if kind == "bool" else self.pick(("=", "=", "+=", "-="))
        kind = self.pick(
            {"float": ["float", "float", "int"], "int": ["int", "bounded"]}.get(kind, [kind])
        )
        test, place = self.place(into, array)
        lines = [f"{place} {sign} {self.value(kind)}"]
        lines += [f"{place} %= 1009"] if array == "i8:1" else []
        return [f"if {test}:", *indented(lines)]

    def choice(self) -> list[str]:
        """``if``, perhaps with ``elif`` and ``else``."""
        lines, ways = list[str](), [set(self.scope)]
        for head in self.pick((["if"], ["if", "else"], ["if", "else"], ["if", "elif", "else"])):
            lines.append("else:" if head == "else" else f"{head} {self.value('bool')}:")
            ways = ways[1:] if head == "else" else ways
            with self.inside(loop=False):
                block = self.block(self.random.randint(1, 3))
                block += [self.way_out()] if self.random.random() < 0.1 else []
                lines += indented(block)
                if not block[-1].startswith(("return", "break", "continue")):
                    ways.append(set(self.scope))
        shared = set.intersection(*ways) if ways else set(self.scope)
        self.scope = {name: kind for name, kind in self.known.items() if name in shared}
        return lines

    def leaving(self) -> list[str]:
        """Leave the loop, its round, or the function."""
        return [f"if {self.value('bool')}:", f"    {self.way_out()}"]

    def way_out(self) -> str:
        """``break``, ``continue`` or ``return``."""
        way = self.pick(("break", "continue", "return")) if self.loops else "return"
        return f"return {self.value(self.result)}" if way == "return" else way

    def loop(self, head: str, *before: str) -> list[str]:
        """A loop with some body."""
        return [head, *indented([*before, *self.block(self.random.randint(1, 4))])]

    def over_range(self) -> list[str]:
        """``for i in range(...)``."""
        few = f"{self.value('int', 1)} % {self.pick((2, 3, 4))}"
        ends = (few, "3", f"-1, {few}", "3, -1, -1", f"{few}, 5, 2", f"{few}, N", "5, -2, -3")
        with self.inside(loop=True):
            return self.loop(f"for {self.target('int')} in range({self.pick(ends)}):")

    def counted(self) -> list[str]:
        """``while``."""
        name = f"n{len(self.known)}"
        self.scope[name] = self.known[name] = "int"
        self.kept.add(name)
        first = f"{name} = {self.pick((0, 2, 3))}"
        with self.inside(loop=True):
            if self.random.random() < 0.5:
                test = self.pick((f"{name} > 0", f"{name} > 0 and {self.value('bool')}"))
                return [first, *self.loop(f"while {test}:", f"{name} -= 1")]
            leave = f"{name} -= 1", f"if {name} < 0:", "    break"
            return [first, *self.loop("while True:", *leave)]

    def over_array(self) -> list[str]:
        """``for`` over entries or rows."""
        array = self.pick([*ENTRIES, "f8:2"])
        source = self.value(array, 1)
        with self.inside(loop=True):
            return self.loop(f"for {self.target(ENTRIES.get(array, 'f8:1'))} in {source}:")

    def over_tuple(self) -> list[str]:
        """``for`` over the parts of a tuple."""
        kind = self.kind()
        parts = [self.value(kind, 1) for _ in range(self.pick((1, 2, 3)))]
        source, lines = f"({', '.join(parts)},)", list[str]()
        if self.random.random() < 0.5:
            name = self.target(Tuple("", (kind,) * len(parts), (kind,) * len(parts)))
            lines, source = [f"{name} = {source}"], name
        with self.inside(loop=True):
            return lines + self.loop(f"for {self.target(kind)} in {source}:")

    # -- values ------------------------------------------------------------------------------------

    def value(self, kind: Any, depth: int = 3) -> str:
        """An expression."""
        if kind == "bounded":
            return f"max(-30.0, min({self.value('float', depth)}, 30.0))"
        ways: list[Callable[[], str | None]] = [lambda: self.old(kind)] * 3
        if depth > 0 and self.random.random() < 0.4:
            ways += [lambda: self.either(kind, depth - 1), lambda: self.called(kind, depth - 1)] * 2
        if isinstance(kind, Tuple):
            ways += [lambda: self.new_tuple(kind, max(depth - 1, 0))] * 3
        elif kind == "any":
            ways += [lambda: self.value(self.pick(("int", "float")), depth)] * 3
        elif kind in NUMBERS:
            ways += [lambda: self.pick(LITERALS[kind])]
            ways += [lambda: self.made(kind, depth - 1)] * (8 if depth > 0 else 0)
        elif depth > 0:
            ways += [lambda: self.part_of_array(kind)]
        found = None
        while found is None:
            found = self.pick(ways)()
        return found

    def made(self, kind: str, depth: int) -> str:
        """A number that is computed."""

        def part(match: re.Match[str]) -> str:
            name = match[1]
            if name.startswith("in "):
                test, place = self.place(self.value(name[3:], 0), name[3:])
                return f"({place} if {test} else {self.value(kind, depth)})"
            if name == "n1":  # Python would not look at it if the first comparison failed
                return self.pick(LITERALS["float"])
            if name in ("n", "v"):
                return self.value("bounded" if name == "n" else self.pick([*ENTRIES]), depth)
            return self.value(LETTERS[name], depth)

        return re.sub(r"\{([^}]*)\}", part, self.pick(re.split(r";\s*|\n\s*", WAYS[kind])))

    def old(self, kind: Any) -> str | None:
        """What a variable has, or a part of one."""
        found = [text for name, own in self.scope.items() for text in parts_of(name, own, kind)]
        return self.pick(found) if found else None

    def either(self, kind: Any, depth: int) -> str:
        """A conditional expression."""
        test, a, b = (self.value(x, depth) for x in ("bool", kind, kind))
        return f"({a} if {test} else {b})"

    def called(self, kind: Any, depth: int) -> str | None:
        """What a function returns."""
        found = [helper for helper in self.helpers if helper[2] == kind]
        if not found:
            return None
        name, kinds, _ = self.pick(found)
        given = [self.value(other, depth) for other in kinds]
        return f"{name}({self.some_named(given, [f'p{k}' for k in range(len(given))])})"

    def new_tuple(self, kind: Tuple, depth: int) -> str:
        """A tuple of its parts."""
        parts = [self.value(part, depth) for part in kind.parts]
        return (
            f"{kind.name}({self.some_named(parts, kind.fields)})"
            if kind.name
            else f"({', '.join(parts)},)"
        )

    def some_named(self, given: list[str], names: Any) -> str:
        """Arguments, the last ones perhaps with their names."""
        split = self.pick((self.random.randint(0, len(given)), len(given)))
        pairs = list(zip(names, given, strict=True))
        return ", ".join(given[:split] + [f"{name}={x}" for name, x in pairs[split:]])

    def part_of_array(self, kind: str) -> str | None:
        """A slice, or a row."""
        some = [f"{self.value('int', 0)} % 5", "", "0", "1", "-1", "-2", "3", "9", "-7"]
        ends = f"{self.pick(some)}:{self.pick(some)}"
        if kind == "f8:1" and "m" in self.kept and self.random.random() < 0.5:
            return f"m[{self.pick(('0', '-1', 'abs(i) % 3'))}{self.pick((']', f', {ends}]'))}"
        array = self.old(kind)
        return array and f"{array}[{ends}]"

    def place(self, array: str, kind: str) -> tuple[str, str]:
        """Whether an array has entries, and one of them."""
        i, j = self.value("int", 0), self.value("int", 0)
        if kind == "f8:2":
            between = self.pick((", ", "]["))
            return (
                f"min({array}.shape) > 0",
                f"{array}[{i} % len({array}){between}{j} % {array}.shape[1]]",
            )
        return f"len({array}) > 0", f"{array}[{self.pick(('-1', '0', f'{i} % len({array})'))}]"


# -- running ---------------------------------------------------------------------------------------


def arguments(rng: random.Random, module: Any) -> tuple[Any, ...]:
    """Some arguments of an entry."""
    special = [0.0, -0.0, 1.0, -1.0, 1e-300, -1e300, float("inf"), float("nan")]

    def real() -> float:
        return (
            rng.choice(special) if rng.random() < 0.15 else rng.choice((1, 1, 40)) * rng.gauss(0, 1)
        )

    def vector(n: int) -> Any:
        return np.array([real() for _ in range(n)])

    v = vector(rng.choice((3, 5)))
    pair = module.Pair(real(), rng.randint(-9, 9))
    deep = module.Deep(pair, real(), rng.choice((v, vector(4))), True)
    k = np.array([rng.randint(-20, 20) for _ in range(4)])
    w = np.array([rng.random() < 0.5 for _ in range(rng.choice((0, 3)))], bool)
    c = np.array([complex(real(), real()) for _ in range(rng.choice((0, 3)))], complex)
    m = vector(12).reshape(3, 4)
    return rng.randint(-6, 6), real(), real(), rng.random() < 0.5, v, m, k, w, c, deep


def tried(numbers: range, seed: int, folder: Path, times: int = 6) -> tuple[int, list[str]]:
    """How many runs of some programs agree, and what is said of the others.

    Parameters
    ----------
    numbers : range
        Of the programs.
    seed : int
    folder : Path
        For their module.
    times : int
        How often each of them runs; not counted where Python raises an error.
    """
    writers = [Writer(f"{seed}/{number}") for number in numbers]
    module = module_of(SHARED + "\n\n".join(writer.program() for writer in writers), folder)
    reference, agreed, wrong = by_python(module), 0, list[str]()
    with patch.dict(os.environ, STICKSLIP_CACHE=str(folder / "cache")):  # theirs is for once
        for writer, k in itertools.product(writers, range(times)):
            name, given = writer.name, arguments(random.Random(f"{writer.name}/{k}"), module)
            with suppress(ArithmeticError, ValueError):
                found = differences(getattr(module, name), reference[name], given)
                agreed += not found
                wrong += [f"{module.__file__}: {name}: {found}"] * bool(found)
    return agreed, wrong


def main() -> int:
    """Many programs, in modules of a few dozen."""
    parser = argparse.ArgumentParser(prog="python -m tests.translator.random_programs")
    parser.add_argument("--count", type=int, default=1000, help="of programs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first program")
    parser.add_argument("--keep", type=Path, help="folder for the modules, else a temporary one")
    given = parser.parse_args()
    last, agreed, failed = given.first + given.count, 0, 0
    with tempfile.TemporaryDirectory() as temporary:
        for first in range(given.first, last, FEW):
            numbers = range(first, min(first + FEW, last))
            fine, wrong = tried(numbers, given.seed, given.keep or Path(temporary))
            agreed, failed = agreed + fine, failed + len(wrong)
            print(*wrong, sep="\n", end="\n" * bool(wrong), flush=True)
    print(f"{given.count} programs: {agreed} runs agree, {failed} do not")
    return failed > 0


if __name__ == "__main__":
    sys.exit(main())
