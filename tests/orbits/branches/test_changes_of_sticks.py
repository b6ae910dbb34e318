"""Changes of sticks along branches: each has a defining equation, chosen by the sequences on both
sides, and is certified; closed forms of Den Hartog's oscillator are the reference."""

from __future__ import annotations

import math

import pytest

from stickslip import Branch, catalogue, continue_cycle, find_cycle
from stickslip.orbits.branches.onset import Onset, Way, onsets_between
from stickslip.orbits.return_map.mode_sequence import (
    Sequence,
    _exchanged,
    slips_back,
    sticks_once_more,
)

OSCILLATOR = catalogue.forced_oscillator()


def over(parameter: str, span: tuple[float, float], **start: float) -> Branch:
    """A branch of the oscillator from some parameters, certified."""
    branch = continue_cycle(find_cycle(OSCILLATOR, parameters=start), parameter, span)
    assert branch.certificate.ok, branch.certificate.describe()
    return branch


def residual_of(branch: Branch, kind: str) -> tuple[float, str]:
    """The value of the only point of a kind, and the name of its first residual."""
    (point,) = branch.of_kind(kind)
    return point.value, point.residuals[0].name


def slips_back_at(omega: float) -> float:
    """F_c/P at which the mass begins to slip back before it sticks. It then slips for a period of
    the free oscillator, and its force is at a threshold at both ends."""
    return math.sin(math.pi * omega) * omega**2 / (1.0 - omega**2)


@pytest.mark.parametrize("start", [0.47, 0.4806, 0.52])
def test_a_slip_back_over_the_frequency(start: float) -> None:
    """From all sides, although a multiplier is 1 at this point: it touches 1 there. Beyond it, the
    speed touches 0 where the stick ends."""
    branch = over("omega", (0.45, 0.6), omega=start, F_c=0.3)
    assert branch.points["omega"].values[[0, -1]].tolist() == [0.45, 0.6]
    value, name = residual_of(branch, "slip back")
    assert slips_back_at(value) == pytest.approx(0.3, rel=1e-10)
    assert name == "force at the beginning of the stick"
    value, name = residual_of(branch, "stick onset")
    assert value == pytest.approx(0.48147824701527, rel=1e-10)
    assert name == "smallest slip speed"
    assert len(branch.special) == 2


@pytest.mark.parametrize("omega", [0.4, 0.43])
def test_a_slip_back_over_the_friction(omega: float) -> None:
    """Down to cycles that do not stick, without a loss, and up to the friction that equals the
    force."""
    branch = over("F_c", (0.1, 1.2), omega=omega, F_c=0.6)
    value, _ = residual_of(branch, "slip back")
    assert value == pytest.approx(slips_back_at(omega), rel=1e-10)
    assert branch.of_kind("stick onset")
    assert not branch.of_kind("loss of the cycle")


@pytest.mark.parametrize(("omega", "force"), [(0.4, 1.0), (0.8, 1.0), (0.4, 1.7)])
def test_cycles_that_shrink_to_rest(omega: float, force: float) -> None:
    """The mass stays at rest in its middle position where friction equals the force."""
    branch = over("F_c", (0.5, 2.0), omega=omega, F_c=0.6 * force, P=force)
    value, name = residual_of(branch, "boundary equilibrium")
    assert value == pytest.approx(force, rel=1e-12)
    assert name == "force at its threshold"
    assert branch.of_kind("boundary equilibrium")[0].state["x"] == pytest.approx(0.0, abs=1e-12)


def phases(*modes: int) -> Sequence:
    """The phases of a cycle with one contact."""
    return tuple(((mode,), ()) for mode in modes)


def test_events_that_exchange_their_order() -> None:
    """Two contacts: one begins to stick before the other, or after it."""
    first = (((1, 1), ()), ((0, 1), ()), ((0, 0), ()), ((1, 0), ()))
    second = (((1, 1), ()), ((1, 0), ()), ((0, 0), ()), ((1, 0), ()))
    assert not onsets_between(first, second)
    assert _exchanged(first, second)
    assert _exchanged(first[1:] + first[:1], second)
    assert not _exchanged(first, first)
    assert not _exchanged(first, (first[0], second[1], first[3], first[2]))


def test_sequences_tell_the_defining_equation() -> None:
    nonstop = phases(-1, 1)
    stops = phases(-1, 0, 1, 0)
    cases = {
        # touches 0, reverses, and sticks at all
        (phases(1), phases(0, 1)): Onset(0, Way.TOUCHES),
        (nonstop, phases(-1, 1, 0, 1)): Onset(0, Way.TOUCHES),
        (nonstop, stops): Onset(0, Way.REVERSES),
        # sticks as before, or at one more reversal
        (stops, phases(-1, 1, 0, 1, -1, 0)): Onset(0, Way.SLIPS_BACK, True),
        (phases(-1, 0, 1), phases(-1, 0, 1, -1, 0, 1)): None,
        (phases(-1, 0, 1), stops): Onset(0, Way.REVERSES, True),
    }
    for sides, expected in cases.items():
        for before, after in (sides, sides[::-1]):
            assert onsets_between(before, after) == ([] if expected is None else [expected])
    assert slips_back(stops, phases(-1, 1, 0, 1, -1, 0)) == [0]
    assert sticks_once_more(phases(-1, 0, 1), stops) == [0]
