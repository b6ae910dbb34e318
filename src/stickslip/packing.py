"""Packing of many variables of a dataset into few arrays, since the cost of a file depends on the
number of variables.

Variables of one shape and one unit stand together in ``packed_1``, ``packed_2``, ...: arrays with a
first dimension more, along which a coordinate, ``packed_1_names``, says their names. With xarray
``data["packed_1"].sel(packed_1_names="x_7")`` is one of them.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray

_MANY = 200  # variables above which they are packed
_PREFIX = "packed_"
_OWN = "stickslip_attributes"


def in_few(data: xarray.Dataset) -> xarray.Dataset:
    """The same with few variables, if they are many."""
    if len(data.data_vars) <= _MANY:
        return data
    import numpy as np
    import xarray as xr

    groups: dict[Any, list[str]] = {}
    for name in data.data_vars:
        variable = data.variables[name]
        unit = str(variable.attrs.get("units", ""))
        alone = str(name) if variable.dtype.kind not in "biuf" else ""  # texts stay as they are
        groups.setdefault((variable.dims, variable.dtype.str, unit, alone), []).append(str(name))
    kept = {names[0]: data[names[0]] for names in groups.values() if len(names) == 1}
    coordinates = dict(data.coords)
    together: dict[str, Any] = {}
    for (dims, _, unit, _), names in groups.items():
        if len(names) == 1:
            continue
        place = f"{_PREFIX}{len(together) + 1}"
        along = f"{place}_names"
        values = np.stack([data.variables[name].values for name in names])
        attributes = json.dumps([_plain(data.variables[name].attrs) for name in names])
        attrs = {_OWN: attributes, **({"units": unit} if unit else {})}
        together[place] = ((along, *dims), values, attrs)
        coordinates[along] = xr.DataArray(np.array(names, dtype=str), dims=along)
    return xr.Dataset({**kept, **together}, coordinates, data.attrs)


def in_all(data: xarray.Dataset) -> xarray.Dataset:
    """The packed variables."""
    places = [name for name in data.data_vars if _OWN in data.variables[name].attrs]
    if not places:
        return data
    import xarray as xr

    variables: dict[Any, Any] = {}
    for place in places:
        along, *dims = data[place].dims
        attributes = json.loads(data[place].attrs[_OWN])
        rows = zip(data[along].values, data[place].values, attributes, strict=True)
        variables |= {str(name): (dims, row, _restored(own)) for name, row, own in rows}
    rest = data.drop_vars([*places, *(data[place].dims[0] for place in places)])
    names = {name: (v.dims, v.values, v.attrs) for name, v in rest.data_vars.items()}
    return xr.Dataset({**names, **variables}, rest.coords, data.attrs)


def _plain(attributes: dict[str, Any]) -> dict[str, Any]:
    """Attributes for JSON; arrays with their type."""
    import numpy as np

    return {
        key: {"type": value.dtype.str, "values": value.tolist()}
        if isinstance(value, np.ndarray | np.generic)
        else value
        for key, value in attributes.items()
    }


def _restored(attributes: dict[str, Any]) -> dict[str, Any]:
    import numpy as np

    return {
        key: np.array(value["values"], dtype=value["type"]) if isinstance(value, dict) else value
        for key, value in attributes.items()
    }
