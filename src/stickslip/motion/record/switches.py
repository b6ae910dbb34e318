"""The switches of a motion: the modes of its contacts at every knot, and their changes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.field import MODE_NAMES
from stickslip.kept import cached_property
from stickslip.model.entries.keys import JOINED, normal_force
from stickslip.model.quantities import contact_key
from stickslip.model.system import System
from stickslip.motion.record.knots import IS_CLOSED, IS_OPEN, Knots
from stickslip.symbolic.pieces import boundary, is_smooth_knot

if TYPE_CHECKING:
    import pandas

    from stickslip.equations.derive import MotionEquations
    from stickslip.model.declaration import DryContact

SLIP_WORD = "slip"  # in a plane, where it has no sign


class Switches:
    """Modes of the contacts of a motion from knot to knot, in readable form.

    The engine has a contact for each direction, one for what slips as one, and numbers for modes;
    here they have the names of the declaration.

    Parameters
    ----------
    system : System
        That was declared.
    equations : MotionEquations
        As they were derived for the engine.
    """

    def __init__(self, system: System, equations: MotionEquations, knots: Knots) -> None:
        self.system = system
        self.equations = equations
        self.knots = knots

    @cached_property
    def contacts(self) -> dict[str, int]:
        """Key of each contact that rubs in the order of declaration, with its number in the engine;
        in a plane of each of its components."""
        equations = self.equations
        numbers = equations.numbers
        names = [n for n in self.system.dry_contacts if not equations.contacts[numbers[n]].opens]
        return {contact_key(name): numbers[name] for name in names}

    @cached_property
    def openings(self) -> dict[str, int]:
        """Key of each contact that can open, with the number of its normal direction."""
        numbers = self.equations.numbers
        return {contact_key(name): numbers[normal_force(name)] for name in self.system.unilateral}

    @cached_property
    def modes(self) -> dict[str, Array]:
        """Mode of each contact after every knot, by its name in variables: 0 in stick, ±1 in slip
        (1 in a plane); for a contact that can open also 2 if open, and 3 if closed and
        frictionless."""
        mode = self.knots.slip
        first = {name: contact_key(parts[0]) for name, parts in self.system.frictional.items()}
        found = {
            contact_key(name): mode[:, self.contacts[key]]
            for name, key in first.items()
            if key in self.contacts
        }
        for key, backward in self.turned.items():
            found[key] = np.where(backward, -found[key], found[key]).astype(np.int8)
        for key, i in self.openings.items():
            closed = found.get(key, np.full(len(mode), IS_CLOSED))
            found[key] = np.where(mode[:, i] == 0, closed, IS_OPEN).astype(np.int8)
        for key in map(contact_key, self.system.constraints):
            found.setdefault(key, np.full(len(mode), IS_CLOSED, np.int8))
        return found

    @cached_property
    def turned(self) -> dict[str, Array]:
        """For merged contacts with opposite directions: whether they slip backward after every
        knot, by the names of variables."""
        equations = self.equations
        if not equations.turning:
            return {}
        regions, place = np.unique(self.knots.region, axis=0, return_inverse=True)
        turned = [equations.turned(row.tolist()) for row in regions]
        return {
            contact_key(name): np.array([name in own for own in turned])[place.ravel()]
            for name in dict.fromkeys(name for own in turned for name in own)
        }

    @cached_property
    def columns(self) -> dict[str, Array]:
        """Modes at the knots of contacts that switch as one, by name, in the order of the engine.

        Of contacts that are one with others that is the mode of all, and of those among them that
        can open whether they are open; but each of contacts that can all open has its own.
        """
        equations = self.equations
        opening = {normal_force(name): name for name in self.system.unilateral}
        planes = {part: name for name, parts in self.system.planes.items() for part in parts}
        found: dict[str, Array] = {}
        switching = [
            one
            for i, (c, own) in enumerate(zip(equations.contacts, equations.members, strict=True))
            for one in ([(i, floor, (floor,)) for floor in own] if c.opens else [(i, c, own)])
        ]
        for i, c, own in switching:
            if c.side_of or self._opens_apart(own):
                continue
            name = opening.get(c.name) or planes.get(c.name, c.name)
            together = next((o for o in equations.members if len(o) > 1 and _has(o, name)), own)
            if len(own) > 1:
                pressing = equations.pressing(i)
                free = np.full(
                    len(self.knots.mode), bool(pressing) and not equations.has_own_friction(i)
                )
                loose = free & np.all(self.knots.mode[:, pressing] != 0, axis=1)
                found[name] = np.where(loose, IS_OPEN, self.knots.slip[:, i]).astype(np.int8)
            elif len(together) > 1 and not self._opens_apart(together):
                closed = self.knots.mode[:, i] == 0
                found[name] = np.where(closed, IS_CLOSED, IS_OPEN).astype(np.int8)
            else:
                found[name] = self.modes[contact_key(name)]
        return found

    def _opens_apart(self, own: tuple[DryContact, ...]) -> bool:
        """Whether several contacts that are one can each open, or are floors that are one."""
        return len(own) > 1 and (own[0].opens or all(c.name in self.system.unilateral for c in own))

    @cached_property
    def published(self) -> Array:
        """Modes at the knots, a column for each of these."""
        columns = [*self.columns.values()]
        # A constraint without friction has no column, though its sides are contacts.
        return np.stack(columns, axis=1) if columns else self.knots.slip[:, :0]

    @cached_property
    def switched(self) -> tuple[Array, dict[tuple[int, int], str]]:
        """Changes of these columns from knot to knot; and the names of contacts that can open and
        switch as one, by knot and column of the first: changes of the others are omitted."""
        mode = self.published
        changes = np.diff(mode, axis=0)
        names = [*self.columns]
        seen = mode.copy()  # along one direction
        for j, name in enumerate(names):
            if (backward := self.turned.get(contact_key(name))) is not None:
                seen[:, j] = np.where(backward & (mode[:, j] <= 1), -mode[:, j], mode[:, j])
        joined: dict[tuple[int, int], str] = {}
        opening = {normal_force(name): name for name in self.system.unilateral}
        for own in self.equations.members:
            if not self._opens_apart(own):
                continue
            columns = [names.index(opening.get(c.name, c.name)) for c in own]
            for knot in np.flatnonzero(np.count_nonzero(changes[:, columns], axis=1) > 1):
                alike: dict[tuple[int, int], list[int]] = {}
                for j in columns:
                    if changes[knot, j]:
                        way = int(seen[knot, j]), int(seen[knot + 1, j])
                        alike.setdefault(way, []).append(j)
                for first, *others in alike.values():
                    changes[knot, others] = 0
                    joined[int(knot), first] = JOINED.join(names[j] for j in (first, *others))
        return changes, joined

    @property
    def crossed(self) -> Array:
        """Changes of the regions of all kinks but those of samples and smooth tables, and those
        that are guards of jumps alone."""
        equations = self.equations
        left_out = {*filter(is_smooth_knot, equations.kinks)} | equations.guards_alone
        counted = [guard not in left_out for guard in equations.kinks]
        return np.diff(self.knots.region, axis=0) * np.array(counted, int)

    @cached_property
    def jumped(self) -> Array:
        """Jumps at the end of each step, shape (steps, jumps)."""
        k = self.knots
        jumps = self.equations.jumps
        found = np.zeros((len(k.clock) - 1, len(jumps)), bool)
        for j, jump in enumerate(jumps):
            rises = k.region[:-1, jump.kink] == 0
            passes = rises if jump.direction > 0 else ~rises if jump.direction < 0 else True
            found[:, j] = (k.cause[1:] == jump.kink) & passes
        return found

    def events(self, state: Sequence[str]) -> pandas.DataFrame:
        """Every change of mode or region, and every jump; see
        :attr:`stickslip.motion.trajectory.Trajectory.events`.

        Parameters
        ----------
        state : sequence of str
            Names of the parts of the state.
        """
        import pandas as pd

        equations = self.equations
        k = self.knots
        mode = self.published
        switched, joined = self.switched
        changes = np.hstack([switched, self.crossed, self.jumped])
        knot, which = np.nonzero(changes)
        names = [*self.columns] + [boundary(g) for g in equations.kinks]
        names += [jump.name for jump in equations.jumps]
        # The names of the modes −1, 0, 1, of contacts that can open, of the regions 0, 1, and of
        # the sides of a jump; the last one is for a slip in a plane.
        words = [MODE_NAMES[mode] for mode in (-1, 0, 1)]
        words = [*words, "open", "closed", "below", "above", "before", "after", SLIP_WORD]
        said = mode + 1
        in_plane = np.array([name in self.system.planes for name in self.columns], bool)
        said[:, in_plane] = np.where(mode[:, in_plane] == 1, len(words) - 1, said[:, in_plane])
        values = np.hstack([said, k.region + 5, np.full((len(mode), len(equations.jumps)), 7)])
        said_of = np.array(names, dtype=object)[which]
        places = zip(knot.tolist(), which.tolist(), strict=True) if joined else ()
        for i, place in enumerate(places):
            said_of[i] = joined.get(place, said_of[i])
        leaps = which >= mode.shape[1] + len(equations.kinks)
        columns = {
            "time": k.time[knot + 1],
            "contact": said_of,
            "from": np.array(words, dtype=object)[values[knot, which]],
            "to": np.array(words, dtype=object)[values[knot + 1, which] + leaps],
        }
        states = zip(state, k.state[knot + 1].T, strict=True)
        return pd.DataFrame(columns | dict(states))


def _has(contacts: tuple[DryContact, ...], name: str) -> bool:
    return any(c.name == name for c in contacts)


def flags_of_modes(system: System, contact: str) -> dict[str, Any]:
    """The numbers of the modes of a contact and their names, as attributes of a variable."""
    words = ["slip-", "stick", "slip+"]
    if contact in system.unilateral or contact in system.constraints:
        words += ["open", "closed"]
    first = -1
    if contact in system.planes:
        words = ["stick", SLIP_WORD, *words[3:]]
        first = 0
    return {
        "flag_values": np.arange(first, first + len(words), dtype=np.int8),
        "flag_meanings": " ".join(words),
    }
