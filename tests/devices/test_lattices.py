"""Lattices on devices, run by OpenCL on the processor and compared with C."""

import numpy as np
import nvrtc
import pytest
from lattice.test_seams import text as seamed
from support import COMMAND
from systems import LATTICES, spec_of

import phigen
from phigen.api import compilation_of
from phigen.compiler import emit
from phigen.errors import DeviceError
from phigen.lattice.states import start_of
from phigen.runtime.devices.device import OutOfMemoryError
from phigen.runtime.devices.lattices import DeviceLattice
from phigen.runtime.interface import BackendError
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.lattice_series import recordable
from phigen.spec import loads

pytest.importorskip("pyopencl")

MONITORED = "pythagorean"
QUICK, LONGER = ("fput",), ("heisenberg", "thermal_heisenberg", "xxz_disorder", MONITORED)


def cases():
    for name in LATTICES:
        mark = () if name in QUICK else pytest.mark.slow if name in LONGER else pytest.mark.exhaustive
        yield pytest.param(name, marks=mark)


def both(source):
    compilation = compilation_of(source, profile="small")
    return [phigen.compile(compilation, target, profile="small") for target in ("opencl", "c")]


def beginning(name, interface):
    """Return a start for a lattice: a random state, the step size, and the other arguments (random parameters at sites,
    and a seed if there is noise).
    """
    rng, run = np.random.default_rng(0), next(iter(spec_of(name).runs.values()))
    if interface.graph or interface.pairs:
        start = start_of(spec_of(name), run)
        return start.state, float(run.step), start.arguments
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
    np.testing.assert_allclose(ours.t, theirs.t, rtol=1e-13)


def of_group_size(device, size):
    """Return the solver with another number of work items in a group."""
    files, interface = device.backend._files, device.interface
    other = DeviceLattice(files, interface, "opencl", {f"{interface.name}_GROUP": size})
    return LatticeSolver(other, interface, device.spec)


GRAPH = """
phigen: 1
name: net
lattice: {graph: bonds}
coordinates: [x, y, z]
parameters: {J: {value: 1, at: bonds}, B: {value: 0.3, at: sites}}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: {sites: -B*z, bonds: "-J*(x[a]*x[b] + y[a]*y[b] + z[a]*z[b]) - (x[a]*y[b] - y[a]*x[b])/5"}
casimirs: {C: x**2 + y**2 + z**2}
observables:
  total: {sum: z, over: sites}
  mean: {mean: x*y, over: sites}
  largest: {max: x, over: sites}
  bond: {mean: "x[a]*x[b]", over: bonds}
  least: {min: "z[a]*z[b]", over: bonds}
  height: z**2
"""


@pytest.mark.slow
def test_recorded_numbers_are_those_of_c_and_do_not_depend_on_the_size_of_work_groups():
    device, c = both(loads(GRAPH))
    rng = np.random.default_rng(1)
    bonds = np.array([(a, b) for a, b in rng.integers(0, 90, (150, 2)) if a != b])
    more = {"bonds": bonds, "J": rng.random(len(bonds)), "B": rng.random(90)}
    x, of = rng.standard_normal((3, 90)), recordable(c.interface)
    ours, theirs, others = (
        solver.series(x, 0.05, 6, of=of, stride=2, **more) for solver in (device, c, of_group_size(device, 5))
    )
    assert list(ours.columns) == list(theirs.columns) == ["energy", "total", "mean", "largest", "bond", "least"]
    for name in of:
        np.testing.assert_allclose(ours.columns[name], theirs.columns[name], rtol=1e-13, atol=1e-13)
        np.testing.assert_array_equal(ours.columns[name], others.columns[name])
    np.testing.assert_array_equal(ours.last, others.last)
    seen, expected = (solver.observables(ours.last, **more) for solver in (device, c))
    np.testing.assert_allclose(seen["height"], expected["height"], rtol=1e-14)


@pytest.mark.slow
def test_sites_on_seams_are_those_of_c():
    device, c = both(loads(seamed("layer", (3, 5), "small")))
    x = 1 + 0.3 * np.random.default_rng(0).standard_normal((3, 3, 5))
    ours, theirs = (solver.integrate(x, 0.1, 5) for solver in (device, c))
    np.testing.assert_allclose(ours.x, theirs.x, rtol=0, atol=1e-14)


@pytest.mark.slow
def test_stages_that_sweeps_do_not_solve_are_solved_by_newton_s_method(monkeypatch):
    device, c = both("kdv")
    solve, solved = device.backend.stepping._newton, []
    monkeypatch.setattr(device.backend.stepping, "_newton", lambda *a: solved.append(1) or solve(*a))
    x = 1 + 0.3 * np.random.default_rng(0).standard_normal((1, 8))
    ours, theirs = (solver.integrate(x, 0.3, 1) for solver in (device, c))
    np.testing.assert_allclose(ours.x, theirs.x, rtol=0, atol=1e-13)
    assert solved


CHAIN = """
phigen: 1
name: chain
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + (q[i+1]-q)**2/2 + (q[i+1]-q)**3/12
"""


@pytest.mark.slow
def test_compensated_sums_of_floats_are_those_of_c(tmp_path):
    """In single precision with compensated sums, states on devices are close to those of C, energy drifts no more than
    in C, and a resumed run has the same bits as an uninterrupted one.
    """
    device, c = both(loads(CHAIN + "real: float\nsolver: {compensated: true}\n"))
    x = 0.3 * np.random.default_rng(0).standard_normal((2, 32))
    ours, theirs = (solver.integrate(x, 0.05, 600, stride=60) for solver in (device, c))
    np.testing.assert_allclose(ours.x, theirs.x, rtol=0, atol=1e-5)
    assert np.ptp(ours.energy) < 1.5 * np.ptp(theirs.energy)
    session, resumed = (device.backend.start(x, {}) for _ in range(2))
    session.advance(0.05, 70)
    stored, state = session.saved(), session.state()
    assert np.abs(stored["compensation"]).max() > 0
    resumed.place(state)
    resumed.resume(0.05, 70, stored)
    for each in (session, resumed):
        each.advance(0.05, 70)
    np.testing.assert_array_equal(session.state(), resumed.state())


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


@pytest.mark.slow
def test_steps_equal_in_tau_keep_clock_and_state_of_failed_and_resumed_runs(monkeypatch):
    device, c = both(MONITORED)
    x, h, more = beginning(MONITORED, c.interface)
    session, resumed = (device.backend.start(x, more) for _ in range(2))
    session.advance(h, 7)
    stored, state, passed = session.saved(), session.state(), session.time()
    resumed.place(state)
    resumed.resume(h, 7, stored)
    for each in (session, resumed):
        each.advance(h, 5)
    np.testing.assert_array_equal(session.state(), resumed.state())
    assert session.time() == resumed.time() > passed > 0
    session.place(state)
    monkeypatch.setattr(session, "_failed", lambda: True)
    elapsed = session.time()
    with pytest.raises(BackendError, match="NOT_FINITE"):
        session.advance(h, 1)
    np.testing.assert_array_equal(session.state(), state)
    assert session.time() == elapsed
    with pytest.raises(BackendError, match="BAD_ARGUMENT"):  # a single body has no negative potential energy
        device.backend.start(x[:, :1], {"m": more["m"][:1]})


def test_a_run_on_a_device_that_was_lost_is_resumed_with_the_same_bits(monkeypatch, tmp_path):
    device, _ = both("fput")
    x, h, _ = beginning("fput", device.interface)
    expected, launch, launches = device.integrate(x, h, 20, stride=5), device.device.launch, []

    def lost(*arguments):
        launches.append(arguments)
        if len(launches) > 150:
            raise DeviceError("the device was lost")
        launch(*arguments)

    monkeypatch.setattr(device.device, "launch", lost)
    with pytest.raises(DeviceError, match=r"after step (5|10|15): "):
        device.integrate(x, h, 20, stride=5, checkpoints=tmp_path / "run.npz")
    monkeypatch.undo()
    resumed = device.integrate(x, h, 20, stride=5, checkpoints=tmp_path / "run.npz")
    np.testing.assert_array_equal(resumed.x, expected.x)


def test_lattices_that_exceed_the_memory_of_the_device_are_refused(monkeypatch):
    device, _ = both("fput")
    x, h, _ = beginning("fput", device.interface)

    def full(size):
        raise OutOfMemoryError("CL_MEM_OBJECT_ALLOCATION_FAILURE")

    monkeypatch.setattr(device.device, "empty", full)
    with pytest.raises(DeviceError, match=r"fput: too little memory for \(\d+,\) sites: CL_MEM"):
        device.integrate(x, h, 20)


@pytest.mark.skipif(not nvrtc.is_installed(), reason="the wheels of NVRTC and ptxas are not installed")
@pytest.mark.slow
@pytest.mark.parametrize("architecture", nvrtc.ARCHITECTURES)
@pytest.mark.parametrize(
    ("name", "kernels"),
    [
        ("xxz_disorder", ["sweep1", "sweep2", "sweep3", "energy", "reduce"]),
        ("kdv", ["relax", "increment", "slope", "combine"]),
        ("food_web", ["gather1_a", "gather1_b", "sweep1"]),
    ],
)
def test_kernels_compile_for_two_generations_of_cards(name, kernels, architecture, tmp_path):
    (text,) = emit(compilation_of(name, profile="small").program, "device", COMMAND).values()
    compiled = nvrtc.assembled(nvrtc.ptx(text, architecture), architecture, tmp_path)
    assert {f"{name}_{kernel}_kernel" for kernel in kernels} < compiled.keys()
    assert all(kernel.spilled == 0 for kernel in compiled.values())
