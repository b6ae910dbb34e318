"""The smooth vector field of one mode and region, as expressions.

Within a fixed mode of every contact and a fixed region of every kink the linear problems of
:mod:`stickslip.equations.derive` are solved symbolically: the rates are then plain expressions in
t, the state and the parameters, and their Jacobian, higher derivatives, guards and derivatives with
respect to parameters are exact.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from stickslip.kept import cached_property
from stickslip.model.entries.keys import JOINED, NORMAL, normal_force
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

Mode = tuple[int, ...]
Region = tuple[int, ...]

MODE_NAMES = {-1: "slip-", 0: "stick", 1: "slip+"}


@dataclass(frozen=True)
class ContactField:
    """One contact in a mode: relative velocity u, friction force λ, thresholds s⁺ (u > 0) and s⁻ (u
    < 0); for a normal direction s⁺ is the adhesion.

    Attributes
    ----------
    gap : Expr or None
        Of the normal direction of a contact that can open: u is its rate, λ the normal force.
    loose : bool
        Whether it is the friction of a contact that is open.
    plane : int
        1 and 2 for the components of a contact in a plane.
    room : Expr
        Of the first of these: s² − |A⁻¹λ|² in stick, |Au| in slip.
    side_of : str
        Of a side of a constraint, the name of that.
    parts : tuple of ContactField
        Of several contacts that are one, each along its own direction.
    prescribed : bool
        Whether both of its sides move as given: then u has to vanish in stick.
    """

    name: str
    kind: str
    u: Expr
    force: Expr
    plus: Expr
    minus: Expr
    gap: Expr | None = None
    loose: bool = False
    plane: int = 0
    room: Expr = ex.ZERO
    side_of: str = ""
    parts: tuple[ContactField, ...] = ()
    prescribed: bool = False


@dataclass(frozen=True)
class Guard:
    """A function that must be nonnegative in a mode.

    Attributes
    ----------
    switch : int
        The engine's number of the switch (``Knots.cause``): kinks first, then contacts.
    to : int
        Region or mode of that switch on the other side.
    """

    value: Expr
    switch: int
    to: int


@dataclass(frozen=True)
class Field:
    """The vector field y' = f(t, y, p) of one mode and region.

    Attributes
    ----------
    state, parameters : tuple of str
        Names of y and p, in their order.
    mode, region : tuple of int
        Mode of each contact (0 stick, ±1 slip, ±2 carried by others at its threshold; of one that
        can open 0 closed, 1 open) and region of each kink (1: guard ≥ 0, 0: guard < 0).
    rates : list of Expr
        f, in the order of the state.
    contacts : list of ContactField
        In the engine's order.
    kinks : list of Expr
        Guards of the functions with kinks.
    constraints : list of Expr
        What vanishes in this mode: u of sticking inertial contacts, u and the gap of closed ones,
        λ + σs of sliding rate-independent ones. They are invariant under the flow.
    leaps : list of Expr
        Changes of the state in declared jumps.
    planes : list of tuple of int
        Contacts that are the components of one in a plane.
    shared : frozenset of int
        Contacts that stick and share their forces with others: these are one choice, the least, and
        there may be others that hold when these do not.
    """

    state: tuple[str, ...]
    parameters: tuple[str, ...]
    mode: Mode
    region: Region
    rates: list[Expr]
    contacts: list[ContactField]
    kinks: list[Expr]
    constraints: list[Expr]
    leaps: list[Expr]
    energy: Expr
    planes: list[tuple[int, ...]]
    shared: frozenset[int]

    @property
    def names(self) -> tuple[str, ...]:
        """All names in the expressions: t, the state, the parameters."""
        return ("t", *self.state, *self.parameters)

    @cached_property
    def jacobian(self) -> list[list[Expr]]:
        """∂f/∂y."""
        return [self.gradient(f) for f in self.rates]

    def gradient(self, e: Expr) -> list[Expr]:
        """∂e/∂y."""
        return [ex.derivative(e, y) for y in self.state]

    def slopes(self, parameter: str) -> list[Expr]:
        """∂f/∂p for one parameter (or ∂f/∂t for ``"t"``)."""
        return [ex.derivative(f, parameter) for f in self.rates]

    def along(self, e: Expr) -> Expr:
        """Rate of change of an expression along the motion."""
        return ex.along(e, {"t": ex.ONE, **dict(zip(self.state, self.rates, strict=True))})

    @cached_property
    def guards(self) -> list[Guard]:
        """Functions that must be nonnegative: signed kinks, λ + s⁺ and s⁻ − λ in stick, σu in slip,
        the normal force of closed and the gap of open contacts; in a plane s² − |A⁻¹λ|² in stick,
        |Au| in slip."""
        found = [
            Guard(g if r == 1 else -g, j, 1 - r)
            for j, (g, r) in enumerate(zip(self.kinks, self.region, strict=True))
        ]
        for switch, (c, m) in enumerate(
            zip(self.contacts, self.mode, strict=True), start=len(self.kinks)
        ):
            if c.plane == 1:
                found.append(Guard(c.room, switch, 1 if m == 0 else 0))
            elif c.plane == 2:
                continue
            elif c.gap is not None:
                held = c.force + c.plus
                found.append(Guard(held, switch, 1) if m == 0 else Guard(c.gap, switch, 0))
            elif m == 0 and c.prescribed:
                found += [Guard(-c.u, switch, 1), Guard(c.u, switch, -1)]
            elif m == 0:
                found += [Guard(c.force + c.plus, switch, 1), Guard(c.minus - c.force, switch, -1)]
            elif not c.loose:
                found.append(Guard(c.u if m > 0 else -c.u, switch, 0))
        return found


def switched(field: Field, switch: int, setting: int) -> tuple[Mode, Region]:
    """Mode and region that differ by one switch; components of a contact in a plane switch
    together."""
    mode, region = list(field.mode), list(field.region)
    if switch < len(region):
        region[switch] = setting
    else:
        contact = switch - len(region)
        pair = next((pair for pair in field.planes if contact in pair), (contact,))
        for i in pair:
            mode[i] = setting
    return tuple(mode), tuple(region)


def mode_name(mode: int, in_plane: bool = False) -> str:
    """Name of the mode of a contact; in a plane slip has no sign."""
    return "slip" if in_plane and mode != 0 else MODE_NAMES[mode]


def named_modes(
    contacts: Sequence[str], mode: Sequence[int], turned: Collection[str] = ()
) -> dict[str, str]:
    """Modes of contacts, by name; a contact that can open has one entry: open, or the mode of its
    friction.

    Parameters
    ----------
    contacts : sequence of str
        Names in the engine's order; both components of a contact in a plane have its name, sides
        of constraints none, and contacts that are one theirs, joined.
    turned : collection of str
        Which of these slip back where the first slips forward.
    """
    found = {
        name: mode_name(-m if name in turned else m, contacts.count(label) > 1)
        for label, m in zip(contacts, mode, strict=True)
        if label
        for name in label.split(JOINED)
    }
    friction = {normal_force(name): name for name in found}
    for name, m in zip(contacts, mode, strict=True):
        if name in friction or name.startswith(NORMAL):
            del found[name]
            rubs = friction.get(name, name.removeprefix(NORMAL))
            found[rubs] = "open" if m != 0 else found.get(rubs, "closed")
    return found


def in_region(expression: Expr, regions: Mapping[Expr, int], *, undefined: bool = False) -> Expr:
    """The expression with every function with a kink replaced by its branch in a region (1: guard ≥
    0); `undefined` as of :func:`~stickslip.symbolic.expressions.rewrite`."""

    def taken(e: Expr) -> Expr | None:
        if e.op != "select":
            return None
        above, *branches = ex.branches_of(e, regions)
        return branches[0 if above == 1 else 1]

    return ex.rewrite(expression, taken, again=True, undefined=undefined)
