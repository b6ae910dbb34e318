"""Equations as a person would write them: exact words for a few systems, numbers for all of
them."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Mapping

import pytest

import stickslip as ss
from stickslip.display.equations import ACCELERATION, Balance, Equations
from stickslip.display.printers import UnicodeWriter
from stickslip.display.symbols import latex_name, unicode_name, unicode_unit, width
from stickslip.display.tree import (
    Call,
    Name,
    Node,
    Number,
    Reader,
    Relation,
    Sum,
    Term,
    differentiated,
)
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.pieces import STRUCTURES

NAMES = ss.catalogue.names()


def shown(system: ss.System, *lines: str) -> None:
    text = str(system.equations())
    for line in lines:
        assert line in text.splitlines(), f"{line!r} is not in\n{text}"


def particle(potential: str, **more: object) -> ss.System:
    """One heavy particle in a potential; the parameters are there to be used."""
    parameters = {
        name: ss.Parameter(value) for name, value in {"k": 2.0, "c": 3.0, "g": 0.5}.items()
    }
    return ss.System(
        name="particle",
        parameters=parameters,
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential=potential,
        **more,  # type: ignore[arg-type]
    )


def test_rocking_toy_reads_as_in_the_paper() -> None:
    shown(
        ss.catalogue.rocking_toy(),
        "Rocking toy animal without translational inertia",
        "Mielke 2017, (4.2)",
        "  ψ     inertial           rad   rocking angle",
        "  ½ I_b ψ̇² + ½ a (x_R − x_L)² + ½ b ψ² − c (x_R − x_L) ψ − P (x_R + x_L)",
        "  ½ δ ψ̇² + (ρ + H_R(ψ)) |ẋ_R| + (ρ + H_L(ψ)) |ẋ_L|",
        "  I_b ψ̈ + δ ψ̇ + b ψ − c (x_R − x_L) = 0",
        "  a (x_R − x_L) − c ψ − P + (ρ + H_R(ψ)) Sign(ẋ_R) ∋ 0",
        "  a (x_L − x_R) + c ψ − P + (ρ + H_L(ψ)) Sign(ẋ_L) ∋ 0",
        "  H_R(ψ) = ½ H* (1 + clip(ψ/ψ*, −1, 1))",
        "  H_L(ψ) = H_R(−ψ)",
        "  ρ     rho        0.2    N       in (0, ∞)   dry friction in the joints",
        "  X = (P − ρ − c ψ*)/a = 0.5",
    )


def test_spring_slider_and_scaled_slider() -> None:
    shown(
        ss.catalogue.spring_slider(mu="2/sqrt(alpha)"),
        "  ν U̇ + k U + μ(α) Sign(U̇ − shear(t)) ∋ ν shear(t)",
        "  α̇ = α₀ − α + k U (shear(t) − U̇)",
        "  μ(α) = 2/√α",
        "  shear(t) = ℓ̇(t)",
    )
    shown(
        ss.catalogue.scaled_slider_limit(),
        "  β̇ = v̂ (1 − b √ν)/ν + b slip/√ν − γ/(ν μ₀)",
        "  slip = max(β, 0)",
    )


def test_laws_that_differ_by_direction_or_in_sliding_are_listed() -> None:
    shown(
        ss.catalogue.two_leg_crawler(),
        "  k (x₂ − x₁ − L(t)) − λ₂ = 0",
        "  front leg:   u₂ = ẋ₂",
        "    u_i = 0:  −f⁺ ≤ λ_i ≤ f⁻",
        "    u_i > 0:  λ_i = −f⁺",
        "    u_i < 0:  λ_i = f⁻",
    )
    stribeck = ss.Contact(
        "d_x - 2*d_y", threshold="c", kinetic="g + (c - g)/(1 + speed)", surface_speed=0.5
    )
    shown(
        particle("0", contacts={"pad": stribeck}),
        "  ẍ − λ = 0",
        "  ÿ + 2 λ = 0",
        "  pad:   u = ẋ − 2 ẏ − 0.5",
        "    u = 0:  |λ| ≤ c",
        "    u ≠ 0:  λ = −(g + (c − g)/(1 + |u|)) sgn(u)",
    )


def test_friction_in_a_plane_is_a_law_of_vectors() -> None:
    disc = ss.Contact(("d_x", "d_y"), "c", surface_speed=("-k*y", "k*x"))
    shown(
        particle("k/2*x**2", contacts={"table": disc}),
        "  c √((ẋ + k y)² + (ẏ − k x)²)",
        "  ẍ + k x − λ₁ = 0",
        "  ÿ − λ₂ = 0",
        "  table:   u = (ẋ + k y, ẏ − k x)",
        "    u = 0:  |λ| ≤ c",
        "    u ≠ 0:  λ = −c u/|u|",
    )
    ellipse = ss.Contact(("d_x", "d_y"), "c", axes=(1, "g"), kinetic="c*exp(-speed)")
    shown(
        particle("0", contacts={"table": ellipse}),
        "  table:   u = (ẋ, ẏ),  A = diag(1, g)",
        "    u = 0:  |A⁻¹ λ| ≤ c",
        "    u ≠ 0:  A⁻¹ λ = −c exp(−|A u|) A u/|A u|",
    )
    several = particle(
        "0", contacts={"one": disc, "two": ellipse, "line": ss.Contact("d_x", "c", kinetic="g")}
    )
    shown(
        several,
        "  ẍ − λ_1,1 − λ_2,1 − λ₃ = 0",
        "  two:   u₂ = (ẋ, ẏ),  A₂ = diag(1, g)",
        "    u₂ ≠ 0:  A₂⁻¹ λ₂ = −c exp(−|A₂ u₂|) A₂ u₂/|A₂ u₂|",
    )
    latex = several.equations(latex=True)
    assert r"A_{2} &= \mathrm{diag}(1, g)" in latex
    assert r"\left|A_{2}^{-1} \, \lambda_{2}\right| \leq c" in latex
    assert "<msup><mrow><msub><mi>A</mi>" in several._repr_html_()


def test_the_matrix_of_the_axes_takes_a_letter_that_is_free() -> None:
    system = ss.System(
        name="block",
        parameters={"A": ss.Parameter(1.0)},
        coordinates={"x": ss.Inertial(force="A"), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts={"table": ss.Contact(("d_x", "d_y"), 2, axes=(1, 0.5))},
    )
    shown(system, "    u = 0:  |E⁻¹ λ| ≤ 2")


def test_a_block_between_two_springs() -> None:
    shown(ss.catalogue.block_chain(N=3), "  m ẍ₂ + k x₂ + k_c (2 x₂ − x₁ − x₃) − λ₂ = 0")


@pytest.mark.parametrize(
    ("potential", "force"),
    [
        ("k/2*max(x - g, 0)**2", "k max(x − g, 0)"),
        ("k*abs(x)", "k sgn(x)"),
        ("-c*cos(2*pi*x/g)", "2 c π sin(2 π x/g)/g"),
        ("f(x)*y", "y f′(x)"),
        ("f(2*x)", "2 f′(2 x)"),
        ("h(x, y)", "∂_a h(x, y)"),
        ("lift*y", "y ∂_x lift"),
        ("k**x", "k^x log(k)"),
        ("c/x", "−c/x²"),
        ("sqrt(x)", "1/(2 √x)"),
        ("piecewise(x < g, x**2, x**3 - g**3 + g**2)", "{2 x if x < g; 3 x² otherwise}"),
        ("clip(x, 0, 1)", "{0 if x < 0; 0 if x > 1; 1 otherwise}"),
        ("x*y**2/3 + 0.05*x", "⅓ y² + 0.05"),
    ],
)
def test_derivatives_keep_functions_and_order(potential: str, force: str) -> None:
    functions = {"f(s)": "s**2 + 1", "h(a, b)": "a*b", "lift": "x**2"}
    shown(
        particle(potential, functions=functions, initial={"x": 1.0}),
        f"  ẍ + {force} = 0".replace("+ −", "− "),
    )


def test_piecewise_functions_get_a_brace() -> None:
    text = str(
        particle("0", functions={"G(v)": "piecewise(v < 0, -v, v < 2, v**2/2, 2)"}).equations()
    )
    assert (
        "         ⎧ −v     if v < 0\n  G(v) = ⎨ ½ v²   if v < 2\n         ⎩ 2      otherwise"
        in text
    )


def test_conditions_tell_whether_they_hold() -> None:
    assert "holds" in str(ss.catalogue.rocking_toy().equations())
    weak = str(ss.catalogue.rocking_toy(P=0.3).equations())
    assert "  stride           P > ρ + c ψ*   FAILS: X is not positive" in weak


@pytest.mark.parametrize(
    ("name", "text", "latex"),
    [
        ("psi_star", "ψ*", r"\psi^{*}"),
        ("x_R", "x_R", "x_{R}"),
        ("mu_0", "μ₀", r"\mu_{0}"),
        ("x12", "x₁₂", "x_{12}"),
        ("v_hat", "v̂", r"\hat{v}"),
        ("I_b", "I_b", "I_{b}"),
        ("k_1_2", "k_1,2", "k_{1,2}"),
        ("omega_psi", "ω_ψ", r"\omega_{\psi}"),
        ("epsilon", "ε", r"\varepsilon"),
        ("f_plus", "f⁺", "f^{+}"),
        ("mean_speed", "mean_speed", r"\mathrm{mean\_speed}"),
        ("ell", "ℓ", r"\ell"),
    ],
)
def test_names_become_symbols(name: str, text: str, latex: str) -> None:
    assert unicode_name(name) == text
    assert latex_name(name) == latex


def test_rates_units_and_widths() -> None:
    assert (unicode_name("x_R", 1), unicode_name("psi", 2)) == ("ẋ_R", "ψ̈")
    assert latex_name("v_hat", 1) == r"\dot{\hat{v}}"
    assert [unicode_unit(u) for u in ("kg*m^2/s", "1", "m^-1", "m^(1/2)")] == [
        "kg·m²/s",
        "",
        "m⁻¹",
        "m^(1/2)",
    ]
    assert width("ψ̈") == 1


@pytest.mark.parametrize("name", NAMES)
def test_no_line_is_wider_than_100_columns(name: str) -> None:
    assert max(map(width, str(ss.catalogue.get(name).equations()).splitlines())) <= 100


def test_a_long_chain_is_wrapped() -> None:
    text = str(ss.catalogue.block_chain(N=40).equations())
    assert max(map(width, text.splitlines())) <= 100


@pytest.mark.parametrize("name", NAMES)
def test_latex_is_well_formed(name: str) -> None:
    from matplotlib.mathtext import MathTextParser

    latex = ss.catalogue.get(name).equations(latex=True)
    assert latex.startswith("\\begin{aligned}\n")
    assert latex.endswith("\n\\end{aligned}")
    parser = MathTextParser("agg")
    for row in latex.splitlines()[1:-1]:
        if "cases" not in row:  # the one construct that matplotlib does not know
            formula = (
                row.removesuffix(r"\\")
                .replace("&", "")
                .replace(r"\text{if }", "")
                .replace("tfrac", "frac")
            )
            parser.parse(f"${formula}$")


def test_a_notebook_shows_equations_and_parameters() -> None:
    equations = ss.catalogue.rocking_toy().equations()
    assert isinstance(equations, Equations)
    assert equations._repr_latex_().startswith("$$\n\\begin{aligned}")
    assert (
        r"| $\psi^{*}$ | 1 | rad | angle at which one side carries all weight |"
        in equations._repr_markdown_()
    )
    assert repr(equations) == str(equations)


# What is shown is what is computed: the trees, evaluated, against the engine's expressions.


class Evaluator:
    """Value of a tree for given names; dry friction counts as zero."""

    def __init__(self, system: ss.System, values: Mapping[str, float]) -> None:
        self.definitions = Reader(system).definitions
        self.values = values

    def __call__(self, node: Node, bound: Mapping[str, float] | None = None) -> float:
        values = self.values if bound is None else bound
        match node:
            case Number(value):
                return float(value)
            case Name(name) if name.startswith("lam"):
                return 0.0
            case Name(name):
                return math.pi if name == "pi" else values[name]
            case Sum(terms):
                return sum(self(term, bound) for term in terms)
            case Term(factor, powers):
                return float(factor) * math.prod(
                    self(b, bound) ** self(e, bound) for b, e in powers
                )
            case Relation(sign, left, right):
                a, b = self(left, bound), self(right, bound)
                return float({"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b}[sign])
            case Call(name, arguments, _, by):
                return self.call(name, [self(a, bound) for a in arguments], by, values)
        raise TypeError(node)

    def call(
        self, name: str, a: list[float], by: tuple[str, ...], values: Mapping[str, float]
    ) -> float:
        if name == "Sign":
            return 0.0
        if name not in self.definitions:
            return self.builtin(name, a)
        arguments, body = self.definitions[name]
        inside = {**self.values, **dict(zip(arguments, a, strict=True))}
        for variable in by:
            body = differentiated(
                body, arguments[int(variable)] if variable.isdigit() else variable
            )
        return self(body, inside)

    @staticmethod
    def builtin(name: str, a: list[float]) -> float:
        match name:
            case "piecewise":
                hit = (
                    value for condition, value in zip(a[:-1:2], a[1:-1:2], strict=True) if condition
                )
                return next(hit, a[-1])
            case "clip":
                return min(max(a[0], a[1]), a[2])
            case "min" | "max":
                return min(a) if name == "min" else max(a)
        if name in STRUCTURES:
            return ex.number(STRUCTURES[name].made(*map(ex.num, a)))
        return ex.FUNCTIONS[name](a[0])


EVERYTHING = particle(
    "f(x)*y + k/2*max(x - y, 0, g)**2 + c*log(1 + x**2)*h(y, x) + lift**2*tanh(x*y) - "
    "atan(x)/cosh(y)**2 + min(x, y)**3"
    " + clip(x, -g, g)*y + exp(-x/k)*sin(omega*t) + sqrt(1 + y**2)*asinh(x) + tan(x/9) + sinh(y) + "
    "abs(x)**1.5 + k**y + erf(x - y)*k",
    functions={
        "f(s)": "s**3 + x*s",
        "h(a, b)": "a*b - f(a)",
        "lift": "x**2 + h(x, t)",
        "omega": "k + c",
    },
)


@pytest.mark.parametrize("name", [*NAMES, "everything"])
def test_what_is_shown_is_what_is_computed(name: str) -> None:
    system = EVERYTHING if name == "everything" else ss.catalogue.get(name).plain
    equations = system.equations()
    for seed in range(5):
        compare(system, equations, random.Random(seed))


def compare(system: ss.System, equations: Equations, rng: random.Random) -> None:
    """Both sides of all equations at random values."""
    declared = system.declaration
    values = {x: rng.uniform(-1.0, 1.0) for x in [*declared.coordinates, "t"]}
    # Internal variables may stand in a logarithm.
    values |= {z: rng.uniform(0.0, 1.0) for z in declared.internal}
    values |= {f"d_{x}": rng.uniform(-1.0, 1.0) for x in declared.coordinates}
    accelerations = {q: rng.uniform(-1.0, 1.0) for q in declared.inertial}
    for unknown, row in system.unknowns.items():
        values[unknown] = sum(weight * values[mode] for mode, weight in row.items())
    values |= system.values
    normals = [c for c in declared.contacts if c.opens]
    values |= {c.name: rng.uniform(0.0, 1.0) for c in normals}
    evaluate = Evaluator(
        system, values | {ACCELERATION.format(q): a for q, a in accelerations.items()}
    )

    def expected(x: str) -> float:
        terms = [
            ex.evaluate(m, values) * accelerations[q]
            for (p, q), m in declared.mass.items()
            if p == x
        ]
        terms += [
            ex.evaluate(c, values) * values[f"d_{y}"]
            for (p, y), c in declared.damping.items()
            if p == x
        ]
        terms += [ex.evaluate(declared.drags[x], values)] if x in declared.drags else []
        if x in declared.inertial:
            terms.append(-ex.evaluate(declared.velocity_force(x), values))
        pressed = [(c.direction[x], values[c.name]) for c in normals if x in c.direction]
        terms += [-ex.evaluate(weight, values) * force for weight, force in pressed]
        return sum(terms) + ex.evaluate(ex.derivative(declared.potential, x), values)

    for x, balance in zip(system.coordinates, equations.balances, strict=True):
        assert evaluate(balance.left) == pytest.approx(expected(x), rel=1e-11, abs=1e-11)
        assert evaluate(balance.right) == pytest.approx(
            ex.evaluate(declared.forces[x], values), rel=1e-11, abs=1e-11
        )
    for name, law in zip(system.internal, equations.laws, strict=True):
        assert isinstance(law, Balance)
        assert evaluate(law.right) == pytest.approx(
            ex.evaluate(declared.laws[name], values), rel=1e-11, abs=1e-11
        )


def test_reading_back_what_is_written() -> None:
    """Brackets stand where they are needed: what is printed means what was meant."""
    rng = random.Random(7)
    system = particle("0")
    read = Reader(system).read
    write = UnicodeWriter({}, {}, {})
    evaluate = Evaluator(system, {"x": 0.7, "y": -1.3, "k": 2.0})
    patterns = [
        "({a} + {b})",
        "({a} - {b})",
        "({a})*({b})",
        "({a})/(3 + ({b})**2)",
        "-({a})",
        "({a})**2",
    ]
    patterns.append("sqrt(4 + ({a})**2)")

    def random_formula(depth: int) -> str:
        if depth == 0:
            return rng.choice(["x", "y", "k", "2", "0.3"])
        return rng.choice(patterns).format(a=random_formula(depth - 1), b=random_formula(depth - 1))

    for _ in range(300):
        text = random_formula(rng.randint(1, 4))
        written = write(read(text))
        assert evaluate(read(_typed(written))) == pytest.approx(evaluate(read(text))), (
            text,
            written,
        )


def _typed(text: str) -> str:
    """What the terminal shows, as one would type it: a blank between factors is a product."""
    for glyph, number in {
        "½": "(1/2)",
        "⅓": "(1/3)",
        "⅔": "(2/3)",
        "¼": "(1/4)",
        "¾": "(3/4)",
    }.items():
        text = text.replace(glyph, number)
    digits = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")
    text = re.sub("[⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda m: "**" + m[0].translate(digits), text)
    text = re.sub(r"√(\w+|\()", lambda m: "sqrt(" if m[1] == "(" else f"sqrt({m[1]})", text)
    return text.replace("−", "-").replace(" + ", "+").replace(" - ", "-").replace(" ", "*")
