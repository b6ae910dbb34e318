"""What was once certified and wrong, right and not certified, or refused: none of it may come
back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip import (
    Contact,
    Inertial,
    Internal,
    Outcome,
    Parameter,
    RateIndependent,
    System,
    Trajectory,
    Viscous,
    simulate,
    simulate_many,
)
from stickslip.motion.affine.nodes import COUNT, GAUSS_NODES, GAUSS_WEIGHTS, INTEGRALS

SCALES = [1e-60, 1e-12, 1e12, 1e60]


def given(**defaults: float) -> dict[str, Parameter]:
    return {name: Parameter(default=value) for name, value in defaults.items()}


def block(
    potential: str, threshold: str = "0.1", kinetic_force: str | None = None, **parts: object
) -> System:
    """A mass of 1 on the ground."""
    return System(
        "block",
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential=potential,
        contacts={"ground": Contact("d_x", threshold, kinetic=kinetic_force)},
        **parts,  # type: ignore[arg-type]
    )


def certified(motion: Trajectory, *outcomes: Outcome) -> Trajectory:
    """The motion, which has to end as one of these and to be certified."""
    assert motion.outcome in (outcomes or (Outcome.FINISHED, Outcome.AT_REST)), motion.message
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


# --- Steps that miss nothing ----------------------------------------------------------------------

PULSE = block("x**2/2 - 10*exp(-((t - p)/w)**2)*x", "0.5", parameters=given(p=50.0, w=3.0))


def test_pulse_that_underflows_where_the_step_begins() -> None:
    motion = certified(simulate(PULSE, (0.0, 100.0)))
    # By an event-driven integrator of its own (SciPy, DOP853 with 1e-13).
    assert np.max(np.abs(motion.at(np.linspace(0, 100, 20001))["x"])) == pytest.approx(
        13.8485, abs=1e-4
    )


@pytest.mark.parametrize("width", [3.0, 0.3, 1e-2, 1e-4])
def test_impulse_of_a_pulse(width: float) -> None:
    # A pulse much shorter than the period gives the impulse 10 √π w, less what friction takes
    # meanwhile.
    motion = certified(simulate(PULSE, (0.0, 60.0), parameters={"w": width}))
    if width < 0.1:
        speed = np.max(np.abs(motion.knots.state[:, 1]))
        assert speed == pytest.approx(
            10 * math.sqrt(math.pi) * width, rel=0.5 * width, abs=3 * width
        )
    assert motion.n_switches > 0


def test_pulses_of_many_motions_at_once() -> None:
    at = np.linspace(20.0, 80.0, 7)
    found = simulate_many(PULSE, (0.0, 100.0), parameters={"p": at, "w": np.full(7, 0.5)}).dataset
    for i, p in enumerate(at):
        alone = certified(simulate(PULSE, (0.0, 100.0), parameters={"p": float(p), "w": 0.5}))
        assert float(found["final_x"][i]) == pytest.approx(alone.final["x"], abs=1e-9)


# --- No false alarms ------------------------------------------------------------------------------

HEAVY = System(
    "light and heavy",
    parameters=given(M=374.0),
    coordinates={"x": Inertial(), "X": Inertial()},
    kinetic="d_x**2/2 + M*d_X**2/2",
    potential="x**2/2 + (x - X)**2/2 - 3*sin(t)*x",
    contacts={"light": Contact("d_x", "0.5"), "heavy": Contact("d_X", "50")},
)


@pytest.mark.parametrize("mass", [1.0, 373.0, 374.0, 1e12])
def test_stuck_mass(mass: float) -> None:
    motion = certified(simulate(HEAVY, (0.0, 100.0), parameters={"M": mass}))
    assert motion.final["X"] == 0.0


def test_drill_string_with_a_stuck_bit() -> None:
    drill = System(
        "drill string",
        parameters=given(J_1=2122.0, J_2=471.9, k=861.5, c_1=425.0, c_2=50.0, T=2000.0, s=3.0e4),
        coordinates={"th": Inertial(), "ph": Inertial()},
        kinetic="J_1*d_th**2/2 + J_2*d_ph**2/2",
        potential="k*(th - ph)**2/2 - T*th",
        viscous="c_1*d_th**2/2 + c_2*d_ph**2/2",
        contacts={"bit": Contact("d_ph", "s")},
    )
    motion = certified(simulate(drill, (0.0, 100.0)))
    assert motion.final["ph"] == 0.0
    assert motion.final["th"] == pytest.approx(2000.0 / 861.5, abs=1e-2)


@pytest.mark.parametrize("rtol", [1e-8, 1e-10, 1e-12])
def test_rate_and_state_in_logarithms(rtol: float) -> None:
    # The quasidynamic slider in ln(V/V₀) and ln(θV₀/D), well below the critical stiffness: slip is
    # fast, rest long.
    slider = System(
        "rate and state",
        parameters=given(a=0.01, b=0.015, k=0.003, eta=1e-6, V_p=1.0),
        internal={
            "v": Internal("(k*(V_p - exp(v)) - b*(exp(-h) - exp(v)))/(a + eta*exp(v))"),
            "h": Internal("exp(-h) - exp(v)"),
        },
    )
    motion = certified(simulate(slider, (0.0, 100.0), initial={"v": 0.3, "h": 0.0}, rtol=rtol))
    assert motion.certificate["equations of motion"].value < 1e-9
    assert motion.certificate["rounding errors of the audit"].value < 1e-10


# --- No false refusals ----------------------------------------------------------------------------

THROWN = block("0")


def test_thrown_blocks_come_to_rest() -> None:
    speeds = np.linspace(0.1, 2.0, 201)[1:]
    many = simulate_many(THROWN, (0.0, 50.0), initial={"d_x": speeds}).dataset
    assert np.all(np.isin(many["outcome"], [Outcome.FINISHED.code, Outcome.AT_REST.code]))
    assert np.allclose(many["final_x"], speeds**2 / 0.2, rtol=1e-14)
    assert np.all(many["final_d_x"] == 0.0)
    motion = certified(simulate(THROWN, (0.0, 50.0), initial={"d_x": 0.7}))
    assert motion.outcome is Outcome.AT_REST


SCALED = System(
    "scaled",
    parameters=given(m=1.0, k=1.0, F=1.0, s=0.3, w=0.8, c=0.05),
    coordinates={"x": Inertial()},
    kinetic="m*d_x**2/2",
    potential="k*x**2/2 - F*cos(w*t)*x",
    viscous="c*d_x**2/2",
    contacts={"ground": Contact("d_x", "s")},
)
STRIBECK = System(
    "scaled Stribeck belt",
    parameters=given(m=1.0, k=1.0, s=1.0, r=0.5, v=0.5, V=0.3),
    coordinates={"x": Inertial()},
    kinetic="m*d_x**2/2",
    potential="k*x**2/2",
    contacts={"belt": Contact("d_x", "s", surface_speed="V", kinetic="r + (s - r)*exp(-speed/v)")},
)


@pytest.mark.parametrize("what", ["forces", "masses", "lengths", "times"])
@pytest.mark.parametrize("system", [SCALED, STRIBECK], ids=lambda s: s.name)
def test_units_do_not_matter(system: System, what: str) -> None:
    # Every number by its dimension: force F, length L, time T.
    powers = {
        "m": (1, -1, 2),
        "k": (1, -1, 0),
        "F": (1, 0, 0),
        "s": (1, 0, 0),
        "w": (0, 0, -1),
        "c": (1, -1, 1),
    }
    powers |= {"r": (1, 0, 0), "v": (0, 1, -1), "V": (0, 1, -1)}
    units = {"forces": (1, 0, 0), "masses": (1, 0, 0), "lengths": (0, 1, 0), "times": (0, 0, 1)}[
        what
    ]
    plain = certified(simulate(system, (0.0, 30.0), initial={"x": 0.7}))
    for scale in SCALES:
        if what == "masses":  # heavier, and stiffer: the same motion with larger forces
            scale = math.sqrt(scale)
        by = {n: scale ** float(np.dot(powers[n], units)) for n in system.parameters}
        length, time = scale ** units[1], scale ** units[2]
        numbers = {n: by[n] * p.default for n, p in system.parameters.items()}
        motion = certified(
            simulate(system, (0.0, 30.0 * time), initial={"x": 0.7 * length}, parameters=numbers)
        )
        assert motion.n_switches == plain.n_switches
        assert motion.final["x"] / length == pytest.approx(plain.final["x"], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("weight", [1e-7, 1e7])
def test_scaled_directions(weight: float) -> None:
    motion, plain = (
        certified(simulate(System(
            "scaled direction",
            coordinates={"x": Inertial(), "y": Inertial()},
            kinetic="d_x**2/2 + d_y**2/2",
            potential="x**2/2 + (x - y)**2/2 - 2*sin(t)*y",
            contacts={"a": Contact(f"{w!r}*d_x", repr(0.3 / w)), "b": Contact("d_y - d_x", "0.2")},
        ), (0.0, 40.0)))
        for w in (weight, 1.0)
    )  # fmt: skip
    assert motion.n_switches == plain.n_switches
    assert motion.final["x"] == pytest.approx(plain.final["x"], abs=1e-9)


def reference(force: object, until: float, x: float = 0.0, s: float = 0.1) -> float:
    """Position of a mass of 1 at the end, by an event-driven integrator of SciPy."""
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    t = 0.0
    y = np.array([x, 0.0])
    mode = 0
    while t < until:
        if mode == 0:
            times = np.linspace(t, until, 20001)
            beyond = np.abs([force(u, y[0]) for u in times]) > s  # type: ignore[operator]
            if not beyond.any():
                break
            i = int(np.argmax(beyond))
            if i > 0:
                at = y[0]
                t = brentq(lambda u, q=at: abs(force(u, q)) - s, times[i - 1], times[i], xtol=1e-15)  # type: ignore[operator]
            mode = int(np.sign(force(times[i], y[0])))  # type: ignore[operator]
            y[1] = 0.0

        def stops(u: float, z: np.ndarray) -> float:
            return float(z[1])

        stops.terminal = True  # type: ignore[attr-defined]
        stops.direction = -mode  # type: ignore[attr-defined]
        found = solve_ivp(
            lambda u, z, d=mode: [z[1], force(u, z[0]) - d * s],  # type: ignore[operator]
            (t, until), y, method="DOP853", rtol=1e-12, atol=1e-14, events=stops, max_step=0.02,
        )  # fmt: skip
        t = float(found.t[-1])
        y = found.y[:, -1].copy()
        pull = force(t, y[0])  # type: ignore[operator]
        mode = int(np.sign(pull)) if abs(pull) > s else 0
    return float(y[0])


@pytest.mark.parametrize(("potential", "force", "x"), [
    ("x**10/10 - x", lambda t, x: 1 - x**9, 0.0),
    ("x**4/4 - x", lambda t, x: 1 - x**3, 0.0),
    ("x**2/2 - sin(t)**22*x", lambda t, x: math.sin(t) ** 22 - x, 0.0),
    ("x**2/2 - (t/4)**9*x", lambda t, x: (t / 4) ** 9 - x, 0.0),
    ("x**2/2 + 0.4*max(x - 0.1, 0)**2.5 - sin(t)*x",
     lambda t, x: math.sin(t) - x - max(x - 0.1, 0) ** 1.5, 0.0),
    ("abs(x)**1.5 - sin(t)*x",
     lambda t, x: math.sin(t) - 1.5 * math.copysign(abs(x) ** 0.5, x), 0.0),
])  # fmt: skip
def test_powers_that_vanish(potential: str, force: object, x: float) -> None:
    motion = certified(simulate(block(potential), (0.0, 8.0), initial={"x": x}))
    assert motion.final["x"] == pytest.approx(reference(force, 8.0, x), abs=1e-8)


def test_wall_of_a_high_power() -> None:
    # x³⁹ is nothing where the flight begins and where it ends; in between it is a wall.
    wall = block("x**40/40 + x/2", "0.001")
    motion = certified(simulate(wall, (0.0, 8.0), initial={"d_x": 1.5}))
    assert 1.0 < np.max(motion.at(np.linspace(0, 8, 4001))["x"]) < 1.1


@pytest.mark.parametrize("kind", ["autonomous", "driven", "rate-independent"])
def test_late_starts(kind: str) -> None:
    late = 1e9
    if kind == "rate-independent":
        system = System(
            "late play",
            coordinates={"x": RateIndependent()},
            potential="x**2/2 - sin(t)*x",
            contacts={"ground": Contact("d_x", "0.1")},
        )
    else:
        system = block("x**2/2" if kind == "autonomous" else "x**2/2 - sin(t)*x", "0.05")
    start = {"x": math.sin(late)}
    motion = certified(simulate(system, (late, late + 50.0), initial=start))
    # The same phase early: 1e9 less whole turns, to the digits that a number of the size of 1e9
    # has.
    early = math.fmod(late, 2 * math.pi)
    same = certified(simulate(system, (early, early + 50.0), initial={"x": math.sin(early)}))
    assert motion.n_switches == same.n_switches
    assert motion.final["x"] == pytest.approx(same.final["x"], abs=1e-6)


@pytest.mark.parametrize("kind", ["inertial", "rate-independent"])
def test_loads_that_begin_late(kind: str) -> None:
    # A phase of the size of 1e9 has no digits left for what happens in it; one that counts from the
    # beginning has all.
    inertial = kind == "inertial"
    system = System(
        "late load",
        parameters=given(late=0.0),
        coordinates={"x": Inertial() if inertial else RateIndependent()},
        kinetic="d_x**2/2" if inertial else "0",
        potential="x**2/2 - 2*cos(1.1*(t - late) + 0.3)*x",
        contacts={"ground": Contact("d_x", "0.7")},
    )
    early = certified(simulate(system, (0.0, 32.0), initial={"x": 1.5}))
    late = certified(
        simulate(system, (1e9, 1e9 + 32.0), initial={"x": 1.5}, parameters={"late": 1e9})
    )
    assert late.n_switches == early.n_switches > 10
    assert late.final["x"] == pytest.approx(early.final["x"], abs=1e-12)


# --- Outcomes -------------------------------------------------------------------------------------


def test_kinetic_force_that_leaves_its_admissible_set_on_the_way() -> None:
    # The sliding force 0.5 − 0.1 t is negative from t = 5 on; the load keeps the block sliding.
    system = System(
        "fading",
        parameters=given(rate=0.1),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="-2*x",
        contacts={"ground": Contact("d_x", "1", kinetic="0.5 - rate*t")},
    )
    motion = simulate(system, (0.0, 20.0))
    assert motion.outcome is Outcome.INADMISSIBLE_KINETIC
    assert motion.knots.time[-1] == pytest.approx(5.0, abs=1e-12)
    assert not motion.certificate.ok
    assert motion.certificate.lawful


def test_refused_motions_are_never_certified() -> None:
    jump = System(
        "play", coordinates={"x": RateIndependent()}, potential="x**4/4 - x**2/2 - t*x/10",
        contacts={"ground": Contact("d_x", "0.05")},
    )  # fmt: skip
    motion = simulate(jump, (0.0, 100.0), initial={"x": -1.0})
    assert motion.outcome is Outcome.NO_BOUNDED_RATE
    assert not motion.certificate.ok
    assert motion.certificate.lawful


def test_several_viscous_contacts_start_as_the_static_thresholds_say() -> None:
    # x breaks its threshold at t = 1 and drops to its sliding force; the dashpot then pulls y with
    # 0.72, above 0.6.
    system = System(
        "two in a row",
        coordinates={"x": Viscous(), "y": Viscous()},
        viscous="d_x**2/2 + d_y**2/2 + 9*(d_x - d_y)**2/2",
        potential="-t*x",
        contacts={
            "a": Contact("d_x", "1", kinetic="0.2"),
            "b": Contact("d_y", "0.6", kinetic="0.1"),
        },
    )
    motion = certified(simulate(system, (0.0, 3.0)))
    assert list(motion.events["time"]) == pytest.approx([1.0, 1.0], abs=1e-12)
    # From then on 19 d_x = 10 (t − 0.2) − 0.9 and 19 d_y = 9 (t − 0.2) − 1.
    assert motion.final["x"] == pytest.approx(34.2 / 19, abs=1e-11)
    assert motion.final["y"] == pytest.approx(30.4 / 19, abs=1e-11)


def test_drag_that_is_positive_up_to_rounding() -> None:
    drag = System(
        "drag", coordinates={"x": Inertial(drag="log(d_x + sqrt(1 + d_x**2))")}, kinetic="d_x**2/2",
        potential="x**2/2 - sin(t)*x", contacts={"ground": Contact("d_x", "0.1")},
    )  # fmt: skip
    same = System(
        "drag", coordinates={"x": Inertial(drag="asinh(d_x)")}, kinetic="d_x**2/2",
        potential="x**2/2 - sin(t)*x", contacts={"ground": Contact("d_x", "0.1")},
    )  # fmt: skip
    a, b = (certified(simulate(s, (0.0, 20.0))) for s in (drag, same))
    assert a.final["x"] == pytest.approx(b.final["x"], abs=1e-9)


def test_slip_that_is_shorter_than_the_clock_can_tell() -> None:
    # At t = 55 the speed is e^19 and changes within 1e-8: the rounding of a time moves the state by
    # 1e-6 of itself.
    slider = System(
        "rate and state in logarithms",
        parameters=given(
            a=0.009202090014039625,
            b=0.011593577026655791,
            k=0.00236505010500439,
            V_p=1.205087883953547,
        ),
        internal={
            "phi": Internal("(k*(V_p - exp(phi)) - b*(exp(-psi) - exp(phi)))/a"),
            "psi": Internal("exp(-psi) - exp(phi)"),
        },
    )
    start = {"phi": 1.7026145449805756, "psi": 0.20739909000928833}
    motion = certified(simulate(slider, (0.0, 59.69635525506633), initial=start))
    assert np.max(motion.knots.state[:, 0]) > 19.0
    assert np.min(np.diff(motion.knots.time)) < 1e-8


def test_force_that_is_small_beside_its_terms() -> None:
    # The spring between two legs is short, and they are far away: their force is measured against
    # itself.
    parameters = given(k=1.4, f=0.124, g=0.394, D=2.4, p=9.086, w=0.0083)
    crawler = System(
        "crawler",
        parameters=parameters,
        coordinates={"x": RateIndependent(), "y": RateIndependent()},
        potential="k/2*(y - x - D*exp(-((t - p)/w)**2))**2",
        contacts={"hind": Contact("d_x", ("f", "g")), "front": Contact("d_y", ("f", "g"))},
    )
    for far in (0.0, 1e3):
        motion = certified(simulate(crawler, (0.0, 20.0), initial={"x": far, "y": far}))
        # The pulse pushes the front leg forward, and pulls the hind leg after it.
        assert motion.final["y"] - far == pytest.approx(2.4 - 0.124 / 1.4, abs=1e-10)
        assert motion.final["x"] - far == pytest.approx(2.4 - 2 * 0.124 / 1.4, abs=1e-10)


@pytest.mark.parametrize(
    ("time", "length", "force"), [(1.0, 1.0, 1.0), (1e60, 1.0, 1.0), (1e-60, 1.0, 1e60)]
)
def test_loads_that_grow_with_time_in_every_unit(time: float, length: float, force: float) -> None:
    k = 1.8 * force / length
    c = 0.01 * force * time / length
    V = 0.8 * length / time
    dragged = System(
        "dragged",
        parameters=given(m=force * time**2 / length, k=k, c=c, V=V, s=0.9 * force, d=0.3 * force),
        coordinates={"x": Inertial()},
        kinetic="m*d_x**2/2",
        potential="k*(x - V*t)**2/2",
        viscous="c*d_x**2/2",
        contacts={"ground": Contact("d_x", "s", kinetic="d")},
    )
    motion = certified(simulate(dragged, (0.0, 40.0 * time)))
    assert motion.n_switches == 17
    # The spring pulls with 0.9 where the first slip begins.
    start = motion.knots.time[1] / time
    assert start == pytest.approx(0.9 / (1.8 * 0.8), rel=1e-12)
    if time == 1.0:
        # one flight from switch to switch: in closed form
        assert len(motion.knots.time) == motion.n_switches + 2


# -- several contacts hold one thing ---------------------------------------------------------------


def pads(**laws: str) -> System:
    """Two pads on one disc, pulled by a force that grows with time."""
    front, back = laws.get("front", "F"), laws.get("back", "G")
    return System(
        "disc",
        parameters=given(S=0.5, T=0.4, F=0.3, G=0.1),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="-t*x",
        contacts={
            "front": Contact("d_x", "S", kinetic=front),
            "back": Contact("-2*d_x", "T/2", kinetic=f"({back})/2"),
        },
    )


def test_pads_side_by_side_hold_all_they_can() -> None:
    """At rest a share of 0.5 + 0.4 is needed; a pad at its threshold must not be taken for one that
    slides."""
    motion = certified(simulate(pads(), (0.0, 2.0)))
    assert motion.events["time"].to_numpy() == pytest.approx([0.9], rel=1e-12)
    assert motion.events["contact"].tolist() == ["front + back"]
    assert motion.events["to"].tolist() == ["slip+"]
    assert motion.n_switches == 1
    assert motion.at(1.5)["mode_front"] == -motion.at(1.5)["mode_back"] == 1
    # Then 0.3 + 0.1 resist: x'' = t - 0.4.
    u = 1.1
    assert motion.final["d_x"] == pytest.approx(0.5 * u + u * u / 2, rel=1e-12)
    held = motion.at([0.3, 0.8])
    assert held["mode_front"].tolist() == held["mode_back"].tolist() == [0, 0]
    assert held["friction_front"] - 2 * held["friction_back"] == pytest.approx(
        [-0.3, -0.8], abs=1e-12
    )
    assert float(simulate_many(pads(), (0.0, 2.0))["final_x"][0]) == pytest.approx(
        motion.final["x"], rel=1e-12
    )


def test_pads_come_to_rest_together_and_hold() -> None:
    motion = certified(simulate(pads(), (-0.8, 0.8), initial={"d_x": 0.3}))
    # x'' = t - 0.4 until x' = 0; then they hold what the smaller forces of sliding could not.
    assert motion.events["time"].to_numpy() == pytest.approx([0.4 - math.sqrt(0.84)], rel=1e-12)
    assert motion.final["d_x"] == 0.0


def test_rest_that_ends_too_early_is_not_certified() -> None:
    """The friction law alone would allow a jump from rest at 0.5 to a sliding force of 0.3 with a
    threshold of 0.8."""
    early = simulate(block("-t*x", "s", parameters=given(s=0.5), kinetic_force="0.3"), (0.0, 2.0))
    assert certified(early).events["time"].tolist() == pytest.approx([0.5])
    held = block("-t*x", "s", parameters=given(s=0.8), kinetic_force="0.3")
    told = Trajectory(simulate(held, (0.0, 0.1)).problem, (0.0, 2.0), early.knots, early.outcome)
    assert not told.certificate.ok
    assert told.certificate["friction law"].value == pytest.approx(0.3 / 0.8, rel=1e-6)


def on_a_table(potential: str, **parts: object) -> System:
    """A mass of 1 on a plane; it rests up to a force of s and slides with 0.3."""
    return System(
        "block on a table",
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential=potential,
        parameters=given(s=0.5),
        contacts={"table": Contact(("d_x", "d_y"), "s", kinetic="0.3")},
        **parts,  # type: ignore[arg-type]
    )


def on_a_line(potential: str) -> System:
    return block(potential, "s", parameters=given(s=0.5), kinetic_force="0.3")


def dragged(potential: str) -> System:
    """Without mass: what resists is 0.3 and a viscous force."""
    return System(
        "dragged",
        coordinates={"x": Viscous()},
        viscous="d_x**2/2",
        potential=potential,
        parameters=given(s=0.5),
        contacts={"ground": Contact("d_x", "s", kinetic="0.3")},
    )


def side_by_side() -> System:
    """Two feet of one block, which begin to slip together."""
    return System(
        "two feet",
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="-2*t*x",
        parameters=given(s=0.5),
        contacts={"front": Contact("d_x", "s", kinetic="0.3"), "back": Contact("d_x", "0.5")},
    )


# A system, where it starts, and the first event, for which a threshold of 0.5 is to blame.
BEGINNINGS = {
    "at the start, on a line": (on_a_line("-0.6*x"), {}, None),
    "at the start, in a plane": (on_a_table("-0.36*x - 0.48*y"), {}, None),
    "at the start, without mass": (dragged("-0.6*x"), {}, None),
    "from rest, on a line": (on_a_line("-t*x"), {}, 0.5),
    "from rest, in a plane": (on_a_table("-0.6*t*x - 0.8*t*y"), {}, 0.5),
    "from rest, without mass": (dragged("-t*x"), {}, 0.5),
    "two together": (side_by_side(), {}, 0.5),
    # From -0.3 with a force of 0.6 and a friction of 0.3.
    "reversal on a line": (on_a_line("-0.6*x"), {"d_x": -0.3}, 1 / 3),
    # In a plane that is one slip, which turns round.
    "reversal in a plane": (on_a_table("-0.36*x - 0.48*y"), {"d_x": -0.18, "d_y": -0.24}, None),
}


@pytest.mark.parametrize("name", BEGINNINGS)
def test_slips_that_begin_too_early_are_not_certified(name: str) -> None:
    """Each slips because its threshold is 0.5; at 0.8 it would stick, though its slip obeys the
    friction law from there on."""
    system, initial, when = BEGINNINGS[name]
    motion = certified(simulate(system, (0.0, 2.0), initial=initial))
    if when is not None:
        assert motion.events["time"].to_numpy()[0] == pytest.approx(when, rel=1e-9)
    assert abs(motion.final["x"]) > 0.1
    held = simulate(system, (0.0, 0.1), initial=initial, parameters={"s": 0.8})
    told = Trajectory(held.problem, (0.0, 2.0), motion.knots, motion.outcome)
    assert not told.certificate.ok
    assert told.certificate["friction law"].value > 0.1


def test_sampled_residuals_bound_the_integral_of_their_modulus() -> None:
    """For polynomials of the degree that the nodes determine, steep ones among them; the weights of
    the quadrature alone are no bound."""
    degree = COUNT - 1
    x = np.linspace(0.0, 1.0, 20_001)
    rng = np.random.default_rng(5)
    shapes = [rng.normal(size=degree + 1) for _ in range(50)]
    shapes += [np.eye(degree + 1)[degree], [1.0], np.eye(degree + 1)[2] - 0.3]
    exceeded = 0
    for c in shapes:
        p = np.polynomial.Legendre(c, domain=[0.0, 1.0])
        size = np.mean(np.abs(p(0.5 * (x[1:] + x[:-1]))))
        samples = np.abs(p(GAUSS_NODES))
        assert size <= INTEGRALS @ samples
        exceeded += bool(size > (1.0 + 1e-6) * GAUSS_WEIGHTS @ samples)
    assert exceeded > 0
