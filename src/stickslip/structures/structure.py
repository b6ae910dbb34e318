"""A structure: its matrices, modes, and reductions."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.kept import cached_property, kept, made_once
from stickslip.numerics.levels import ROUNDING
from stickslip.structures import matrices
from stickslip.structures.checks import (
    check_names,
    check_not_negative,
    check_positive,
    checked_basis,
)
from stickslip.structures.damping import (
    Coefficient,
    ModalDamping,
    ProportionalDamping,
    damping_of_shapes,
)
from stickslip.structures.matrices import Symmetric, is_sparse

if TYPE_CHECKING:
    from stickslip.results import Summary

UnknownKey = int | str
"""An unknown, by its index or its name."""
Method = Literal["craig-bampton", "modal"]
_ALL = 50  # number of unknowns that results show
_SHOWN = 6  # number of frequencies in a summary


@dataclass(frozen=True)
class LeftOut:
    """The modes omitted by a reduction.

    Attributes
    ----------
    method : str
        ``"craig-bampton"`` or ``"modal"``.
    unknowns : int
        How many there were.
    frequency : float
        The first angular frequency left out: of a mode that is fixed at the kept unknowns, or of
        the structure; infinite if none is.
    static_error : float
        By how much the displacement of a kept unknown under a force on it is too small, at most, as
        a part of it; zero where that is exact, NaN where no unknown is kept. Rigid modes are no
        part of it.
    """

    method: str
    unknowns: int
    frequency: float
    static_error: float


@dataclass(frozen=True, eq=False, repr=False)
class Structure:
    """A linear structure, M ü + C u̇ + K u = f, given by its matrices.

    If it is named u in a system, formulas use its degrees of freedom as ``u[3]``, or ``u[tip]`` by
    name, and their rates as ``d_u[tip]``.

    Attributes
    ----------
    mass, stiffness : array or sparse array, shape (n, n)
        Symmetric; the mass positive definite, the stiffness positive semidefinite: if it is
        singular, the structure has rigid modes. Symmetry is checked to 9 digits.
    damping : array or sparse array, ProportionalDamping, ModalDamping or None
        A symmetric positive semidefinite matrix, or a damping rule, whose coefficients may be
        formulas of parameters of the system; no damping by default.
    names : list of str, or mapping of str to int
        Names of all degrees of freedom, or of some by index. Stored as a mapping.
    unit : str
        Unit of displacements.
    basis : array, shape (N, n), optional
        Degrees of freedom as linear combinations of n coordinates, for a reduced structure: the
        columns are shapes, from a reduction by this or another program. Indices and names then
        refer to rows.
    left_out : LeftOut, optional
        The modes omitted by a reduction.

    Raises
    ------
    DeclarationError
        If a matrix is not symmetric, not positive (semi)definite or not finite, shapes do not
        match, there are more damping ratios than modes, or a name is invalid, duplicate or refers
        to no degree of freedom.

    Examples
    --------
    >>> import stickslip as ss
    >>> chain = ss.Structure([[1, 0], [0, 1]], [[2, -1], [-1, 2]], names=["left", "right"])
    >>> [round(float(omega), 12) for omega in chain.frequencies]
    [1.0, 1.732050807569]
    """

    mass: Symmetric
    stiffness: Symmetric
    damping: Symmetric | ProportionalDamping | ModalDamping | None = None
    names: Mapping[str, int] | Sequence[str] | None = None
    unit: str = field(default="", kw_only=True)
    basis: Array | None = field(default=None, kw_only=True)
    left_out: LeftOut | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        put = object.__setattr__
        if not isinstance(self.unit, str):
            raise DeclarationError("unit", "expected a string", 'Write it in quotes, like "m"')
        names = _indices(self.names)
        called = {index: name for name, index in names.items()}

        def said(index: int) -> str:
            return called.get(index, str(index)) if self.basis is None else str(index)

        mass = matrices.checked_symmetric(self.mass, "mass", said)
        stiffness = matrices.checked_symmetric(self.stiffness, "stiffness", said)
        sizes = {"mass": mass, "stiffness": stiffness}
        damping = self.damping
        if damping is not None and not isinstance(damping, ProportionalDamping | ModalDamping):
            sizes["damping"] = damping = matrices.checked_symmetric(damping, "damping", said)
        for what, matrix in sizes.items():
            if matrix.shape != mass.shape:
                n, m = matrix.shape[0], mass.shape[0]
                raise DeclarationError(
                    what,
                    f"its shape is ({n}, {n}), but that of the mass is ({m}, {m})",
                    "Give matrices of the same size",
                )
        if len({is_sparse(matrix) for matrix in sizes.values()}) > 1:
            from scipy.sparse import csc_array

            sizes = {what: csc_array(matrix) for what, matrix in sizes.items()}
        put(self, "mass", sizes["mass"])
        put(self, "stiffness", sizes["stiffness"])
        put(self, "damping", sizes.get("damping", damping))
        put(self, "basis", None if self.basis is None else checked_basis(self.basis, mass.shape[0]))
        if isinstance(damping, ModalDamping):
            damping.check_count(self.coordinates)
        check_names(self.names, names, self.unknowns)
        put(self, "names", names)
        check_positive(self.mass, said)
        check_not_negative(self.stiffness, self.mass, "stiffness")
        if "damping" in sizes:
            check_not_negative(self.damping, self.mass, "damping")

    # -- unknowns ----------------------------------------------------------------------------------

    @property
    def unknowns(self) -> int:
        """Number of degrees of freedom available in formulas."""
        return int((self.mass if self.basis is None else self.basis).shape[0])

    @property
    def coordinates(self) -> int:
        """Number of coordinates; the number of degrees of freedom, unless a basis is given."""
        return int(self.mass.shape[0])

    @property
    def indices(self) -> dict[str, int]:
        """Names with the indices of their degrees of freedom."""
        return cast("dict[str, int]", self.names)

    @cached_property
    def _called(self) -> dict[int, str]:
        return {index: name for name, index in self.indices.items()}

    def key(self, index: int) -> UnknownKey:
        """Name of a degree of freedom, or its index if it has none."""
        return self._called.get(index, index)

    def index(self, unknown: UnknownKey) -> int:
        """Index of a degree of freedom.

        Raises
        ------
        KeyError
            If there is no such degree of freedom; the argument lists those that exist.
        """
        names = self.indices
        if isinstance(unknown, str) and unknown not in names and not unknown.isdecimal():
            raise KeyError(
                suggestion(unknown, names) if names else "Its degrees of freedom have no names"
            )
        index = names[unknown] if isinstance(unknown, str) and unknown in names else int(unknown)
        if not 0 <= index < self.unknowns:
            raise KeyError(f"Use an index from 0 to {self.unknowns - 1}")
        return index

    @cached_property
    def own(self) -> dict[int, int]:
        """Number of the coordinate for each unknown that is a coordinate, by index."""
        if self.basis is None:
            return {i: i for i in range(self.coordinates)}
        single = np.count_nonzero(self.basis, axis=1) == 1
        rows = np.flatnonzero(single)
        places = np.argmax(self.basis[rows] != 0.0, axis=1)
        ones = self.basis[rows, places] == 1.0
        return dict(zip(rows[ones].tolist(), places[ones].tolist(), strict=True))

    @cached_property
    def shown(self) -> tuple[UnknownKey, ...]:
        """Unknowns that results show by default: those with names and those kept by a reduction, or
        all if there are only a few."""
        named = [*self.indices.values()] if len(self.indices) <= _ALL else []
        own = [*self.own] if self.basis is not None and len(self.own) <= _ALL else []
        few = range(self.unknowns if self.unknowns <= _ALL else 0)
        return tuple(self.key(index) for index in dict.fromkeys([*named, *own]) or few)

    # -- modes -------------------------------------------------------------------------------------

    @property
    def _eigen(self) -> tuple[Array, Array]:
        """Squares of the frequencies, and modes of the coordinates."""

        def solved() -> tuple[Array, Array]:
            if is_sparse(self.mass):
                matrices.check_memory(self.coordinates)
            return _fixed(*matrices.lowest_modes(self.stiffness, self.mass, self.coordinates))

        return made_once(self, "modes", solved)

    @property
    def known_modes(self) -> tuple[Array, Array] | None:
        """Squares of the frequencies and modes of the coordinates, if they have been computed."""
        return kept(self, "modes").get(None)

    @property
    def squares(self) -> Array:
        """Squares of the frequencies, shape (n,), ascending."""
        return self._eigen[0]

    @property
    def frequencies(self) -> Array:
        """Angular frequencies without damping, shape (n,), ascending; zero for rigid modes.

        Raises
        ------
        DeclarationError
            If the structure is too large for all its modes.
        """
        return np.sqrt(self.squares)

    @property
    def modes(self) -> Array:
        """Mode shapes, normalised to unit modal mass, shape (unknowns, n)."""
        shapes = self._eigen[1]
        return shapes if self.basis is None else self.basis @ shapes

    def shape_at(self, index: int) -> Array:
        """Values of the mode shapes at one degree of freedom, shape (n,)."""
        shapes = self._eigen[1]
        return shapes[index] if self.basis is None else self.basis[index] @ shapes

    def in_modes(self, values: Array) -> Array:
        """The amplitudes of the modes, shape (n,), from values of the coordinates, shape (n,)."""
        return self._eigen[1].T @ (self.mass @ values)

    @property
    def modal_damping(self) -> Array:
        """Damping of the modes of unit mass: shape (n,) if it does not couple them, else (n, n).

        Raises
        ------
        DeclarationError
            If a coefficient is a formula of parameters.
        """
        squares, shapes = self._eigen
        if self.damping is None:
            return np.zeros(len(squares))
        if isinstance(self.damping, ProportionalDamping | ModalDamping):
            return self.damping.of_modes(squares)
        rule = _proportional(self.damping, self.mass, self.stiffness)
        if rule is not None:
            return rule.of_modes(squares)
        return damping_of_shapes(matrices.dense(self.damping), shapes)

    # -- smaller ones ------------------------------------------------------------------------------

    @validated
    def reduced(
        self,
        keep: Sequence[UnknownKey] = (),
        modes: int = 20,
        *,
        method: Method = "craig-bampton",
    ) -> Structure:
        """Reduce the structure to fewer coordinates, with the same dynamics at low frequencies.

        Parameters
        ----------
        keep : sequence of int or str
            Degrees of freedom with contacts, springs and loads.
        modes : int
            Number of modes in addition to these.
        method : {"craig-bampton", "modal"}
            The Craig-Bampton method uses the kept degrees of freedom, and the lowest modes of the
            structure with these fixed; its static response to forces on them is exact. The modal
            method uses only the lowest modes of the structure.

        Returns
        -------
        Structure
            Its degrees of freedom have the same indices and names; :attr:`left_out` describes the
            omitted modes.

        Raises
        ------
        DeclarationError
            If a degree of freedom does not exist or is named twice, none is kept with the
            Craig-Bampton method, or rigid modes remain when the kept ones are fixed.

        Notes
        -----
        R. R. Craig and M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA
        Journal 6 (1968). Sparse structures are reduced by shift-invert Lanczos iteration, and the
        number of modes is checked by Sylvester's law of inertia.
        """
        from stickslip.structures.reduction import craig_bampton, modal

        if modes < 0 or method not in ("craig-bampton", "modal"):
            raise DeclarationError(
                "modes" if modes < 0 else "method",
                f"{modes} is negative" if modes < 0 else f"unknown method '{short(method)}'",
                "Give an integer, like 20"
                if modes < 0
                else suggestion(method, ("craig-bampton", "modal"), '"'),
            )
        places = self._places(keep, fixed=method == "craig-bampton")
        shapes, mass, stiffness, left_out = (
            craig_bampton(self, places, modes)
            if method == "craig-bampton"
            else modal(self, places, modes)
        )
        damping = self.damping
        if damping is not None and not isinstance(damping, ProportionalDamping | ModalDamping):
            damping = shapes.T @ (damping @ shapes)
            damping = (damping + damping.T) / 2.0
        if isinstance(damping, ModalDamping):
            damping = damping.of_lowest(mass.shape[0])
        basis = shapes if self.basis is None else self.basis @ shapes
        return Structure(
            mass, stiffness, damping, self.names, unit=self.unit, basis=basis, left_out=left_out
        )

    def _places(self, keep: Sequence[UnknownKey], fixed: bool) -> list[int]:
        """Rows of kept unknowns; for Craig and Bampton's method they are coordinates."""
        found: list[int] = []
        for unknown in keep:
            where = f"keep: {short(str(unknown))}"
            if isinstance(unknown, bool) or not isinstance(unknown, int | str | np.integer):
                raise DeclarationError(where, "not an index or a name", "Give an index or a name")
            try:
                index = self.index(unknown if isinstance(unknown, str) else int(unknown))
            except KeyError as error:
                raise DeclarationError(where, "no such degree of freedom", error.args[0]) from None
            if index in found:
                raise DeclarationError(where, "it is listed twice", "List it once")
            if fixed and index not in self.own:
                raise DeclarationError(
                    where,
                    "it is not a coordinate of this structure, which is already reduced",
                    'Reduce the original structure, or use method="modal"',
                )
            found.append(index)
        if fixed and not found:
            raise DeclarationError(
                "keep",
                "no degrees of freedom are kept",
                'List those with contacts and loads, or use method="modal"',
            )
        return found

    def plain(self) -> dict[str, Any]:
        """Plain data for a model file, with arrays as one string."""
        from stickslip.structures.files import packed_structure

        return packed_structure(self)

    # -- summaries
    # -----------------------------------------------------------------------------------

    @cached_property
    def digest(self) -> str:
        """Hash of the structure, sixteen hexadecimal digits."""
        found = hashlib.sha256()
        for name in ("mass", "stiffness", "damping", "basis"):
            part = getattr(self, name)
            if part is None or isinstance(part, ProportionalDamping | ModalDamping):
                found.update(repr(part).encode())
                continue
            arrays = (part.indptr, part.indices, part.data) if is_sparse(part) else (part,)
            for array in arrays:
                found.update(f"{name} {array.shape} {array.dtype.kind}".encode())
                found.update(np.ascontiguousarray(array).tobytes())
        found.update(repr((self.indices, self.unit, self.left_out)).encode())
        return found.hexdigest()[:16]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Structure) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __reduce__(self) -> tuple[Any, ...]:
        parts = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return _remade, (parts, self.known_modes)

    def __repr__(self) -> str:
        return f"<Structure {self.digest}: {self}>"

    def __str__(self) -> str:
        named = f", {len(self.indices)} named" if self.indices else ""
        by = f", {self.coordinates:,} coordinates" if self.basis is not None else ""
        return f"{self.unknowns:,} degrees of freedom{named}{by}"

    def summary(self) -> Summary:
        """Summary: sizes, frequencies, damping, and omitted modes."""
        from stickslip.results import Summary

        rows = [("unknowns", f"{self.unknowns:,}")]
        if self.indices:
            rows.append(("names", _some([*self.indices])))
        if self.basis is not None:
            rows.append(("coordinates", f"{self.coordinates:,}"))
        data: dict[str, Any] = {"unknowns": self.unknowns, "coordinates": self.coordinates}
        try:
            frequencies = self.frequencies
        except DeclarationError as error:
            rows.append(("frequencies", f"not computed: {error.reason}"))
        else:
            rigid = int(np.count_nonzero(frequencies == 0.0))
            if rigid:
                rows.append(
                    (
                        "rigid modes",
                        f"{rigid}: the stiffness is singular, and the structure may drift",
                    )
                )
            rows.append(("frequencies", _some([f"{omega:.6g}" for omega in frequencies[rigid:]])))
            data |= {"rigid_modes": rigid, "frequencies": frequencies[rigid:].tolist()}
        rows.append(("damping", self._damping_in_words()))
        if (left := self.left_out) is not None:
            rows.append(("reduced from", f"{left.unknowns:,} degrees of freedom, {left.method}"))
            rows.append(("first omitted frequency", f"{left.frequency:.6g}"))
            error = left.static_error
            said = f"{100.0 * error:.2g} %" if error == error else "none kept"
            rows.append(("static error", said))
            data |= {"left_out": {"frequency": left.frequency, "static_error": error}}
        return Summary("Structure", tuple(rows), data, True)

    def _damping_in_words(self) -> str:
        match self.damping:
            case None:
                return "none"
            case ProportionalDamping(alpha, beta):
                return f"{_said(alpha, 6)} of the mass, {_said(beta, 6)} of the stiffness"
            case ModalDamping(ratios):
                listed = cast("tuple[Coefficient, ...]", ratios)
                return f"{_some([_said(ratio, 4) for ratio in listed])} of critical"
        return "a matrix"

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()


def attach_modes(structure: Structure, squares: Array, modes: Array) -> None:
    """Attach known modes to a new structure.

    Parameters
    ----------
    squares : array, shape (n,)
    modes : array, shape (n, n)
        Of its coordinates.
    """
    kept(structure, "modes")[None] = _fixed(squares, modes)


def _remade(parts: dict[str, Any], modes: tuple[Array, Array] | None) -> Structure:
    """A structure from another process, with the same modes."""
    made = Structure(**parts)
    if modes is not None:
        attach_modes(made, *modes)
    return made


def _fixed(*arrays: Array) -> tuple[Array, Array]:
    for array in arrays:
        array.flags.writeable = False
    first, second = arrays
    return first, second


def _said(coefficient: Coefficient, digits: int) -> str:
    """A coefficient as text."""
    return coefficient if isinstance(coefficient, str) else f"{coefficient:.{digits}g}"


def _some(texts: Sequence[str]) -> str:
    more = f", ... ({len(texts)} in all)" if len(texts) > _SHOWN else ""
    return ", ".join(texts[:_SHOWN]) + more


def _indices(names: Any) -> dict[str, int]:
    """Names with their indices, not yet checked against sizes."""
    if isinstance(names, Mapping):
        return dict(names)
    listed = list(names) if isinstance(names, Sequence) and not isinstance(names, str) else []
    return {name: index for index, name in enumerate(listed)}


def _proportional(
    damping: Symmetric, mass: Symmetric, stiffness: Symmetric
) -> ProportionalDamping | None:
    """The rule by which a matrix was made, if it is C = α M + β K up to rounding."""

    for parts in ([stiffness], [mass], [mass, stiffness]):
        table = np.array([[float((a * b).sum()) for a in parts] for b in parts])
        size = np.sqrt(np.diag(table))
        if not np.all(size > 0.0):
            continue
        found = np.zeros(len(parts))
        apart = damping
        for _ in range(3):  # later iterations remove rounding errors
            right = np.array([float((part * apart).sum()) for part in parts])
            found += np.linalg.lstsq(table / np.outer(size, size), right / size)[0] / size
            apart = damping - sum(c * part for c, part in zip(found, parts, strict=True))
        terms = sum(abs(c * part) for c, part in zip(found, parts, strict=True))
        if np.all(found >= 0.0) and (abs(apart) - ROUNDING * (abs(damping) + terms)).max() <= 0.0:
            alpha = found[0] if parts[0] is mass else 0.0
            beta = found[-1] if parts[-1] is stiffness else 0.0
            return ProportionalDamping(float(alpha), float(beta))
    return None
