"""Positions of the quantities of a system in the arrays of compiled functions, independent of its
parameters."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.layout import INVERSES, Layout
from stickslip.equations.codegen.program import pack
from stickslip.equations.coupling import somewhere
from stickslip.kept import made_once
from stickslip.model.entries.polynomials import is_bounded
from stickslip.motion.steps.arrays import (
    ADMISSIBLE,
    ADMISSIBLE_SIZE,
    FORMULA,
    LEAD,
    MASSIVE,
    PART,
    RUBBING,
    SLIPS,
    STATIC,
    Rows,
)
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.equations.derive import MotionEquations
    from stickslip.equations.native.systems import CompiledSystem


def layout_rows(compiled: CompiledSystem) -> Rows:
    """The rows of a system, without those that may become negative for some parameters."""
    return made_once(compiled, "rows", lambda: _rows(compiled.equations, compiled.layout))


def _rows(equations: MotionEquations, layout: Layout) -> Rows:
    sizes = np.array(
        [layout.sizes[k] for k in ("n", "nq", "nz", "nr", "na", "mq", "mz", "mr", "kinks")]
    )
    tables = (layout.u, layout.force, layout.plus, layout.minus, layout.kinks)
    u, force, plus, minus, kinks = (np.array(table, dtype=np.int64) for table in tables)
    noise = _places_of_sizes(layout)
    pulled = {i for plane in equations.planes if plane.pull for i in plane.parts}
    dropping = ({i for i, *_ in layout.kinetic} - pulled) | _carried(equations, layout)
    state = frozenset(layout.state)
    watched = np.array(list(noise), dtype=np.int64)
    bounded = [is_bounded(guard) for guard in equations.kinks]
    states = _numbers_of_states(equations, layout)
    return Rows(
        sizes,
        u,
        force,
        plus,
        minus,
        kinks,
        watched,
        np.array(list(noise.values()), dtype=np.int64),
        np.zeros((0, 3), np.int64),
        np.array(
            [not guard.symbols & state for guard in equations.kinks],
            dtype=np.int64,
        ),
        np.array(bounded if any(bounded) else [], dtype=np.int64),
        _vanishing(equations, layout),
        np.array([c in dropping for c in range(len(u))], dtype=np.int64),
        pack(layout),
        *_coupling(layout),
        *_openings(layout),
        *_links(equations, layout),
        _held_again(equations, layout, dropping),
        *_jumps(layout),
        *_planes(equations, layout),
        np.array(layout.pieces, dtype=np.int64).reshape(-1, 3),
        0,
        *_together(equations, layout),
        _bodies(equations),
        *_contacts(equations, layout),
        *_sets(equations, layout),
        *_beside_planes(equations, layout, list(noise)),
        states,
        guards_of(states, len(layout.kinks), 0),
    )


def guards_of(states: Array, kinks: int, required: int) -> Array:
    """The numbers of the guards that there are: two of each contact along a line, one of others."""
    first = kinks + 2 * np.arange(len(states))
    own = [*first[states > 1], *(first[states == 3] + 1)]
    last = kinks + 2 * len(states)
    return np.array([*range(kinks), *sorted(own), *range(last, last + required)], dtype=np.int64)


def _held_again(equations: MotionEquations, layout: Layout, dropping: set[int]) -> Array:
    """Whether contacts may be held by more than their forces, or from another side."""
    found = np.zeros(len(layout.u), np.int64)
    found[[*dropping, *_adhesive(layout)]] = 1
    found[[i for plane in equations.planes for i in plane.parts]] = 2
    return found


def _adhesive(layout: Layout) -> list[int]:
    """Contacts that can open, and hold a pull: they have a threshold."""
    return [c for c in sorted(layout.gaps) if layout.plus[c] != layout.minus[c]]


def _carried(equations: MotionEquations, layout: Layout) -> set[int]:
    """Contacts along lines that others may hold, since their directions depend on each other: with
    the forces of d_x and d_y, one along d_x − d_y rests, at its threshold or not.

    Directions that change on the way are looked at in one point, at which no coefficient vanishes
    that does not everywhere.
    """
    found = set[int]()
    for part in (part for parts in layout.coupled.values() for part in parts):
        directions = {c: equations.contacts[c].direction for c in part.contacts}
        # Contacts that move coordinates alone do not depend on others.
        while True:
            moved = Counter(x for direction in directions.values() for x in direction)
            left = {c: j for c, j in directions.items() if all(moved[x] > 1 for x in j)}
            if len(left) == len(directions):
                break
            directions = left
        if len(directions) > 1:
            names = sorted({x for direction in directions.values() for x in direction})
            J = np.array(
                somewhere([[j.get(x, ex.ZERO) for x in names] for j in directions.values()])
            )
            J = J / np.linalg.norm(J, axis=1)[:, None]
            rank = np.linalg.matrix_rank(J)
            others = (np.delete(J, i, axis=0) for i in range(len(J)))
            found |= {
                c
                for c, rest in zip(directions, others, strict=True)
                if np.linalg.matrix_rank(rest) == rank
            }
    lines = {i for i, c in enumerate(equations.contacts) if not (c.opens or c.plane)}
    return (found & lines) - set(layout.together)


def _together(equations: MotionEquations, layout: Layout) -> tuple[Array, Array]:
    """Groups of contacts that may share forces, −1 for others; and these contacts."""
    found = np.full(len(layout.u), -1, np.int64)
    for c, number in layout.together.items():
        found[c] = number
    sharing = [c for c in equations.directions if c in layout.together]
    return found, np.array(sharing, dtype=np.int64)


def _bodies(equations: MotionEquations) -> Array:
    """First index and number of the modes of each structure."""
    d = equations.declaration
    table = [(d.inertial.index(modes[0]), len(modes)) for modes in d.bodies]
    return np.array(table, dtype=np.int64).reshape(-1, 2)


def _contacts(
    equations: MotionEquations, layout: Layout
) -> tuple[Array, int, Array, Array, Array, Array, Array, Array, int, Array]:
    """Indices of contacts: their first directions, the number with mass, the first direction of the
    contact of each direction, all directions of each contact with their offsets, contacts that
    open, those of them that adhere, and those that do not open, with the number of these with mass,
    and those along a line."""
    blocks = equations.directions
    rubbing = [c for c in blocks if c not in layout.gaps]
    lead = np.zeros(len(layout.u), np.int64)
    for c, parts in blocks.items():
        lead[[*parts]] = c
    return (
        np.array([*blocks], dtype=np.int64),
        sum(c < layout.sizes["mq"] for c in blocks),
        lead,
        np.array([d for parts in blocks.values() for d in parts], dtype=np.int64),
        np.cumsum([0, *(len(blocks.get(c, ())) for c in range(len(lead)))], dtype=np.int64),
        np.array(sorted(layout.gaps), dtype=np.int64),
        np.array(_adhesive(layout), dtype=np.int64),
        np.array(rubbing, dtype=np.int64),
        sum(c < layout.sizes["mq"] for c in rubbing),
        np.array([c for c in rubbing if len(blocks[c]) == 1], dtype=np.int64),
    )


def _sets(equations: MotionEquations, layout: Layout) -> tuple[Array, Array]:
    """The rows of the radii of sets of forces, by direction, and the numbers of their formulas."""
    radii = np.array([layout.plus, layout.minus], dtype=np.int64).reshape(2, -1).T.copy()
    formula = np.full(len(layout.u), -1, np.int64)
    for plane in layout.planes:
        own = [*equations.directions[plane[LEAD]]]
        radii[own] = plane[STATIC]
        formula[own] = plane[FORMULA]
    return radii, formula


def _beside_planes(
    equations: MotionEquations, layout: Layout, watched: list[int]
) -> tuple[Array, Array]:
    """Directions that a linear problem couples to friction in a plane; and the positions of the
    sizes of second derivatives of the coordinates and gaps among the rows that bound steps."""
    turning = {i for plane in equations.planes for i in plane.parts}
    parts = [
        part
        for coupled in layout.coupled.values()
        for part in coupled
        if turning.intersection(part.contacts)
    ]
    beside = np.zeros(len(layout.u), np.int64)
    beside[[c for part in parts for c in part.contacts]] = 1
    made = {
        q: int(layout.rate_sizes[layout.sizes["nq"] + q])
        for part in layout.coupled["Rq"]
        if part in parts
        for q in part.coordinates
    }
    made |= {row: len(layout.u) + c for c, row in layout.gaps.items() if beside[c]}
    return beside, np.array([made.get(row, -1) for row in watched], dtype=np.int64)


def _numbers_of_states(equations: MotionEquations, layout: Layout) -> Array:
    """Numbers of states of contacts, by their first directions."""
    blocks = equations.directions
    return np.array(
        [_states(blocks.get(c, ()), c in layout.gaps) for c in range(len(layout.u))], np.int64
    )


def _states(parts: tuple[int, ...], opens: bool) -> int:
    """Number of states of a contact with some directions; a slip has a sign along a line only."""
    return (2 if opens or len(parts) > 1 else 3) if parts else 1


def _planes(equations: MotionEquations, layout: Layout) -> tuple[Array, Array, Array, Array]:
    """Contacts in a plane, the one that each contact is a component of, those that move masses, and
    those that have a formula."""
    table = np.array(layout.planes, dtype=np.int64).reshape(-1, 16)
    plane = np.full(len(layout.u), -1, np.int64)
    for p, (first, *_) in enumerate(layout.planes):
        plane[[*equations.directions[first]]] = p
    return table, plane, np.flatnonzero(table[:, MASSIVE]), np.flatnonzero(table[:, FORMULA] >= 0)


def _coupling(layout: Layout) -> tuple[Array, Array, Array, Array]:
    """Components of the linear problems, their members, the component of each contact, and the
    directions that change with the state or time."""
    parts = list[tuple[int, ...]]()
    members = list[int]()
    homes = np.full((len(layout.u), 2), -1, np.int64)
    for matrix, name in enumerate(INVERSES):
        seat = 0
        for part in layout.coupled[name]:
            n, m = len(part.coordinates), len(part.contacts)
            for j, c in enumerate(part.contacts):
                homes[c] = len(parts), seat + n + j
            parts.append((matrix, seat, n, m, len(members), int(part.moving)))
            members += [*part.coordinates, *part.contacts]
            seat += n + m
    homes[homes[:, PART] < 0, PART] = len(parts)
    table = np.array(parts, dtype=np.int64).reshape(-1, 6)
    turning = np.full((len(layout.u), layout.shape("J")[1]), -1, np.int64)
    for place, row in layout.turning.items():
        turning[place] = row
    return table, np.array(members, dtype=np.int64), homes, turning


def _openings(layout: Layout) -> tuple[Array, Array]:
    """Rows of the gaps and of the restitution of contacts, −1: of none."""
    found = tuple(np.full(len(layout.u), -1, np.int64) for _ in range(2))
    for array, table in zip(found, (layout.gaps, layout.restitution), strict=True):
        for c, value in table.items():
            array[c] = value
    return found  # type: ignore[return-value]


def _links(equations: MotionEquations, layout: Layout) -> tuple[Array, Array, Array, Array]:
    """Pairs of a friction contact and the normal force that it depends on, the first pair of each
    contact, the rows of the coefficients, and the contacts that have other forces, too."""
    table = np.array([link[:2] for link in layout.links], dtype=np.int64).reshape(-1, 2)
    friction = np.array([link[2] for link in layout.links], dtype=np.int64).reshape(-1, 4)
    first = np.searchsorted(table[:, RUBBING], np.arange(len(layout.u) + 1))
    pressed = set(table[:, RUBBING])
    alone = np.array(
        [c not in pressed or equations.has_own_friction(c) for c in range(len(layout.u))],
        dtype=np.int64,
    )
    return table, first.astype(np.int64), friction, alone


def _jumps(layout: Layout) -> tuple[Array, Array]:
    """Jumps of the state, and which parts of it have new values."""
    table = list[tuple[int, ...]]()
    landings = list[int]()
    for kink, direction, places in layout.jumps:
        table.append((kink, direction, len(landings), len(places)))
        landings += places
    return np.array(table, dtype=np.int64).reshape(-1, 4), np.array(landings, dtype=np.int64)


def _places_of_sizes(layout: Layout) -> dict[int, int]:
    """Rows that bound the step, with the places of the sizes of their terms: the state, then
    guards."""
    n = layout.sizes["n"]
    contacts = len(layout.u)
    kinks = len(layout.kinks)
    noise = dict(enumerate(layout.rate_sizes))
    others = {row: -1 for row in (*layout.plus, *layout.minus)}
    others |= {row: 2 * contacts + c for c, row in enumerate(layout.force)}
    others |= {row: c for c, row in enumerate(layout.u)}
    others |= {row: 3 * contacts + j for j, row in enumerate(layout.kinks[:kinks])}
    others |= {row: 3 * contacts + kinks + c for c, row in layout.gaps.items()}
    for plane in layout.planes:
        others |= {plane[SLIPS]: plane[LEAD], plane[ADMISSIBLE]: plane[ADMISSIBLE_SIZE]}
    return noise | {row: others[row] for row in sorted(others) if row >= n}


def _vanishing(equations: MotionEquations, layout: Layout) -> Array:
    """The part of the state that is zero where a kink is, −1 where it is more than that."""
    state = {name: i for i, name in enumerate(layout.state)}
    felt = state.keys() | {"t"}
    found = []
    for guard in equations.kinks:
        (name, *others) = sorted(guard.symbols & felt) or [""]
        alone = (
            not others
            and name in state
            and ex.substitute(guard, {name: ex.ZERO}, undefined=True) is ex.ZERO
        )
        found.append(
            state[name] if alone and not ex.derivative(guard, name).symbols & {name} else -1
        )
    return np.array(found, dtype=np.int64)
