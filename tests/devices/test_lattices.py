"""Lattices on devices, by OpenCL on the processor, against C."""

import numpy as np
import nvrtc
import pytest
from support import COMMAND
from systems import LATTICES, spec_of

import phigen
from phigen.api import compilation_of
from phigen.compiler import emit
from phigen.errors import DeviceError, SpecError
from phigen.runtime.devices.lattices import DeviceLattice

pytest.importorskip("pyopencl")

QUICK, LONGER = ("fput",), ("heisenberg", "thermal_heisenberg", "xxz_disorder")
REFUSED = {
    "chiral_magnet": "interact in pairs",
    "food_web": "interact in pairs",
    "kdv": "implicit",
    "outer_planets": "interact in pairs",
    "point_vortices": "implicit",
}


def cases():
    for name in (n for n in LATTICES if n not in REFUSED):
        mark = () if name in QUICK else pytest.mark.slow if name in LONGER else pytest.mark.exhaustive
        yield pytest.param(name, marks=mark)


def both(name):
    compilation = compilation_of(name, profile="small")
    return [phigen.compile(compilation, target, profile="small") for target in ("opencl", "c")]


def beginning(name, interface):
    """A random state, a step, parameters at sites, and random numbers."""
    rng, run = np.random.default_rng(0), next(iter(spec_of(name).runs.values()))
    sizes = tuple(max(8, 2 * period * least) for period, least in zip(interface.periods, interface.least, strict=True))
    x = 1 + 0.1 * rng.standard_normal((len(interface.coordinates), *sizes))
    more = {"seed": 3} if interface.noise else {}
    return x, float(run.step), {**more, **{name: 0.5 + rng.random(sizes) for name in interface.at_sites}}


@pytest.mark.parametrize("name", [*cases()])
def test_fields_are_those_of_c(name):
    device, c = both(name)
    x, h, more = beginning(name, c.interface)
    ours, theirs = (solver.integrate(x, h, 20, stride=5, **more) for solver in (device, c))
    np.testing.assert_allclose(ours.x, theirs.x, rtol=0, atol=1e-14 * np.abs(theirs.x).max())
    np.testing.assert_allclose(ours.energy, theirs.energy, rtol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("name", REFUSED)
def test_lattices_without_kernels_are_refused(name):
    program = compilation_of(name, profile="small").program
    with pytest.raises(SpecError, match=REFUSED[name]):
        emit(program, "device", COMMAND)


@pytest.mark.slow
def test_bits_do_not_depend_on_the_size_of_work_groups():
    device, _ = both("fput")
    x, h, _ = beginning("fput", device.interface)
    files, interface = device.backend._files, device.interface
    other = DeviceLattice(files, interface, "opencl", {"fput_GROUP": 3})
    session = other.start(x, dict(interface.parameters))
    session.advance(h, 20)
    np.testing.assert_array_equal(session.state(), device.integrate(x, h, 20).x[-1])


@pytest.mark.slow
def test_a_failing_step_leaves_the_state_before_it():
    device, c = both("fput")
    x, _, _ = beginning("fput", c.interface)
    x[:, 2] = 30
    errors = []
    for solver in (device, c):
        with pytest.raises(phigen.StepError) as raised:
            solver.integrate(x, 0.5, 200, stride=1)
        errors.append(raised.value)
    assert errors[0].step == errors[1].step > 0
    assert errors[0].status == errors[1].status == "NOT_FINITE"
    np.testing.assert_allclose(errors[0].trajectory.x[-1], errors[1].trajectory.x[-1], rtol=1e-9)


def test_a_lost_device_says_where_the_run_can_be_resumed(monkeypatch):
    device, _ = both("fput")
    x, h, _ = beginning("fput", device.interface)

    def lost(*arguments):
        raise DeviceError("the device was lost")

    monkeypatch.setattr(device.device, "launch", lost)
    with pytest.raises(DeviceError, match="checkpoints="):
        device.integrate(x, h, 20)


@pytest.mark.skipif(not nvrtc.is_installed(), reason="the wheels of NVRTC and ptxas are not installed")
@pytest.mark.slow
@pytest.mark.parametrize("architecture", nvrtc.ARCHITECTURES)
def test_kernels_compile_for_two_generations_of_cards(architecture, tmp_path):
    (text,) = emit(compilation_of("xxz_disorder", profile="small").program, "device", COMMAND).values()
    compiled = nvrtc.assembled(nvrtc.ptx(text, architecture), architecture, tmp_path)
    assert {f"xxz_disorder_sweep{k}_kernel" for k in (1, 2, 3)} < compiled.keys()
    assert all(kernel.spilled == 0 for kernel in compiled.values())
