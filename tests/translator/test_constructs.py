"""Constructs of the language, against Python's own run of the same source.

What random programs meet often is here only where it once went wrong, or easily would.
"""

from __future__ import annotations

import random
from pathlib import Path
from textwrap import indent
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from .judging import by_python, differences, module_of
from .random_programs import PARAMETERS, SHARED, arguments

HELPERS = """
class Wide(NamedTuple):
    first: Pair
    second: Pair
    row: Vector
    yes: bool

COLUMNS, TURNS = np.arange(6.0).reshape(2, 3).T, np.array([1j, 0.5 - 2j])
FLAGS, SHORT = np.array([True, False]), np.array([5, -7], np.int16)
NESTED, EMPTY, ALONE = (1, (2.5, 3)), np.zeros((2, 0)), np.array(2.5)

@compiled()
def following(p, x):
    return Pair(p.a / 2 + x, p.b + 1)
@compiled()
def following_wide(w, x):
    return Wide(w.second, following(w.first, x), w.row, not w.yes)
@compiled()
def wide(deep, x):
    return Wide(Pair(x, 1), deep.pair, deep.x, deep.yes)
@compiled()
def exchanged(p, q):
    p, q = q, p
    p = Pair(p.a + q.a, q.b)
    return p, q
@compiled()
def reassigned(w, n):
    if n > 0: w = Wide(w.second, w.first, w.row[1:], w.yes)
    while n > 0:
        n -= 1
        w = Wide(w.second, w.first, w.row, not w.yes)
    return w.first.a + len(w.row)
@compiled()
def noted(v, k, yes):
    v[k] = 2.0 * v[k] + 1.0
    return yes
@compiled()
def described(x):
    total, mixed = 0.0, 1.0
    for k in range(len(x)):
        total += x[k]
        mixed = 0.5 * mixed + x[k]
    return len(x) + 100.0 * total + mixed
@compiled()
def weighted(x, y, z):
    return x + 10 * y + 100 * z
@compiled()
def halved(x: float):
    return x // 2 + 0.25
@compiled(inline=True)
def whole_half(n):
    return n // 2
@compiled()
def promised(n) -> float:
    if n > 1: return n
    return n > 0
@compiled()
def promised_complex(x) -> complex:
    if x > 2.0: return x
    if x > 0.0: return x * 1j
    return 3
@compiled()
def first(x):
    return x[0]
@compiled()
def small(x, n):
    return n > 0, (x, n), x * 1j
@compiled()
def large(x, v, m):
    return (v, (x, m), small(x, 1), v[1:], (True, 2, x))
@compiled()
def ω_of(out, entry, v1, words, then3):
    return (out + entry * entry, v1, words, then3, out, out + 1)
"""
BODIES = {
    "variables whole or real": """
a, b, d, flag = 1, i if i < 2 else x, 2, i > 0
if i > 0: a = x
if i > 2: flag = i
s = t = u = 0
for n in range(i + 7):
    a, b, d = b, d, a + 1
    if b == 3: b = x
    s = t + 1
    t = u + 1
    u = y
return a + b / 2 + 100 * d + s + flag + (3 if i == 1 else 0.5)
""",
    "exchanges": """
s = deep.x
for n in range(5):
    if v[n % 3] > s[0]:
        x, y = y, x
        v, s = s, v
        v[0], s[1] = s[1], v[0]
    x, y, a = y, x + n, x
    v[n % 3], v[(n + 1) % 3] = a, v[n % 3]
r = v if i > 0 else m[1]
s = m[i % 3] if len(r) == 3 else r[1:]
s[0] = 4.0
while len(r) > 2:
    r = r[1:]
    r[0] += 1.0
return x - 3.0 * y + r[0] + s[0]
""",
    "exchanges of tuples": """
p, q, t = deep.pair, Pair(y, i), (x, (y, i))
r = (p, (x, q))
for n in range(7):
    p, q = q, p
    p = Pair(p.a + 1.0, q.b)
    r = (r[1][1], (r[0].a, r[0]))
    r = r[0], (r[1][0], r[0])
    t = (t[1][0], (t[0], t[1][1] + 1))
    x, i = q
u = (t, t)
u = (u[1], (u[0][0], (u[0][0] - 1.0, i)))
(a, (b, n)), d = u
return p.a + 10.0 * q.a + p.b + 3.0 * r[1][0] + x - i + a + 2.0 * b + n + d[1][0]
""",
    "kept from the round before": """
p, s, total = deep.pair, wide(deep, y), 0.0
before, wide_before = p, s
for n in range(5):
    before = p
    p = following(p, x)
    wide_before = s
    s = following_wide(s, p.a)
    total += before.a - p.a + wide_before.first.a - 2.0 * s.first.a
    if s.yes: s = wide_before
return total + before.b + wide_before.second.b
""",
    "results of several calls": """
s = wide(deep, 1.0)
a, b = following_wide(s, x), following_wide(s, y)
t = following_wide(following_wide(a, y), x)
d = (following_wide(b, 1.0), following(a.first, x), following(a.first, y))
r = (s if x > 0.0 else following_wide(s, x)).second
q = (1, x) if i < 0 else (x, 2)
flag, (e, n), turn = small(x, i)
rows, (g, row), inner, rest, (yes, two, _) = large(x, v, m[1])
rest[0] = 7.0
row[0] += 1.0
e = e + n if flag else -g
total = a.second.a + 2.0 * b.second.a + 4.0 * t.first.a - d[0].second.a + d[1].a - d[2].b
total += r.a + q[1]
return total + e + turn.imag + inner[1][0] + rows[1] + two + yes + len(large(x, v, v)[3])
""",
    "parameters that are assigned to": """
s = wide(deep, y)
p, q = exchanged(s.first, s.second)
deep = Deep(following(deep.pair, x), deep.pair.a, deep.x[1:], not deep.yes)
return p.a + 3.0 * q.a + s.first.b + reassigned(s, i) + deep.pair.a + deep.s + len(deep.x)
""",
    "parts of a tuple": """
s, total = wide(deep, y), 0.0
last = s.first
for part in (s.first, s.second, following(s.first, x)):
    if part.b == i: continue
    last = part
    for a in (part.a, 2, True, x):
        if a > 3: break
        total += a
        x = total
    if part.b > i: break
for row in (v, s.row, v[1:]):
    v = row
    total = total * 0.5 + row[0]
for n in BOTH: total += n
p, q = deep.pair, Pair(y, 3)
t, rows = (p, q, p), (v, v[1:])
for other in t:
    t = (q, Pair(x, 1), q)
    total = 2.0 * total + other.a
for row in rows:
    rows = (v[2:], v[2:])
    total += len(row)
return total + last.a + part.b + v[0] + t[1].b + len(rows[0])
""",
    "parts of an argument": """
for part in (deep, Deep(Pair(x, 1), y, v, yes), deep):
    found = part
    inner = part.pair
    if part.pair.b > i: break
for both in ((deep.pair, inner), (inner, Pair(y, 2))):
    if both[0].b > i:
        one = both[1]
    else:
        one = both[0]
s, other = deep.pair, deep
return found.s + 2.0 * part.pair.a + 3.0 * inner.a + one.a + s.a + other.pair.b + other.x[1]
""",
    "constants": """
a, (b, n) = NESTED
total = float(a)
for part in NESTED[1]: total += part
for row in TABLE: total += described(row) + described(row[i % 2 :])
total += COLUMNS[1, i % 2] + SIGNS[2] + TURNS[i % 2].imag + SHORT[1] + described(SIGNS[: i % 3])
total += TABLE.shape[1] + EMPTY.shape[0] + described(EMPTY[1]) + ALONE[()]
total += described(TABLE[-1][1:])
return total + b * n + (3.0 if FLAGS[i % 2] else 5.0) + math.pi
""",
    "entries of many axes": """
n = i % 2
b4[n, 1, 0, 2] = v[n] + m[n, -1]
b4[-1][n][1 - n][-2] = a3[n, 1 + n, 1] - a3[-1, n, -2]
r, s, t = m[n], a3[n, 1], b4[n][2]
r[1] += 1.0
s[0], t[1, 2] = t[1, 2], s[0]
t[0][3] = len(r) + 10 * len(b4[0, 1]) + t.shape[1]
row = a3[-1][n]
row[n] *= 2.0
total = b4[n][1, 0][2] + b4[1, n, 1 - n, 3] + m[1][n] + r[-1] + m[n, 1] + a3[n, 1, 0]
return total + t[0, 3] + row[0]
""",
    "slices": """
i, j = abs(i), abs(k[0])
total = described(v[i:j]) + described(v[i:]) + described(v[:j]) + described(v[:])
total += described(v[-2:]) + described(v[:-1]) + described(v[-9:9]) + described(v[2:1])
total += described(v[1:-1])
total += described(v[i:-1]) + described(v[-3:j]) + described(v[0:0]) + described(v[5:9])
total += described(v[1:][i:j]) + described(v[:2][-1:]) + described(v[3:])
total += len(v[: i - 2 if i > 2 else 0]) + described(m[1, i:j])
total += described(m[-1, 1:]) + described(a3[1, 2, :1]) + described(m[0][i:])
for row in m[i:j]: total = 0.5 * total + described(row)
blocks, part = a3[1, i:], a3[1:,]
for n in range(len(blocks)): total += blocks[n, 1] + described(blocks[n])
part[0, 1, 0] = 3.5
return total + m[i:j].shape[0] + 10 * m[i:j].shape[1] + a3[1, 1, 0] + len(a3[:]) + part.shape[1]
""",
    "loops over arrays": """
total = 0.0
for a in v:
    total = 0.5 * total + a
    v[-1] += 1.0
for row in m:
    row[0] = total
    for a in row: total = 0.5 * total + a
    if row[1] > 0.0: continue
for block in a3[1:]:
    for row in block:
        if row[0] > 1.0: break
        total += row[1]
for n in k: total += n
for flag in flags: total += 2.0 if flag else -1.0
for a in v[9:]: total += 1e9 * a
for a in v:
    v = v[1:]
    total += a
return total + len(v)
""",
    "augmented assignments": """
n = i % 3
v[n] += 2
v[n] *= v[(n + 1) % 3]
m[n, 1] -= 0.5
m[n][2] /= 3.0
k[n] += 5
k[n] //= 3
k[n] <<= 2
k[-1] -= k[0]
k[1] += 1.75
v[0] = v[1] = v[2] - 1.0
v[n], m[1, n], n = m[1, n], v[n], 2
x %= 3
y = y ** 2
a = 1j
a *= x
return v[n] + x + y + a.imag
""",
    "kinds of entries": """
v[0] = i
v[1] = i > 0
k[0] = 2.75 if i > 0 else -2.75
k[1] = i < 0
flags[0] = not flags[1]
flags[1] = x > 0.0 or flags[0]
turns[0] = i
turns[1] = v[2]
turns[0] *= complex(1.0, i)
turns[1] += x
h[0, 0] = i
h[1, 2] = -128
h[1, 0] += h[0, 0] // 3
i2[0], i4[0] = -5 * i, i2[1] * 3000
i4[1] = i4[0] - i2[0]
total = turns[1].imag + h[1, 2] * 2 + (k[0] if flags[0] else 7) + i2[0] + i4[1] * 70_000
return total + abs(turns[0]) + (h[0, 0] << 3) + flags[1] + v[1]
""",
    "ranges": """
total, b, stop = 0, k[0] % 5, 4
for n in range(i): total = total * 3 + n
for n in range(i, b): total = total * 3 + n
for n in range(i, b + 9, 4): total = total * 3 + n
for n in range(b, i, -1): total = total * 3 + n
for n in range(b + 9, i, -3): total = total * 3 + n
for n in range(5, 1): total += 1000 * n
for n in range(True): total += 17 + n
for k[0] in range(3): total += k[0] * k[1]
n = -5
for n in range(i):
    n = n * 7
    i -= 1
    total += n
for j in range(3):
    for j in range(3): total += j
    total += 10 * j
for q in range(stop):
    stop = 2
    total += q * stop
return total % 1_000_003 + n
""",
    "assigned on every way": """
while True:
    i += 1
    if i > 3:
        d = x
        break
    if i < -2:
        d = 2 * x
        break
for t in (1.0, x):
    if i > 4:
        a = t
        continue
    elif t > 0.0:
        a = -t
    else:
        return d
    a += 1.0
if i == 5:
    return a
    i = 3
elif x > 0.0:
    b = 1
else:
    while True:
        i -= 1
        if i < 0: return i - a
        continue
        i += 100
return a + d + b
""",
    "what is not looked at": """
a, b, total = i > 0, k[0] > 0, 0.0
if noted(v, 0, a) and noted(v, 1, b) or noted(v, 2, i > k[0]): total += 1.0
if not (noted(v, 0, b) or not noted(v, 1, a)): total += 2.0
d = noted(v, 0, a) or noted(v, 1, b) and noted(v, 2, a)
e = a and (noted(v, 0, b) or b)
total += 4.0 if d and not noted(v, 0, e) else noted(v, 1, i)
n = 0
while n < 3 and noted(v, n, v[n] < 5.0): n += 1
g = (noted(v, 0, a) and b) == (d or noted(v, 2, e))
while i: i = i // 2 if i > 0 else i + 1
return total + 8.0 * d + 16.0 * e + 32.0 * g + n + (1.0 if x else 0.5)
""",
    "names and types of arguments": """
p, q, turn = Pair(b=i, a=x), Pair(x, b=i + 1), promised_complex(x)
a, b, s, d, e, g = ω_of(y, x, i, i + 1, i + 2)
t: float = i
t = t / 2 + weighted(x, z=i, y=2) + weighted(z=x, y=i, x=1) + p.a - q.b + weighted(p.b, y=1, z=2)
t += a + b + 2 * s + 4 * d + 8 * e + 16 * g + turn.real + turn.imag + promised_complex(i).imag
t += halved(i) + whole_half(i) * 3 + whole_half(x) * 7 + promised(i) / 2 + promised(i > 2)
t += first(v) + first(first(m)) + first(k) // 2 + first(first((v, i))) + first((i, v))
return t + first(turns).imag + (1.0 if first(flags) else 2.0)
""",
}
MORE = {
    "a3": ("f8", (3, 4, 2)),
    "b4": ("f8", (3, 4, 2, 5)),
    "flags": ("b1", (2,)),
    "turns": ("c16", (2,)),
    "h": ("i1", (2, 3)),
    "i2": ("i2", (2,)),
    "i4": ("i4", (2,)),
}
"""Arrays that are given besides those of random programs: types of entries, and lengths."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """An entry of each body."""
    notes = {name: note for name, (_, note) in PARAMETERS.items()}
    notes |= {name: f'Annotated[np.ndarray, "{kind}:{len(n)}"]' for name, (kind, n) in MORE.items()}
    head = ", ".join(f"{name}: {note}" for name, note in notes.items())
    lines = [SHARED, HELPERS]
    for number, body in enumerate(BODIES.values()):
        lines += [f"@entry_point()\ndef f{number}({head}) -> float:", indent(body, "    ")]
    return module_of("\n".join(lines), tmp_path_factory.mktemp("constructs"))


@pytest.mark.parametrize("what", BODIES)
def test_constructs(made: ModuleType, what: str) -> None:
    name = f"f{list(BODIES).index(what)}"
    rng, reference, wrong = random.Random(what), by_python(made)[name], list[str]()
    for _ in range(60):
        more = [
            np.array([rng.randint(-4, 4) for _ in range(np.prod(n))], kind).reshape(n)
            for kind, n in MORE.values()
        ]
        given: tuple[Any, ...] = (*arguments(rng, made), *more)
        wrong += filter(None, [differences(getattr(made, name), reference, given)])
    assert not wrong[:3]


def powers(rng: random.Random) -> str:
    """A function with powers of variables that are whole first and real later."""
    names = rng.sample("abcd", 3)
    powers = [f"total += {rng.choice(names)} ** {rng.choice(('2', '3', '-1', 'k'))}"] * 2
    turns = [f"{x} = {rng.choice(names)} * 0.5 + {rng.randrange(1, 9) / 8}" for x in names]
    lines = rng.sample(powers + turns + ["total += k"], 6)
    first = "; ".join(f"{x} = {rng.randrange(1, 5)}" for x in names)
    return f"""@entry_point()
def f(n: int) -> float:
    {first}; total = 0.0
    for k in range(n):
        {"; ".join(lines)}
    return total
"""


def test_powers_of_what_is_real_in_the_end(tmp_path: Path) -> None:
    rng = random.Random(1)
    for _ in range(25):
        module = module_of(powers(rng), tmp_path)
        for n in (0, 1, 5):
            assert not differences(module.f, by_python(module)["f"], (n,))


# Conditions that are constants, and code that no way leads to.
DEAD = (
    "while 1:\n x += 1.0\n if x > 9.0: break",
    "while True:\n if n > 5: return x\n n += 1\n continue",
    "while False: x = 2.0",
    "if False: y = 1.0\nelse: y = x\nx = y",
    "if True: return x\nelse: return 2.0 * x",
    "x += (1.0 if True else 2.0) + (x if not True else 3.0)",
    "x += 1.0 if True or x > 1.0 else 2.0",
    "y = x > 0.0 and (True and n > 1)\nx += float(y) + float(False or n > 2)",
    "for k in range(n): return x + k",
    "for k in range(n):\n while True:\n  x += 1.0\n  if x > 5.0: return x",
    "for k in range(n):\n if k == 2: continue\n else: break",
    "for a in (1.0, x, 3.0):\n if n > 1: break\n return a",
    "for a in (1.0, x, 3.0):\n if a > 2.0: continue\n x += a",
)


@pytest.mark.parametrize("body", DEAD)
def test_code_that_is_never_reached(body: str, tmp_path: Path) -> None:
    head = "@entry_point()\ndef f(n: int, x: float) -> float:\n"
    module = module_of(f"{head}{indent(body, '    ')}\n    return x\n", tmp_path)
    for given in ((0, -3.0), (1, 0.5), (3, 2.5)):
        assert not differences(module.f, by_python(module)["f"], given)
