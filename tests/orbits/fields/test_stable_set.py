"""States that friction moves until it holds them: one contact after the other."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from stickslip import Contact, Parameter, RateIndependent, System, catalogue
from stickslip.equations.derive import derive
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.stable_set import excess, settle_friction

COUPLED = {
    "by a spring": ("k/2*(r - s)**2", ("f", "f")),
    "by a threshold": ("0", ("f", "f*(1 + 1/(0.1 + r**2))")),
    "not": ("0", ("f", "f")),
}


def one_by_one(potential: str, forces: tuple[str, str], start: list[float]) -> np.ndarray:
    """The same for two sliders, by hand."""
    r, s = start
    spring = 1.0 if "k" in potential else 0.0
    for _ in range(200):
        own, between = 2.0, spring
        force = -own * r - between * (r - s)
        bound = 0.3
        r += (max(force - bound, 0.0) + min(force + bound, 0.0)) / (own + between)
        force = -own * s - between * (s - r)
        bound = 0.3 * (1.0 + 1.0 / (0.1 + r**2) if "r" in forces[1] else 1.0)
        s += (max(force - bound, 0.0) + min(force + bound, 0.0)) / (own + between)
    return np.array([r, s])


@pytest.mark.parametrize("way", COUPLED)
@pytest.mark.parametrize("start", [[3.0, -2.0], [-1.0, 4.0], [0.05, 0.1]])
def test_coordinates_move_to_the_nearest_place(way: str, start: list[float]) -> None:
    """Those that depend on each other in turn, the others together."""
    potential, forces = COUPLED[way]
    system = System(
        "two sliders",
        parameters={"k": Parameter(1.0), "f": Parameter(0.3)},
        coordinates={"r": RateIndependent(), "s": RateIndependent()},
        potential=f"r**2 + s**2 + {potential}",
        contacts={x: Contact(f"d_{x}", force) for x, force in zip("rs", forces, strict=True)},
    )
    equations = derive(system.declaration)
    states = np.array([start, [0.0, 0.0]])
    settle_friction(equations, system.values, states)
    assert states[0] == pytest.approx(one_by_one(potential, forces, start), rel=1e-12)
    assert np.array_equal(states[1], [0.0, 0.0])
    assert not np.any(excess(equations, system.values, states))


def test_pieces_are_made_once_by_many_threads() -> None:
    """Each mode has one number, and that of its piece."""
    system = catalogue.iwan_oscillator()
    equations = derive(system.declaration)
    pieces = Pieces(equations)
    count, region = len(equations.contacts), np.ones(len(equations.kinks), np.int8)
    modes = np.random.default_rng(0).integers(-1, 2, (40, count)).astype(np.int8)
    failed: list[str] = []

    def request(order: np.ndarray) -> None:
        for mode in modes[order]:
            piece = pieces(mode, region)
            if piece.field.mode != tuple(mode.tolist()):
                failed.append(f"{piece.field.mode} instead of {mode}")
            if len(pieces.listed.steady) > len(pieces.made):
                failed.append("more are listed than there are")

    orders = [np.random.default_rng(i).permutation(len(modes)) for i in range(6)]
    threads = [threading.Thread(target=request, args=(order,)) for order in orders]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failed
    assert len({id(piece) for piece in pieces.made}) == len(np.unique(modes, axis=0))
