"""Random texts in the place of formulas: read, or refused in one line, soon, and never executed."""

from __future__ import annotations

import random
import time

import pytest

import stickslip as ss
from seeds import seeds
from stickslip.errors import DeclarationError

SYSTEM = ss.System(
    "s",
    parameters={"a": ss.Parameter(1.5), "b": ss.Parameter(-0.7)},
    functions={"f(u)": "sin(u)*u", "g(u, v)": "u**2 - v"},
    drives={"w": "cos(3*t)"},
    coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
    kinetic="d_x**2/2 + d_y**2/2",
)
VALUES = {**SYSTEM.values, "x": 0.37, "y": -1.21, "t": 0.6, "speed": 0.3}
VALID = (
    "sin(x)*exp(-y**2) + a",
    "piecewise(x < 0, a, x < 1, b, x)",
    "mod(x + y, 2) - floor(x)",
    "min(x, y, a) + max(x, b)",
    "f(x) + g(x, y)*d_f(a)",
    "x**(a + 1)/(1 + abs(y))",
    "clip(x, -1, 1) + smoothstep(y, 0, 1)",
    "w + d_w + t*speed",
    "-x**2**0.5 + (x - y)*(x + y)",
)
TOKENS = (
    "x y a b t w speed pi f g d_f d_w sin sqrt piecewise min max mod floor clip smoothstep square "
    "( ) , + - * / ** < > <= >= == != = := : ; . .. ... @ ~ << | & ' \" \\ # ! % ^ // [ ] { } "
    "0 1 2 0.5 1e308 1e-320 9**9 1j 0x10 1_000 0b1 inf nan None True lambda if else not and or "
    "await yield import __import__ __class__ f'{x}' b'x' *x **x x=1 π 𝑥 ₓ ² − ∞ é \u202e \ud800 "
    "\0"
).split(" ")
SPACES = (" ", "\n", "\t", "")
SECONDS = 2.0  # of the processor, for one text


def random_text(rng: random.Random) -> str:
    """Tokens, characters, or a formula with something wrong."""
    kind = rng.random()
    if kind < 0.3:
        return rng.choice(SPACES).join(rng.choice(TOKENS) for _ in range(rng.randint(1, 25)))
    if kind < 0.4:
        most = rng.choice([0x7F, 0x2FFF, 0x10FFFF])
        return "".join(chr(rng.randint(0, most)) for _ in range(rng.randint(0, 40)))
    letters = list(rng.choice(VALID))
    others = TOKENS if rng.random() < 0.5 else "xyab123+-*/,()<> "
    for _ in range(rng.randint(1, 2)):
        place = rng.randrange(len(letters))
        letters[place] = rng.choice(others)
    return "".join(letters)


def value(text: str) -> float:
    """What a formula gives."""
    declaration = SYSTEM.declaration
    return declaration.value(declaration.scope.parse(text, "formula"), VALUES)


def test_random_texts(monkeypatch: pytest.MonkeyPatch) -> None:
    executed = list[str]()
    outcomes = {"read": 0, "refused": 0}
    for seed in seeds(3000):
        text = random_text(random.Random(seed))
        begun = time.process_time()
        with monkeypatch.context() as patch:
            for name in ("eval", "exec"):
                patch.setattr(f"builtins.{name}", lambda *_, name=name: executed.append(name))
            try:
                found = value(text)
            except DeclarationError as error:
                said = str(error)
                assert error.reason and error.remedy, (seed, text)
                assert "\n" not in said and len(said) < 600, (seed, text, said)
                outcomes["refused"] += 1
            else:
                assert isinstance(found, float), (seed, text)
                outcomes["read"] += 1
        assert time.process_time() - begun < SECONDS, (seed, text)
    assert not executed
    assert min(outcomes.values()) > 0.02 * sum(outcomes.values()), outcomes
