"""Several coordinates and contacts: ties, corners, redundant contacts, pairs, chains, legs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import cos
from typing import Any

import numpy as np

from stickslip import Contact, Inertial, RateIndependent, System, Viscous, catalogue

from ..case import Case, Rng, family, given, log_uniform, pick
from ..references.mechanics import TIME, Mechanics, Zone
from .shapes import BUMPS, STEPS, Shape
from .single import KINDS

KIND_COUNTS = {"inertial": (2, 0, 0, 0), "viscous": (0, 2, 0, 0), "rate-independent": (0, 0, 2, 0)}


@cache
def pair_of(
    kind: str, load: str = "cos(omega*t + phi)", kinetic: str | None = None, mutual: bool = False
) -> System:
    """Two coordinates on springs, joined by a spring, each with a contact; or with one contact
    between them."""
    parameters = given(
        m=1.0,
        n=1.0,
        c=0.2,
        e=0.2,
        k=1.0,
        h=1.0,
        j=0.7,
        mu=0.5,
        nu=0.5,
        F=1.0,
        G=1.0,
        omega=1.0,
        phi=0.0,
    )
    parameters |= given(F_k=0.2, G_k=0.2, p=1.0, w=0.1)
    contacts = {"first": Contact("d_x", "mu", kinetic=kinetic and "F_k")}
    contacts["second"] = Contact("d_x - d_y" if mutual else "d_y", "nu", kinetic=kinetic and "G_k")
    return System(
        name=f"{kind} pair",
        parameters=parameters,
        coordinates={"x": KINDS[kind](), "y": KINDS[kind]()},
        kinetic="m*d_x**2/2 + n*d_y**2/2" if kind == "inertial" else 0.0,
        potential=f"k*x**2/2 + h*y**2/2 + j*(x - y)**2/2 - (F*x + G*y)*({load})",
        viscous="c*d_x**2/2 + e*d_y**2/2" if kind != "rate-independent" else 0.0,
        contacts=contacts,
    )


def pair_by_hand(
    kind: str,
    n: dict[str, float],
    load: Any,
    kinetic: bool = False,
    mutual: bool = False,
    zones: tuple = (),
) -> Mechanics:
    """The same by hand."""
    k, h, j, F, G = (n[name] for name in ("k", "h", "j", "F", "G"))
    c, e = (n["c"], n["e"]) if kind == "inertial" else (0.0, 0.0)
    weights = {"inertial": ("m", "n"), "viscous": ("c", "e"), "rate-independent": ()}[kind]

    def force(t: Any, x: Any, v: Any, a: Any, side: Any) -> list[Any]:
        pull = load(t)
        joint = j * (x[0] - x[1])
        drag = (c * v[0], e * v[1]) if kind == "inertial" else (0.0, 0.0)
        return [F * pull - k * x[0] - joint - drag[0], G * pull - h * x[1] + joint - drag[1]]

    return Mechanics(
        kinds=KIND_COUNTS[kind],
        inertia=np.diag([n[name] for name in weights]),
        J=[[1.0, 0.0], [1.0, -1.0] if mutual else [0.0, 1.0]],
        force=force,
        threshold=lambda t, x, v, a, side: [n["mu"], n["nu"]],
        kinetic=(lambda t, x, v, a, side, speed: [n["F_k"], n["G_k"]]) if kinetic else None,
        zones=zones,
    )


def ordinary_pair(rng: Rng, kind: str) -> dict[str, float]:
    n = {name: rng.uniform(0.5, 2.0) for name in ("m", "n", "k", "h", "j", "F", "G")}
    n |= (
        {"c": rng.uniform(0.05, 0.3), "e": rng.uniform(0.05, 0.3)}
        if kind == "inertial"
        else {"c": 1.0, "e": 0.6}
    )
    n |= {"mu": rng.uniform(0.2, 0.8), "nu": rng.uniform(0.2, 0.8), "omega": rng.uniform(0.4, 1.5)}
    return n | {"phi": rng.uniform(0, 6), "F_k": 0.7 * n["mu"], "G_k": 0.5 * n["nu"]}


def wave(n: dict[str, float]) -> Any:
    return lambda t: np.cos(n["omega"] * t + n["phi"])


@family
def pair_with_two_contacts(rng: Rng) -> Case:
    """Two coordinates of one kind."""
    kind = pick(rng, list(KINDS))
    n = ordinary_pair(rng, kind)
    if kind == "rate-independent":
        n["phi"] = np.pi / 2  # starts inside the stable set
    return Case(pair_of(kind), n, {}, rng.uniform(8, 20), pair_by_hand(kind, n, wave(n)))


@family
def pair_static_above_kinetic(rng: Rng) -> Case:
    """Static above kinetic on both, inertial or viscous; now and then loaded beyond both thresholds
    at the start."""
    kind = pick(rng, ("inertial", "viscous"))
    n = ordinary_pair(rng, kind)
    return Case(
        pair_of(kind, kinetic="yes"),
        n,
        {},
        rng.uniform(8, 15),
        pair_by_hand(kind, n, wave(n), kinetic=True),
    )


@family
def symmetric_pair(rng: Rng) -> Case:
    """Equal coordinates with equal or opposite loads: both contacts always change at once."""
    kind = pick(rng, list(KINDS))
    n = ordinary_pair(rng, kind)
    sign = pick(rng, (1.0, -1.0))
    n |= {
        "n": n["m"],
        "h": n["k"],
        "e": n["c"],
        "nu": n["mu"],
        "G": sign * n["F"],
        "phi": np.pi / 2,
    }
    if kind != "rate-independent" and rng.random() < 0.5:
        n["phi"] = rng.uniform(0, 6)
    return Case(pair_of(kind), n, {}, rng.uniform(8, 20), pair_by_hand(kind, n, wave(n)))


@family
def pair_with_a_pulse(rng: Rng) -> Case:
    """One short pulse for both."""
    kind = pick(rng, list(KINDS))
    shape = pick(rng, BUMPS)
    assert isinstance(shape, Shape)
    n = ordinary_pair(rng, kind)
    span = rng.uniform(15.0, 30.0)
    w = span * log_uniform(rng, 1e-4, 2e-2)
    p = span * rng.uniform(0.1, 0.9)
    kick = {"inertial": 1 / w, "viscous": 1 / min(w, 1.0), "rate-independent": 1.0}[kind]
    n |= {"p": p, "w": w, "F": rng.normal() * kick, "G": rng.normal() * kick}
    mechanics = pair_by_hand(kind, n, lambda t: shape.at((t - p) / w), zones=(Zone(TIME, p, w),))
    return Case(pair_of(kind, shape.text("t")), n, {}, span, mechanics)


@cache
def felt(kind: str, patch: str) -> System:
    return System(
        name="a patch under the neighbour",
        parameters=given(m=1.0, c=0.5, k=1.0, f=0.4, mu=0.5, d=0.5, F=1.0, omega=0.5, p=0.5, w=0.1),
        coordinates={"y": Inertial(), "x": KINDS[kind]()},
        kinetic="d_y**2/2 + m*d_x**2/2" if kind == "inertial" else "d_y**2/2",
        potential="k*x**2/2 - f*x + y**2/2 - F*cos(omega*t)*y",
        viscous="c*d_x**2/2" if kind != "rate-independent" else 0.0,
        contacts={"x": Contact("d_x", f"mu*(1 - d*{patch})"), "y": Contact("d_y", 0.1)},
    )


@family
def weakness_elsewhere(rng: Rng) -> Case:
    """A block that stands still, and slips while another one swings through a narrow place."""
    kind = pick(rng, list(KINDS))
    shape = pick(rng, BUMPS)
    assert isinstance(shape, Shape)
    n = {
        "m": rng.uniform(0.5, 2),
        "c": rng.uniform(0.3, 1),
        "k": rng.uniform(0.5, 2),
        "mu": rng.uniform(0.3, 0.8),
    }
    n |= {"d": rng.uniform(0.5, 1), "F": rng.uniform(0.8, 2), "omega": rng.uniform(0.3, 0.7)}
    n |= {
        "p": rng.uniform(-0.5, 0.5),
        "w": log_uniform(rng, 1e-3, 0.1),
        "f": n["mu"] * (1 - n["d"] * rng.uniform(0.1, 0.9)),
    }
    k, c, mu, d, F, omega, p, w, f = (
        n[name] for name in ("k", "c", "mu", "d", "F", "omega", "p", "w", "f")
    )
    drag = c if kind == "inertial" else 0.0

    def force(t: Any, x: Any, v: Any, a: Any, side: Any) -> list[Any]:
        return [F * np.cos(omega * t) - x[0], f - k * x[1] - (drag * v[1] if drag else 0.0)]

    mechanics = Mechanics(
        kinds={"inertial": (2, 0, 0, 0), "viscous": (1, 1, 0, 0), "rate-independent": (1, 0, 1, 0)}[
            kind
        ],
        inertia={
            "inertial": np.diag([1.0, n["m"]]),
            "viscous": np.diag([1.0, c]),
            "rate-independent": [[1.0]],
        }[kind],
        J=[[0.0, 1.0], [1.0, 0.0]],
        force=force,
        threshold=lambda t, x, v, a, side: [mu * (1 - d * shape.at((x[0] - p) / w)), 0.1],
        zones=(Zone(0, p, w),),
    )
    return Case(
        felt(kind, shape.text("y")),
        n,
        {"y": 2.0 * pick(rng, (-1.0, 1.0))},
        rng.uniform(8, 15),
        mechanics,
    )


@family
def mutual_friction(rng: Rng) -> Case:
    """Friction on the floor and between two blocks, on springs."""
    n = ordinary_pair(rng, "inertial")
    kinetic = bool(rng.random() < 0.5)
    mechanics = pair_by_hand("inertial", n, wave(n), kinetic=kinetic, mutual=True)
    system = pair_of("inertial", kinetic="yes" if kinetic else None, mutual=True)
    return Case(system, n, {"x": rng.normal(), "d_y": rng.normal()}, rng.uniform(8, 15), mechanics)


@cache
def sled() -> System:
    return System(
        name="block on a sled",
        parameters=given(m=1.0, n=1.0, mu=0.5, nu=0.3),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="m*d_x**2/2 + n*d_y**2/2",
        contacts={"floor": Contact("d_x", "mu"), "between": Contact("d_y - d_x", "nu")},
    )


@family
def block_on_a_sled(rng: Rng) -> Case:
    """Both are thrown over a floor; nothing else acts until both rest."""
    n = {
        "m": rng.uniform(0.3, 3),
        "n": rng.uniform(0.3, 3),
        "mu": log_uniform(rng, 0.03, 1),
        "nu": rng.uniform(0.1, 1),
    }
    mechanics = Mechanics(
        kinds=(2, 0, 0, 0),
        inertia=np.diag([n["m"], n["n"]]),
        J=[[1.0, 0.0], [-1.0, 1.0]],
        force=lambda t, x, v, a, side: [0.0, 0.0],
        threshold=lambda t, x, v, a, side: [n["mu"], n["nu"]],
        step=0.5,
    )
    start = {"d_x": float(rng.choice([0.0, 1.0])) * rng.normal(), "d_y": rng.normal()}
    span = 3 * (n["m"] + n["n"]) * (abs(start["d_x"]) + abs(start["d_y"])) / min(n["mu"], n["nu"])
    return Case(sled(), n, start, min(span, 60.0), mechanics)


# -- more contacts than directions -----------------------------------------------------------------


@cache
def doubled(kind: str) -> System:
    coordinate = Inertial() if kind == "inertial" else Viscous()
    return System(
        name="two contacts side by side",
        parameters=given(m=1.0, c=1.0, k=1.0, mu=0.3, nu=0.2, F=1.0, omega=1.0, phi=0.0),
        coordinates={"x": coordinate},
        kinetic="m*d_x**2/2" if kind == "inertial" else 0.0,
        potential="k*x**2/2 - F*cos(omega*t + phi)*x",
        viscous="c*d_x**2/2",
        contacts={"front": Contact("d_x", "mu"), "back": Contact("2*d_x", "nu")},
    )


@family
def redundant_contacts(rng: Rng) -> Case:
    """Two contacts in one direction, whose forces cannot be told apart: together they are one."""
    kind = pick(rng, ("inertial", "viscous"))
    n = {
        "m": rng.uniform(0.5, 2),
        "c": rng.uniform(0.1, 1),
        "k": rng.uniform(0.5, 2),
        "mu": rng.uniform(0.1, 0.4),
    }
    n |= {
        "nu": rng.uniform(0.05, 0.2),
        "F": rng.uniform(0.5, 3),
        "omega": rng.uniform(0.4, 1.5),
        "phi": rng.uniform(0, 6),
    }
    k = n["k"]
    F = n["F"]
    omega = n["omega"]
    phi = n["phi"]
    drag = n["c"] if kind == "inertial" else 0.0
    mechanics = Mechanics(
        kinds=(1, 0, 0, 0) if kind == "inertial" else (0, 1, 0, 0),
        inertia=[[n["m"] if kind == "inertial" else n["c"]]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [
            F * cos(omega * t + phi) - k * x[0] - (drag * v[0] if drag else 0.0)
        ],
        threshold=lambda t, x, v, a, side: [n["mu"] + 2 * n["nu"]],
    )
    return Case(
        doubled(kind), n, {"x": rng.normal()}, rng.uniform(10, 25), mechanics, friction=False
    )


@cache
def pads(kind: str) -> System:
    return System(
        name="two pads on one disc",
        parameters=given(m=1.0, c=1.0, k=1.0, F=1.0, omega=1.0, phi=0.0)
        | given(mu=0.5, mu_b=0.4, nu=0.3, nu_b=0.2, F_k=0.3, F_b=0.2, G_k=0.1, G_b=0.1),
        coordinates={"x": Inertial() if kind == "inertial" else Viscous()},
        kinetic="m*d_x**2/2" if kind == "inertial" else 0.0,
        potential="k*x**2/2 - F*cos(omega*t + phi)*x",
        viscous="c*d_x**2/2",
        contacts={
            "front": Contact("d_x", ("mu", "mu_b"), kinetic=("F_k", "F_b")),
            "back": Contact("-2*d_x", ("nu_b", "nu"), kinetic=("G_b", "G_k")),
        },
    )


@family
def pads_side_by_side(rng: Rng) -> Case:
    """Two contacts in one direction, static above kinetic: they let go where all of both thresholds
    is needed."""
    kind = pick(rng, ("inertial", "viscous"))
    n = {
        "m": rng.uniform(0.5, 2),
        "c": rng.uniform(0.1, 1),
        "k": rng.uniform(0.5, 2),
        "F": rng.uniform(0.5, 3),
    }
    n |= {"omega": rng.uniform(0.4, 1.5), "phi": rng.uniform(0, 6)}
    for static, sliding in (("mu", "F_k"), ("mu_b", "F_b"), ("nu", "G_k"), ("nu_b", "G_b")):
        n[static] = rng.uniform(0.1, 0.4)
        n[sliding] = rng.uniform(0.2, 1.0) * n[static]
    k = n["k"]
    F = n["F"]
    omega = n["omega"]
    phi = n["phi"]
    drag = n["c"] if kind == "inertial" else 0.0
    mechanics = Mechanics(
        kinds=(1, 0, 0, 0) if kind == "inertial" else (0, 1, 0, 0),
        inertia=[[n["m"] if kind == "inertial" else n["c"]]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [
            F * cos(omega * t + phi) - k * x[0] - (drag * v[0] if drag else 0.0)
        ],
        threshold=lambda t, x, v, a, side: ([n["mu"] + 2 * n["nu"]], [n["mu_b"] + 2 * n["nu_b"]]),
        kinetic=lambda t, x, v, a, side, speed: (
            [n["F_k"] + 2 * n["G_k"]],
            [n["F_b"] + 2 * n["G_b"]],
        ),
    )
    return Case(pads(kind), n, {"x": rng.normal()}, rng.uniform(10, 25), mechanics, friction=False)


@cache
def triangle() -> System:
    return System(
        name="three contacts for two masses",
        parameters=given(
            k=1.0, h=1.0, mu=0.4, nu=0.3, xi=0.2, F=1.0, G=1.0, omega=1.0, eta=1.0, phi=0.0
        ),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="d_x**2/2 + d_y**2/2",
        potential="k*x**2/2 + h*y**2/2 - F*sin(omega*t)*x - G*sin(eta*t + phi)*y",
        contacts={
            "x": Contact("d_x", "mu"),
            "y": Contact("d_y", "nu"),
            "both": Contact("d_x - d_y", "xi"),
        },
    )


@family
def hyperstatic(rng: Rng) -> Case:
    """Three contacts hold two masses: forces in stick are not unique, the motion is."""
    n = {
        "k": rng.uniform(0.5, 2),
        "h": rng.uniform(0.5, 2),
        "mu": rng.uniform(0.2, 0.5),
        "nu": rng.uniform(0.2, 0.5),
    }
    n |= {
        "xi": rng.uniform(0.1, 0.4),
        "F": rng.uniform(0.5, 2),
        "G": rng.uniform(0.5, 2),
        "phi": rng.uniform(-0.3, 0.3),
    }
    n |= {"omega": rng.uniform(0.5, 1.5), "eta": rng.uniform(0.5, 1.5)}
    k, h, F, G, omega, eta, phi = (n[name] for name in ("k", "h", "F", "G", "omega", "eta", "phi"))
    mechanics = Mechanics(
        kinds=(2, 0, 0, 0),
        inertia=np.eye(2),
        J=[[1.0, 0.0], [0.0, 1.0], [1.0, -1.0]],
        force=lambda t, x, v, a, side: [
            F * np.sin(omega * t) - k * x[0],
            G * np.sin(eta * t + phi) - h * x[1],
        ],
        threshold=lambda t, x, v, a, side: [n["mu"], n["nu"], n["xi"]],
    )
    return Case(triangle(), n, {}, rng.uniform(8, 15), mechanics, friction=False)


@cache
def triangle_with_drops() -> System:
    return System(
        name="three contacts for two masses",
        parameters=given(
            k=1.0, h=1.0, mu=0.4, nu=0.3, xi=0.2, F=1.0, G=1.0, omega=1.0, eta=1.0, phi=0.0
        )
        | given(F_k=0.3, G_k=0.2, H_k=0.1),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="d_x**2/2 + d_y**2/2",
        potential="k*x**2/2 + h*y**2/2 - F*sin(omega*t)*x - G*sin(eta*t + phi)*y",
        contacts={
            "x": Contact("d_x", "mu", kinetic="F_k"),
            "y": Contact("d_y", "nu", kinetic="G_k"),
            "both": Contact("d_x - d_y", "xi", kinetic="H_k"),
        },
    )


HELD = (("F_k", "mu"), ("G_k", "nu"), ("H_k", "xi"))


@family
def hyperstatic_with_static_above_kinetic(rng: Rng) -> Case:
    """The same, where what is carried at its threshold must not be mistaken for what slides."""
    case = hyperstatic(rng)
    held = {a: rng.uniform(0.3, 1.0) * case.parameters[b] for a, b in HELD}
    n = {**case.parameters, **held}
    assert case.mechanics is not None
    mechanics = replace(
        case.mechanics, kinetic=lambda t, x, v, a, side, speed: [n[a] for a, _ in HELD]
    )
    return replace(case, system=triangle_with_drops(), parameters=n, mechanics=mechanics)


# -- heavy and light -------------------------------------------------------------------------------


@family
def heavy_and_light(rng: Rng) -> Case:
    """A mass that is stuck for ever beside one that moves."""
    n = ordinary_pair(rng, "inertial")
    heavy = log_uniform(rng, 1e-10, 1e10)
    n |= {"n": heavy, "nu": rng.uniform(20.0, 50.0), "phi": rng.uniform(0, 6)}
    return Case(
        pair_of("inertial"),
        n,
        {"x": rng.normal()},
        rng.uniform(8, 20),
        pair_by_hand("inertial", n, wave(n)),
    )


@cache
def drill() -> System:
    return System(
        name="drill string",
        parameters=given(
            J_1=2000.0, J_2=400.0, k=500.0, c=200.0, T=5000.0, mu=3000.0, F_k=1500.0, V=5.0
        ),
        coordinates={"th": Inertial(), "ph": Inertial()},
        kinetic="J_1*d_th**2/2 + J_2*d_ph**2/2",
        potential="k*(th - ph)**2/2 - T*th",
        viscous="c*d_th**2/2",
        contacts={"bit": Contact("d_ph", "mu", kinetic="F_k + (mu - F_k)*exp(-speed/V)")},
    )


@family
def drill_string(rng: Rng) -> Case:
    """A table driven by a constant torque, a bit with Stribeck friction that sticks, slips, or
    sticks for ever."""
    n = {
        "J_1": rng.uniform(1000, 3000),
        "J_2": log_uniform(rng, 10, 1e5),
        "k": rng.uniform(200, 800),
        "V": 5.0,
    }
    n |= {"c": rng.uniform(100, 400), "T": rng.uniform(1000, 6000), "mu": rng.uniform(2000, 6000)}
    n["mu"] *= float(rng.choice([1.0, 1.0, 10.0]))  # ten times as much holds for ever
    n |= {"F_k": 0.5 * n["mu"]}
    k, c, T, mu, F_k, V = (n[name] for name in ("k", "c", "T", "mu", "F_k", "V"))
    mechanics = Mechanics(
        kinds=(2, 0, 0, 0),
        inertia=np.diag([n["J_1"], n["J_2"]]),
        J=[[0.0, 1.0]],
        force=lambda t, x, v, a, side: [T - k * (x[0] - x[1]) - c * v[0], k * (x[0] - x[1])],
        threshold=lambda t, x, v, a, side: [mu],
        kinetic=lambda t, x, v, a, side, speed: [F_k + (mu - F_k) * np.exp(-speed[0] / V)],
    )
    return Case(drill(), n, {}, rng.uniform(15, 40), mechanics)


# -- chains and legs -------------------------------------------------------------------------------


@cache
def chain() -> System:
    names = ("x", "y", "z")
    return System(
        name="three blocks on a belt",
        parameters=given(k=1.0, j=1.0, mu=1.0, V=0.3, v_s=0.5, d=0.4),
        coordinates={name: Inertial() for name in names},
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2",
        potential="k*(x**2 + y**2 + z**2)/2 + j*((x - y)**2 + (y - z)**2)/2",
        contacts={
            n: Contact(f"d_{n}", "mu", "V", "mu*(1 - d) + mu*d/(1 + speed/v_s)") for n in names
        },
    )


@family
def blocks_on_a_belt(rng: Rng) -> Case:
    """A short chain with friction that falls with speed, for a short time."""
    n = {
        "k": rng.uniform(0.5, 1.5),
        "j": rng.uniform(0.5, 2),
        "mu": 1.0,
        "V": rng.uniform(0.2, 0.8),
        "v_s": 0.5,
    }
    n |= {"d": rng.uniform(0.1, 0.6)}
    k = n["k"]
    j = n["j"]
    V = n["V"]
    d = n["d"]
    mechanics = Mechanics(
        kinds=(3, 0, 0, 0),
        inertia=np.eye(3),
        J=np.eye(3),
        force=lambda t, x, v, a, side: [
            -k * x[0] - j * (x[0] - x[1]),
            -k * x[1] - j * (2 * x[1] - x[0] - x[2]),
            -k * x[2] - j * (x[2] - x[1]),
        ],
        threshold=lambda t, x, v, a, side: [1.0, 1.0, 1.0],
        kinetic=lambda t, x, v, a, side, speed: 1 - d + d / (1 + speed / 0.5),
        belt=lambda t: [V + 0 * t] * 3,
    )
    start = {name: 0.3 * rng.normal() for name in ("x", "y", "z")}
    return Case(chain(), n, start, 8.0, mechanics)


@cache
def crawler(length: str) -> System:
    return System(
        name="crawler",
        parameters=given(k=1.0, f=0.1, g=0.4, D=1.0, omega=1.0, p=1.0, w=0.1),
        coordinates={"x": RateIndependent(), "y": RateIndependent()},
        potential=f"k/2*(y - x - ({length}))**2",
        contacts={"hind": Contact("d_x", ("f", "g")), "front": Contact("d_y", ("f", "g"))},
    )


@family
def crawling_legs(rng: Rng) -> Case:
    """Two legs with bristles, driven by a length that swings or jolts; the pair can be shifted
    freely."""
    shape = pick(rng, (None, BUMPS[0], BUMPS[1]))
    n = {
        "k": rng.uniform(0.5, 2),
        "f": rng.uniform(0.05, 0.2),
        "g": rng.uniform(0.25, 0.5),
        "D": rng.uniform(1, 3),
    }
    n |= {
        "omega": rng.uniform(0.5, 2.0),
        "p": rng.uniform(2, 15),
        "w": 20 * log_uniform(rng, 1e-4, 3e-2),
    }
    k, f, g, D, omega, p, w = (n[name] for name in ("k", "f", "g", "D", "omega", "p", "w"))

    def length(t: Any) -> Any:
        return D / 2 * np.sin(omega * t) if shape is None else D * shape.at((t - p) / w)

    mechanics = Mechanics(
        kinds=(0, 0, 2, 0),
        J=np.eye(2),
        force=lambda t, x, v, a, side: [
            k * (x[1] - x[0] - length(t)),
            -k * (x[1] - x[0] - length(t)),
        ],
        threshold=lambda t, x, v, a, side: ([f + 0 * t, f + 0 * t], [g + 0 * t, g + 0 * t]),
        zones=() if shape is None else (Zone(TIME, p, w),),
    )
    text = "D/2*sin(omega*t)" if shape is None else f"D*{shape.text('t')}"
    return Case(crawler(text), n, {}, 20.0, mechanics)


@cache
def toy() -> System:
    return catalogue.rocking_toy()


def standing(rng: Rng, n: dict[str, float]) -> dict[str, float]:
    """A tilted toy whose unloaded leg holds its pull."""
    psi = rng.uniform(0.7, 0.9)
    return {
        "psi": psi,
        "x_R": n["c"] * psi - n["P"] + n["rho"] * rng.uniform(-0.9, 0.9),
        "x_L": 0.0,
    }


def toy_by_hand(n: dict[str, float]) -> Mechanics:
    """The same by hand."""
    delta, b, c, rho, H, P = (n[name] for name in ("delta", "b", "c", "rho", "H_star", "P"))

    def weights(psi: Any, side: Any) -> tuple[Any, Any]:
        share = psi if side[0] < 0 and side[1] > 0 else (1.0 if side[0] > 0 else -1.0)
        return rho + H / 2 * (1 + share), rho + H / 2 * (1 - share)

    def force(t: Any, x: Any, v: Any, a: Any, side: Any) -> list[Any]:
        psi = x[0]
        d = x[1] - x[2]
        return [-b * psi + c * d - delta * v[0], P - d + c * psi, P + d - c * psi]

    return Mechanics(
        kinds=(1, 0, 2, 0),
        inertia=[[1.0]],
        J=[[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        force=force,
        threshold=lambda t, x, v, a, side: list(weights(x[0], side)),
        kinks=lambda t, x, v, a: [x[0] - 1.0, x[0] + 1.0],
    )


@family
def corners_of_the_toy(rng: Rng) -> Case:
    """The rocking toy [M] (4.2): a rocking mass and two legs, which change at the corners of their
    bounds at once."""
    n = {
        "I_b": 1.0,
        "delta": rng.uniform(0.02, 0.2),
        "a": 1.0,
        "b": rng.uniform(0.8, 1.2),
        "c": rng.uniform(0.2, 0.4),
    }
    n |= {
        "rho": rng.uniform(0.1, 0.3),
        "psi_star": 1.0,
        "H_star": rng.uniform(2.5, 3.5),
        "P": rng.uniform(0.8, 1.1),
    }
    return Case(toy(), n, standing(rng, n), rng.uniform(8, 25), toy_by_hand(n))


@cache
def steep_toy() -> System:
    return catalogue.rocking_toy().configure({"H_R": "H_star/2*(1 + tanh(psi/psi_star))"})


@family
def toy_on_a_knife_edge(rng: Rng) -> Case:
    """The rocking toy whose weight changes legs within a narrow angle."""
    n = {
        "I_b": 1.0,
        "delta": rng.uniform(0.02, 0.2),
        "a": 1.0,
        "b": rng.uniform(0.8, 1.2),
        "c": rng.uniform(0.2, 0.4),
    }
    n |= {
        "rho": rng.uniform(0.1, 0.3),
        "psi_star": log_uniform(rng, 1e-4, 0.1),
        "H_star": rng.uniform(2.5, 3.5),
    }
    n |= {"P": rng.uniform(0.8, 1.1)}
    delta, b, c, rho, H, P, w = (
        n[name] for name in ("delta", "b", "c", "rho", "H_star", "P", "psi_star")
    )

    def force(t: Any, x: Any, v: Any, a: Any, side: Any) -> list[Any]:
        psi = x[0]
        d = x[1] - x[2]
        return [-b * psi + c * d - delta * v[0], P - d + c * psi, P + d - c * psi]

    mechanics = Mechanics(
        kinds=(1, 0, 2, 0),
        inertia=[[1.0]],
        J=[[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        force=force,
        threshold=lambda t, x, v, a, side: [
            rho + H * STEPS[0].at(x[0] / w),
            rho + H * STEPS[0].at(-x[0] / w),
        ],
        zones=(Zone(0, 0.0, w),),
    )
    return Case(steep_toy(), n, standing(rng, n), rng.uniform(5, 15), mechanics)
