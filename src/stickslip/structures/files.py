"""Structures in model files: matrices in separate files, or all arrays packed into one string."""

from __future__ import annotations

import io
import zipfile
from base64 import b64decode, b64encode
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import DeclarationError, short, suggestion
from stickslip.structures.damping import ModalDamping, ProportionalDamping
from stickslip.structures.matrices import Symmetric, is_sparse
from stickslip.structures.structure import LeftOut, Structure, attach_modes

_KEYS = ("mass", "stiffness", "damping", "names", "unit", "keep", "modes", "method")
_PACKED_KEYS = ("packed", "damping", "names", "unit", "left_out")
_KINDS = (".mtx", ".npz", ".npy", ".mat")
_MOST_BYTES = 2_000_000_000  # largest number of bytes of arrays in one file


def packed_structure(structure: Structure) -> dict[str, Any]:
    """A structure as data for a model file: names and rules as text, arrays in one packed string.

    The modes are stored, too: computed on another machine they differ by rounding, and with them
    the coordinates.
    """
    arrays: dict[str, Any] = {}
    for name in ("mass", "stiffness", "damping", "basis"):
        matrix = getattr(structure, name)
        if matrix is None or isinstance(matrix, ProportionalDamping | ModalDamping):
            continue
        if is_sparse(matrix):
            parts = {"data": matrix.data, "indices": matrix.indices, "indptr": matrix.indptr}
            arrays |= {f"{name}_{part}": array for part, array in parts.items()}
        else:
            arrays[name] = matrix
    known = structure.known_modes
    if known is not None:
        arrays["squares"], arrays["modes"] = known
    file = io.BytesIO()
    # Data that is not zero compresses poorly, so little time is spent on it.
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as parts:
        for name, array in arrays.items():
            with parts.open(f"{name}.npy", "w", force_zip64=True) as part:
                np.lib.format.write_array(part, np.asarray(array), allow_pickle=False)
    found: dict[str, Any] = {"packed": b64encode(file.getvalue()).decode()}
    if isinstance(structure.damping, ProportionalDamping | ModalDamping):
        found["damping"] = structure.damping.plain()
    if structure.indices:
        found["names"] = structure.indices
    if structure.unit:
        found["unit"] = structure.unit
    if (left := structure.left_out) is not None:
        found["left_out"] = [left.method, left.unknowns, left.frequency, left.static_error]
    return found


def from_plain(table: Mapping[str, Any], where: str, folder: Path = Path()) -> Structure:
    """A structure from its entry in a model file.

    Parameters
    ----------
    table : mapping
        With ``mass``, ``stiffness`` and ``damping``, names of files relative to the folder, and
        ``names`` and ``unit``; damping may be ``{ratios = [0.01]}`` or ``{alpha = 1.0, beta =
        1e-6}``. With ``keep``, ``modes`` and ``method`` it is reduced. Or ``packed``.
    where : str
        The key, for messages.

    Raises
    ------
    DeclarationError
    """
    known = _PACKED_KEYS if "packed" in table else _KEYS
    for key in table:
        if key not in known:
            raise DeclarationError(f"{where}.{key}", "unknown key", suggestion(key, known))
    for key in () if "packed" in table else ("mass", "stiffness"):
        if key not in table:
            raise DeclarationError(
                f"{where}.{key}", "this key is missing", f'Add it, as in: {key} = "{key}.mtx"'
            )
    try:
        if "packed" in table:
            return _unpacked(table, where)
        mass, stiffness = (_read(table[key], f"{where}.{key}", folder) for key in _KEYS[:2])
        damping = table.get("damping")
        if isinstance(damping, str):
            damping = _read(damping, f"{where}.damping", folder)
        elif damping is not None:
            damping = _rule(damping, "damping")
        unit = table.get("unit", "")
        if not isinstance(unit, str):
            raise DeclarationError("unit", "expected a string", 'Write it in quotes, like "m"')
        made = Structure(mass, stiffness, damping, table.get("names"), unit=unit)
        if table.keys() & {"keep", "modes", "method"}:
            return made.reduced(
                table.get("keep", ()),
                table.get("modes", 20),
                method=table.get("method", "craig-bampton"),
            )
        return made
    except DeclarationError as error:
        inside = error.where.startswith(where)
        place = error.where if inside else f"{where}.{error.where}"
        raise DeclarationError(place, error.reason, error.remedy) from None


def _rule(given: object, where: str) -> ProportionalDamping | ModalDamping:
    """A damping rule."""
    match given:
        case {"ratios": ratios, **others} if not others:
            return ModalDamping(ratios)
        case {"alpha": alpha, "beta": beta, **others} if not others:
            return ProportionalDamping(alpha, beta)
    raise DeclarationError(
        where,
        "not a matrix or a damping rule",
        'Write it like "C.mtx", {ratios = [0.01]} or {alpha = 1.0, beta = 1e-6}',
    )


def _read(given: object, where: str, folder: Path) -> Symmetric:
    """A matrix from a file: ``K.mtx``, or ``beam.npz:K`` if the file contains several."""
    if not isinstance(given, str):
        raise DeclarationError(where, "expected the name of a file", 'Write it like "K.mtx"')
    file, _, variable = given.partition(":") if ":" in given[2:] else (given, "", "")
    path = folder / file
    kind = path.suffix.lower()
    if kind not in _KINDS:
        raise DeclarationError(
            where, f"unknown file format '{short(file)}'", f"Use one of {', '.join(_KINDS)}"
        )
    try:
        return _matrix_in(path, kind, variable, where)
    except DeclarationError:
        raise
    except FileNotFoundError:
        raise DeclarationError(where, f"no such file: '{short(file)}'", "Check the path") from None
    except Exception as error:  # readers raise errors of any kind
        raise DeclarationError(
            where, f"'{short(file)}' cannot be read ({short(str(error))})", "Check the file"
        ) from None


def _matrix_in(path: Path, kind: str, variable: str, where: str) -> Symmetric:
    if kind == ".mtx":
        from scipy.io import mmread

        return mmread(path)
    if kind == ".npy":
        return np.load(path, allow_pickle=False)
    if kind == ".mat":
        from scipy.io import loadmat

        found = {k: v for k, v in loadmat(path).items() if not k.startswith("__")}
        return found[_chosen(variable, list(found), where)]
    with np.load(path, allow_pickle=False) as arrays:
        if "format" in arrays.files:
            from scipy.sparse import load_npz

            return load_npz(path)
        return arrays[_chosen(variable, arrays.files, where)]


def _chosen(variable: str, known: list[str], where: str) -> str:
    """The name of an array in a file; it may be omitted if there is only one."""
    if not variable and len(known) == 1:
        return known[0]
    if variable not in known:
        raise DeclarationError(
            where,
            f"the file has no array '{short(variable)}'"
            if variable
            else "the file has several arrays",
            f"Name one of {', '.join(known[:10])}, as in file:{known[0] if known else 'K'}",
        )
    return variable


def _unpacked(table: Mapping[str, Any], where: str) -> Structure:
    """A structure from a packed text."""
    try:
        content = io.BytesIO(b64decode(str(table["packed"]), validate=True))
        with zipfile.ZipFile(content) as parts:
            if sum(part.file_size for part in parts.infolist()) > _MOST_BYTES:
                raise ValueError
        with np.load(content, allow_pickle=False) as arrays:
            found = {name: arrays[name] for name in arrays.files}
        matrices = {name: _assembled(found, name) for name in ("mass", "stiffness", "damping")}
        left = table.get("left_out")
        left_out = None if left is None else LeftOut(*left)
    except (ValueError, TypeError, KeyError, IndexError, EOFError, zipfile.BadZipFile):
        raise DeclarationError(
            f"{where}.packed", "the packed arrays are damaged", "Write the file again"
        ) from None
    damping = matrices["damping"]
    if "damping" in table:
        damping = _rule(table["damping"], "damping")
    made = Structure(
        matrices["mass"],
        matrices["stiffness"],
        damping,
        table.get("names"),
        unit=str(table.get("unit", "")),
        basis=found.get("basis"),
        left_out=left_out,
    )
    if "modes" in found:
        n = made.coordinates
        squares, modes = (np.asarray(found.get(name, 0)) for name in ("squares", "modes"))
        if squares.shape != (n,) or modes.shape != (n, n):
            raise DeclarationError(
                "packed", "the packed modes do not match the structure", "Write the file again"
            )
        attach_modes(made, squares.astype(float), modes.astype(float))
    return made


def _assembled(arrays: Mapping[str, Any], name: str) -> Any:
    """A matrix from packed arrays, dense or sparse; None if it is not among them."""
    if name in arrays or f"{name}_data" not in arrays:
        return arrays.get(name)
    from scipy.sparse import csc_array

    data, indices, indptr = (arrays[f"{name}_{part}"] for part in ("data", "indices", "indptr"))
    n = len(indptr) - 1
    return csc_array((data, indices, indptr), shape=(n, n))
