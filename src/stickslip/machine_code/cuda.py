"""An NVIDIA GPU, used through the functions of its driver."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from contextlib import suppress
from ctypes import addressof, byref, c_char_p, c_int, c_int64, c_size_t, c_uint, c_uint64, c_void_p
from functools import cache
from hashlib import sha256
from threading import Lock
from typing import Any

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, StickslipError
from stickslip.machine_code.functions import Entry
from stickslip.machine_code.objects import digest
from stickslip.machine_code.ptx import CAPABILITY, ptx_of
from stickslip.machine_code.store import cache_folder, keep, stored

_DRIVER = "nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1"
_THREADS = 64  # threads of a block
_LOG = 8192  # largest number of characters of the assembler's log
_PTX, _LOG_PLACE, _LOG_SIZE = 1, 5, 6  # a kind of code, and options of its assembler
_MAJOR, _MINOR = 75, 76  # attributes of a GPU
_NO_MEMORY, _NO_DEVICE = 2, 100  # errors
# Arguments of the driver's functions: pointers, addresses on the GPU, sizes, whole numbers, texts.
_KINDS = {"p": c_void_p, "a": c_uint64, "n": c_size_t, "i": c_int, "u": c_uint, "s": c_char_p}
_TAKES = {
    "cuInit": "u",
    "cuDriverGetVersion": "p",
    "cuGetErrorName": "ip",
    "cuDeviceGet": "pi",
    "cuDeviceGetName": "pii",
    "cuDeviceGetAttribute": "pii",
    "cuDevicePrimaryCtxRetain": "pi",
    "cuCtxSetCurrent": "p",
    "cuCtxSynchronize": "",
    "cuMemGetInfo_v2": "pp",
    "cuMemAlloc_v2": "pn",
    "cuMemFree_v2": "a",
    "cuMemcpyHtoD_v2": "apn",
    "cuMemcpyDtoH_v2": "pan",
    "cuMemcpyDtoD_v2": "aan",
    "cuLinkCreate_v2": "uppp",
    "cuLinkAddData_v2": "pipnsupp",
    "cuLinkComplete": "ppp",
    "cuLinkDestroy": "p",
    "cuModuleLoadData": "pp",
    "cuModuleGetFunction": "pps",
    "cuLaunchKernel": "puuuuuuuppp",
}


class Cuda:
    """The first GPU that the driver knows.

    Raises
    ------
    DeclarationError
        If there is no GPU, no driver, or the GPU is too old.
    """

    def __init__(self) -> None:
        self._driver = _driver()
        self._context = c_void_p()
        self._call("cuInit", 0)
        device, label = c_int(), ctypes.create_string_buffer(256)
        self._call("cuDeviceGet", byref(device), 0)
        self._call("cuDeviceGetName", label, len(label), device)
        self.name: str = label.value.decode(errors="replace")
        self.capability: tuple[int, int] = (
            self._attribute(_MAJOR, device),
            self._attribute(_MINOR, device),
        )
        if self.capability < CAPABILITY:
            said, least = (".".join(map(str, x)) for x in (self.capability, CAPABILITY))
            reason = f"{self.name} has compute capability {said}; {least} is needed"
            raise DeclarationError("device", reason, 'Use device="cpu"')
        self._call("cuDevicePrimaryCtxRetain", byref(self._context), device)
        self._known: dict[Any, list[Any]] = {}
        self._lock = Lock()

    def _call(self, name: str, *given: Any) -> None:
        """Call the driver in the context of this GPU, since any thread may call."""
        if self._context:
            self._driver.cuCtxSetCurrent(self._context)
        code = getattr(self._driver, name)(*given)
        if code == _NO_DEVICE:
            reason = "no CUDA device was found on this machine"
            raise DeclarationError("device", reason, 'Use device="cpu"')
        if code == _NO_MEMORY:
            raise StickslipError(
                f"{self.name}: its memory is full. Close other programs that use it"
            )
        if code:
            said = c_char_p()
            self._driver.cuGetErrorName(code, byref(said))
            raise StickslipError(f"the GPU: {name} fails with {(said.value or b'?').decode()}")

    def _attribute(self, number: int, device: c_int) -> int:
        found = c_int()
        self._call("cuDeviceGetAttribute", byref(found), number, device)
        return found.value

    # -- memory ------------------------------------------------------------------------------------

    def free(self) -> int:
        """Bytes that are free."""
        found, whole = c_size_t(), c_size_t()
        self._call("cuMemGetInfo_v2", byref(found), byref(whole))
        return found.value

    def allocate(self, size: int) -> int:
        """Address of so many bytes."""
        address = c_uint64()
        self._call("cuMemAlloc_v2", byref(address), size)
        return address.value

    def release(self, address: int) -> None:
        """Give bytes back; at the end of the process the driver has done so."""
        with suppress(StickslipError):
            self._call("cuMemFree_v2", address)

    def send(self, address: int, array: Array) -> None:
        """Copy an array to the GPU."""
        self._call("cuMemcpyHtoD_v2", address, array.ctypes.data, array.nbytes)

    def fetch(self, address: int, array: Array) -> None:
        """Copy from the GPU into an array."""
        self._call("cuMemcpyDtoH_v2", array.ctypes.data, address, array.nbytes)

    def copy(self, source: int, target: int, size: int) -> None:
        """Copy bytes within the GPU."""
        self._call("cuMemcpyDtoD_v2", target, source, size)

    # -- functions ---------------------------------------------------------------------------------

    def load(self, entries: Sequence[Entry], system: str) -> list[Any]:
        """Entries on the GPU, which call the functions of a system.

        Parameters
        ----------
        system : str
            LLVM assembly of its functions.
        """
        key = tuple(entries), system
        with self._lock:
            if key not in self._known:
                self._known[key] = self._loaded(entries, system)
            return self._known[key]

    def _loaded(self, entries: Sequence[Entry], system: str) -> list[Any]:
        module = c_void_p()
        self._call("cuModuleLoadData", byref(module), self._code(ptx_of(entries, system)))
        found = [c_void_p() for _ in entries]
        for place, entry in zip(found, entries, strict=True):
            self._call("cuModuleGetFunction", byref(place), module, entry.__name__.encode())
        return found

    def _code(self, ptx: bytes) -> bytes:
        """Machine code for this GPU, from disk or new."""
        version = c_int()
        self._call("cuDriverGetVersion", byref(version))
        key = digest(sha256(ptx).hexdigest(), self.capability, version.value)
        path = cache_folder() / f"gpu.{key[:24]}.cubin"
        code = stored(path, key)
        if code is None:
            code = self._assembled(ptx)
            keep(path, key, code)
        return code

    def _assembled(self, ptx: bytes) -> bytes:
        """Machine code from the driver's assembler.

        It takes each function by itself for what may be linked, which is done in seconds; for a
        whole program it takes minutes. The linker knows how much room the stack needs.
        """
        log = ctypes.create_string_buffer(_LOG)
        options = (c_int * 2)(_LOG_PLACE, _LOG_SIZE)
        values = (c_void_p * 2)(addressof(log), _LOG)
        linker, code, size = c_void_p(), c_void_p(), c_size_t()
        text = ctypes.create_string_buffer(ptx)
        self._call("cuLinkCreate_v2", len(options), options, values, byref(linker))
        try:
            self._call(
                "cuLinkAddData_v2", linker, _PTX, text, len(text), b"stickslip", 0, None, None
            )
            self._call("cuLinkComplete", linker, byref(code), byref(size))
            return ctypes.string_at(code, size.value)
        except StickslipError as error:
            raise StickslipError(f"{error} {log.value.decode(errors='replace')}".strip()) from None
        finally:
            self._call("cuLinkDestroy", linker)

    def launch(self, function: Any, words: Array, count: int) -> None:
        """Run the loaded function in a number of threads, and wait for them.

        Parameters
        ----------
        words : array of int
            All arguments but the last.
        """
        place = self.allocate(words.nbytes)
        try:
            self.send(place, words)
            given = c_uint64(place), c_int64(count)
            addresses = (c_void_p * len(given))(*map(addressof, given))
            blocks = -(-count // _THREADS)
            grid = blocks, 1, 1, _THREADS, 1, 1
            self._call("cuLaunchKernel", function, *grid, 0, None, addresses, None)
            self._call("cuCtxSynchronize")
        finally:
            self.release(place)


@cache
def _driver() -> Any:
    """The driver's library.

    Raises
    ------
    DeclarationError
        If it is not installed.
    """
    try:
        library = ctypes.CDLL(_DRIVER)
    except OSError:
        reason = f"NVIDIA's driver ({_DRIVER}) is not installed"
        raise DeclarationError("device", reason, 'Use device="cpu"') from None
    for name, kinds in _TAKES.items():
        getattr(library, name).argtypes = [_KINDS[kind] for kind in kinds]
    return library
