"""Benchmark of a graphics card against one processor core: ensembles, spins on a cubic lattice, and diffrax.

``python -m benchmarks --only devices`` uses the card that CuPy finds, or else the first device of OpenCL; ``--target``
and the variable PHIGEN_DEVICE choose another. A processor with an OpenCL driver can run everything too, with fewer
members.

Calls of `ensemble` and `integrate` in Python are timed. The time of a step is the difference between a long and a short
run, divided by the difference of their numbers of steps. So copies and launches, which occur in every run, do not
count. The tables also state the time of the long run, divided by its number of steps. Before anything is timed, states
are compared with those of the solver in C.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

import phigen
from benchmarks.lattices import CUBE
from benchmarks.problems import PROBLEMS
from benchmarks.tables import machine, table
from phigen import spec as specs
from phigen.api import compilation_of
from phigen.errors import DeviceError, MissingPackageError, PhigenError
from phigen.runtime.devices.opening import device_of

BODY, STEP = PROBLEMS[0], 0.1
OSCILLATORS = (
    "phigen: 1\nname: bench\ncoordinates: [x, y, px, py]\npoisson: {canonical: {q: [x, y], p: [px, py]}}\n"
    "hamiltonian: (px**2 + py**2 + x**2 + y**2)/2 + x**2*y - y**3/3\norder: 4\nscheme: splitting\n"
)
#: Least and largest number of steps of a short run, and the factor by which a long run has more steps.
STEPS, MOST_STEPS, LONGER = 200, 51_200, 3
#: Largest number of members: a card has its full throughput with fewer.
MOST_MEMBERS = 10_000_000
#: Numbers of blocks that a CUDA multiprocessor is asked to run at once; with 1, a thread may use most registers.
BLOCKS = (1, 3, 4, 5)

Run = Callable[[int, int], float]
"""Function that makes a run with a number of members and a number of steps, and returns its seconds."""


def bodies(members: int) -> np.ndarray:
    """Return random momenta (members, 3) of rigid bodies on the sphere |x|² = 3, whose energies vary by a factor of
    three."""
    x = np.random.default_rng(1).normal(size=(members, 3))
    return np.asarray(x * np.sqrt(3 / (x**2).sum(1, keepdims=True)))


def oscillators(members: int) -> np.ndarray:
    """Return random states (members, 4) of the Hénon–Heiles system, whose energies are below 1/10, so that orbits
    are bounded."""
    x = np.random.default_rng(1).uniform(-1, 1, size=(members, 4))
    return np.asarray(0.2 * x)


@dataclass(frozen=True)
class Case:
    """Ensemble to measure: title, spec, function that makes initial states, and ``expected``, the picoseconds for a
    member and step that were predicted for an H200 card."""

    title: str
    spec: str
    starts: Callable[[int], np.ndarray]
    expected: str = ""


SPLITTING = Case("Hénon–Heiles, splitting, order 4", OSCILLATORS, oscillators, "25")
CASES = (
    Case("rigid body, series, order 4", BODY.spec(4), bodies, "60"),
    Case("rigid body, series, order 4, gauge of each member", BODY.spec(4, "gauge auto"), bodies),
    Case("rigid body, exact flow", BODY.spec(4, "splitting"), bodies),
    SPLITTING,
    Case("rigid body, series, order 4, single precision", BODY.spec(4) + "real: float\n", bodies),
    Case("Hénon–Heiles, splitting, order 4, single precision", OSCILLATORS + "real: float\n", oscillators),
)


@dataclass(frozen=True)
class Effort:
    """Amount of work: seconds by which a long run should exceed a short run, number of repetitions, and sites along
    an edge of the cubic lattice."""

    seconds: float
    rounds: int
    edge: int


def measured(target: str | None, quick: bool, say: Callable[[str], None]) -> Iterator[str]:
    """Yield the parts of the page, one after the other. Raises `DeviceError` or `MissingPackageError` without a
    device."""
    target = target or default_target()
    device = device_of(target)
    effort = Effort(0.1, 1, 16) if quick else Effort(1.0, 3, 128 if device.is_card else 32)
    say(f"{target}: {device.name}")
    yield f"{device!r}, target {target}, beside one core of {machine()}; phigen {phigen.__version__}."
    for part in (_ensembles, _spins, _peers):
        yield part(target, effort, say)


def default_target() -> str:
    """Return the target of the first card: cuda if CuPy finds a card, else opencl."""
    try:
        device_of("cuda")
    except (DeviceError, MissingPackageError):
        return "opencl"
    return "cuda"


# times -------------------------------------------------------------------------------------------------------------


def members_of(run: Run, seconds: float) -> int:
    """Return a number of members, at most `MOST_MEMBERS`, for which a run of `STEPS` steps takes about the given
    time."""
    members = 1024
    run(members, 1)  # the first run compiles, and is not timed
    while members < MOST_MEMBERS:
        spent = run(members, STEPS)
        if spent > seconds / 2:
            return min(MOST_MEMBERS, max(256, round(members * seconds / spent)))
        members = min(MOST_MEMBERS, 4 * members)
    return MOST_MEMBERS


def steps_of(run: Run, members: int, seconds: float) -> int:
    """Return a number of steps of short runs such that the long run takes at least ``seconds`` more than the short run.

    The difference must be that large, since copies of many members can take a second as well.
    """
    steps = STEPS
    while steps < MOST_STEPS and run(members, LONGER * steps) - run(members, steps) < seconds:
        steps *= 2
    return steps


def per_step(run: Run, members: int, effort: Effort) -> tuple[float, float]:
    """Return two times in picoseconds for a member and step, both medians over the repetitions.

    The first is the difference of a long and a short run, divided by the additional steps. The second is the whole time
    of the long run, divided by its steps.
    """
    short_steps, differences, whole = steps_of(run, members, effort.seconds), [], []
    long_steps = LONGER * short_steps
    for _ in range(effort.rounds):
        short, long = run(members, short_steps), run(members, long_steps)
        differences.append(1e12 * (long - short) / members / (long_steps - short_steps))
        whole.append(1e12 * long / members / long_steps)
    return median(differences), median(whole)


def ensemble_run(solver: Any, starts: Callable[[int], np.ndarray], **more: Any) -> Run:
    """Return the function that times a run of an ensemble, for a number of members and a number of steps."""
    prepared: dict[int, np.ndarray] = {}

    def run(members: int, steps: int) -> float:
        if members not in prepared:
            prepared.clear()
            prepared[members] = starts(members)
        begun = time.perf_counter()
        solver.ensemble(prepared[members], STEP, steps, **more)
        return time.perf_counter() - begun

    return run


# ensembles ---------------------------------------------------------------------------------------------------------


def _ensembles(target: str, effort: Effort, say: Callable[[str], None]) -> str:
    head = ("ensemble", "blocks", "members", "ps a member and step", "of the whole run", "expected of an H200",
            "one core, ps", "core / device", "difference from C")  # fmt: skip
    rows = [row for case in CASES for row in _rows(case, target, effort, say)]
    return f"### Ensembles, h = {STEP}\n\n{table(head, rows)}"


def _rows(case: Case, target: str, effort: Effort, say: Callable[[str], None]) -> Iterator[list[str]]:
    say(case.title)
    compilation = compilation_of(specs.loads(case.spec, "bench.yaml"))
    core = phigen.compile(compilation, "c")
    alone = ensemble_run(core, case.starts, threads=1)
    core_ps = per_step(alone, members_of(alone, effort.seconds), effort)[0]
    for blocks in BLOCKS if target == "cuda" else (1,):
        try:
            solver = phigen.compile(compilation, target)
            if target == "cuda":
                solver.backend.defined[f"{solver.interface.name}_BLOCKS"] = blocks
            same = difference(solver, compilation, case.starts(1000))
            run = ensemble_run(solver, case.starts)
            members = members_of(run, effort.seconds)
            ps, whole = per_step(run, members, effort)
        except PhigenError as error:
            yield [case.title, str(blocks), "", f"failed: {_one_line(error)}", *[""] * 5]
            continue
        yield [case.title, str(blocks), f"{members:,}", f"{ps:.3g}", f"{whole:.3g}", case.expected, f"{core_ps:.3g}",
               f"{core_ps / ps:.3g}", f"{same:.1e}"]  # fmt: skip


def difference(solver: Any, compilation: Any, x0: np.ndarray) -> float:
    """Return the largest difference after 100 steps between states of the device and states of C of profile small.

    C compilers may fuse products and sums, so states differ by rounding errors. Raises `DifferentStepsError` for larger
    differences, since a comparison of times would be meaningless.
    """
    exact = phigen.compile(compilation_of(compilation.spec, profile="small"), "c", profile="small")
    largest = float(np.abs(solver.ensemble(x0, STEP, 100) - exact.ensemble(x0, STEP, 100)).max())
    return checked(largest, 1e-4 if solver.interface.single else 1e-12)


class DifferentStepsError(PhigenError):
    """The device computes other states than C, beyond rounding errors."""


def checked(difference: float, bound: float) -> float:
    if not difference < bound:
        raise DifferentStepsError(f"steps differ from those of C by {difference:.1e}")
    return difference


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:120].replace("|", "/")


# spins -------------------------------------------------------------------------------------------------------------


def _spins(target: str, effort: Effort, say: Callable[[str], None]) -> str:
    """Return the table of spin updates per second on a cubic lattice. States stay on the device during a run."""
    head = ("order", "spins", "steps of spins a second", "expected of an H200", "one core", "device / core",
            "difference from C")  # fmt: skip
    rows = []
    for order, expected in ((2, "1.5e+10"), (4, "")):
        say(f"spins, order {order}")
        row = [str(order), f"{effort.edge**3:,}"]
        try:
            rates, same = _spin_rates(target, order, effort)
        except PhigenError as error:
            rows.append([*row, f"failed: {_one_line(error)}", *[""] * 4])
            continue
        ratio = rates[0] / rates[1]
        rows.append([*row, f"{rates[0]:.3g}", expected, f"{rates[1]:.3g}", f"{ratio:.3g}", f"{same:.1e}"])
    return f"### Cubic Heisenberg lattice, double precision\n\n{table(head, rows)}"


def _spin_rates(target: str, order: int, effort: Effort) -> tuple[list[float], float]:
    """Return the spin updates per second of the device and of one core, and the difference of their states after ten
    steps."""
    x, compilation = CUBE.start(effort.edge), compilation_of(specs.loads(_cube(order), "bench.yaml"))
    solvers = [phigen.compile(compilation, name) for name in (target, "c")]
    ours, theirs = (s.integrate(x, STEP, 10, 10).x[-1] for s in solvers)
    same = checked(float(np.abs(ours - theirs).max()), 1e-12)
    return [_spin_rate(s, x, effort) for s in solvers], same


def _cube(order: int) -> str:
    return f"phigen: 1\nname: bench\n{CUBE.spec}order: {order}\nscheme: splitting\n"


def _spin_rate(solver: Any, x: np.ndarray, effort: Effort) -> float:
    def run(steps: int) -> float:
        begun = time.perf_counter()
        solver.integrate(x, STEP, steps, steps)
        return time.perf_counter() - begun

    run(1)
    steps = 4
    while run(steps) < effort.seconds / 2:
        steps *= 2
    seconds = median(run(LONGER * steps) - run(steps) for _ in range(effort.rounds))
    return x[0].size * steps * (LONGER - 1) / seconds


# diffrax -----------------------------------------------------------------------------------------------------------


def _peers(target: str, effort: Effort, say: Callable[[str], None]) -> str:
    """Return the table that compares diffrax with phigen's splitting on the same device.

    Both make steps of the same size, so their energy errors differ.
    """
    title = "### diffrax"
    try:
        import diffrax
        import jax
    except ImportError as error:
        return f"{title}\n\nNot measured: {error.name} is not installed (`pip install diffrax 'jax[cuda12]'`)."
    kind = jax.default_backend()
    if (kind == "gpu") != device_of(target).is_card:
        return f"{title}\n\nNot measured: JAX runs on {kind}, the target {target} on {device_of(target).name}."
    say("diffrax")
    jax.config.update("jax_enable_x64", True)
    ours = phigen.compile(specs.loads(SPLITTING.spec, "bench.yaml"), target)
    solve = diffrax_run(diffrax, jax)

    def peer_run(members: int, steps: int) -> float:
        return solve(SPLITTING.starts(members), steps)[1]

    x0, rows = SPLITTING.starts(1000), []
    runs = [("phigen, splitting, order 4", ensemble_run(ours, SPLITTING.starts), ours.ensemble(x0, STEP, 100))]
    runs += [("diffrax, Dopri5", peer_run, solve(x0, 100)[0])]
    times = [per_step(run, members_of(run, effort.seconds), effort)[0] for _, run, _ in runs]
    for (name, _, ends), ps in zip(runs, times, strict=True):
        rows.append([name, f"{ps:.3g}", f"{ps / times[0]:.3g}", f"{energy_error(x0, ends):.1e}"])
    head = ("Hénon–Heiles", "ps a member and step", "over phigen", f"energy error at t = {100 * STEP:g}")
    about = f"{diffrax.__version__}, constant steps of {STEP}, double precision, on {kind}"
    return f"{title} {about}\n\n{table(head, rows)}"


def energy_error(starts: np.ndarray, ends: np.ndarray) -> float:
    """Return the largest energy error of the Hénon–Heiles system, relative to the largest initial energy."""

    def energy(x: np.ndarray) -> np.ndarray:
        q, p, px, py = x.T
        return np.asarray((px**2 + py**2 + q**2 + p**2) / 2 + q**2 * p - p**3 / 3)

    return float(np.abs(energy(ends) - energy(starts)).max() / energy(starts).max())


def diffrax_run(diffrax: Any, jax: Any) -> Callable[[np.ndarray, int], tuple[np.ndarray, float]]:
    """Return a function of initial states and a number of steps. It returns the final states and the seconds without
    compilation."""

    def field(t: Any, x: Any, args: Any) -> Any:
        q, p, px, py = x
        return jax.numpy.array([px, py, -q - 2 * q * p, -p - q * q + p * p])

    @jax.jit
    def solve(x0: Any, duration: Any) -> Any:
        term, controller = diffrax.ODETerm(field), diffrax.ConstantStepSize()

        def one(x: Any) -> Any:
            solved = diffrax.diffeqsolve(
                term, diffrax.Dopri5(), 0.0, duration, STEP, x, max_steps=None, stepsize_controller=controller
            )
            return solved.ys[-1]

        return jax.vmap(one)(x0)

    def run(x0: np.ndarray, steps: int) -> tuple[np.ndarray, float]:
        solve(x0, STEP).block_until_ready()  # JAX compiles for each number of members
        begun = time.perf_counter()
        ends = np.asarray(solve(x0, STEP * steps))
        return ends, time.perf_counter() - begun

    return run
