"""The target cuda, with an imitation of CuPy that runs kernels on the processor; see `cupy_by_hand`."""

import sys

import numpy as np
import pytest
from devices import cupy_by_hand
from support import compile_text
from systems import spec_of

import phigen
from phigen.api import compilation_of
from phigen.errors import DeviceError, MissingPackageError
from phigen.lattice.states import start_of
from phigen.runtime.devices import cuda

BODY = """
coordinates: [x1, x2, x3]
parameters: {I1: 1, I2: 2}
poisson:
  brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}
hamiltonian: (x1**2/I1 + x2**2/I2 + x3**2/3)/2
order: 2
"""


@pytest.fixture
def cupy(monkeypatch):
    """Replace the package cupy by the imitation, and return it."""
    module = cupy_by_hand.module()
    monkeypatch.setitem(sys.modules, "cupy", module)
    monkeypatch.setattr(cuda, "_OPENED", {})
    return module


def both(source):
    compilation = compilation_of(source, profile="small")
    return [phigen.compile(compilation, target, profile="small") for target in ("cuda", "c")]


@pytest.mark.slow
def test_members_have_the_bits_of_c(cupy):
    """Members agree bit by bit with C: with coefficients that all members share, passed by value, and with different
    parameters and steps.
    """
    device, c = both(compile_text(BODY))
    assert repr(device.device) == "<CUDA device: Emulated card, 1024 MiB>"
    x0 = np.random.default_rng(2).standard_normal((300, 3)) + 1
    member_values = {"h": np.linspace(0.01, 0.1, 300), "I1": np.linspace(1, 2, 300)}
    for more in ({"h": 0.1}, member_values):
        arguments = {"X0": x0, "steps": 20, "stride": 6, **more}
        np.testing.assert_array_equal(device.ensemble(**arguments), c.ensemble(**arguments))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fput", "pythagorean"])
def test_fields_are_those_of_c(name, cupy):
    device, c = both(name)
    run = next(iter(spec_of(name).runs.values()))
    start = start_of(spec_of(name), run)
    ours, theirs = (s.integrate(start.state, float(run.step), 9, stride=4, **start.arguments) for s in (device, c))
    np.testing.assert_allclose(ours.x, theirs.x, rtol=0, atol=1e-14 * np.abs(theirs.x).max())
    np.testing.assert_allclose(ours.energy, theirs.energy, rtol=1e-13)


@pytest.mark.slow
def test_faults_of_a_card_are_reported_and_lose_no_members(cupy, monkeypatch):
    device, c = both(compile_text(BODY))
    x0 = np.random.default_rng(2).standard_normal((100, 3)) + 1
    expected, call = c.ensemble(x0, 0.1, 5), cupy_by_hand.RawKernel.__call__
    failing = [
        cupy_by_hand.CUDADriverError(f"CUDA_ERROR_{word}") for word in ("OUT_OF_MEMORY", "LAUNCH_OUT_OF_RESOURCES")
    ]
    launches = []

    def launch(kernel, grid, block, args, **others):
        launches.append(grid)
        if len(launches) > 1 and failing:
            raise failing.pop()
        call(kernel, grid, block, args, **others)

    monkeypatch.setattr(cupy_by_hand.RawKernel, "__call__", launch)
    np.testing.assert_array_equal(device.ensemble(x0, 0.1, 5), expected)
    assert launches == [(1,)] * 7  # coefficients; then all members, one half, four quarters
    launches.clear()
    failing += [cupy_by_hand.CUDADriverError("CUDA_ERROR_ILLEGAL_ADDRESS: an illegal memory access")]
    with pytest.raises(
        DeviceError, match=r"(?s)Emulated card: the device was lost.*ILLEGAL_ADDRESS.*start Python again"
    ):
        device.ensemble(x0, 0.1, 5)
    full = cupy_by_hand.OutOfMemoryError("Out of memory allocating 4,194,304 bytes")
    monkeypatch.setattr(cupy, "empty", lambda *a, **k: (_ for _ in ()).throw(full))
    with pytest.raises(DeviceError, match=r"Emulated card has too little memory for one member: Out of memory"):
        device.ensemble(x0, 0.1, 5)


def test_text_that_nvrtc_refuses_is_an_error_with_its_messages(cupy):
    with pytest.raises(DeviceError, match=r"Emulated card: NVRTC refuses the generated code\n.*error"):
        cuda.device().compiled("nonsense", {})


@pytest.mark.slow
def test_a_second_card_has_arrays_and_kernels_of_its_own(monkeypatch):
    monkeypatch.setitem(sys.modules, "cupy", cupy_by_hand.module(cards=2))
    monkeypatch.setattr(cuda, "_OPENED", {})
    compilation = compilation_of(compile_text(BODY), profile="small")
    x0 = np.random.default_rng(2).standard_normal((10, 3)) + 1
    expected = phigen.compile(compilation, "c", profile="small").ensemble(x0, 0.1, 5)
    for index in (1, 0):
        solver = phigen.compile(compilation, "cuda", profile="small", device=index)
        cupy_by_hand.RawKernel.launched.clear()
        np.testing.assert_array_equal(solver.ensemble(x0, 0.1, 5), expected)
        assert cupy_by_hand.RawKernel.launched == [index] * 2  # one launch for coefficients, one for members
    with pytest.raises(
        TypeError, match="device is '1', but must be a number; the devices of CUDA are 0: Emulated card"
    ):
        phigen.compile(compilation, "cuda", profile="small", device="1")


def test_without_nvrtc_the_error_says_what_to_install(cupy, monkeypatch):
    """CuPy loads NVRTC at the first compilation; if that fails, the error names the package to install."""

    def absent(module):
        raise RuntimeError('Failure finding "libnvrtc.so.12"')

    monkeypatch.setattr(cupy_by_hand.RawModule, "compile", absent)
    with pytest.raises(
        MissingPackageError, match=r"(?s)Emulated card: NVRTC.*libnvrtc.so.12.*pip install 'phigen\[cuda\]'"
    ):
        cuda.device().compiled("", {})

    def unloadable(module):
        raise cupy_by_hand.CUDADriverError("CUDA_ERROR_NO_BINARY_FOR_GPU")

    monkeypatch.setattr(cupy_by_hand.RawModule, "compile", unloadable)
    with pytest.raises(DeviceError, match="driver failed: CUDA_ERROR_NO_BINARY_FOR_GPU"):
        cuda.device().compiled("", {})


def test_a_machine_without_a_card_or_driver_is_told_what_to_install(cupy, monkeypatch):
    monkeypatch.setattr(cupy.cuda.runtime, "getDeviceCount", lambda: 0)
    with pytest.raises(DeviceError, match="CUDA has no card; install NVIDIA's driver, or use target opencl"):
        phigen.compile("pendulum_euler", "cuda")

    def insufficient():
        raise cupy_by_hand.CUDARuntimeError("cudaErrorInsufficientDriver")

    monkeypatch.setattr(cupy.cuda.runtime, "getDeviceCount", insufficient)
    with pytest.raises(DeviceError, match=r"CUDA has no driver, .*cudaErrorInsufficientDriver"):
        phigen.compile("pendulum_euler", "cuda")


def test_without_its_package_the_target_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "cupy", None)
    monkeypatch.setattr(cuda, "_OPENED", {})
    with pytest.raises(MissingPackageError, match=r"pip install 'phigen\[cuda\]'"):
        phigen.compile("pendulum_euler", "cuda")


def test_imitation_of_cupy_has_the_signatures_of_cupy():
    """The functions of the imitation have the signatures of the installed CuPy, which can be imported without a
    graphics card.
    """
    real = pytest.importorskip("cupy")
    signatures = {
        real.RawModule: "RawModule(str code=None, *, str path=None, tuple options=(), str backend='nvrtc'",
        real.RawModule.compile: "compile(self, log_stream=None)",
        real.RawModule.get_function: "get_function(self, str name)",
        real.RawKernel.__call__: "__call__(self, grid, block, args",
        real.ndarray.set: "set(self, arr, stream=None)",
        real.ndarray.get: "get(self, stream=None, order='C', out=None, blocking=True)",
        real.cuda.runtime.getDeviceProperties: "getDeviceProperties(int device)",
        real.cuda.Device: "Device(device=None)",
    }
    for function, signature in signatures.items():
        assert signature in function.__doc__
    assert {"max_threads_per_block", "local_size_bytes"} <= vars(real.RawKernel).keys()
    for error in (
        real.cuda.memory.OutOfMemoryError,
        real.cuda.driver.CUDADriverError,
        real.cuda.runtime.CUDARuntimeError,
        real.cuda.compiler.CompileException,
    ):
        assert issubclass(error, Exception)
