"""A map on disk: a Zarr 3 group that xarray can read, written chunk by chunk.

The store records its own progress. Every chunk of every variable is one file with a checksum, which
is replaced atomically, and the outcomes of a chunk are written after all its other variables: a
point with an outcome has all other values. So the missing points are known after any interruption.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from stickslip.arrays import Array
from stickslip.checksums import LAYOUT, TABLE
from stickslip.errors import StickslipError, need, printable
from stickslip.motion.outcome import Outcome
from stickslip.storage import PREFIX, readable
from stickslip.sweeps import damage
from stickslip.sweeps.damage import Chunk
from stickslip.sweeps.request.axes import Axis, Grid, make_grid
from stickslip.sweeps.request.carry import Carry
from stickslip.sweeps.request.plan import FORMAT, KIND, LABELS, NOT_COMPUTED, Part, Plan

if TYPE_CHECKING:
    import xarray
    import zarr

need("zarr", "maps")

Slices = tuple[slice, ...]


class MapStore:
    """A map that is being computed.

    Attributes
    ----------
    path : Path or None
        None: in memory.
    outcome : array of int8
        Codes of all points, negative if not computed.
    """

    def __init__(self, group: zarr.Group, plan: Plan, grid: Grid, path: Path | None) -> None:
        self.group = group
        self.plan = plan
        self.grid = grid
        self.path = path
        self.names: list[str] = list(plan.variables())
        # A chunk without a file is one that is not computed, so also chunks without any value get
        # one.
        self.arrays: dict[str, Any] = {
            name: _array(group, name).with_config({"write_empty_chunks": True})
            for name in self.names
        }
        self.outcome: Array = np.full(grid.shape, NOT_COMPUTED, np.int8)

    @property
    def left(self) -> int:
        """Number of points that are not computed."""
        return int(np.count_nonzero(self.outcome < 0))

    def load(self) -> None:
        """Read which points are computed.

        Raises
        ------
        StickslipError
            If a chunk of outcomes is damaged.
        """
        for chunk in self.grid.chunks():
            region = self.grid.region(chunk)
            self.outcome[region] = self.read("outcome", chunk)
        if self.plan.carry is None:
            # With more time, or on a less busy machine, these may arrive.
            self.outcome[self.outcome == Outcome.TIME_UP.code] = NOT_COMPUTED

    def read(self, name: str, chunk: Chunk) -> Array:
        """Read one chunk of a variable.

        Raises
        ------
        StickslipError
            If it is damaged.
        """
        region = self.grid.region(chunk)
        try:
            return np.asarray(self.arrays[name][region])
        except (ValueError, RuntimeError) as error:
            raise _damaged(self.path, [(name, chunk)], str(error)) from None

    def audit(self, repair: bool = False) -> None:
        """Mark the points of missing chunks as not computed, and those of damaged ones if they are
        to be repaired.

        Raises
        ------
        StickslipError
            If chunks are damaged, and not to be repaired.
        """
        if self.path is None:
            return
        array = self.arrays["outcome"].metadata.to_dict()
        found = damage.faults(self.path, self.names, array, self._is_empty)
        if found.damaged and not repair:
            raise _damaged(self.path, found.damaged)
        for _, chunk in [*found.damaged, *found.missing]:
            self._write("outcome", self.grid.region(chunk), NOT_COMPUTED)

    def _is_empty(self, chunk: Chunk) -> bool:
        return bool(np.all(self.read("outcome", chunk) == NOT_COMPUTED))

    def missing(self, chunk: Chunk, wanted: Array | None = None) -> Array:
        """Positions in a chunk, in C order, of the points that are not computed.

        Parameters
        ----------
        wanted : array of bool, shape of the grid, optional
            Only these.
        """
        region = self.grid.region(chunk)
        todo = self.outcome[region] < 0
        return np.flatnonzero(todo if wanted is None else todo & wanted[region])

    def write(self, chunk: Chunk, inside: Array, values: Mapping[str, Array]) -> None:
        """Write the values at some points of a chunk.

        Raises
        ------
        StickslipError
            If it cannot be written; earlier values stay intact.
        """
        region = self.grid.region(chunk)
        for name in self.names:
            block = self._merged(name, chunk, inside, np.asarray(values[name]))
            self._write(name, region, block)
            if name == "outcome":
                self.outcome[region] = block

    def _merged(self, name: str, chunk: Chunk, inside: Array, values: Array) -> Array:
        """A chunk of a variable with other values at some points."""
        before = self.outcome[self.grid.region(chunk)]
        if len(inside) == before.size:
            return values.reshape(before.shape)
        block = before.copy() if name == "outcome" else self.read(name, chunk).copy()
        block.reshape(-1)[inside] = values
        return block

    def whole(self, name: str) -> Array:
        """All values of a variable."""
        return np.asarray(self.arrays[name][...])

    def replace(self, name: str, table: Array, where: Array) -> None:
        """Write other values at some points, chunk by chunk.

        Parameters
        ----------
        table, where : array, shape of the grid
            Values, and whether they are new.
        """
        for chunk in self.grid.chunks():
            region = self.grid.region(chunk)
            if np.any(where[region]):
                self._write(name, region, table[region])
        if name == "outcome":
            self.outcome[...] = table

    def _write(self, name: str, region: Slices, block: Array | int) -> None:
        self._check_exists()
        try:
            self.arrays[name][region] = block
        except OSError as error:
            done = self.grid.size - self.left
            raise StickslipError(
                f"{self.path}: cannot be written ({error.strerror or error}). {done} of "
                f"{self.grid.size} points are kept; free some space, and run the same command "
                "again to resume"
            ) from None

    def _check_exists(self) -> None:
        """Raise an error if the store has been removed, instead of writing an incomplete one."""
        if self.path is not None and not damage.is_there(self.path):
            raise StickslipError(
                f"{self.path}: was removed while the map was computed. Run the same command again"
            )

    def dataset(self) -> xarray.Dataset:
        """The map; values are read from the store when they are needed.

        Raises
        ------
        StickslipError
            If the store was removed.
        """
        import xarray as xr

        self._check_exists()
        return _plain(xr.open_zarr(self.group.store, chunks=None, consolidated=True))


def _plain(data: xarray.Dataset) -> xarray.Dataset:
    """The dataset without checksums of files, and with the names of records."""
    data.attrs = {key: value for key, value in data.attrs.items() if key not in (LAYOUT, TABLE)}
    for name, coordinate in data.coords.items():
        if LABELS in coordinate.attrs:
            attributes = {k: v for k, v in coordinate.attrs.items() if k != LABELS}
            labels = np.array(coordinate.attrs[LABELS], dtype=object)
            data = data.assign_coords({name: (coordinate.dims, labels, attributes)})
    return data


def _damaged(path: Path | None, chunks: list[tuple[str, Chunk]], why: str = "") -> StickslipError:
    """Message about damaged chunks."""
    reason = f" ({' '.join(why.split())})" if why else ""
    return StickslipError(
        f"{path}: damaged: {damage.files(chunks)}{reason}. The rest is intact; use --repair to "
        "recompute these chunks"
    )


def read_map(path: Path) -> xarray.Dataset:
    """A stored map; values are read when they are needed.

    Points of which a file is missing have the outcome -1, not computed.

    Raises
    ------
    StickslipError
        If it is not a map of ours, or damaged.

    Warns
    -----
    UserWarning
        If files are missing, or it was stored without checksums.
    """
    import xarray as xr

    from stickslip.sweeps.files import MapFiles

    arrays = damage.check_description(path, KIND)
    stored_plan(path)
    files = MapFiles.opened(path)
    data = _plain(xr.open_zarr(files, chunks=None, consolidated=True))
    names = [*(name for name in map(str, data.data_vars) if name != "outcome"), "outcome"]
    sizes = arrays["outcome"]["chunk_grid"]["configuration"]["chunk_shape"]

    def region(chunk: Chunk) -> Slices:
        return tuple(slice(i * size, (i + 1) * size) for i, size in zip(chunk, sizes, strict=True))

    def is_empty(chunk: Chunk) -> bool:
        return bool(np.all(data["outcome"].variable[region(chunk)] == NOT_COMPUTED))

    found = damage.faults(path, names, arrays["outcome"], is_empty)
    if found.damaged:
        raise _damaged(path, found.damaged)
    lost = {*found.unfinished, *(chunk for _, chunk in found.missing)}
    if lost:
        for name in names:  # the other values of points that are not computed are unknown, too
            values = data[name].values.copy()
            for chunk in lost:
                if name == "outcome" or np.issubdtype(values.dtype, np.floating):
                    values[region(chunk)] = NOT_COMPUTED if name == "outcome" else np.nan
            data[name] = data[name].copy(data=values)
    if found.missing:
        text = f"missing: {damage.files(found.missing)}; their points are treated as not computed"
        warnings.warn(f"{path}: {text}", stacklevel=3)
    return data


def _array(group: zarr.Group, name: str) -> zarr.Array:
    found: Any = group[name]
    return found


# -- making and opening ----------------------------------------------------------------------------


def create(plan: Plan, path: Path | None) -> MapStore:
    """Create a store without points, in memory or at an unused path."""
    import zarr
    from zarr.storage import MemoryStore

    from stickslip.sweeps.files import MapFiles

    lines = [] if plan.carry is None else list(plan.carry.path(plan.axes)[0])
    grid = make_grid(plan.axes, lines)
    place = MemoryStore() if path is None else MapFiles(path)
    group = zarr.open_group(place, mode="w-", zarr_format=3)
    coordinates = plan.coordinates()
    group.attrs.update(
        {
            "title": plan.system.title or plan.system.name,
            "source": plan.system.source,
            "coordinates": " ".join(coordinates),
            **{PREFIX + key: text for key, text in plan.parts().items()},
        }
    )
    for name, (dimension, values, attributes) in coordinates.items():
        array = _new_array(
            group, name, (dimension,), values.shape, values.shape, "f8", np.nan, attributes
        )
        array[:] = values
    dimensions = tuple(axis.dimension for axis in plan.axes)
    for name, (kind, empty, attributes) in plan.variables().items():
        _new_array(group, name, dimensions, grid.shape, grid.chunk, kind, empty, attributes)
    with warnings.catch_warnings():
        # Zarr 3 does not specify consolidated metadata yet; xarray still looks for them.
        warnings.filterwarnings("ignore", message="Consolidated metadata")
        group = zarr.consolidate_metadata(group.store)
    if path is not None:
        damage.seal_store(path)
    return MapStore(group, plan, grid, path)


def _new_array(
    group: zarr.Group,
    name: str,
    dimensions: tuple[str, ...],
    shape: tuple[int, ...],
    chunk: tuple[int, ...],
    kind: str,
    empty: float,
    attributes: dict[str, Any],
) -> zarr.Array:
    from zarr.codecs import Crc32cCodec, ZstdCodec

    return group.create_array(
        name,
        shape=shape,
        chunks=chunk,
        dtype=kind,
        fill_value=empty,
        dimension_names=dimensions,
        attributes=attributes,
        compressors=[ZstdCodec(level=1), Crc32cCodec()],
    )


@contextlib.contextmanager
def opened(
    plan: Plan, path: Path, *, extend: bool = False, overwrite: bool = False
) -> Iterator[MapStore]:
    """The store of a plan at a path, locked for this process: created, resumed, extended or
    replaced.

    Raises
    ------
    StickslipError
        If something else is there, another map, or another process is writing it; or the place is
        not writable.
    """
    if not path.name or "\0" in str(path):
        raise StickslipError(
            f"{printable(str(path))}: not a valid path for a map. Choose another --out, like "
            "map.zarr"
        )
    with contextlib.ExitStack() as stack:
        try:
            store = _opened(stack, plan, path, extend, overwrite)
        except OSError as error:
            raise StickslipError(
                f"{path}: cannot be written ({error.strerror or error}). Choose another --out"
            ) from None
        yield store


def _opened(
    stack: contextlib.ExitStack, plan: Plan, path: Path, extend: bool, overwrite: bool
) -> MapStore:
    path.parent.mkdir(parents=True, exist_ok=True)
    stack.enter_context(_lock(path))
    _finish_replacement(path)
    if not path.exists():
        return _replaced(plan, path, None)
    damage.check_description(path, KIND)
    parts, axes = stored_plan(path)
    for leftover in [*path.rglob("*.partial"), *path.parent.glob(f".{path.name}.*.unfinished")]:
        shutil.rmtree(leftover) if leftover.is_dir() else leftover.unlink()
    if overwrite:
        return _replaced(plan, path, None)
    held = replace(plan, axes=axes)
    change = held.difference(parts, axes) or (None if extend else plan.difference(parts, axes))
    if change is not None:
        add = "--extend to add points, " if change.part is Part.VALUES and not extend else ""
        raise StickslipError(
            f"{path}: holds a map {change.text}. Use {add}--overwrite to replace it, or another "
            "--out"
        )
    store = _existing(held, path)
    if extend and plan.difference(parts, axes):
        store.audit()
        return _replaced(_extended(plan, held, path), path, store)
    return store


def _existing(plan: Plan, path: Path) -> MapStore:
    import zarr

    from stickslip.sweeps.files import MapFiles

    group = zarr.open_group(MapFiles(path), mode="r+", use_consolidated=False)
    return MapStore(group, plan, Grid(plan.axes, _array(group, "outcome").chunks), path)


def stored_plan(path: Path) -> tuple[dict[str, str], tuple[Axis, ...]]:
    """Stored parts and axes of a store whose description was checked.

    Raises
    ------
    StickslipError
        If it cannot be read.
    """
    import zarr

    try:
        group = zarr.open_group(path, mode="r", use_consolidated=False)
        parts = {
            k.removeprefix(PREFIX): str(v) for k, v in group.attrs.items() if k.startswith(PREFIX)
        }
        readable(path, parts, FORMAT)
        axes = []
        for declared in json.loads(parts["axes"]):
            arrays = [_array(group, name) for name in declared["names"]]
            labels = cast("Sequence[str]", arrays[0].attrs.get(LABELS, ()))
            values = np.array([array[:] for array in arrays])
            axes.append(Axis(tuple(declared["names"]), values, declared["spacing"], tuple(labels)))
    except StickslipError:
        raise
    except Exception as error:  # zarr may raise any exception for a damaged store without checksums
        raise StickslipError(f"{path}: its description is damaged; nothing was changed") from error
    return parts, tuple(axes)


# -- replacing and extending -----------------------------------------------------------------------


def _extended(plan: Plan, held: Plan, path: Path) -> Plan:
    """The plan with the stored values of axes where they agree up to rounding."""
    change = plan.difference(held.parts(), held.axes)
    if change is not None and change.part is Part.AXES:
        raise StickslipError(f"{path}: holds a map {change.text}. Extend it along its own axes")
    axes = []
    for k, (new, old) in enumerate(zip(plan.axes, held.axes, strict=True)):
        found = new.positions(old)
        if np.any(found < 0):
            place = int(np.argmin(found))
            lost = ", ".join(f"{v:g}" for v in old.values[:, place])
            lost = old.labels[place] if old.labels else lost
            raise StickslipError(
                f"{path}: the value {','.join(old.names)} = {lost} of the stored map is not among "
                "the new ones."
                " Refine it, such as from n to 2n - 1 points"
            )
        if plan.carry is not None and plan.carry.axis == k:
            _check_order(plan.carry, found, len(new), path)
        values = new.values.copy()
        values[:, found] = old.values
        axes.append(replace(new, values=values))
    return replace(plan, axes=tuple(axes))


def _check_order(carry: Carry, found: Array, count: int, path: Path) -> None:
    """Reject new values on a line before the old ones, since these would then start from other
    states.

    Parameters
    ----------
    found : array of int
        Places of the old values.
    count : int
        Of all values.
    """
    first = 0 if carry.steps[0] > 0 else count - len(found)
    after = np.array_equal(found, first + np.arange(len(found)))
    if not after or (len(carry.steps) > 1 and count > len(found)):
        raise StickslipError(
            f"{path}: the state is carried along {carry.text}, and the new values of that axis "
            "do not follow the stored ones. Extend another axis, continue in the same "
            "direction, or start again with --overwrite"
        )


def _replaced(plan: Plan, path: Path, old: MapStore | None) -> MapStore:
    """Replace the store at a path by a new one with the points of the old one.

    It is written to a temporary path, and renamed when it is complete.
    """
    place = path.with_name(f".{path.name}.{os.getpid()}.unfinished")
    before = _before(path)
    try:
        store = create(plan, place)
        if old is not None:
            _copy(old, store)
        if path.exists():
            os.rename(path, before)
        os.rename(place, path)
    finally:
        shutil.rmtree(place, ignore_errors=True)
    shutil.rmtree(before, ignore_errors=True)
    return _existing(plan, path)


def _before(path: Path) -> Path:
    return path.with_name(f".{path.name}.before")


def _finish_replacement(path: Path) -> None:
    """Complete a replacement that was killed between its two renamings."""
    before = _before(path)
    if before.is_dir():
        shutil.rmtree(before) if path.exists() else os.rename(before, path)


def _copy(old: MapStore, new: MapStore) -> None:
    """Copy the points of one store that the other one contains."""
    places = [o.positions(n) for o, n in zip(old.grid.axes, new.grid.axes, strict=True)]
    for chunk in new.grid.chunks():
        region = new.grid.region(chunk)
        where = [place[part] for place, part in zip(places, region, strict=True)]
        kept = [np.flatnonzero(place >= 0) for place in where]
        if not all(map(len, kept)):
            continue
        source = tuple(place[k] for place, k in zip(where, kept, strict=True))
        shape = tuple(part.stop - part.start for part in region)
        inside = np.ravel_multi_index(np.ix_(*kept), shape).reshape(-1)
        values = {
            name: np.asarray(old.arrays[name].oindex[source]).reshape(-1) for name in new.names
        }
        done = values["outcome"] >= 0
        new.write(chunk, inside[done], {name: some[done] for name, some in values.items()})


@contextlib.contextmanager
def _lock(path: Path) -> Iterator[None]:
    """Lock a store against writing by other processes; the lock ends with the process.

    The lock is a file next to the store, since the store itself may be replaced, and is deleted at
    the end.
    """
    from filelock import FileLock, Timeout

    place = path.with_name(f".{path.name}.lock")
    try:
        with FileLock(place, timeout=0):
            try:
                yield
            finally:
                with contextlib.suppress(OSError):
                    place.unlink()
    except Timeout:
        raise StickslipError(
            f"{path}: another process is writing it. Wait for it, or choose another --out"
        ) from None
