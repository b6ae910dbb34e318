"""Contacts that are refused, and motions that end early at one: each by a reason that stands in the
documentation, with its remedy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from adversarial.kinds import points
from adversarial.kinds.dissipations import draw
from stickslip import (
    Contact,
    DeclarationError,
    Inertial,
    Outcome,
    RateIndependent,
    System,
    Trajectory,
    Unilateral,
    Viscous,
    simulate,
)
from stickslip.model.system import AnyContact, Coordinate

PAGE = Path(__file__).parents[2] / "docs" / "is-this-for-me.md"


def body(
    coordinates: Mapping[str, Coordinate], contacts: Mapping[str, AnyContact], **given: Any
) -> System:
    return System("refused", coordinates=coordinates, contacts=contacts, **given)


def masses(*names: str) -> dict[str, Coordinate]:
    return {x: Inertial() for x in names}


def on_legs(count: int) -> System:
    """A plate on legs at the corners of a square, whose friction tips it."""
    corners = ((1, 1), (1, -1), (-1, -1), (-1, 1))[:count]
    return body(
        masses("x", "y", "z", "a", "b"),
        {
            f"leg {i}": Unilateral(f"z + {u}*a + {v}*b", ("d_x - 0.2*d_a", "d_y - 0.2*d_b"), mu=0.3)
            for i, (u, v) in enumerate(corners)
        },
        kinetic="(d_x**2 + d_y**2 + d_z**2 + d_a**2 + d_b**2)/2",
        potential="9.81*z",
    )


def rolled() -> System:
    """Scales on a body in a plane, with another contact."""
    scales = Contact(("d_x", "d_y"), 1.0, dissipation="sqrt(v1**2 + 2*v2**2)")
    other = Contact(("d_x + d_p", "d_y"), 1.0)
    return body(
        masses("x", "y", "p"),
        {"scales": scales, "other": other},
        kinetic="(d_x**2 + d_y**2 + d_p**2)/2",
    )


def turning() -> System:
    """Scales whose directions turn with the body, held by two more contacts along lines."""
    return body(
        masses("x", "y", "p"),
        {
            "scales": Contact(
                ("cos(p)*d_x + sin(p)*d_y", "cos(p)*d_y - sin(p)*d_x"),
                1.0,
                dissipation="sqrt(v1**2 + 2*v2**2)",
            ),
            "one": Contact("d_x + sin(p)*d_p", 1.0),
            "two": Contact("d_y + cos(p)*d_p", 1.0),
        },
        kinetic="(d_x**2 + d_y**2 + d_p**2)/2",
    )


FREE = "d_x**2/2"
SLIDER = "(d_x**2 + d_y**2)/2"
REFUSED: dict[str, Callable[[], System]] = {
    "already has the contact": lambda: body(
        {"x": RateIndependent()},
        {"one": Contact("d_x", 1.0), "two": Contact("d_x", 2.0)},
        potential="x**2/2",
    ),
    "a contact of rate-independent coordinates must act on exactly one of them": lambda: body(
        {"x": RateIndependent(), "y": RateIndependent()},
        {"one": Contact("d_x - d_y", 1.0), "two": Contact("d_y", 1.0)},
        potential="(x**2 + y**2)/2",
    ),
    "a kinetic force below the threshold needs inertia or viscosity": lambda: body(
        {"x": RateIndependent()}, {"one": Contact("d_x", 1.0, kinetic=0.5)}, potential="x**2/2"
    ),
    "for viscous coordinates the kinetic force must not depend on the speed": lambda: body(
        {"x": Viscous()},
        {"one": Contact("d_x", 1.0, kinetic="0.5 + 0.5*exp(-speed)")},
        viscous="d_x**2/2",
    ),
    "it combines": lambda: body(
        {"x": Inertial(), "y": Viscous()},
        {"one": Contact("d_x - d_y", 1.0)},
        kinetic=FREE,
        viscous="d_y**2/2",
    ),
    "has a drag, so a contact cannot act on its rate": lambda: body(
        {"x": Viscous(drag="d_x + d_x**3")}, {"one": Contact("d_x", 1.0)}
    ),
    "its coefficients depend on q, but its coordinates are viscous": lambda: body(
        {"x": Viscous(), "q": Inertial()},
        {"one": Contact("(1 + q**2)*d_x", 1.0)},
        kinetic="d_q**2/2",
        viscous="d_x**2/2",
    ),
    "a contact with a gap needs inertial coordinates": lambda: body(
        {"x": Viscous(), "y": Inertial()},
        {"floor": Unilateral("y", "d_x", mu=0.3)},
        kinetic="d_y**2/2",
        viscous="d_x**2/2",
    ),
    "for an evolution without mass use a SupportFormula": lambda: body(
        {"x": Viscous(), "y": Viscous()},
        {"scales": Contact(("d_x", "d_y"), 1.0, dissipation="sqrt(v1**2 + 2*v2**2)")},
        viscous="(d_x**2 + d_y**2)/2",
    ),
    "which a contact with a dissipation does not support": lambda: body(
        masses("x", "y", "z"),
        {
            "floor": Unilateral("z"),
            "scales": Contact(
                ("d_x", "d_y"), "0.3*normal_floor", dissipation="sqrt(v1**2 + 2*v2**2)"
            ),
        },
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2",
        potential="z",
    ),
    "acts in a plane on the same body": rolled,
    "state-dependent contact directions act on": turning,
    "the normal forces of the body are statically indeterminate": lambda: on_legs(4),
    "in a plane it must be proportional to": lambda: body(
        masses("x", "y", "z"),
        {"floor": Unilateral("z"), "table": Contact(("d_x", "d_y"), "1 + 0.3*normal_floor")},
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2",
        potential="z",
    ),
    "it is not linear in": lambda: body(
        masses("x", "z"),
        {"floor": Unilateral("z"), "table": Contact("d_x", "0.3*normal_floor**2")},
        kinetic="(d_x**2 + d_z**2)/2",
        potential="z",
    ),
    "a contact in a plane without mass slips in the direction of the force": lambda: body(
        {"x": Viscous(), "y": Viscous()},
        {"table": Contact(("d_x", "d_y"), 1.0), "rail": Contact("d_x", 1.0)},
        viscous="(d_x**2 + d_y**2)/2",
    ),
    "the viscosities of its components differ": lambda: body(
        {"x": Viscous(), "y": Viscous()},
        {"table": Contact(("d_x", "d_y"), 1.0)},
        viscous="d_x**2/2 + d_y**2",
    ),
    "each of them vanishes where the other does not": lambda: body(
        masses("x"),
        {"one": Contact("(x - 1)*d_x", 1.0), "two": Contact("(x - 2)*d_x", 1.0)},
        kinetic=FREE,
    ),
    "but another tangential restitution": lambda: body(
        masses("x", "y"),
        {
            "one": Unilateral("y", "d_x", mu=0.3, tangential_restitution=0.5),
            "two": Unilateral("y + 1", "d_x", mu=0.3),
        },
        kinetic=SLIDER,
        potential="y",
    ),
}


@pytest.mark.parametrize("reason", REFUSED)
def test_a_refusal_gives_its_reason(reason: str) -> None:
    with pytest.raises(DeclarationError) as raised:
        simulate(REFUSED[reason](), (0.0, 1.0))
    assert reason.lower() in str(raised.value).lower()


def test_the_page_names_each_refusal() -> None:
    text = " ".join(PAGE.read_text(encoding="utf-8").split())
    assert [reason for reason in REFUSED if f"“{reason}" not in text] == []


def test_three_legs_are_not_refused() -> None:
    assert simulate(on_legs(3), (0.0, 0.1)).outcome.ok


def puck(*forces: str) -> System:
    """A puck that holds a force of 1 in each direction."""
    return body(
        {x: Inertial(force=force) for x, force in zip("xy", forces, strict=True)},
        {"table": Contact(("d_x", "d_y"), 1.0)},
        kinetic=SLIDER,
    )


def rolling() -> System:
    """A disc that slides and turns as given; at the start a point of its rim is at rest."""
    speeds = ("cos(3*t)", "sin(3*t)*cos(3*t)", "cos(3*t)**2")
    disc = Contact(("0", "0", "0"), dissipation="disc(v1, v2, v3)", surface_speed=speeds)
    return body(masses("x"), {"disc": disc}, kinetic=FREE)


ENDS: dict[Outcome, tuple[Callable[[], Trajectory | str], Callable[[], Trajectory] | None]] = {
    Outcome.NO_MODE: (
        lambda: simulate(puck("1", "t**3"), (0.0, 0.3)),
        lambda: simulate(puck("1 + 1e-9", "t**3"), (0.0, 0.3)),
    ),
    Outcome.UNDEFINED: (lambda: points.simulated(draw("units", 0)), None),
    Outcome.TIME_UP: (lambda: simulate(rolling(), (0.0, 0.3), time_limit=0.5), None),
}
"""Motions that end so, and what the remedy makes of them, where it is one number."""


@pytest.mark.parametrize("outcome", ENDS)
def test_a_motion_ends_by_a_named_outcome_and_obeys_the_law_up_to_there(outcome: Outcome) -> None:
    early, remedied = ENDS[outcome]
    motion = early()
    assert isinstance(motion, Trajectory)
    assert motion.outcome is outcome
    assert "the law is satisfied up to there" in motion.certificate.verdict
    assert remedied is None or remedied().certificate.ok


def test_the_page_names_how_motions_end() -> None:
    table = PAGE.read_text(encoding="utf-8").partition("motions that end early")[2]
    assert [outcome for outcome in ENDS if f"*{outcome.label}*" not in table] == []
