"""The catalogue: every system is declared as its source says, and nothing else depends on any of
them."""

import ast
import inspect
import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import stickslip
from oracles import belt_block, crawler, den_hartog, prandtl_tomlinson
from stickslip import catalogue
from stickslip.errors import DeclarationError
from stickslip.model.system import System
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

SOURCE = Path(stickslip.__file__).parent
ISSUED = [
    "belt_block",
    "belt_stribeck",
    "bladed_disk",
    "block_chain",
    "bouncing_ball",
    "bowed_string",
    "brake_mode_coupling",
    "cantilever",
    "cart_pendulum",
    "coin",
    "conveyor",
    "curling_stone",
    "drill_string",
    "forced_oscillator",
    "isolated_floor",
    "iwan_oscillator",
    "jenkins_oscillator",
    "limit_stops",
    "lugre_positioner",
    "oscillating_play",
    "painleve_rod",
    "pendulum_bearing",
    "planar_jenkins",
    "plate_compactor",
    "prandtl_tomlinson",
    "puck",
    "ramp_walker",
    "rate_and_state_slider",
    "rimless_wheel",
    "rocking_oscillator",
    "rocking_toy",
    "rocking_toy_inertial",
    "scaled_slider",
    "scaled_slider_limit",
    "simplest_walker",
    "sliding_base",
    "snake_segment",
    "spring_slider",
    "stick_slip_actuator",
    "tractrix",
    "turntable",
    "two_block_rate_and_state",
    "two_leg_crawler",
    "velocity_step",
    "wiggly_energy",
    "woodpecker",
]


def values(system: System, **state: float) -> dict[str, float]:
    """Parameters, the initial state, and whatever else is given; rates and t are 0 unless given."""
    d = system.declaration
    zeros = dict.fromkeys(["t", *d.state, *(f"d_{x}" for x in d.coordinates)], 0.0)
    return {**zeros, **system.values, **system.initial, **state}


def facts(system: System) -> dict[str, float]:
    return {name: ex.evaluate(e, system.values) for name, e in system.declaration.facts.items()}


def slope(system: System, x: str) -> Expr:
    """∂Φ/∂x less the given force."""
    return ex.derivative(system.declaration.potential, x) - system.declaration.forces[x]


def test_names():
    assert catalogue.names() == ISSUED
    assert catalogue.names() == sorted(
        p.stem for p in (SOURCE / "catalogue").glob("*.py") if p.stem != "__init__"
    )
    assert set(ISSUED) <= set(dir(catalogue))


@pytest.mark.parametrize("name", ISSUED)
def test_entry(name):
    function = getattr(catalogue, name)
    system = function()
    assert system == catalogue.get(name)
    assert system.name == name == function.__name__
    assert 10 < len(system.title) < 60
    assert system.source
    assert catalogue.about(name) == (system.title, system.source)
    assert all(p.meaning for p in system.parameters.values())
    assert all(c.meaning for c in (*system.coordinates.values(), *system.internal.values()))
    document = inspect.getdoc(function)
    assert document is not None
    assert "References" in document
    given = document[document.index("Parameters\n") : document.index("References\n")]
    assert all(f"``{p}``" in given for p in system.parameters)
    lines = (SOURCE / "catalogue" / f"{name}.py").read_text(encoding="utf-8").splitlines()
    assert len(lines) < 100


@pytest.mark.parametrize("name", ISSUED)
def test_conditions_hold_by_default(name):
    system = catalogue.get(name)
    for condition in system.declaration.conditions.values():
        assert ex.evaluate(condition.margin, system.values) > 0


@pytest.mark.parametrize("name", ISSUED)
def test_start_is_stable(name):
    """Rate-independent coordinates have to start where their contacts hold."""
    system = catalogue.get(name)
    start = values(system)
    for contact in system.declaration.contacts:
        if contact.kind == "rate-independent":
            ((x, weight),) = contact.direction.items()
            pull = -ex.evaluate(slope(system, x) / weight, start)
            assert -ex.evaluate(contact.minus, start) <= pull <= ex.evaluate(contact.plus, start)


def test_units_are_given_throughout_or_nowhere():
    dimensionless = {
        "oscillating_play",
        "spring_slider",
        "scaled_slider",
        "scaled_slider_limit",
        "simplest_walker",
        "wiggly_energy",
    }
    for name in ISSUED:
        system = catalogue.get(name)
        units = [
            p.unit for p in system.parameters.values() if p.meaning != "coefficient of friction"
        ]
        units += [c.unit for c in (*system.coordinates.values(), *system.contacts.values())] + [
            system.time_unit
        ]
        assert not any(units) if name in dimensionless else all(units), name


def test_unknown_system():
    with pytest.raises(
        DeclarationError, match=r"unknown system 'rocking-toi'\. Did you mean 'rocking_toy'\?"
    ):
        catalogue.get("rocking-toi")
    with pytest.raises(DeclarationError, match="Known here: belt_block"):
        catalogue.get("woodworm")
    with pytest.raises(AttributeError, match="woodworm"):
        _ = catalogue.woodworm
    for name in ("__init__", "_hidden", "../x", "os", ""):
        with pytest.raises(DeclarationError):
            catalogue.get(name)


def test_what_is_given():
    assert catalogue.get("rocking_toy", P=1.2).values["P"] == 1.2
    assert catalogue.rocking_toy(P=1).parameters["P"].default == 1.0
    with pytest.raises(DeclarationError, match=r"'p'"):
        catalogue.rocking_toy(p=1.2)
    with pytest.raises(DeclarationError, match="outside the admissible range"):
        catalogue.rocking_toy(I_b=-1.0)
    with pytest.raises(DeclarationError, match="unknown name 'beta'"):
        catalogue.spring_slider(mu="1/beta")


def test_function_stays_a_function_after_an_import_of_its_file():
    code = """
import stickslip as ss
import stickslip.catalogue.rocking_toy
from stickslip.catalogue.belt_block import belt_block
assert callable(ss.catalogue.rocking_toy) and ss.catalogue.rocking_toy().name == "rocking_toy"
assert ss.catalogue.belt_block is belt_block is ss.catalogue.belt_block
import pickle
assert pickle.loads(pickle.dumps(ss.catalogue.spring_slider)) is ss.catalogue.spring_slider
"""
    subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        check=True,
        env={"PYTHONPATH": str(SOURCE.parent)},
    )


def test_no_other_module_uses_a_system():
    for path in SOURCE.rglob("*.py"):
        if "catalogue" not in path.relative_to(SOURCE).parts:
            tree = ast.parse(path.read_text(encoding="utf-8"))
            names = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)}
            names |= {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute)}
            assert not names & set(ISSUED), path


def test_nothing_breaks_without_the_catalogue(tmp_path):
    shutil.copytree(
        SOURCE, tmp_path / "stickslip", ignore=shutil.ignore_patterns("catalogue", "__pycache__")
    )
    example = Path(__file__).parents[2] / "examples" / "rocking-toy.toml"
    code = f"""
import sys, stickslip as ss
assert "{tmp_path.as_posix()}" in ss.__file__
system = ss.load(r"{example}")
assert system.equations() is not None
assert system.to_toml()
assert not any("catalogue" in name for name in sys.modules)
"""
    subprocess.run(
        [sys.executable, "-W", "error", "-c", code], check=True, env={"PYTHONPATH": str(tmp_path)}
    )


def test_declaring_imports_nothing_heavy():
    code = """
import sys, stickslip as ss
ss.catalogue.rocking_toy(); ss.catalogue.names()
heavy = {"numpy", "numba", "sympy", "scipy", "xarray", "pandas", "pydantic", "matplotlib", "typer"}
heavy &= set(sys.modules)
assert not heavy, heavy
"""
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": str(SOURCE.parent)})


# What each system says, against its source.


def test_oscillating_play():
    system = catalogue.oscillating_play()
    (contact,) = system.declaration.contacts
    for t in (0.0, 0.013, 0.4, 4.97):
        state = values(system, t=t, z=0.3)
        assert ex.evaluate(slope(system, "z"), state) == pytest.approx(0.3 - (5 * t - t**2))
        assert ex.evaluate(contact.plus, state) == pytest.approx(
            1 + 0.5 * math.cos(2 * math.pi * t / 0.1)
        )
    other = catalogue.oscillating_play(rho="2 - cos(2*pi*s)", ell="sin(t)", epsilon=0.01)
    assert ex.evaluate(other.declaration.contacts[0].plus, values(other, t=0.005)) == pytest.approx(
        3
    )


@pytest.mark.parametrize(
    "given", [{}, {"mu": "2/sqrt(alpha)", "nu": 0.05, "V": 0.1}, {"k": 2.0, "alpha_0": 0.5}]
)
def test_spring_slider_is_3_3(given):
    system = catalogue.spring_slider(**given)
    (contact,) = system.declaration.contacts
    p = system.values

    def mu(alpha):
        return 2 / math.sqrt(alpha) if "mu" in given else 0.5 + math.exp(-(alpha - 1) / 0.4)

    def G(xi, alpha):
        return math.copysign(max(abs(xi) - mu(alpha), 0), xi) / p["nu"]

    for U, alpha in ((3.0, 1.1), (-2.5, 0.9), (0.2, 1.0), (1.3, 2.0)):
        force = p["k"] * U
        z_rate = G(force, alpha)
        state = values(system, U=U, alpha=alpha, d_U=p["V"] - z_rate)
        assert ex.evaluate(contact.speed, state) == p["V"]
        assert ex.evaluate(contact.plus, state) == pytest.approx(mu(alpha))
        # ν U̇ + kU − ν V is the friction force: ±μ in slip, within ±μ in stick.
        rest = p["nu"] * state["d_U"] + ex.evaluate(slope(system, "U"), state)
        assert rest == pytest.approx(math.copysign(mu(alpha), force) if z_rate else force)
        assert abs(rest) <= mu(alpha) * (1 + 1e-12)
        rate = ex.evaluate(system.declaration.laws["alpha"], state)
        assert rate == pytest.approx(p["alpha_0"] - alpha + force * z_rate)
        # The power of the friction is that of (3.1).
        assert rate == pytest.approx(
            p["alpha_0"] - alpha + mu(alpha) * abs(z_rate) + p["nu"] * z_rate**2
        )


def test_spring_slider_loads():
    def rate(t: float, **given: float | str) -> float:
        system = catalogue.spring_slider(**given)
        return ex.evaluate(system.declaration.contacts[0].speed, values(system, t=t))

    assert rate(3.0) == 0.18
    assert rate(3.0, V=0.5) == 0.5
    assert rate(3.0, ell="0.1*t + t**2") == pytest.approx(6.1)
    plateaus = "piecewise(t < 10, 0.1, t < 20, 0.4, 0.1)"
    assert [rate(t, shear=plateaus) for t in (5, 15, 25)] == [0.1, 0.4, 0.1]
    assert [rate(t, V=plateaus) for t in (5, 15, 25)] == [0.1, 0.4, 0.1]
    with pytest.raises(DeclarationError, match="'ell'"):
        catalogue.spring_slider(ell="t", shear="1")


def test_spring_slider_facts():
    assert facts(catalogue.spring_slider()) == pytest.approx(
        {"U_max": 1.5036, "alpha_max": 1 + 1.5036**2 / 0.02}
    )
    assert facts(catalogue.spring_slider(k=2.0))["U_max"] == pytest.approx(0.7518)
    assert facts(catalogue.spring_slider(shear="0.1")) == {}  # they hold for the steady load V*t


def test_scaled_slider_is_the_spring_slider():
    """(3.5) from (3.3) by V = ν v̂, U = μ̃(α) + ν²β, α = 1 + νγ, μ̃(α) = μ(νγ) + √ν b μ(0)."""
    nu = 0.03
    b = 0.7
    mu_0 = 1.3
    v_hat = 0.8
    scaled = catalogue.scaled_slider(nu=nu, b=b, mu_0=mu_0, v_hat=v_hat)
    mu = f"{mu_0}*exp(-(alpha - 1)/{mu_0}**2) + {nu**0.5 * b * mu_0}"
    plain = catalogue.spring_slider(V=nu * v_hat, nu=nu, mu=mu)
    (contact,) = plain.declaration.contacts
    for beta, gamma in ((0.5, 0.9), (3.0, 0.1), (-2.0, 1.7), (0.0, 0.4)):
        alpha = 1 + nu * gamma
        threshold = ex.evaluate(contact.plus, values(plain, alpha=alpha))
        U = threshold + nu**2 * beta
        U_rate = nu * v_hat - nu * max(beta, 0.0)
        alpha_rate = ex.evaluate(
            plain.declaration.laws["alpha"], values(plain, U=U, alpha=alpha, d_U=U_rate)
        )
        threshold_rate = (
            ex.evaluate(ex.derivative(contact.plus, "alpha"), values(plain, alpha=alpha))
            * alpha_rate
        )
        state = values(scaled, beta=beta, gamma=gamma)
        found = [ex.evaluate(scaled.declaration.laws[name], state) for name in ("beta", "gamma")]
        assert found == pytest.approx(
            [(U_rate - threshold_rate) / nu**2, alpha_rate / nu], rel=1e-9
        )


def test_scaled_slider_needs_3_4():
    system = catalogue.scaled_slider(mu="2 - s")
    condition = system.declaration.conditions["scaling"]
    margin, otherwise = condition.margin, condition.otherwise
    assert ex.evaluate(margin, system.values) < 0
    assert "(3.4)" in otherwise
    fine = catalogue.scaled_slider(mu="2 - s/2 + s**3")
    assert ex.evaluate(fine.declaration.conditions["scaling"].margin, fine.values) > 0


def test_scaled_slider_limit_is_3_6():
    system = catalogue.scaled_slider_limit(nu=0.04, b=0.5, mu_0=2.0, v_hat=3.0)
    laws = system.declaration.laws

    def rates(beta: float, gamma: float) -> list[float]:
        return [
            ex.evaluate(laws[x], values(system, beta=beta, gamma=gamma)) for x in ("beta", "gamma")
        ]

    assert rates(1.0, 0.5) == pytest.approx([75 * 0.9 + 2.5 - 6.25, 1.5])
    assert rates(-1.0, 0.5) == pytest.approx([75 * 0.9 - 6.25, -0.5])
    known = facts(system)
    assert rates(known["beta_star"], known["gamma_star"]) == pytest.approx([0, 0], abs=1e-12)
    omega = math.sqrt(1 - 0.25 / 4)
    assert known["omega_b"] == pytest.approx(omega)
    assert known["slip_duration"] == pytest.approx(math.pi * 0.2 / omega)
    assert known["rho_b"] == pytest.approx(math.exp(math.pi * 0.5 / (2 * omega)))


def test_scaled_slider_tends_to_its_limit():
    for beta, gamma in ((2.0, 0.3), (-5.0, 1.2)):
        gaps = []
        for nu in (1e-2, 1e-4, 1e-6):
            full, limit = catalogue.scaled_slider(nu=nu), catalogue.scaled_slider_limit(nu=nu)
            a, b = (
                [
                    ex.evaluate(s.declaration.laws[x], values(s, beta=beta, gamma=gamma))
                    for x in ("beta", "gamma")
                ]
                for s in (full, limit)
            )
            gaps.append([nu * abs(a[0] - b[0]), abs(a[1] - b[1])])
        assert np.all(np.array(gaps[1:]) <= 0.15 * np.array(gaps[:-1]) + 1e-15)


def H_R(psi: float, H_star: float = 3.0, psi_star: float = 1.0) -> float:
    return (
        0.0
        if psi <= -psi_star
        else H_star
        if psi >= psi_star
        else H_star * (psi + psi_star) / (2 * psi_star)
    )


def test_rocking_toy_is_4_2():
    system = catalogue.rocking_toy()
    right, left = system.declaration.contacts
    for psi, x_R, x_L in (
        (0.3, 0.2, -0.1),
        (-1.7, 1.0, 0.6),
        (2.0, 0.0, 0.5),
        (1.0, 0.0, 0.0),
        (-1.0, 3.0, 2.0),
    ):
        state = values(system, psi=psi, x_R=x_R, x_L=x_L)
        d = x_R - x_L
        assert ex.evaluate(slope(system, "psi"), state) == pytest.approx(psi - 0.3 * d)
        assert ex.evaluate(slope(system, "x_R"), state) == pytest.approx(d - 0.3 * psi - 1)
        assert ex.evaluate(slope(system, "x_L"), state) == pytest.approx(-d + 0.3 * psi - 1)
        assert ex.evaluate(right.plus, state) == pytest.approx(0.2 + H_R(psi))
        assert ex.evaluate(left.plus, state) == pytest.approx(0.2 + H_R(-psi))
    guards = {n.args[0] for n in ex.walk([right.plus, left.plus]) if n.op == "select"}
    assert len(guards) == 2  # both legs have their kinks at ±ψ*


def test_rocking_toy_facts():
    for given in ({}, {"P": 1.2, "H_star": 4.0, "c": 0.4}):
        system = catalogue.rocking_toy(**given)
        p = system.values
        known = facts(system)
        assert known["X"] == pytest.approx((p["P"] - p["rho"] - p["c"] * p["psi_star"]) / p["a"])
        assert known["psi_2"] == pytest.approx(p["psi_star"] + 2 * p["rho"] / p["c"])

        def G_L(psi, p=p):
            return (-p["P"] + p["c"] * psi + p["rho"] + H_R(-psi, p["H_star"])) / p["a"]

        assert G_L(known["psi_3"]) == pytest.approx(known["X"])
        assert G_L(p["psi_star"]) == pytest.approx(-known["X"])
    assert facts(catalogue.rocking_toy()) == pytest.approx(
        {"X": 0.5, "psi_2": 7 / 3, "psi_3": 1 / 6}
    )


@pytest.mark.parametrize(
    ("given", "failing"),
    [
        ({"P": 0.4}, {"stride"}),
        ({"P": 1.6}, {"hold"}),
        ({"c": 1.5, "P": 1.9, "H_star": 5.0}, {"stable upright"}),
        ({"c": 0.9, "H_star": 1.0, "P": 0.45}, {"stride", "corner"}),
        ({}, set()),
    ],
)
def test_conditions_for_walking(given, failing):
    for name in ("rocking_toy", "rocking_oscillator"):
        system = catalogue.get(name, **given)
        found = {
            key
            for key, condition in system.declaration.conditions.items()
            if not ex.evaluate(condition.margin, system.values) > 0
        }
        assert found == failing


def test_rocking_toy_inertial_is_4_1():
    system = catalogue.rocking_toy_inertial(m_W=0.3, m_b=0.2, m_l=0.1, I_b=2.0, g=10.0)
    d, p = system.declaration, system.values
    mass = {pair: ex.evaluate(e, p) for pair, e in d.mass.items()}
    assert mass == pytest.approx(
        {
            ("psi", "psi"): 2.0,
            ("x_R", "x_R"): 0.6,
            ("x_L", "x_L"): 0.6,
            ("x_R", "x_L"): 0.5,
            ("x_L", "x_R"): 0.5,
        }
    )
    damping = {pair: ex.evaluate(e, p) for pair, e in d.damping.items()}
    assert damping == pytest.approx(
        {("psi", "psi"): 0.04, ("x_R", "x_R"): 0.05, ("x_L", "x_L"): 0.05}
    )
    state = values(system, psi=0.4, x_R=1.0, x_L=0.3)
    assert ex.evaluate(slope(system, "x_R"), state) == pytest.approx(0.7 - 0.12 - 1.5)
    assert facts(system)["P"] == pytest.approx(1.5)
    assert facts(catalogue.rocking_toy_inertial(m_W=0.1))["sliding_speed"] == pytest.approx(
        (5 - 1.7) / 0.05
    )
    light, limit = catalogue.rocking_toy_inertial(), catalogue.rocking_toy()
    for x in ("psi", "x_R", "x_L"):
        at = {"psi": 0.7, "x_R": 1.0, "x_L": 0.3}
        assert ex.evaluate(slope(light, x), values(light, **at)) == ex.evaluate(
            slope(limit, x), values(limit, **at)
        )


def test_rocking_oscillator_has_the_branches_of_4_4():
    system = catalogue.rocking_oscillator()
    p = system.values
    known = facts(system)
    X, psi_3 = known["X"], known["psi_3"]

    def Gamma(psi: float) -> float:
        if psi <= psi_3:
            return X
        return -p["P"] + 0.3 * psi + p["rho"] + H_R(-psi) if psi < 1 else -X

    for psi in (-2.3, -1.0, 0.0, 0.16, 0.2, 0.5, 0.99, 1.0, 1.7, 2.3):
        for rate, G in ((0.4, Gamma(psi)), (-0.4, -Gamma(-psi))):
            force = ex.evaluate(
                system.declaration.forces["psi"], values(system, psi=psi, d_psi=rate)
            )
            assert force == pytest.approx(0.3 * G, abs=1e-15)
    # The energy of one period, ∮ c G dψ over an amplitude of 2.
    psi = np.linspace(-2, 2, 400_001)
    upper = np.array([Gamma(s) for s in psi[::10]])
    assert 2 * 0.3 * np.trapezoid(upper, psi[::10]) == pytest.approx(
        known["energy_per_period"], rel=1e-6
    )


def test_plate_compactor():
    system = catalogue.plate_compactor()
    (ground,) = system.declaration.contacts
    for t in (0.0, 0.03, 0.0523, 1.0):
        expected = 0.6 * max(100 * 9.81 + 900 * math.cos(60 * t), 0)
        assert ex.evaluate(ground.plus, values(system, t=t)) == pytest.approx(expected)
    assert facts(system) == pytest.approx({"mean_threshold": 588.6, "smallest_threshold": 48.6})
    lifted = catalogue.plate_compactor(F=2000.0)
    assert ex.evaluate(lifted.declaration.contacts[0].plus, values(lifted, t=math.pi / 60)) == 0
    assert facts(lifted)["smallest_threshold"] == 0


@pytest.mark.parametrize(("r", "beta"), [(0.8, 0.3), (1.2, 0.3), (2.0, 0.4)])
def test_forced_oscillator_facts(r, beta):
    system = catalogue.forced_oscillator(omega=3 * r, k=9.0, F_c=2 * beta, P=2.0)
    known = facts(system)
    assert known["r"] == pytest.approx(r)
    assert known["beta"] == pytest.approx(beta)
    assert known["nonstop_amplitude"] == pytest.approx(2 / 9 * den_hartog.amplitude(r, beta))


def test_belt_block_facts():
    p = {"m": 2.0, "k": 3.0, "V": 0.4, "F_s": 1.5, "F_k": 0.7}
    known = facts(catalogue.belt_block(**p))
    assert known["period"] == pytest.approx(belt_block.period(**p))
    assert known["slip_duration"] == pytest.approx(belt_block.slip_duration(**p))
    assert (known["smallest_force"], known["largest_force"]) == pytest.approx(
        belt_block.force_range(**p)
    )
    assert facts(catalogue.belt_block())["period"] == pytest.approx(7.0952615, rel=1e-7)


def test_prandtl_tomlinson_facts():
    system = catalogue.prandtl_tomlinson()
    p = {name: system.values[name] for name in ("k", "V_0", "a")}
    assert facts(system) == pytest.approx(
        {
            "eta": prandtl_tomlinson.eta(**p),
            "largest_force": 2 * math.pi * p["V_0"] / p["a"],
            "force_at_jump": prandtl_tomlinson.force_at_jump(**p),
        }
    )
    soft = catalogue.prandtl_tomlinson(k=50.0)
    assert (
        facts(soft)["force_at_jump"]
        == facts(catalogue.prandtl_tomlinson(V_0=0.0))["force_at_jump"]
        == 0
    )
    assert ex.evaluate(soft.declaration.conditions["jumps"].margin, soft.values) < 0


@pytest.mark.parametrize(
    ("f_plus", "f_minus", "D"), [(0.1, 0.4, 1.0), (0.4, 0.1, 1.0), (0.3, 0.4, 0.2)]
)
def test_two_leg_crawler_facts(f_plus, f_minus, D):
    known = facts(catalogue.two_leg_crawler(f_plus=f_plus, f_minus=f_minus, D=D, k=2.0, omega=3.0))
    step = crawler.net_displacement(D, 2.0, f_plus, f_minus)
    assert known == pytest.approx({"step_per_cycle": step, "mean_speed": 3 * step / (2 * math.pi)})


@pytest.mark.parametrize("N", [1, 2, 8])
def test_block_chain(N):
    system = catalogue.block_chain(N=N, k=1.5, k_c=0.25)
    d = system.declaration
    assert len(d.inertial) == len(d.contacts) == N
    stiffness = np.array(
        [
            [ex.evaluate(ex.derivative(slope(system, x), y), system.values) for y in d.inertial]
            for x in d.inertial
        ]
    )
    neighbours = np.diag(np.ones(N - 1), 1) + np.diag(np.ones(N - 1), -1)
    assert stiffness == pytest.approx(
        1.5 * np.eye(N) + 0.25 * (np.diag(neighbours.sum(0)) - neighbours)
    )
    assert all(ex.evaluate(c.speed, system.values) == 0.1 for c in d.contacts)


@pytest.mark.parametrize("N", [0, -1, 2.5, 20_001, 10**400, "3", math.nan, True, None])
def test_wrong_number_of_blocks(N):
    with pytest.raises(
        DeclarationError, match=r"block_chain.N: not a number of blocks\. Give an integer"
    ):
        catalogue.block_chain(N=N)


def test_a_long_chain():
    assert len(catalogue.block_chain(N=1000).declaration.contacts) == 1000
