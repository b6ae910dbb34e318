"""numba's machine code on disk, good for as long as all sources that shape it stay the same.

numba keeps the machine code of a function beside the file in which the function stands, and looks
at that file alone when it asks whether the code is still good. But constants, layouts and whole
functions of other files are compiled into it: after an update, old code would go on with new data.
So :func:`njit` has it look at all files that shape the code.
"""

from __future__ import annotations

import importlib
import sys
import warnings
from types import ModuleType
from typing import Any

from numba import njit
from numba.core import caching

from stickslip.machine_code.stamps import inside, stamp

__all__ = ["njit"]


class _AllSources:
    """A place for machine code that is good for as long as :func:`stamp` stays the same."""

    _py_file: str

    def get_source_stamp(self) -> str:
        return stamp(self._py_file)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        return super().from_function(py_func, py_file) if inside(py_file) else None  # type: ignore[misc]


class _ReadableIndex(caching.IndexDataCacheFile):
    """An index of machine code that names a class which is no longer there is an old one: none."""

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except (AttributeError, ImportError):
            return {}


def _look_at_all_sources() -> None:
    """Put our places before numba's own, one for each of its folders: the given one, beside the
    file, the user's."""
    implementation: Any = getattr(caching, "CacheImpl", None) or getattr(caching, "_CacheImpl")  # noqa: B009
    places = implementation._locator_classes
    ours = [type(f"{place.__name__}OfAllSources", (_AllSources, place), {}) for place in places[:3]]
    implementation._locator_classes = [*ours, *places]
    caching.IndexDataCacheFile = _ReadableIndex


def _import_array_functions() -> None:
    """Import numba's array functions but not SciPy's linear algebra, a sixth of the time of a whole
    short process.

    They only look whether it is there; compiled code that calls it (none of ours) imports it by
    itself.
    """
    blas = "scipy.linalg.cython_blas"
    if blas not in sys.modules:
        sys.modules[blas] = ModuleType(blas)
        try:
            importlib.import_module("numba.np.arraymath")
        finally:
            del sys.modules[blas]


_look_at_all_sources()
_import_array_functions()
# The engine takes a model's machine code as arguments; numba calls that experimental whenever it
# compiles such a call.
warnings.filterwarnings("ignore", message="First-class function type feature is experimental")
