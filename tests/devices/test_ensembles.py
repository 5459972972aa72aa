"""Ensembles on devices, run by OpenCL on the processor and compared with C."""

import math
import pickle
import re
from types import SimpleNamespace

import numpy as np
import pytest
from support import compile_text
from systems import spec_of

import phigen
from phigen import resources
from phigen.api import compilation_of, interface_of
from phigen.compiler import emit
from phigen.errors import DeviceError, PhigenWarning
from phigen.runtime.devices import opencl
from phigen.runtime.devices.device import OutOfMemoryError
from phigen.sweeping.devices import own_device, workers_of
from phigen.symbolic.expression import topological
from phigen.targets.device.registers import spilling

pytest.importorskip("pyopencl")

#: Functions whose last bits depend on the mathematical library; all other operations give the same bits everywhere.
TRANSCENDENTAL = {"exp", "expm1", "log", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh", "atan", "anomaly"}

CORPUS = sorted(path.stem for path in resources.bundled_specs().glob("*.yaml"))
BODY = """
coordinates: [x1, x2, x3]
parameters: {I1: 1, I2: 2}
poisson:
  brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}
hamiltonian: (x1**2/I1 + x2**2/I2 + x3**2/3)/2
casimirs: {C: x1**2 + x2**2 + x3**2}
order: 2
"""
#: Systems for quick tests. `LONGER` has one for each kind of step, with time, with noise and with a monitor; the rest
#: of the corpus needs --corpus.
QUICK = ("pendulum_euler",)
LONGER = (
    "kepler_eccentric",
    "rigid_body",
    "nambu_pendulum",
    "kowalevski_gauss",
    "seasonal_predator_prey",
    "thermal_spin",
)


def cases():
    for name in CORPUS:
        mark = () if name in QUICK else pytest.mark.slow if name in LONGER else pytest.mark.exhaustive
        yield pytest.param(name, marks=mark)


def both(source):
    """Return the solvers of a system in OpenCL and in C, both with the profile small."""
    compilation = compilation_of(source, profile="small")
    return [phigen.compile(compilation, target, profile="small") for target in ("opencl", "c")]


def starts(name, members):
    run = next(iter(spec_of(name).runs.values()))
    start = np.array([float(v) for v in run.initial])
    return start * (1 + 1e-3 * np.random.default_rng(1).standard_normal((members, len(start)))), float(run.step)


@pytest.mark.parametrize("name", [*cases()])
def test_members_are_those_of_c(name):
    """Members agree with C, bit by bit if the system calls no function of `TRANSCENDENTAL` and has no noise. With noise
    both draw the same random numbers.
    """
    device, c = both(name)
    x0, h = starts(name, 5)
    drawn = {"seed": 7} if c.interface.noise else {}
    frames, expected = (solver.ensemble(x0, h, 40, stride=7, **drawn) for solver in (device, c))
    program = compilation_of(name, profile="small").program
    called = {e.op for kernel in program.kernels for e in topological([*kernel.roots])}
    if called.isdisjoint(TRANSCENDENTAL) and not c.interface.noise:
        np.testing.assert_array_equal(frames, expected)
    np.testing.assert_allclose(frames, expected, rtol=0, atol=1e-14 * np.abs(expected).max())


@pytest.fixture(scope="module")
def body():
    return both(compile_text(BODY))


@pytest.fixture
def x0():
    return np.random.default_rng(2).standard_normal((100, 3)) + 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "source",
    [
        BODY,
        BODY.replace("order: 2", "order: 4\nscheme: splitting"),
        BODY.replace("order: 2", "order: 6\ncomposition: yoshida"),
    ],
)
def test_members_with_common_coefficients_have_the_bits_of_others(source, x0):
    device = phigen.compile(compile_text(source), "opencl", profile="small")
    gauge = np.array([0.3]) if "t_GAUGES" in device.backend._header else None
    fixed = device.backend if gauge is None else device.backend.with_gauge(gauge)
    solver = type(device)(fixed, device.interface)
    common = solver.ensemble(x0, 0.1, 20)
    run = solver.ensemble(x0, np.full(100, 0.1), 20)
    assert set(fixed._compiled) == {True, False}
    np.testing.assert_array_equal(common, run)


@pytest.mark.slow
def test_members_have_parameters_and_steps_of_their_own(body, x0):
    device, c = body
    member_values = {"h": np.linspace(0.01, 0.1, 100), "I1": np.linspace(1, 2, 100)}
    np.testing.assert_array_equal(
        device.ensemble(x0, steps=20, **member_values), c.ensemble(x0, steps=20, **member_values)
    )


@pytest.mark.parametrize("size", [pytest.param(1, marks=pytest.mark.slow), 48])
def test_bits_do_not_depend_on_the_size_of_work_groups(body, x0, size):
    device, _ = body
    again = pickle.loads(pickle.dumps(device))
    again.backend.defined["t_GROUP"] = size
    np.testing.assert_array_equal(again.ensemble(x0, 0.1, 20, stride=4), device.ensemble(x0, 0.1, 20, stride=4))


def test_work_groups_are_smaller_where_shared_memory_is_little(body, x0, monkeypatch):
    """The predictor of a member takes 216 bytes of shared memory, so 20 kB suffice for 92 members, and groups of 64 are
    chosen.
    """
    device, _ = body
    again = pickle.loads(pickle.dumps(device))
    assert again.backend._group() == {}
    monkeypatch.setattr(again.device, "shared", 20_000)
    assert again.backend._group() == {"t_GROUP": 64}
    np.testing.assert_array_equal(again.ensemble(x0, 0.1, 20, stride=4), device.ensemble(x0, 0.1, 20, stride=4))


@pytest.mark.slow
def test_work_groups_are_no_larger_than_a_device_can_run(x0, monkeypatch):
    """Groups have at most the size that the device allows: for ensembles with and without predictors in shared memory,
    and for lattices.
    """
    device, compiled = opencl.device(), []
    build = device.compiled
    monkeypatch.setattr(device, "group", 40)
    monkeypatch.setattr(device, "compiled", lambda text, defined: compiled.append(defined) or build(text, defined))
    for source in (compile_text(BODY), "pendulum_euler"):
        ours, c = both(source)
        start = x0[:, : ours.interface.dimension]
        np.testing.assert_allclose(ours.ensemble(start, 0.1, 5), c.ensemble(start, 0.1, 5), rtol=0, atol=1e-13)
    ours, c = both("toda")
    start = 0.1 + np.zeros((2, 50))
    np.testing.assert_allclose(ours.integrate(start, 0.1, 5).x, c.integrate(start, 0.1, 5).x, rtol=0, atol=1e-13)
    assert [n for macros in compiled for name, n in macros.items() if name.endswith("_GROUP")] == [32] * len(compiled)


def test_failed_members_have_the_statuses_of_c(body, x0):
    x0[3], x0[50] = 1e200, 1e60
    errors = []
    for solver in body:
        with pytest.raises(phigen.StepError) as raised:
            solver.ensemble(x0, 0.1, 20, stride=5)
        errors.append(raised.value)
    assert errors[0].members == errors[1].members == (3, 50)
    assert errors[0].status == errors[1].status
    np.testing.assert_array_equal(errors[0].trajectory, errors[1].trajectory)


def test_ensembles_that_exceed_the_memory_are_divided(body, x0, monkeypatch):
    device, _ = body
    expected = device.ensemble(x0, 0.1, 20, stride=4)
    monkeypatch.setattr(device.device, "memory", 20_000)
    assert 1 < device.backend._batch(device._members(x0, 0.1, 20, 4, None, {}, None, {})) < 100
    np.testing.assert_array_equal(device.ensemble(x0, 0.1, 20, stride=4), expected)


def test_a_launch_without_memory_is_divided(body, x0, monkeypatch):
    device, _ = body
    expected, launch, sizes = device.ensemble(x0, 0.1, 20), device.device.launch, []

    def limited(kernel, items, *rest):
        sizes.append(items)
        if items > 64:
            raise OutOfMemoryError("CL_OUT_OF_RESOURCES")
        launch(kernel, items, *rest)

    monkeypatch.setattr(device.device, "launch", limited)
    np.testing.assert_array_equal(device.ensemble(x0, 0.1, 20), expected)
    assert sizes == [1, 100, 50, 50]  # work items: coefficients, all members, two halves


def test_a_lost_device_leaves_the_members_that_are_done(body, x0, monkeypatch):
    device, _ = body
    expected, launch, launches = device.ensemble(x0, 0.1, 20), device.device.launch, []

    def lost(*arguments):
        launches.append(arguments)
        if len(launches) > 2:  # the coefficients and the first batch succeed
            raise DeviceError("the device was lost")
        launch(*arguments)

    monkeypatch.setattr(device.backend, "_batch", lambda members: 40, raising=False)
    monkeypatch.setattr(device.device, "launch", lost)
    with pytest.raises(DeviceError, match="members from 40 on were not integrated") as raised:
        device.ensemble(x0, 0.1, 20)
    np.testing.assert_array_equal(raised.value.trajectory[:40], expected[:40])
    assert np.isnan(raised.value.trajectory[40:]).all()


def test_a_machine_without_a_driver_is_told_what_to_install(monkeypatch):
    cl = pytest.importorskip("pyopencl")
    monkeypatch.setattr(opencl, "_OPENED", {})
    monkeypatch.setattr(cl, "get_platforms", list)
    with pytest.raises(DeviceError, match="pip install 'pyopencl"):
        phigen.compile("pendulum_euler", "opencl")


def test_a_device_without_double_precision_is_refused(monkeypatch):
    monkeypatch.setattr(opencl.device(), "double", False)
    with pytest.raises(DeviceError, match="real: float"):
        phigen.compile("pendulum_euler", "opencl")


def test_an_array_that_exceeds_the_memory_of_the_device_is_one():
    device = opencl.device()
    with pytest.raises(OutOfMemoryError):
        device.empty(2 * device.largest + device.memory)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("rigid_body", {}),
        ("henon_heiles", {"order": 6}),
        ("rigid_body", {"order": 4, "scheme": "splitting"}),
        ("pendulum_euler", {}),
        ("thermal_spin", {}),
        ("kowalevski_gauss", {}),
        ("nambu_pendulum", {}),
    ],
)
def test_sizes_of_kernels_are_those_of_the_generated_code(name, options):
    """The sizes in the Python interface equal the constants in the generated code, since they have the same sources."""
    program = compilation_of(name, profile="small", **options).program
    (text,) = emit(program, "device", "phigen build").values()

    def constants(*names):
        matches = {n: re.search(rf"{program.name}_{n} =? ?(\d+)", text) for n in names}
        return [int(match[1]) for match in matches.values() if match]

    launch = interface_of(program).ensemble
    assert constants("GROUP") == [launch.group]
    shared = math.prod(constants("STAGES", "DIFFERENCES", "DIM")) if f"{program.name}_LENT" in text else 0
    assert launch.predictors == shared
    common = math.prod(constants("STAGES", "COEFFICIENTS")) if f"{program.name}_COMMON" in text else 0
    assert (launch.coefficients, launch.gauges) == (common, sum(constants("GAUGES")))


def test_steps_that_a_card_runs_slowly_are_warned_of(body, x0, monkeypatch):
    """If the driver reports that the kernel uses memory besides registers, running an ensemble gives a warning."""
    device, _ = body
    again = pickle.loads(pickle.dumps(device))
    monkeypatch.setattr(again.device, "is_card", True)
    monkeypatch.setattr(again.device, "local_bytes", lambda kernel: 880)
    with pytest.warns(
        PhigenWarning,
        match=r"t: each member uses 880 bytes of .* besides registers, which is slow; give all members the same",
    ):
        again.ensemble(x0, 0.1, 1)


def test_files_say_which_steps_spill_registers():
    """The header of the generated code names steps that spill registers, by measurements with the CUDA compiler; see
    docs/devices.md.
    """
    (text,) = emit(compilation_of("kepler", order=6, profile="small").program, "device", "phigen build").values()
    note = (
        "the steps of kepler (4 coordinates, 118 coefficients) need more registers than cards have (kepler of order 6"
    )
    assert f"{note} spills 2.8 kB): take a lower order, or scheme" in " ".join(text.split("*/")[0].split())
    body = spilling(compilation_of("rigid_body", order=8, profile="small").program)
    assert (
        "(3 coordinates, 80 coefficients) need more registers than cards have (rigid_body of order 8 spills 8.1" in body
    )
    for name, order in (("rigid_body", 6), ("kepler", 4), ("henon_heiles", 6), ("kepler_eccentric", None)):
        assert not spilling(compilation_of(name, order=order, profile="small").program)
    assert "memory of cards" in spilling(compilation_of("nambu_pendulum", profile="small").program)


def test_an_unknown_device_is_refused_with_those_there_are(monkeypatch):
    monkeypatch.setattr(opencl, "_OPENED", {})
    monkeypatch.setenv("PHIGEN_DEVICE", "voodoo")
    with pytest.raises(DeviceError, match="PHIGEN_DEVICE is 'voodoo', but OpenCL has the devices 0: "):
        phigen.compile("pendulum_euler", "opencl")


def test_devices_have_numbers_and_workers_take_them_in_turn(monkeypatch):
    distributed = pytest.importorskip("distributed")
    one = opencl._listed(opencl._library())[0]
    monkeypatch.setattr(opencl, "_OPENED", {})
    monkeypatch.setattr(opencl, "_listed", lambda cl: [one, one])
    second = phigen.compile("pendulum_euler", "opencl", device=1)
    assert second.device is opencl.device(1) is not opencl.device(0)
    assert pickle.loads(pickle.dumps(second)).device is second.device
    with pytest.raises(DeviceError, match=r"device is 2, but OpenCL has the devices 0: .*; 1: "):
        phigen.compile("pendulum_euler", "opencl", device=2)
    with pytest.raises(ValueError, match="device=1 is for the targets opencl and cuda, not 'c'"):
        phigen.compile("pendulum_euler", "c", device=1)
    assert workers_of("opencl") == 2
    assert own_device("opencl") is None
    for name, number in ((0, 0), (1, 1), (2, 0), ("tcp://127.0.0.1:8786", None)):
        monkeypatch.setattr(distributed, "get_worker", lambda name=name: SimpleNamespace(name=name))
        assert own_device("opencl") == number
    monkeypatch.setenv("PHIGEN_DEVICE", "1")
    assert (workers_of("opencl"), own_device("opencl")) == (1, None)


def test_solvers_are_pickled_and_tell_their_device(body, x0):
    device, _ = body
    again = pickle.loads(pickle.dumps(device))
    np.testing.assert_array_equal(again.ensemble(x0, 0.1, 3), device.ensemble(x0, 0.1, 3))
    assert device.device.name == again.device.name
    assert device.device.memory > 0


def test_trajectories_and_observables_are_those_of_the_host(body):
    device, c = body
    ours, theirs = (solver.integrate([1, 0.2, 0.1], 0.1, 10) for solver in (device, c))
    np.testing.assert_allclose(ours.x, theirs.x, atol=1e-14)
    np.testing.assert_allclose(ours.energy, theirs.energy, atol=1e-14)
