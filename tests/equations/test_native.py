"""Machine code written from the tape computes what an interpreter of the same tape computes, which
shares no code with it (``oracles/tape.py``)."""

from __future__ import annotations

import builtins
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from oracles.tape import ARITHMETIC, OTHERS, Interpreted
from stickslip import (
    Contact,
    Inertial,
    Internal,
    Parameter,
    RateIndependent,
    System,
    Unilateral,
    Viscous,
    catalogue,
    simulate,
)
from stickslip.arrays import Array, IntVector, Matrix, Vector
from stickslip.equations.codegen.generate import generate
from stickslip.equations.codegen.layout import Generated, Layout
from stickslip.equations.derive import derive
from stickslip.equations.native import looped as looped_series
from stickslip.equations.native.systems import assembly_of, compile_system
from stickslip.machine_code import objects
from stickslip.machine_code.functions import entry_point
from stickslip.machine_code.interface import (
    INTERFACE,
    Jets,
    Powers,
    Residuals,
    SystemFunction,
)
from stickslip.machine_code.objects import addresses
from stickslip.motion.engine.tables import run_setups
from stickslip.motion.problem import pose
from stickslip.motion.steps.arrays import (
    AIM,
    AIM_SPEED,
    Constants,
    Space,
    make_space,
)
from stickslip.symbolic.scalars import ParameterExpressions, Scalar, Store, element
from stickslip.symbolic.tape import DIRECTION_GIVEN, Op

UNIT = 0.7  # of time, in which the series are
TRIALS = 12

EVERYTHING = System(
    "everything",
    parameters={"p": Parameter(1.7), "w": Parameter(1.3)},
    internal={
        "x": Internal(
            "exp(-x) + log(2 + x**2) + sqrt(1 + x**2) + 1/(2 + x**2) + x/(3 + x**2) + sin(w*t + x)"
            " + sin(x)*cosh(x) + tanh(x) + tan(x/3) + atan(x) + erf(x) + asinh(x*y)"
        ),
        "y": Internal("abs(x)**p + max(x - y, 0)**2 + (1 + y**2)**p + cos(w*t) + y**5 - y**(-2)"),
    },
    initial={"x": 0.4, "y": 0.6},
)
PIECES = System(
    "pieces",
    parameters={"T": Parameter(1.7), "w": Parameter(1.3)},
    internal={
        "x": Internal(
            "floor(3*x) + mod(t + x, T) + triangle(w*t) + sawtooth(2*x) + log1p(x**2)"
            " + max(T - w, 0)*abs(T - 2)"
        ),
        "y": Internal("sign(y)*square(w*t) + heaviside(x - y)*asin(y/3) + expm1(-x) + acos(x/9)"),
        "z": Internal("smoothstep(z, x, x + T)*mod(t, T) + floor(t/T)"),
    },
    initial={"x": 0.4, "y": 0.6},
)
MIXED = System(
    "all three kinds",
    parameters={
        name: Parameter(value)
        for name, value in dict(m=2.0, n=1.5, k=1.1, c=0.4, nu=0.7, rho=0.6, w=0.1).items()
    },
    coordinates={"x": Inertial(), "y": Inertial(), "z": Viscous(), "r": RateIndependent()},
    internal={"a": Internal("1 - a*abs(d_z) + w*sin(a)")},
    kinetic="m/2*d_x**2 + n/2*d_y**2 + d_x*d_y/5",
    potential="k/2*(x - r)**2 + c/4*z**4 + (z - y)**2/2 - r*cos(t) + r**4/12 + exp(-x)/9",
    viscous="nu/2*d_z**2 + c/2*(d_x - d_y)**2",
    contacts={
        "floor": Contact("d_x - d_y/2", "rho*(1 + x**2)", kinetic="rho/2/(1 + speed)"),
        "wall": Contact("d_z", ("1 + abs(a)", "2"), surface_speed="0.1*sin(3*t)"),
        "ground": Contact("d_r", "1 + x**2/5 + r**2/7"),
    },
)
COUPLED = System(
    "many masses, one rope",
    parameters={"k": Parameter(1.0)},
    coordinates={f"x{i}": Inertial() for i in range(10)},
    kinetic=" + ".join(f"d_x{i}**2/2" for i in range(10)) + " + d_x0*(d_x1 + d_x9)/9",
    potential=" + ".join(f"k/2*(x{i} - x{i + 1})**2" for i in range(9)),
    contacts={"rope": Contact(" + ".join(f"d_x{i}" for i in range(10)), "1")},
)
RESISTED = System(
    "resisted",
    coordinates={
        "q": Inertial(),
        "u": Viscous(drag="(2 + sin(d_q) + max(alpha, 0)**2)*asinh(5*d_u)"),
        "w": Viscous(),
        "v": Viscous(drag="sinh(d_v)*(2 + cos(q + t))"),
    },
    kinetic="d_q**2/2",
    potential="(q - u)**2/2 + (u - v)**2 + (v - w)**2/2 - u*sin(t)",
    viscous="d_u**2/2 + d_w**2/2 + d_q**2/2 + 0.1*d_q*d_u",
    internal={"alpha": Internal("d_u*d_v - alpha + d_w")},
    contacts={"ground": Contact("d_w", "0.5")},
    initial={"q": 0.1},
)
PRESSED = System(
    "pressed in a plane",
    parameters={"mu": Parameter(0.4), "w": Parameter(1.3)},
    coordinates={"x": Inertial(), "y": Inertial(), "z": Inertial()},
    kinetic="d_x**2/2 + 0.7*d_y**2 + 0.2*d_x*d_y + d_z**2/2",
    potential="(2 + sin(w*t) + x**2)*z + x**2/2 + x*y/3",
    contacts={"foot": Unilateral("z - sin(w*t)/9", ("d_x", "d_x + d_y"), "mu", axes=(1.0, 0.6))},
    initial={"d_x": 0.4, "d_y": -0.2},
)
EDGES = System(
    "on edges",  # a mass that may be negative, a root of rounding errors
    coordinates={"q": Inertial()},
    kinetic="(1 - 9*q**2)*d_q**2/2",
    potential="q**2/2",
    internal={"a": Internal("sqrt((a + q)**2 - a**2 - 2*a*q - q**2) - a")},
    initial={"a": 1.0},
)
LOOSE = System(
    "loose",  # a force without stiffness
    coordinates={"r": RateIndependent()},
    potential="-r*cos(t)",
    contacts={"ground": Contact("d_r", "1")},
)
SYSTEMS = {name: name for name in catalogue.names()} | {
    system.name: system
    for system in (EVERYTHING, PIECES, MIXED, COUPLED, RESISTED, PRESSED, EDGES, LOOSE)
}
SYSTEMS["a long chain"] = catalogue.block_chain(N=40)


@cache
def generated_of(name: str) -> tuple[System, Generated]:
    named = SYSTEMS[name]
    system = catalogue.get(named) if isinstance(named, str) else named
    return system, generate(derive(system.declaration))


@cache
def oracle_of(name: str) -> Interpreted:
    _, generated = generated_of(name)
    return Interpreted(generated)


def compiled_by_llvm(generated: Generated, folder: Path) -> dict[str, SystemFunction]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(objects, "cache_folder", lambda: folder)
        found = addresses(assembly_of(generated), list(INTERFACE))
    return {name: kind(at) for (name, kind), at in zip(INTERFACE.items(), found, strict=True)}


@entry_point()
def call_residual(
    f: Residuals,
    t: float,
    y: Vector,
    mode: IntVector,
    reg: IntVector,
    K: Vector,
    G: Vector,
    P: Matrix,
) -> None:
    f(t, y, mode, reg, K, G, P)


@entry_point()
def call_powers(f: Powers, W: Matrix, reg: IntVector, K: Vector, out: Vector) -> None:
    f(W, reg, K, out)


@entry_point()
def call_jets(
    f: Jets,
    t: float,
    y: Vector,
    mode: IntVector,
    reg: IntVector,
    K: Vector,
    Rq: Matrix,
    Rz: Matrix,
    N: int,
    s: Space,
) -> int:
    return f(t, y, mode, reg, K, Rq, Rz, N, s.W, s.A, s.B, s.mag)


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    """What is infinite or undefined is compared, too."""
    with np.errstate(all="ignore"):
        yield


def constants_of(system: System, generated: Generated) -> tuple[Array, Constants]:
    layout = generated.layout
    values = np.array([*system.values.values(), 0.0])
    return values, Constants(*(np.zeros(layout.shape(name)) for name in Constants._fields))


def fill(space: Space, generated: Generated, rng: np.random.Generator) -> None:
    """Random inverses, and directions that may be given; nothing else."""
    for part in space:
        part[:] = 0
    for plane in generated.layout.planes:
        first, count = plane[AIM], plane[AIM_SPEED] + 1 - plane[AIM]
        given = rng.normal(size=(count, space.W.shape[1]))
        given[: count - 1, 0] /= np.linalg.norm(given[: count - 1, 0])
        space.W[first : first + count] = given
    space.W[len(generated.layout.state), 1] = UNIT
    for inverse in (space.Rq, space.Rz):
        inverse[:] = rng.normal(size=inverse.shape)


def cases(system: System, layout: Layout) -> Iterator[tuple[Array, Array, Array]]:
    rng = np.random.default_rng(3)
    start = np.array([float(system.initial.get(name, 0.0)) for name in layout.state])
    planes = [[*plane.parts] for plane in derive(system.declaration).planes]
    for i in range(TRIALS):
        y = start + 0.3 * rng.normal(size=len(start))
        mode = rng.integers(-2, 3, len(layout.u))
        for plane in planes:
            # components slip and stick together
            mode[plane] = DIRECTION_GIVEN if i % 4 == 3 else abs(mode[plane[0]])
        yield y, mode, rng.integers(0, 2, len(layout.kinks))


def assert_same_series(one: Space, other: Space, layout: Layout, N: int) -> None:
    n = len(layout.state)
    # What a rate is the zero of is rounding.
    zeros = [i.inputs[0] for i in layout.instructions if i.op is Op.WITHIN]
    first, wanted = (np.delete(space.W[:, 0], zeros) for space in (one, other))
    # Terms of a formula cancel where it is looked at beyond its piece, as here.
    known = np.abs(wanted[np.isfinite(wanted)])
    least = 1e-12 * np.max(known, initial=1.0) if layout.formulas else 1e-14
    np.testing.assert_allclose(first, wanted, rtol=1e-13, atol=least)
    # Entries of an inverse that would be zero are rounding errors, beside others that are not.
    least = 1e-15 * np.max(other.mag, initial=0.0) if layout.gaps else 1e-300
    np.testing.assert_allclose(
        one.mag, other.mag, rtol=1e-12 if layout.formulas else 1e-13, atol=least
    )
    # A rate that solves an equation makes stiff series, whose high orders are rounding errors here.
    stiff = any(i.op is Op.IMPLICIT for i in layout.instructions)
    N, limit = (min(N, 8), 1e-11) if stiff else (N, 1e-12)
    # Every order of a direction is divided by the speed, which spreads rounding errors.
    limit = 1e-8 if layout.planes else limit
    N = min(N, 8) if layout.formulas else N
    for got, wanted in ((one.Rq, other.Rq), (one.Rz, other.Rz), (one.B, other.B)):
        size = np.max(np.abs(wanted), initial=1.0)
        np.testing.assert_allclose(got, wanted, rtol=1e-11, atol=1e-14 * size)
    pairs = [(one.W[layout.kept, :N], other.W[layout.kept, :N])]
    pairs.append((one.W[:n, : N + 1], other.W[:n, : N + 1]))
    for got, wanted in pairs:
        np.testing.assert_array_equal(np.isfinite(got), np.isfinite(wanted))
        got, wanted = (np.where(np.isfinite(wanted), x, 0.0) for x in (got, wanted))
        # rounding errors of low orders reach the higher ones
        size = np.maximum.accumulate(np.max(np.abs(wanted), axis=0, initial=1e-3))
        off = float(np.max(np.abs(got - wanted) / size, initial=0.0))
        assert off <= limit


@pytest.mark.parametrize("looped", [False, True], ids=["written out", "looped"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_machine_code_is_what_the_tape_says(
    name: str, looped: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(looped_series, "_MOST_PRODUCTS", -1 if looped else 10**9)
    system, generated = generated_of(name)
    layout = generated.layout
    oracle, code = oracle_of(name), compiled_by_llvm(generated, tmp_path)
    values, k = constants_of(system, generated)
    oracle.setup(values, *k)
    _, own = constants_of(system, generated)
    run_setups(code["setup"], values[None], Constants(*(part[None] for part in own)))
    for got, wanted in zip(own, k, strict=True):
        np.testing.assert_array_equal(got, wanted)
    rows = pose(system).rows
    one, other = (make_space(rows, layout.rows, layout.magnitudes, 24) for _ in range(2))
    nr = layout.sizes["nr"]
    for i, (y, mode, region) in enumerate(cases(system, layout)):
        for N in (1, 8, 24) if i == 0 else (24,):
            for space in (one, other):
                fill(space, generated, np.random.default_rng(i))
            at = (0.3, y, mode, region, k.K)
            result = call_jets(code["jets"], *at, one.Rq, one.Rz, N, one)
            o = other
            assert result == oracle.jets(*at, o.Rq, o.Rz, N, o.W, o.A, o.B, o.mag)
            if result == 0:
                assert_same_series(one, other, layout, N)
        landed = sum(len(places) for *_, places in layout.jumps)
        for function, count in (("powers", 3), ("landings", landed)):
            found, wanted = np.zeros(count), np.zeros(count)
            call_powers(code[function], other.W, region, k.K, found)
            getattr(oracle, function)(other.W, region, k.K, wanted)
            np.testing.assert_allclose(found, wanted, rtol=1e-14)
        G, P = np.zeros((2, 2 * nr)), np.zeros((2, nr + 1, nr))
        call_residual(code["residual"], 0.3, y, mode, region, k.K, G[0], P[0])
        oracle.residual(0.3, y, mode, region, k.K, G[1], P[1])
        np.testing.assert_allclose(G[0], G[1], rtol=1e-14)
        np.testing.assert_allclose(P[0], P[1], rtol=1e-14)


def test_every_operation_is_compared() -> None:
    operations = set[Op]()
    scalars = dict[Scalar, str]()

    def visit(s: Scalar) -> None:
        if s not in scalars:
            scalars[s] = s.op
            for part in s.args:
                visit(part)

    for name in SYSTEMS:
        _, generated = generated_of(name)
        tape = generated.layout.instructions
        operations |= {i.op for i in tape}
        g = generated
        for store in [*g.setup, *g.sizes, *g.residual, *g.powers, *g.landings]:
            visit(store.value)
        for s in (s for i in tape for s in i.zero):
            visit(s)
    assert operations == set(Op)
    assert {*scalars.values()} == ARITHMETIC.keys() | OTHERS.keys()


@pytest.mark.parametrize("name", SYSTEMS)
def test_sizes_begin_anew_with_each_call(name: str) -> None:
    """What is too large hides what a guard or the audit has to see, for ever if it were kept."""
    system, generated = generated_of(name)
    layout = generated.layout
    oracle = oracle_of(name)
    values, k = constants_of(system, generated)
    oracle.setup(values, *k)
    space = make_space(pose(system).rows, layout.rows, layout.magnitudes, 8)
    stored = sorted({store.place[0] for store in generated.sizes if store.name == "mag"})
    solved = 0
    for y, mode, region in cases(system, layout):
        fill(space, generated, np.random.default_rng(0))
        at = (0.3, y, mode, region, k.K, space.Rq, space.Rz, 8, space.W, space.A, space.B)
        sizes = []
        for before in (0.0, 1e30):
            space.mag[:] = before
            if oracle.jets(*at, space.mag) == 0:
                sizes.append(space.mag[stored])
        if sizes:  # the mode, drawn at random, has a solution
            np.testing.assert_array_equal(*sizes)
            solved += 1
    assert solved > 0


# -- long sums -------------------------------------------------------------------------------------

PAIRS = 7


@pytest.fixture(scope="module")
def dot(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Sequence[float]], float]:
    """The machine code of Σ aᵢbᵢ, of pairs that stand one after the other."""
    pairs = Scalar("dot", tuple(element("K", i) for i in range(2 * PAIRS)))
    layout = Layout([], {})
    powers = [Store("out", (0,), pairs)]
    generated = Generated(layout, ParameterExpressions([]), [], [], [], powers, [], [])
    code = compiled_by_llvm(generated, tmp_path_factory.mktemp("dot"))["powers"]

    def made(given: Sequence[float]) -> float:
        K, out = np.zeros(2 * PAIRS), np.zeros(1)
        K[: len(given)] = given
        call_powers(code, np.zeros((1, 25)), np.zeros(0, np.int64), K, out)
        return out.item()

    return made


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(*[st.floats(-1e9, 1e9)] * 2), min_size=1, max_size=PAIRS - 2),
    st.floats(-1e-9, 1e-9),
)
def test_sum_in_which_large_terms_cancel(
    dot: Callable[[Sequence[float]], float], pairs: list[tuple[float, float]], rest: float
) -> None:
    """Against rational numbers: a·b − a·b·(1 + ε) keeps its digits."""
    a, b = pairs[0]
    terms = [*pairs, (-a, b * (1.0 + 1e-13)), (rest, 1.0)]
    exact = sum(Fraction(x) * Fraction(y) for x, y in terms)
    size = sum(abs(Fraction(x) * Fraction(y)) for x, y in terms)
    error = abs(Fraction(dot([x for pair in terms for x in pair])) - exact)
    assert error <= 2.0**-52 * abs(exact) + 2.0**-96 * size + 1e-290


def test_sum_of_what_overflows(dot: Callable[[Sequence[float]], float]) -> None:
    assert dot((1e200, 1e200, 1.0, 1.0)) == np.inf
    assert dot((1e305, 1.0, 1.0, 1.0)) == 1e305


# -- machine code on disk --------------------------------------------------------------------------


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, and a process that has loaded nothing."""
    monkeypatch.setattr(objects, "_kept", {})
    return tmp_path


def compiled_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether the functions of a system had to be compiled, and are not only loaded."""
    asked = []
    parse = objects.llvm.parse_assembly
    monkeypatch.setattr(objects, "_kept", {})
    monkeypatch.setattr(objects.llvm, "parse_assembly", lambda x: (asked.append(x), parse(x))[1])
    _, generated = generated_of("spring_slider")
    code = compiled_by_llvm(generated, folder)
    monkeypatch.setattr(objects.llvm, "parse_assembly", parse)
    out = np.zeros(3)
    call_powers(
        code["powers"],
        np.zeros((generated.layout.rows, 25)),
        np.zeros(0, np.int64),
        np.ones(len(generated.layout.constants)),
        out,
    )
    return any(asked)


def test_machine_code_is_kept(shelf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert compiled_once(shelf, monkeypatch)
    (file,) = shelf.iterdir()
    assert not compiled_once(shelf, monkeypatch)
    for damaged in (b"", file.read_bytes()[:-1], b"\0" * 100):
        file.write_bytes(damaged)
        assert compiled_once(shelf, monkeypatch)
        assert not compiled_once(shelf, monkeypatch)


@pytest.mark.parametrize("part", ["name", "features", "version"])
def test_another_processor_has_its_own(
    part: str, shelf: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert compiled_once(shelf, monkeypatch)
    here = objects.processor()
    other = {"name": "", "features": "", "version": (1, 0, 0)}[part]
    monkeypatch.setattr(objects, "processor", lambda: here._replace(**{part: other}))
    assert compiled_once(shelf, monkeypatch)
    assert len(list(shelf.iterdir())) == 2


def test_a_folder_that_cannot_be_written_is_no_obstacle(
    shelf: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert compiled_once(shelf / "nowhere", monkeypatch)


def test_functions_that_llvm_does_not_find(shelf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are told where the mathematical library of C has them."""
    told = dict[str, int]()
    add = objects.llvm.add_symbol
    monkeypatch.setattr(objects.llvm, "address_of_symbol", lambda name: None)
    monkeypatch.setattr(
        objects.llvm, "add_symbol", lambda name, at: (told.update({name: at}), add(name, at))
    )
    assert compiled_once(shelf, monkeypatch)
    assert told
    assert all(told.values())


def test_formulas_never_become_python(shelf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the way to machine code, neither source text nor its compiler is asked."""
    monkeypatch.setenv("STICKSLIP_CACHE", str(shelf))
    system = System("own", internal={"x": Internal("exp(-x) - 3.25*tanh(x)")})
    asked = list[str]()
    with monkeypatch.context() as patch:
        for name in ("eval", "exec", "compile"):
            patch.setattr(builtins, name, lambda *_, name=name, **__: asked.append(name))
        compile_system(system)
    assert not asked
    assert [file.suffix for file in (shelf / "stickslip").iterdir()] == [".o"]
    assert simulate(system, (0.0, 1.0)).outcome.ok


def test_a_new_process_finds_it(shelf: Path) -> None:
    """And a system without a motion imports no compiler."""
    script = """
import sys
import stickslip as ss
system = ss.catalogue.belt_block()
assert "llvmlite" not in sys.modules
print(ss.simulate(system, (0.0, 5.0)).knots.state[-1].tolist())
"""
    env = {"STICKSLIP_CACHE": str(shelf), "PYTHONPATH": ":".join(sys.path), "HOME": str(shelf)}
    runs = [
        subprocess.run(
            [sys.executable, "-c", script], env=env, capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    ]
    assert runs[0] == runs[1]
    assert len(list((shelf / "stickslip").glob(f"{next(iter(INTERFACE))}.*.o"))) == 1
