"""What is asked of NVIDIA's driver, and what is said where it fails: the driver is a stand-in on
this processor."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import DeclarationError, StickslipError
from stickslip.machine_code import cuda
from stickslip.machine_code.cuda import Cuda
from stickslip.machine_code.emulated import Emulated
from stickslip.machine_code.words import Elsewhere, by_python
from stickslip.orbits.settling.engine.threads import advance_thread, grow_thread
from stickslip.sweeps.work import device
from stickslip.translator.values import ArrayType, TupleType

ENTRIES = advance_thread, grow_thread


class Driver:
    """The driver's functions, of which all that are not written here do nothing.

    Attributes
    ----------
    calls : list of str
        So far.
    fails : dict
        Errors by the names of functions.
    """

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.fails: dict[str, int] = {}
        self.capability = {75: 8, 76: 0}
        self.gpu = Emulated()
        self.current: Any = None

    def __getattr__(self, name: str) -> Callable[..., int]:
        kinds = cuda._TAKES[name]
        work = getattr(type(self), f"on_{name.removesuffix('_v2')}", lambda *given: None)

        def call(*given: Any) -> int:
            assert len(given) == len(kinds), name
            if name not in ("cuCtxSetCurrent", "cuGetErrorName"):
                self.calls.append(name)
            if name not in self.fails:
                work(self, *given)
            return self.fails.get(name, 0)

        return call

    def on_cuCtxSetCurrent(self, context: Any) -> None:
        self.current = context

    def on_cuDevicePrimaryCtxRetain(self, context: Any, number: Any) -> None:
        context._obj.value = 17

    def on_cuGetErrorName(self, code: int, said: Any) -> None:
        said._obj.value = b"CUDA_ERROR_OF_SOME_KIND"

    def on_cuDeviceGetName(self, text: Any, size: int, number: Any) -> None:
        text.value = b"Stand-in"

    def on_cuDeviceGetAttribute(self, found: Any, number: int, device: Any) -> None:
        found._obj.value = self.capability[number]

    def on_cuMemGetInfo(self, free: Any, total: Any) -> None:
        free._obj.value = self.gpu.free()

    def on_cuMemAlloc(self, address: Any, size: int) -> None:
        assert self.current.value == 17, "a call in no context"
        address._obj.value = self.gpu.allocate(size)

    def on_cuMemFree(self, address: int) -> None:
        self.gpu.release(address)

    def on_cuMemcpyHtoD(self, target: int, source: int, size: int) -> None:
        ctypes.memmove(target, source, size)

    on_cuMemcpyDtoH = on_cuMemcpyDtoD = on_cuMemcpyHtoD

    def on_cuLinkCreate(self, count: int, options: Any, values: Any, linker: Any) -> None:
        assert list(options) == [5, 6] and count == 2
        self.log = values[0]

    def on_cuLinkAddData(self, linker: Any, kind: int, text: Any, size: int, *rest: Any) -> None:
        assert kind == 1 and text.raw[:size] == b"some PTX\0"
        ctypes.memmove(self.log, b"line 7: wrong", 13)

    def on_cuLinkComplete(self, linker: Any, code: Any, size: Any) -> None:
        self.code = ctypes.create_string_buffer(b"machine code")
        code._obj.value, size._obj.value = ctypes.addressof(self.code), 12

    def on_cuModuleLoadData(self, module: Any, code: bytes) -> None:
        assert code == b"machine code"

    def on_cuModuleGetFunction(self, place: Any, module: Any, name: bytes) -> None:
        names = [entry.__name__.encode() for entry in ENTRIES]
        place._obj.value = 1 + names.index(name)

    def on_cuLaunchKernel(self, function: Any, *given: Any) -> None:
        *grid, shared, stream, addresses, _ = given
        assert grid[1:] == [1, 1, 64, 1, 1] and not shared and not stream
        place, count = (ctypes.c_int64.from_address(address).value for address in addresses)
        assert grid[0] * 64 - 64 < count <= grid[0] * 64
        words = self.gpu._memory[place].view(np.int64)
        self.gpu.launch(ENTRIES[function.value - 1], words, count)


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Driver:
    """A stand-in; nothing is really translated."""
    made = Driver()
    monkeypatch.setattr(cuda, "_driver", lambda: made)
    monkeypatch.setattr(cuda, "ptx_of", lambda entries, system: b"some PTX")
    monkeypatch.setenv("STICKSLIP_CACHE", str(tmp_path))
    return made


def test_a_map_by_the_driver(driver: Driver, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "check_device", lambda: None)
    monkeypatch.setattr(device, "find_device", Cuda)
    given = ss.catalogue.rocking_toy(), {"P": [1.0, 1.1]}, ["speed", "period"]
    there, here = ss.sweep(*given, device="gpu"), ss.sweep(*given)
    assert "cuLaunchKernel" in driver.calls and driver.gpu.taken == 0
    for name in ("outcome", "speed", "period"):
        np.testing.assert_allclose(there[name], here[name], rtol=1e-12, atol=1e-12)


def test_machine_code_is_kept(driver: Driver) -> None:
    """By GPU and by driver."""
    Cuda().load(ENTRIES, "a system")
    assert driver.calls.count("cuLinkComplete") == 1
    gpu = Cuda()
    first = gpu.load(ENTRIES, "a system")
    assert first is gpu.load(ENTRIES, "a system")
    assert [function.value for function in first] == [1, 2]
    assert driver.calls.count("cuLinkComplete") == 1
    driver.capability[75] = 9
    Cuda().load(ENTRIES, "a system")
    assert driver.calls.count("cuLinkComplete") == 2


@pytest.mark.parametrize(
    ("function", "error", "said"),
    [
        ("cuInit", 100, "device: no CUDA device was found on this machine. Use device="),
        ("cuInit", 999, "the GPU: cuInit fails with CUDA_ERROR_OF_SOME_KIND"),
        ("cuMemAlloc_v2", 2, "Stand-in: its memory is full"),
        ("cuLinkComplete", 218, "cuLinkComplete fails with CUDA_ERROR_OF_SOME_KIND line 7: wrong"),
        ("cuCtxSynchronize", 700, "cuCtxSynchronize fails with CUDA_ERROR_OF_SOME_KIND"),
    ],
)
def test_it_says_what_fails(driver: Driver, function: str, error: int, said: str) -> None:
    driver.fails[function] = error
    with pytest.raises(StickslipError, match=said.replace(".", "\\.")):
        gpu = Cuda()
        function, _ = gpu.load(ENTRIES, "a system")
        gpu.launch(function, np.zeros(0, np.int64), 0)
    assert driver.gpu.taken == 0
    assert driver.calls.count("cuLinkCreate_v2") == driver.calls.count("cuLinkDestroy")


def test_an_old_gpu_is_refused(driver: Driver) -> None:
    driver.capability = {75: 6, 76: 1}
    with pytest.raises(DeclarationError, match=r"Stand-in has compute capability 6\.1; 7\.0 is"):
        Cuda()


def test_arrays_elsewhere_are_words() -> None:
    """Their address and lengths, if they are of the type."""
    there = Elsewhere(4096, (2, 3), np.dtype(np.float64))
    wanted = TupleType(tuple, (ArrayType("f8", 2),))
    found = by_python(wanted, (there,))
    assert found is not None and list(found) == [4096, 2, 3]
    for other in (ArrayType("f8", 1), ArrayType("i8", 2)):
        assert by_python(TupleType(tuple, (other,)), (there,)) is None
    assert by_python(wanted, (4096,)) is None
