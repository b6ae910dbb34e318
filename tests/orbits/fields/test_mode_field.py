"""The symbolic field of a mode: the values of the compiled one, and derivatives that are exact."""

import numpy as np
import pytest
from numpy.typing import NDArray

from oracles.fields import function
from stickslip import Contact, Inertial, Internal, Parameter, System, Viscous, catalogue
from stickslip.arrays import IntVector, Vector
from stickslip.equations.derive import derive
from stickslip.equations.field import Field, in_region
from stickslip.equations.mode_fields import mode_field, solve
from stickslip.machine_code.functions import entry_point
from stickslip.machine_code.interface import Jets
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.problem import Problem, pose
from stickslip.motion.steps.arrays import OK, Constants, Rows, Space
from stickslip.orbits.fields.instructions import PointFunction
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator
from systems import ode, oscillator, pair, published


def resting_body(n: int) -> System:
    """A driven body on points of different strength, one of them with axes, and a guide."""
    rng = np.random.default_rng(n)
    contacts: dict[str, Contact] = {}
    for i, (x, y, hold) in enumerate(rng.uniform(0.3, 1.0, (n, 3)).round(3).tolist()):
        direction = (f"d_x - d_th*({x}*sin(th) + {y}*cos(th))", f"d_y + d_th*({x}*cos(th) - {y})")
        axes = (1.0, 1.5) if i == 0 else (1.0, 1.0)
        contacts[f"p{i}"] = Contact(direction, f"s*{hold}", axes=axes)
    contacts["guide"] = Contact("d_x + 0.3*d_y", "0.4*s")
    return System(
        "body",
        parameters={"s": Parameter(1.1)},
        coordinates={x: Inertial(force=f"{x} + sin(t)") for x in ("x", "y", "th")},
        kinetic="(d_x**2 + 2*d_y**2)/2 + 0.2*d_th**2 + 0.1*d_x*d_th",
        potential="x**2 + y*th",
        contacts=contacts,
    )


SYSTEMS = {name: published(name) for name in catalogue.names()}
# A rate that solves an equation has no formula, and an impact is no mode.
SYSTEMS = {
    name: s for name, s in SYSTEMS.items() if not s.declaration.resisted and not s.unilateral
}
SYSTEMS |= {
    "oscillator": oscillator(),
    "viscous pair": pair("viscous"),
    "rate-independent pair": pair("rate-independent"),
}
SYSTEMS |= {f"body on {n} points": resting_body(n) for n in (2, 4)}
SYSTEMS["everything"] = System(
    name="everything",
    parameters={"nu": Parameter(0.3), "k": Parameter(1.2)},
    coordinates={"z": Viscous()},
    internal={
        "a": Internal("exp(-a**2) - tanh(z)*d_z + log(1 + a**2)"),
        "b": Internal(
            "sqrt(1 + z**2)*cos(a) + atan(b) + asinh(a*b) + sinh(0.1*a) - cosh(b)/3 + tan(0.2*b) + "
            "a**k"
        ),
    },
    potential="k/2*z**2 + a**3*z",
    viscous="nu/2*d_z**2",
    contacts={"ground": Contact("d_z", "1 + abs(a)", surface_speed="0.1*sin(t)")},
    initial={"a": 0.5},
)


@entry_point()
def read(
    jets: Jets,
    rows: Rows,
    k: Constants,
    space: Space,
    mode: IntVector,
    region: IntVector,
    t: float,
    y: Vector,
    out: Vector,
) -> bool:
    """Rates, then u, λ, s⁺, s⁻ and guards, of any mode, affine or not."""
    n = rows.sizes[0]
    contacts = len(rows.u)
    W = space.W
    space.known[-1] = 1
    W[n, 1] = 1.0
    if not resolve(rows, k, space, mode):
        return False
    if jets(t, y, mode, region, k.K, space.Rq, space.Rz, 1, W, space.A, space.B, space.mag) != OK:
        return False
    for i in range(n):
        out[i] = W[i, 1]
    for c in range(contacts):
        out[n + c] = W[rows.u[c], 0]
        out[n + contacts + c] = W[rows.force[c], 0]
        out[n + 2 * contacts + c] = W[rows.plus[c], 0]
        out[n + 3 * contacts + c] = W[rows.minus[c], 0]
    for j in range(len(rows.kinks)):
        out[n + 4 * contacts + j] = W[rows.kinks[j], 0]
    finite = True
    for value in out:
        finite = finite and bool(np.isfinite(value))
    return finite


def compiled_values(
    problem: Problem, mode: NDArray, region: NDArray, t: float, y: NDArray
) -> NDArray | None:
    """Rates, then u, λ, s⁺, s⁻ and guards from compiled code; None where the mode has no rates."""
    sizes = problem.compiled.layout.sizes
    out = np.zeros(sizes["n"] + 4 * len(problem.compiled.layout.u) + sizes["kinks"])
    work = (problem.compiled.jets, problem.rows, problem.constants, problem.space())
    return out if read(*work, mode, region, t, y, out) else None


def pieces_of_dissipations(problem: Problem) -> list[int]:
    """Places of the guards of pieces of dissipations among the values."""
    equations = problem.compiled.equations
    n = len(problem.system.declaration.state) + 4 * len(equations.contacts)
    own = {guard for plane in equations.planes for guard, _ in plane.pieces}
    return [n + j for j, guard in enumerate(equations.kinks) if guard in own]


def symbolic_values(field: Field, t: float, y: NDArray, p: NDArray) -> NDArray:
    columns = [
        [getattr(c, name) for c in field.contacts] for name in ("u", "force", "plus", "minus")
    ]
    wanted = [*field.rates, *(e for column in columns for e in column), *field.kinks]
    return function(field, wanted)(t, y, p)


def random_fields(name: str, count: int) -> list[tuple[Field, float, NDArray, NDArray, NDArray]]:
    """Fields of random modes and regions, with t, y, p and the compiled values there."""
    problem = pose(SYSTEMS[name])
    equations = problem.compiled.equations
    rng = np.random.default_rng(len(name))
    p = np.array(list(problem.parameters.values()))
    found = []
    for _ in range(count):
        mode = rng.integers(-1, 2, len(equations.contacts))
        region = rng.integers(0, 2, len(equations.kinks))
        t = float(rng.uniform(0, 3))
        y = rng.uniform(0.3, 1.7, len(problem.system.declaration.state))
        expected = compiled_values(problem, mode, region, t, y)
        if expected is None:
            continue
        field = mode_field(equations, tuple(mode), tuple(region))
        found.append((field, t, y, p, expected))
    return found


@pytest.mark.parametrize("name", SYSTEMS)
def test_same_values_as_the_engine(name: str) -> None:
    cases = random_fields(name, 12)
    assert len(cases) >= 3
    pieces = pieces_of_dissipations(pose(SYSTEMS[name]))
    for field, t, y, p, expected in cases:
        found = symbolic_values(field, t, y, p)
        # A dissipation is 1-homogeneous, so compiled code may scale the guards of its pieces, and
        # leaves them out of a contact that sticks.
        signs = np.sign(expected[pieces])
        assert np.all((signs == 0) | (signs == np.sign(found[pieces])))
        found[pieces] = expected[pieces] = 0.0
        scale = np.maximum(
            np.abs(expected), np.max(np.abs(expected[np.abs(expected) < 1e6]), initial=1.0)
        )
        # Least forces are solved for by other equations, which are less well conditioned.
        limit = 1e-9 if name.startswith("body") else 1e-12
        assert np.max(np.abs(found - expected) / scale) < limit


@pytest.mark.parametrize(
    "name", ["everything", "rocking_toy_inertial", "spring_slider", "rate-independent pair"]
)
def test_slopes_are_those_of_differences(name: str) -> None:
    for field, t, y, p, _ in random_fields(name, 4):
        rates = function(field, field.rates)
        jacobian = function(field, [e for row in field.jacobian for e in row])(t, y, p).reshape(
            len(y), -1
        )
        h = 1e-6
        steps = np.eye(len(y)) * h
        numeric = np.column_stack(
            [(rates(t, y + e, p) - rates(t, y - e, p)) / (2 * h) for e in steps]
        )
        assert jacobian == pytest.approx(
            numeric, rel=1e-6, abs=1e-6 * np.max(np.abs(numeric), initial=1.0)
        )
        for i, parameter in enumerate(field.parameters):
            step = h * np.eye(len(p))[i]
            slope = (rates(t, y, p + step) - rates(t, y, p - step)) / (2 * h)
            scale = np.max(np.abs(slope), initial=1.0)
            assert function(field, field.slopes(parameter))(t, y, p) == pytest.approx(
                slope, rel=1e-6, abs=1e-6 * scale
            )


@pytest.mark.parametrize(
    "name", ["block_chain", "belt_block", "rocking_toy", "rate-independent pair", "oscillator"]
)
def test_constraints_do_not_change_along_the_motion(name: str) -> None:
    seen = 0
    for field, t, y, p, _ in random_fields(name, 12):
        seen += len(field.constraints)
        rates = function(field, [field.along(g) for g in field.constraints])(t, y, p)
        assert np.max(np.abs(rates), initial=0.0) < 1e-12
    assert seen > 0


def test_guards_are_those_of_the_mode() -> None:
    equations = derive(catalogue.spring_slider(mu="abs(alpha)").declaration)
    values = {"t": 0.0, "U": 0.9, "alpha": 1.1, "V": 0.2, "k": 1.0, "alpha_0": 1.0, "nu": 0.02}

    def guards(mode: int, region: int) -> list[tuple[int, int, float]]:
        field = mode_field(equations, (mode,), (region,))
        return [(g.switch, g.to, ex.evaluate(g.value, values)) for g in field.guards]

    # In stick λ = kU; in slip ν(U' − V) = −kU − σμ.
    assert guards(0, 1) == [
        (0, 0, 1.1),
        (1, 1, pytest.approx(0.9 + 1.1)),
        (1, -1, pytest.approx(1.1 - 0.9)),
    ]
    assert guards(0, 0)[0] == (0, 1, -1.1)
    assert guards(1, 1)[1] == (1, 0, pytest.approx((-0.9 - 1.1) / 0.02))
    assert guards(-1, 1)[1] == (1, 0, pytest.approx(-(-0.9 + 1.1) / 0.02))


def test_a_mode_without_rates_is_refused() -> None:
    equations = derive(catalogue.rocking_toy().declaration)
    with pytest.raises(ZeroDivisionError, match="indeterminate"):
        mode_field(equations, (1, 1), (1,) * len(equations.kinks))


def test_many_states_at_once() -> None:
    field = mode_field(derive(SYSTEMS["everything"].declaration), (1,), (1,))
    rng = np.random.default_rng(3)
    p = np.array([0.3, 1.2])
    t = rng.uniform(0, 3, 7)
    y = rng.uniform(0.3, 1.7, (3, 7))
    together = function(field, field.rates)(t, y, p)
    assert together.shape == (3, 7)
    for k in range(7):
        one = function(field, field.rates)(t[k], y[:, k], p)
        assert together[:, k] == pytest.approx(one, rel=1e-14)
        exact = [
            ex.evaluate(e, dict(zip(field.names, [t[k], *y[:, k], *p], strict=True)))
            for e in field.rates
        ]
        assert one == pytest.approx(exact, rel=1e-13)


def test_numbers_alone_fill_the_shape() -> None:
    assert evaluator([ex.num(2.0), ex.sym("x")], ["x"])(np.array([[1.0, 3.0]])).tolist() == [
        [2.0, 2.0],
        [1.0, 3.0],
    ]


def test_kinks_need_their_region() -> None:
    x = ex.sym("x")
    clipped = ex.clip(x, ex.num(-1.0), ex.num(1.0))
    pendulum = mode_field(derive(ode("pendulum", x="v", v="-sin(x)").declaration), (), ())
    with pytest.raises(ValueError, match="regions"):
        PointFunction(pendulum, [clipped])
    assert evaluator([clipped], ["x"])([[-3.0, 0.5, 3.0]]).tolist() == [[-1.0, 0.5, 1.0]]
    guards = [n.args[0] for n in ex.walk([clipped]) if n.op == "select"]
    values = {0.0: x, 5.0: ex.ONE, -5.0: -ex.ONE}
    for at, branch in values.items():
        assert (
            in_region(clipped, {g: int(ex.evaluate(g, {"x": at}) >= 0) for g in guards}) is branch
        )


def test_linear_systems_of_expressions() -> None:
    a, b = ex.sym("a"), ex.sym("b")
    x = solve([[a, b, ex.ZERO], [b, a, ex.ONE], [ex.ZERO, ex.ONE, ex.ZERO - 2.0]], [ex.ONE, a, b])
    values = {"a": 3.0, "b": 0.7}
    expected = np.linalg.solve(
        [[3.0, 0.7, 0.0], [0.7, 3.0, 1.0], [0.0, 1.0, -2.0]], [1.0, 3.0, 0.7]
    )
    assert [ex.evaluate(e, values) for e in x] == pytest.approx(list(expected))
    with pytest.raises(ZeroDivisionError):
        solve([[(a + 1.0) * b, b], [a * b + b, b]], [ex.ONE, ex.ONE])


def test_a_field_without_contacts() -> None:
    field = mode_field(derive(ode("pendulum", x="v", v="-sin(x)").declaration), (), ())
    assert function(field, field.rates)(0.0, [0.5, 1.0], []).tolist() == [1.0, -np.sin(0.5)]
    assert field.guards == []
    assert field.constraints == []
