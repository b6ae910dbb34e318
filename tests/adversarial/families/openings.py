"""Bodies whose contacts open: bouncing, stops, corners, rods and blocks, moving inertia."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import cos, pi, sin
from typing import Any

import numpy as np

from stickslip import Contact, Inertial, System, Unilateral

from ..case import Families, Rng, declaration, given, pick
from ..references.bouncing import Bodies, Touch

G = 9.81


@dataclass(frozen=True)
class Opening:
    """A motion with contacts that open.

    Attributes
    ----------
    system, parameters, initial
        What the library gets.
    bodies : Bodies
        The same for the reference.
    duration : float
    length, speed : float
        Sizes of places and rates.
    """

    system: System
    parameters: Mapping[str, float]
    initial: Mapping[str, float]
    bodies: Bodies
    duration: float
    length: float
    speed: float
    family: str = ""
    seed: int = 0
    names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        places = tuple(self.system.coordinates)
        object.__setattr__(self, "names", (*places, *(f"d_{x}" for x in places)))

    @property
    def start(self) -> np.ndarray:
        """The initial state."""
        return np.array([self.initial.get(n, 0.0) for n in self.names])

    def source(self) -> str:
        """A script that repeats the library's part."""
        plain = [{k: float(v) for k, v in d.items()} for d in (self.initial, self.parameters)]
        return (
            f"system = {declaration(self.system)}\n"
            f"motion = ss.simulate(system, (0.0, {self.duration!r}), initial={plain[0]}, "
            f"parameters={plain[1]})"
        )


FAMILIES: Families[Any] = Families()
family = FAMILIES.add


def restitution(rng: Rng) -> float:
    """None now and then."""
    return float(pick(rng, (0.0, rng.uniform(0.05, 0.8))))


def flat(*numbers: float) -> Any:
    """A constant direction."""
    return lambda *state: numbers


def point(**contacts: Unilateral) -> dict[str, Any]:
    """A point in the plane under gravity."""
    return {
        "coordinates": {"x": Inertial(), "y": Inertial()},
        "kinetic": "m/2*(d_x**2 + d_y**2)",
        "potential": "m*g*y",
        "contacts": contacts,
    }


@family
def thrown_on_a_belt(rng: Rng) -> Opening:
    """A point that is thrown onto a rough belt."""
    n = {"m": rng.uniform(0.3, 2), "g": G, "mu": rng.uniform(0, 1), "e": restitution(rng)}
    n |= {"V": rng.uniform(-2, 2), "b": float(pick(rng, (0.0, rng.uniform(0, 0.9))))}
    system = System(
        name="thrown on a belt",
        parameters=given(**n),
        **point(
            floor=Unilateral(
                "y", "d_x", "mu", surface_speed="V", restitution="e", tangential_restitution="b"
            )
        ),
    )
    floor = Touch(
        lambda t, q: q[1], flat(0, 1), direction=flat(1, 0), mu=n["mu"], e=n["e"], e_t=n["b"],
        belt=n["V"],
    )  # fmt: skip
    bodies = Bodies(2, lambda q: n["m"] * np.eye(2), lambda t, q, v: [0, -n["m"] * G], [floor])
    start = {"y": rng.uniform(0.05, 1), "d_x": rng.uniform(-4, 4), "d_y": rng.uniform(-2, 2)}
    return Opening(system, n, start, bodies, rng.uniform(1, 3), 1.0, 4.0)


@family
def shaken_plate(rng: Rng) -> Opening:
    """A ball on a plate that is shaken, weakly or so that it is thrown off."""
    omega = rng.uniform(5, 30)
    A = rng.uniform(0.2, 3.0) * G / omega**2
    n = {"m": rng.uniform(0.3, 2), "g": G, "e": restitution(rng), "A": A, "omega": omega}
    n["e"] = min(n["e"], 0.5)
    system = System(
        name="shaken plate",
        parameters=given(**n),
        coordinates={"y": Inertial()},
        kinetic="m/2*d_y**2",
        potential="m*g*y",
        contacts={"plate": Unilateral("y - A*sin(omega*t)", restitution="e")},
    )
    plate = Touch(
        lambda t, q: q[0] - A * np.sin(omega * t),
        flat(1),
        lambda t, q: -A * omega * np.cos(omega * t),
        lambda t, q, v: A * omega**2 * np.sin(omega * t),
        e=n["e"],
    )
    bodies = Bodies(
        1, lambda q: n["m"] * np.eye(1), lambda t, q, v: [-n["m"] * G], [plate], 0.5 / omega
    )
    start = {"y": rng.uniform(0.0, 0.3), "d_y": A * omega}
    return Opening(system, n, start, bodies, 2 * pi / omega * rng.uniform(2, 6), 0.3, 2.0)


@family
def between_stops(rng: Rng) -> Opening:
    """A mass on a spring with dry friction between two stops, forced."""
    n = {x: rng.uniform(0.5, 2.0) for x in ("m", "k")} | {"e": restitution(rng)}
    n |= {"F_c": rng.uniform(0, 0.6), "F": rng.uniform(0.5, 4), "omega": rng.uniform(0.5, 3)}
    n |= {"c": rng.uniform(0, 0.3), "a": rng.uniform(0.2, 0.8)}
    system = System(
        name="between stops",
        parameters=given(**n),
        coordinates={"x": Inertial(force="F*cos(omega*t)")},
        kinetic="m/2*d_x**2",
        potential="k/2*x**2",
        viscous="c/2*d_x**2",
        contacts={
            "wall": Contact("d_x", "F_c"),
            "left": Unilateral("x + a", restitution="e"),
            "right": Unilateral("a - x", restitution="e"),
        },
    )
    touches = [
        Touch(direction=flat(1), threshold=n["F_c"]),
        Touch(lambda t, q: q[0] + n["a"], flat(1), e=n["e"]),
        Touch(lambda t, q: n["a"] - q[0], flat(-1), e=n["e"]),
    ]
    bodies = Bodies(
        1,
        lambda q: n["m"] * np.eye(1),
        lambda t, q, v: [n["F"] * np.cos(n["omega"] * t) - n["k"] * q[0] - n["c"] * v[0]],
        touches,
        0.1,
    )
    start = {"x": rng.uniform(-0.1, 0.1), "d_x": rng.uniform(-1, 1)}
    return Opening(system, n, start, bodies, rng.uniform(4, 15), 1.0, 2.0)


@family
def corner(rng: Rng) -> Opening:
    """A ball that is thrown into a corner of a rough floor and a leaning wall."""
    lean = rng.uniform(-0.4, 0.6)
    n = {"m": rng.uniform(0.3, 2), "g": G, "mu": rng.uniform(0, 0.8), "nu": rng.uniform(0, 0.8)}
    n |= {"e": restitution(rng), "f": restitution(rng), "s": sin(lean), "c": cos(lean)}
    system = System(
        name="corner",
        parameters=given(**n),
        **point(
            floor=Unilateral("y", "d_x", "mu", restitution="e"),
            wall=Unilateral("c*(1 - x) + s*y", "c*d_y + s*d_x", "nu", restitution="f"),
        ),
    )
    s, c = n["s"], n["c"]
    touches = [
        Touch(lambda t, q: q[1], flat(0, 1), direction=flat(1, 0), mu=n["mu"], e=n["e"]),
        Touch(
            lambda t, q: c * (1 - q[0]) + s * q[1], flat(-c, s), direction=flat(s, c),
            mu=n["nu"], e=n["f"],
        ),
    ]  # fmt: skip
    bodies = Bodies(2, lambda q: n["m"] * np.eye(2), lambda t, q, v: [0, -n["m"] * G], touches)
    start = {"y": rng.uniform(0.05, 0.8), "d_x": rng.uniform(0, 5), "d_y": rng.uniform(-2, 2)}
    return Opening(system, n, start, bodies, rng.uniform(0.6, 1.5), 1.0, 5.0)


def body(rng: Rng, inertia: float) -> dict[str, float]:
    """Numbers of a rigid body in the plane."""
    m = rng.uniform(0.3, 2)
    return {"m": m, "J": m * inertia, "g": G, "mu": rng.uniform(0, 1), "e": restitution(rng)}


def rigid(n: Mapping[str, float], contacts: dict[str, Unilateral], name: str) -> System:
    """A rigid body in the plane, by default high above the floor."""
    return System(
        name=name,
        parameters=given(**n),
        coordinates={"x": Inertial(), "y": Inertial(), "phi": Inertial()},
        kinetic="m/2*(d_x**2 + d_y**2) + J/2*d_phi**2",
        potential="m*g*y",
        contacts=contacts,
        initial={"y": 3.0},
    )


def corner_at(a: float, b: float, mu: float, e: float) -> Touch:
    """The point (a, b) of a body above a floor y = 0: its height is y + a sin φ + b cos φ."""

    def height(q: Any) -> float:
        return q[1] + a * np.sin(q[2]) + b * np.cos(q[2])

    def along(q: Any) -> tuple[float, float, float]:  # x + a cos φ − b sin φ
        return 1.0, 0.0, -a * np.sin(q[2]) - b * np.cos(q[2])

    return Touch(
        lambda t, q: height(q),
        lambda t, q: (0.0, 1.0, a * np.cos(q[2]) - b * np.sin(q[2])),
        bend=lambda t, q, v: -(a * np.sin(q[2]) + b * np.cos(q[2])) * v[2] ** 2,
        direction=along,
        turn=lambda q, v: (-a * np.cos(q[2]) + b * np.sin(q[2])) * v[2] ** 2,
        mu=mu,
        e=e,
    )


def corner_of(a: str, b: str) -> Unilateral:
    """The same for the library."""
    return Unilateral(
        f"y + {a}*sin(phi) + {b}*cos(phi)",
        f"d_x - ({a}*sin(phi) + {b}*cos(phi))*d_phi",
        "mu",
        restitution="e",
    )


def falling(n: Mapping[str, float], touches: list[Touch]) -> Bodies:
    """A rigid body under gravity."""
    M = np.diag([n["m"], n["m"], n["J"]])
    return Bodies(3, lambda q: M, lambda t, q, v: [0.0, -n["m"] * G, 0.0], touches, 0.05)


@family
def tip_of_a_rod(rng: Rng) -> Opening:
    """A rod whose tip falls onto a rough floor or slides on it, until it is about to lie; friction
    may be above Painlevé's."""
    n = body(rng, 1 / 3) | {"a": -1.0}
    n["mu"] = rng.uniform(0, 2.0)
    phi = rng.uniform(0.4, pi - 0.4)
    system = rigid(n, {"tip": corner_of("a", "0")}, "tip of a rod")
    bodies = falling(n, [corner_at(-1.0, 0.0, n["mu"], n["e"])])
    start = {"phi": phi, "y": sin(phi) + float(pick(rng, (0.0, rng.uniform(0, 0.3))))}
    start |= {"d_x": rng.uniform(-4, 4)}
    return Opening(system, n, start, bodies, 0.3, 1.0, 4.0)


@family
def falling_rod(rng: Rng) -> Opening:
    """A rod that falls onto a floor and comes to lie on both of its ends."""
    n = body(rng, 1 / 3) | {"a": 1.0}
    system = rigid(n, {"left": corner_of("(-a)", "0"), "right": corner_of("a", "0")}, "falling rod")
    touches = [corner_at(a, 0.0, n["mu"], n["e"]) for a in (-1.0, 1.0)]
    phi = rng.uniform(0.05, 1.3) * pick(rng, (-1.0, 1.0))
    above = float(pick(rng, (0.0, rng.uniform(0.05, 0.5))))
    start = {"phi": phi, "y": abs(sin(phi)) + above, "d_x": rng.uniform(-3, 3)}
    start |= {"d_phi": rng.uniform(-2, 2)} if above > 0.0 else {}
    return Opening(system, n, start, falling(n, touches), rng.uniform(0.4, 1.5), 1.0, 4.0)


@family
def rocking_block(rng: Rng) -> Opening:
    """A block that rocks from corner to corner (Housner)."""
    slender = rng.uniform(0.15, 0.5)
    a, b = sin(slender), cos(slender)
    n = body(rng, 1 / 3) | {"a": a, "b": b}
    n["mu"], n["e"] = rng.uniform(0.3, 1.0), float(pick(rng, (0.0, 0.0, rng.uniform(0, 0.4))))
    system = rigid(
        n, {"left": corner_of("(-a)", "(-b)"), "right": corner_of("a", "(-b)")}, "rocking block"
    )
    touches = [corner_at(s * a, -b, n["mu"], n["e"]) for s in (-1.0, 1.0)]
    phi = rng.uniform(0.2, 0.95) * slender * pick(rng, (-1.0, 1.0))
    rest = b * cos(phi) + a * abs(sin(phi))
    start = {"phi": phi, "y": rest + float(pick(rng, (0.0, rng.uniform(0, 0.2))))}
    return Opening(system, n, start, falling(n, touches), rng.uniform(0.5, 3), 1.0, 3.0)


@family
def rough_bowl(rng: Rng) -> Opening:
    """A bead in a hoop, in plane coordinates: it slides, sticks, and may fall off."""
    n = {"m": rng.uniform(0.3, 2), "g": G, "mu": rng.uniform(0, 0.8), "e": restitution(rng)}
    system = System(
        name="rough bowl",
        parameters=given(**n),
        **point(bowl=Unilateral("1 - sqrt(x**2 + y**2)", "x*d_y - y*d_x", "mu", restitution="e")),
    )

    def bend(t: float, q: Any, v: Any) -> float:
        r = np.hypot(*q)
        return -((v @ v) / r - (q @ v) ** 2 / r**3)

    bowl = Touch(
        lambda t, q: 1 - np.hypot(*q),
        lambda t, q: -np.asarray(q) / np.hypot(*q),
        bend=bend,
        direction=lambda q: (-q[1], q[0]),
        mu=n["mu"],
        e=n["e"],
    )
    bodies = Bodies(2, lambda q: n["m"] * np.eye(2), lambda t, q, v: [0, -n["m"] * G], [bowl], 0.05)
    place = rng.uniform(-pi, 0)
    r = 1.0 - rng.uniform(0.05, 0.5)
    start = {"x": r * cos(place), "y": r * sin(place)}
    start |= {"d_x": rng.uniform(-4, 4), "d_y": rng.uniform(-4, 4)}
    return Opening(system, n, start, bodies, rng.uniform(0.5, 2), 1.0, 4.0)


@family
def cart_against_stops(rng: Rng) -> Opening:
    """A pendulum on a cart between two stops, with dry friction under the cart."""
    n = {"M": rng.uniform(0.5, 2), "m": rng.uniform(0.2, 1), "l": rng.uniform(0.4, 1), "g": G}
    n |= {"F_c": float(pick(rng, (0.0, rng.uniform(0, 1.5)))), "e": restitution(rng), "a": 0.0}
    n["a"] = rng.uniform(0.02, 0.2)
    system = System(
        name="cart against stops",
        parameters=given(**n),
        coordinates={"x": Inertial(), "phi": Inertial()},
        kinetic="M/2*d_x**2 + m/2*(d_x**2 + 2*l*d_x*d_phi*cos(phi) + l**2*d_phi**2)",
        potential="-m*g*l*cos(phi)",
        contacts={
            "track": Contact("d_x", "F_c"),
            "left": Unilateral("x + a", restitution="e"),
            "right": Unilateral("a - x", restitution="e"),
        },
    )
    M, m, l, a = (n[x] for x in ("M", "m", "l", "a"))  # noqa: E741

    def mass(q: Any) -> Any:
        b = m * l * np.cos(q[1])
        return np.array([[M + m, b], [b, m * l**2]])

    def load(t: float, q: Any, v: Any) -> Any:
        return [m * l * np.sin(q[1]) * v[1] ** 2, -m * G * l * np.sin(q[1])]

    touches = [
        Touch(direction=flat(1, 0), threshold=n["F_c"]),
        Touch(lambda t, q: q[0] + a, flat(1, 0), e=n["e"]),
        Touch(lambda t, q: a - q[0], flat(-1, 0), e=n["e"]),
    ]
    start = {"phi": rng.uniform(-2.5, 2.5), "d_phi": rng.uniform(-2, 2)}
    bodies = Bodies(2, mass, load, touches, 0.05)
    return Opening(system, n, start, bodies, rng.uniform(1, 5), 1.0, 4.0)


@family
def rod_on_a_hinge(rng: Rng) -> Opening:
    """A double pendulum whose second rod strikes a wall: the gap bends, and so does the inertia."""
    n = {"m": rng.uniform(0.5, 2), "M": rng.uniform(0.5, 2), "g": G, "e": restitution(rng)}
    n |= {"mu": rng.uniform(0, 0.6), "w": rng.uniform(0.2, 0.9)}
    system = System(
        name="rod on a hinge",
        parameters=given(**n),
        coordinates={"a": Inertial(), "b": Inertial()},
        kinetic="(m + M)/2*d_a**2 + M/2*(d_b**2 + 2*d_a*d_b*cos(a - b))",
        potential="-(m + M)*g*cos(a) - M*g*cos(b)",
        viscous="0.05*(d_a**2 + d_b**2)",
        contacts={
            "wall": Unilateral(
                "w - sin(a) - sin(b)", "sin(a)*d_a + sin(b)*d_b", "mu", restitution="e"
            )
        },
    )
    m, M, w = (n[x] for x in ("m", "M", "w"))

    def mass(q: Any) -> Any:
        k = M * np.cos(q[0] - q[1])
        return np.array([[m + M, k], [k, M]])

    def load(t: float, q: Any, v: Any) -> Any:
        k = M * np.sin(q[0] - q[1])
        return [
            -k * v[1] ** 2 - (m + M) * G * np.sin(q[0]) - 0.1 * v[0],
            k * v[0] ** 2 - M * G * np.sin(q[1]) - 0.1 * v[1],
        ]

    wall = Touch(
        lambda t, q: w - np.sin(q[0]) - np.sin(q[1]),
        lambda t, q: (-np.cos(q[0]), -np.cos(q[1])),
        bend=lambda t, q, v: np.sin(q[0]) * v[0] ** 2 + np.sin(q[1]) * v[1] ** 2,
        direction=lambda q: (np.sin(q[0]), np.sin(q[1])),
        turn=lambda q, v: np.cos(q[0]) * v[0] ** 2 + np.cos(q[1]) * v[1] ** 2,
        mu=n["mu"],
        e=n["e"],
    )
    start = {"a": rng.uniform(-1.5, 0), "b": rng.uniform(-1.5, 0)}
    bodies = Bodies(2, mass, load, [wall], 0.03)
    return Opening(system, n, start, bodies, rng.uniform(0.5, 2.0), 1.0, 5.0)


@family
def two_masses_collide(rng: Rng) -> Opening:
    """Two masses on springs that strike each other and a wall, forced."""
    n = {x: rng.uniform(0.5, 2) for x in ("m", "n", "k", "h", "F", "omega")}
    n |= {"e": restitution(rng), "f": restitution(rng), "a": rng.uniform(0.05, 0.4)}
    system = System(
        name="two masses collide",
        parameters=given(**n),
        coordinates={"x": Inertial(force="F*cos(omega*t)"), "y": Inertial()},
        kinetic="m/2*d_x**2 + n/2*d_y**2",
        potential="k/2*x**2 + h/2*y**2",
        viscous="0.02*d_x**2",
        contacts={
            "each other": Unilateral("y - x + a", restitution="e"),
            "wall": Unilateral("a - y", restitution="f"),
        },
    )
    a = n["a"]
    touches = [
        Touch(lambda t, q: q[1] - q[0] + a, flat(-1, 1), e=n["e"]),
        Touch(lambda t, q: a - q[1], flat(0, -1), e=n["f"]),
    ]
    bodies = Bodies(
        2,
        lambda q: np.diag([n["m"], n["n"]]),
        lambda t, q, v: [
            n["F"] * np.cos(n["omega"] * t) - n["k"] * q[0] - 0.04 * v[0],
            -n["h"] * q[1],
        ],
        touches,
    )
    start = {"d_x": rng.uniform(-1, 1), "d_y": rng.uniform(-1, 1)}
    return Opening(system, n, start, bodies, rng.uniform(3, 10), 1.0, 1.5)


@family
def bead_on_a_turning_hoop(rng: Rng) -> Opening:
    """A bead on a rough hoop that turns about its diameter, between two stops on the hoop."""
    n = {"g": G, "R": rng.uniform(0.3, 1.0), "W": rng.uniform(0, 10), "e": restitution(rng)}
    n |= {"f": float(pick(rng, (0.0, rng.uniform(0, 3)))), "s": rng.uniform(0.5, 2.5)}
    system = System(
        name="bead on a turning hoop",
        parameters=given(**n),
        coordinates={"theta": Inertial()},
        kinetic="R**2/2*(d_theta**2 + W**2*sin(theta)**2)",
        potential="-g*R*cos(theta)",
        contacts={
            "hoop": Contact("R*d_theta", "f"),
            "left": Unilateral("R*(s + theta)", restitution="e"),
            "right": Unilateral("R*(s - theta)", restitution="e"),
        },
    )
    R, W, s = n["R"], n["W"], n["s"]
    touches = [
        Touch(direction=flat(R), threshold=n["f"]),
        Touch(lambda t, q: R * (s + q[0]), flat(R), e=n["e"]),
        Touch(lambda t, q: R * (s - q[0]), flat(-R), e=n["e"]),
    ]
    bodies = Bodies(
        1,
        lambda q: R**2 * np.eye(1),
        lambda t, q, v: [R**2 * W**2 * np.sin(q[0]) * np.cos(q[0]) - G * R * np.sin(q[0])],
        touches,
        0.03,
    )
    start = {"theta": rng.uniform(-0.9, 0.9) * s, "d_theta": rng.uniform(-6, 6)}
    return Opening(system, n, start, bodies, rng.uniform(0.5, 3), 1.0, 6.0)


@family
def that_adheres(rng: Rng) -> Opening:
    """One of the others, with adhesion of a few weights at all that opens."""
    others = (
        thrown_on_a_belt,
        shaken_plate,
        between_stops,
        corner,
        tip_of_a_rod,
        falling_rod,
        rocking_block,
        rough_bowl,
        bead_on_a_turning_hoop,
    )
    case = pick(rng, others)(rng)
    weight = case.parameters.get("m", 1.0) * case.parameters.get("g", 1.0)
    pull = float(pick(rng, (rng.uniform(0.0, 0.5), rng.uniform(0.5, 4.0)))) * weight
    contacts = {
        name: replace(contact, adhesion="pull") if isinstance(contact, Unilateral) else contact
        for name, contact in case.system.contacts.items()
    }
    parameters = {**case.system.parameters, **given(pull=pull)}
    system = replace(case.system, contacts=contacts, parameters=parameters)
    touches = [t if t.gap is None else replace(t, pull=pull) for t in case.bodies.touches]
    bodies = replace(case.bodies, touches=touches)
    return replace(case, system=system, bodies=bodies, parameters={**case.parameters, "pull": pull})
