"""Loaded solver and sessions of a lattice in C, called through ctypes."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from phigen.memory import expect_room, filled
from phigen.runtime import cache
from phigen.runtime.binding import bound
from phigen.runtime.interface import (
    FIRST_DRAWS,
    BackendError,
    Draws,
    Floats,
    LatticeInterface,
    MissingExtraError,
    status_name,
)
from phigen.runtime.interrupts import interruptible

_POINTER, _DOUBLE, _SIZE, _INT = ctypes.c_void_p, ctypes.c_double, ctypes.c_size_t, ctypes.c_int
_SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "solver_size": (_SIZE, ()),
    "solver_steps_done": (_SIZE, (_POINTER,)),
    "work_size": (_SIZE, (_POINTER,)),
    "init": (_INT, (_POINTER, _POINTER, _POINTER, _POINTER, _POINTER)),
    "integrate": (_INT, (_POINTER, _DOUBLE, _SIZE)),
    "state": (None, (_POINTER, _POINTER)),
    "hamiltonian": (_DOUBLE, (_POINTER,)),
    "density": (None, (_POINTER, _POINTER)),
    "casimirs": (None, (_POINTER, _POINTER)),
    "vector_field": (None, (_POINTER, _POINTER)),
}

#: Signatures of functions that have other arguments on graphs than on grids.
_OF_GRAPHS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "work_size": (_SIZE, (_POINTER, _SIZE)),
    "init": (_INT, (_POINTER,) * 6),
}

#: Signatures of additional functions. ``_IN_TIME`` is for grids and pairs if H depends on the time, ``_GRAPH_IN_TIME``
#: for graphs if H depends on the time, and ``_NOISY`` for lattices with noise. Each of the three contains ``_PASSED``.
_PASSED: dict[str, tuple[Any, tuple[Any, ...]]] = {"passed": (_INT, (_POINTER, _DOUBLE, _SIZE))}
_IN_TIME = {**_PASSED, "init_at": (_INT, (_POINTER,) * 4 + (_DOUBLE, _POINTER))}
_GRAPH_IN_TIME = {**_PASSED, "init_at": (_INT, (_POINTER,) * 5 + (_DOUBLE, _POINTER))}
_NOISY = {**_PASSED, "set_noise": (_INT, (_POINTER, ctypes.c_uint64, ctypes.c_uint32, ctypes.c_uint64))}

#: Signatures of optional functions: derivatives, saved states, caller-driven stepping, observables, and kicks.
_OFFERED: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "tangent_size": (_SIZE, (_POINTER, _SIZE)),
    "integrate_tangent": (_INT, (_POINTER, _DOUBLE, _SIZE, _SIZE, _POINTER, _POINTER)),
    "trail_size": (_SIZE, (_POINTER, _SIZE)),
    "pullback": (_INT, (_POINTER, _DOUBLE, _SIZE, _SIZE, *(_POINTER,) * 5, _SIZE)),
    "ask": (None, (_POINTER, _POINTER)),
    "saved": (_SIZE, (_POINTER, _POINTER, _POINTER)),
    "resume": (_INT, (_POINTER, _DOUBLE, _POINTER, _SIZE, _SIZE)),
    "stages": (_SIZE, ()),
    "describe": (_INT, (_SIZE, _POINTER)),
    "begin": (_INT, (_POINTER, _DOUBLE)),
    "sweep": (_INT, (_POINTER, _SIZE, _INT, _SIZE, _SIZE)),
    "planes": (_INT, (_POINTER, _SIZE, _SIZE, _SIZE, _POINTER)),
    "put_planes": (_INT, (_POINTER, _SIZE, _SIZE, _SIZE, _POINTER)),
    "holds": (_INT, (_POINTER, _SIZE, _SIZE)),
    "set_planes": (_INT, (_POINTER, _SIZE, _SIZE)),
    "observables": (None, (_POINTER, _POINTER)),
    "observed_fields": (None, (_POINTER, _POINTER)),
    "set_state": (_INT, (_POINTER, _POINTER)),
    "kick": (_INT, (_POINTER, _POINTER)),
    "solver_time": (_DOUBLE, (_POINTER,)),
    "saved_clock": (None, (_POINTER, _POINTER)),
    "resume_clock": (_INT, (_POINTER, _POINTER)),
}

#: Least number of values for which a tape has room. In double precision they take 2 MiB, the size of a core's cache.
MIN_TAPE_VALUES = 1 << 18

#: Least number of states that a tape can store. The reverse pass recomputes the steps between two stored states.
MIN_CHECKPOINTS = 8

#: The size of the tape per step is an average over this number of steps. One step does not suffice, since several steps
#: may share one stored state.
MEASURED_STEPS = 64

#: Largest size of a tape in bytes (64 MiB), unless `MIN_TAPE_VALUES` or `MIN_CHECKPOINTS` needs more.
MAX_TAPE_BYTES = 1 << 26

#: Largest number of site updates (sites × steps) in one call of C. Python handles Ctrl-C only between two calls.
_UPDATES_PER_CALL = 1 << 26


class SweepStage(ctypes.Structure):
    """Description of one sweep of a step: which coordinates and planes it reads, and which coordinates it changes. A
    plane is the set of all sites with one index of the first axis.

    A sweep updates all sites. To update the planes a … b − 1, it reads the planes a − ``behind`` … b − 1 + ``ahead``.
    ``read`` and ``changed`` are bit masks with a bit for each coordinate.
    """

    _fields_: ClassVar = [
        ("behind", ctypes.c_size_t),
        ("ahead", ctypes.c_size_t),
        ("read", ctypes.c_ulong),
        ("changed", ctypes.c_ulong),
    ]
    behind: int
    ahead: int
    read: int
    changed: int


class CLatticeSession:
    """A `phigen.runtime.lattice.LatticeSession` in C, in memory that this object owns."""

    def __init__(
        self,
        functions: Any,
        interface: LatticeInterface,
        x0: Floats,
        parameters: Mapping[str, Any],
        t0: float,
        draws: Draws,
    ) -> None:
        self._c, self._shape, self._before = functions, x0.shape, 0
        self._real: Any = np.float32 if interface.single else np.float64
        self._casimirs = len(interface.casimirs)
        self._observed = len(interface.observables), len(interface.observed_fields)
        # Largest number of arrays (coordinates, *sizes) that `saved` returns. One is the state before the last flow of
        # a step. With compensation, two more are the compensation terms of this state and of the present state.
        self._saved_states = 3 if interface.compensated else 1
        self._slow_steps = interface.slow_steps
        self._steps_per_call = max(1, _UPDATES_PER_CALL // math.prod(x0.shape[1:]))
        sizes = np.array(x0.shape[1:], dtype=np.uintp)
        self._struct = np.zeros(functions.solver_size(), dtype=np.uint8)
        bonds = np.ascontiguousarray(parameters.get("bonds", ()), dtype=np.uintp).reshape(-1, 2)
        graph = np.array([len(bonds), bonds.ctypes.data], dtype=np.uintp)  # the C struct NAME_bonds
        work_size = functions.work_size(sizes.ctypes.data, *([len(bonds)] if interface.graph else []))
        expect_room(f"the arrays of a solver of {' × '.join(map(str, sizes))} sites", work_size)
        self._beside = np.zeros(0, dtype=np.uint8)  # memory for tangent vectors
        self._work = np.zeros(max(work_size, 64), dtype=np.uint8)
        self._address = self._struct.ctypes.data
        with np.errstate(over="ignore"):  # values beyond single precision become infinite, which C reports
            first = np.ascontiguousarray(x0, dtype=self._real)
            packed, referenced = _packed(interface, parameters, x0.shape[1:], len(bonds))
        arrays = [a.ctypes.data for a in (packed, sizes, *([graph] if interface.graph else []), first)]
        begin, last = (functions.init_at, (t0,)) if interface.time else (functions.init, ())
        status = begin(self._address, *arrays, *last, self._work.ctypes.data)
        del referenced  # C has copied the arrays to which ``packed`` points
        if status:
            raise BackendError(status_name(status), 0, x0[None])
        if interface.noise:
            self._expect_done(functions.set_noise(self._address, draws.seed, draws.member, draws.step))

    @property
    def steps(self) -> int:
        """The number of successful steps since the start."""
        return self._before + int(self._c.solver_steps_done(self._address))

    def state(self) -> Floats:
        """Return a copy of the state (coordinates, *sizes)."""
        return self._filled(self._c.state, self._shape)

    def advance(self, h: float, steps: int) -> None:
        """Make ``steps`` steps of size ``h``."""
        while steps > 0:
            chunk = min(steps, self._steps_per_call)
            status = self._c.integrate(self._address, h, chunk)
            if status:
                raise BackendError(status_name(status), self.steps, self.state()[None])
            steps -= chunk

    def advance_tangent(self, h: float, vectors: Floats, steps: int = 1) -> Floats:
        """Make ``steps`` steps, and return the products of their derivative with the tangent ``vectors``."""
        if not hasattr(self._c, "integrate_tangent"):
            raise MissingExtraError("step_tangent")
        propagated = np.array(vectors, dtype=self._real, order="C")
        work_size = self._c.tangent_size(self._address, len(propagated))
        if len(self._beside) < work_size:
            expect_room(f"the arrays of {len(propagated)} tangent vectors", work_size)
            self._beside = np.zeros(work_size, dtype=np.uint8)
        status = self._c.integrate_tangent(
            self._address, h, steps, len(propagated), propagated.ctypes.data, self._beside.ctypes.data
        )
        if status:
            raise BackendError(status_name(status), self.steps, self.state()[None])
        return np.asarray(propagated, dtype=np.float64)

    def pull_back(self, h: float, steps: int, stride: int, bars: Floats, parameters_bar: int) -> tuple[Floats, Floats]:
        """Return the states at the rows of a run, and the cotangent of the initial state.

        ``bars`` are the cotangents of the rows; the cotangent of row 0 is ignored. ``parameters_bar`` is the address of
        a C struct to which the cotangents of the parameters are added.
        """
        row_bars = np.ascontiguousarray(bars[1:], dtype=self._real)
        rows, x0_bar = filled(f"{len(bars)} frames", bars.shape, self._real), np.empty(self._shape, self._real)
        full_tape, single_step_tape = (int(self._c.trail_size(self._address, n)) for n in (steps, 1))
        state = x0_bar.nbytes
        tape_of_steps = int(self._c.trail_size(self._address, 1 + MEASURED_STEPS)) - single_step_tape
        tape_per_step = tape_of_steps // MEASURED_STEPS
        # Size of a tape for a reverse pass that computes each segment of the run twice: the tape has room for stored
        # states and for one segment.
        recomputing_tape = single_step_tape + 3 * math.isqrt(steps * state * tape_per_step)
        # A tape of the whole run is preferred in two cases. One is that recomputing steps is slow. The other is that
        # the tape of a step is smaller than a state, since the inverse flow recomputes states.
        preferred_tape = full_tape if self._slow_steps or tape_per_step < state else recomputing_tape
        min_tape_bytes = max(MIN_TAPE_VALUES * x0_bar.itemsize, single_step_tape + MIN_CHECKPOINTS * 2 * state)
        size = max(min_tape_bytes, min(MAX_TAPE_BYTES, preferred_tape))
        size = max(single_step_tape, min(full_tape or single_step_tape, size))
        expect_room("the stored data of the reverse pass", size)
        tape = np.empty(size, dtype=np.uint8)
        pointers = (rows[1:].ctypes.data, row_bars.ctypes.data, x0_bar.ctypes.data, parameters_bar, tape.ctypes.data)
        with interruptible(lambda question: self._c.ask(self._address, question)):
            status = self._c.pullback(self._address, h, steps, stride, *pointers, size)
        if status:
            self.advance(h, steps)  # raises `BackendError` with the number of the failing step
            raise BackendError(status_name(status), 0, self.state()[None])
        return np.asarray(rows, dtype=np.float64), np.asarray(x0_bar, dtype=np.float64)

    def hamiltonian(self) -> float:
        """Return H of the state."""
        return float(self._c.hamiltonian(self._address))

    def density(self) -> Floats:
        """Return the density of H at the sites (*sizes)."""
        return self._filled(self._c.density, self._shape[1:])

    def casimirs(self) -> Floats:
        """Return the densities of the Casimirs (Casimirs, *sizes)."""
        return self._filled(self._c.casimirs, (self._casimirs, *self._shape[1:]))

    def vector_field(self) -> Floats:
        """Return π∇H (coordinates, *sizes)."""
        return self._filled(self._c.vector_field, self._shape)

    def observables(self) -> Floats:
        """Return the observables that are one number each (observables,)."""
        observed, _ = self._observed
        return self._filled(self._c.observables, (observed,)) if observed else np.empty(0)

    def observed_fields(self) -> Floats:
        """Return the observables with a value at each site (fields, *sizes)."""
        shape = (self._observed[1], *self._shape[1:])
        return self._filled(self._c.observed_fields, shape) if shape[0] else np.empty(shape)

    def saved(self) -> dict[str, Any]:
        """Return the arrays that `resume` needs, besides the state, to continue this integration bit for bit."""
        if not hasattr(self._c, "saved"):
            return {}
        clock = self._clock()
        x = np.empty((self._saved_states * self._shape[0], *self._shape[1:]), self._real)
        full_range_flag = np.zeros(1, dtype=np.uintp)
        fields = self._c.saved(self._address, x.ctypes.data, full_range_flag.ctypes.data)
        return clock | ({"before": x[:fields].copy(), "far": full_range_flag} if fields else {"far": full_range_flag})

    def _clock(self) -> dict[str, Any]:
        """Return the energy level and the physical time of a lattice with a monitor; else {}."""
        return {"passed": self._filled(self._c.saved_clock, (5,))} if hasattr(self._c, "saved_clock") else {}

    def time(self) -> float:
        """Return the physical time since the start, for a lattice with a monitor."""
        return float(self._c.solver_time(self._address))

    def hold(self, level: float) -> None:
        """Set the energy level e of a lattice with a monitor; by default e is −H of the initial state."""
        self._set_clock(np.array([level, *self._clock()["passed"][1:]]))

    def _set_clock(self, clock: Floats) -> None:
        values = np.ascontiguousarray(clock, dtype=self._real)
        self._expect_done(self._c.resume_clock(self._address, values.ctypes.data))

    def resume(self, h: float, steps: int, arrays: Mapping[str, Any]) -> None:
        """Continue after ``steps`` steps of size h; ``arrays`` are the result of `saved`."""
        if hasattr(self._c, "passed"):
            self.passed(h, steps)
        else:
            self._before = steps
        if "far" in arrays:
            x = np.ascontiguousarray(arrays["before"], dtype=self._real) if "before" in arrays else None
            earlier_state, fields = (None, 0) if x is None else (x.ctypes.data, len(x))
            self._expect_done(self._c.resume(self._address, h, earlier_state, fields, int(arrays["far"][0])))
        if "passed" in arrays:
            self._set_clock(arrays["passed"])

    def place(self, x: Floats) -> None:
        """Replace the state by ``x`` (coordinates, *sizes).

        With a monitor, the energy level e becomes −H(x). Raises `BackendError` if x is not finite.
        """
        self._move("set_state", x)

    def kick(self, change: Floats) -> None:
        """Add ``change`` (coordinates, *sizes) to the state. Raises `BackendError` if the sum is not finite."""
        self._move("kick", change)

    def _move(self, name: str, values: Floats) -> None:
        function = getattr(self._c, name, None)
        if function is None:
            raise TypeError("this lattice was compiled without kicks; profile fast includes them")
        x = np.ascontiguousarray(values, dtype=self._real)
        status = function(self._address, x.ctypes.data)
        if status:
            raise BackendError(status_name(status), self.steps, self.state()[None])

    def passed(self, h: float, steps: int) -> None:
        """Advance the time and the random numbers by ``steps`` steps of size h; the state is not changed."""
        self._expect_done(self._c.passed(self._address, h, steps))

    # --- caller-driven stepping: see NAME.h

    def set_planes(self, first: int, planes: int) -> None:
        """Declare that this lattice is a part of a larger lattice, which has ``planes`` planes.

        A plane is the set of all sites with one index of the first axis. The first plane of this lattice is plane
        ``first`` of the larger lattice. With noise, each site then draws the random numbers that it has in the larger
        lattice.
        """
        self._expect_done(self._c.set_planes(self._address, first, planes))

    def begin(self, h: float) -> None:
        """Set the step size, before the first step and whenever it changes."""
        self._expect_done(self._c.begin(self._address, h))

    def sweep(self, stage: int, full_range: int, first: int, end: int) -> None:
        """Make one sweep of a step over the planes ``first`` … ``end`` − 1.

        ``stage`` is the number of the sweep in the step. ``full_range`` is 1 if functions such as sin must be valid for
        all arguments, else 0.
        """
        self._expect_done(self._c.sweep(self._address, stage, full_range, first, end))

    def planes(self, field: int, first: int, end: int) -> Floats:
        """Return a copy of the planes ``first`` … ``end`` − 1 of one coordinate."""
        result = np.empty((end - first, *self._shape[2:]), self._real)
        self._expect_done(self._c.planes(self._address, field, first, end, result.ctypes.data))
        return result

    def put_planes(self, field: int, first: int, end: int, values: Floats) -> None:
        """Replace the values of one coordinate on the planes ``first`` … ``end`` − 1."""
        with np.errstate(over="ignore"):
            values = np.ascontiguousarray(values, dtype=self._real)
        self._expect_done(self._c.put_planes(self._address, field, first, end, values.ctypes.data))

    def holds(self, first: int, end: int) -> bool:
        """Whether all values of the state on the planes ``first`` … ``end`` − 1 are finite."""
        return bool(self._c.holds(self._address, first, end))

    @staticmethod
    def _expect_done(status: int) -> None:
        if status:
            raise ValueError(f"the stage, the planes or the step do not exist: {status_name(status)}")

    def _filled(self, function: Any, shape: tuple[int, ...]) -> Floats:
        result = np.empty(shape, self._real)
        function(self._address, result.ctypes.data)
        return result.astype(np.float64, copy=False)


class CLattice:
    """Solver of a lattice in C. The C files are compiled to a shared library, whose functions the solver calls.

    ``files`` maps the names of the C files to their texts. The object is a `phigen.runtime.lattice.LatticeBackend`.
    """

    target = "c"

    def __init__(self, files: Mapping[str, str], interface: LatticeInterface) -> None:
        self.interface, self._files = interface, dict(files)
        self._library = cache.load(files, threads=True)
        required = _SIGNATURES | (_OF_GRAPHS if interface.graph else {})
        required |= (_GRAPH_IN_TIME if interface.graph else _IN_TIME) if interface.time else {}
        required |= _NOISY if interface.noise else {}
        self._c = bound(self._library, interface.name, required, _OFFERED, single=interface.single)

    def threads(self, sites: int) -> int:
        """Return the number of threads that share the work on a lattice of ``sites`` sites."""
        if not self.interface.is_shared(sites):
            return 1
        # a function of the OpenMP library, which the solver is linked with; missing without OpenMP
        openmp_maximum = getattr(self._library, "omp_get_max_threads", None)
        return int(openmp_maximum()) if openmp_maximum else 1

    def stages(self) -> list[SweepStage]:
        """Return the sweeps of a step, in order. Without noise, the list has an additional sweep at its end.

        The additional sweep replaces two sweeps: the last sweep of a step, and the first sweep of the next step. Raises
        `ValueError` if the C has no caller-driven stepping.
        """
        if not hasattr(self._c, "stages"):
            raise ValueError(
                f"{self.interface.name} has no caller-driven stepping: that needs a split lattice on a grid, "
                "without a boundary seam, compiled with profile fast"
            )
        sweeps = [SweepStage() for _ in range(self._c.stages() + (not self.interface.noise))]
        for k, stage in enumerate(sweeps):
            self._c.describe(k, ctypes.addressof(stage))
        return sweeps

    def __reduce__(self) -> tuple[type[CLattice], tuple[Any, ...]]:
        return CLattice, (self._files, self.interface)

    @property
    def identity(self) -> str:
        """A hash of everything that determines the results."""
        return cache.key_of(self._library)

    def start(
        self, x0: Floats, parameters: Mapping[str, Any], t0: float = 0.0, draws: Draws = FIRST_DRAWS
    ) -> CLatticeSession:
        """Return a session at x0 (coordinates, *sizes), at the time t0."""
        return CLatticeSession(self._c, self.interface, x0, parameters, t0, draws)

    @property
    def has_pullback(self) -> bool:
        return hasattr(self._c, "pullback")

    def pullback(
        self,
        x0: Floats,
        h: float,
        steps: int,
        stride: int,
        bars: Floats,
        parameters: Mapping[str, Any],
        t0: float = 0.0,
    ) -> tuple[Floats, Floats, dict[str, Floats]]:
        if not self.has_pullback:
            raise MissingExtraError("pullback")
        zero = dict.fromkeys(self.interface.parameters, 0.0)
        struct, arrays = _packed(self.interface, zero, x0.shape[1:], len(parameters.get("bonds", ())))
        rows, x0_bar = self.start(x0, parameters, t0).pull_back(h, steps, stride, bars, struct.ctypes.data)
        parameters_bar = {name: np.asarray(struct[name][0], dtype=np.float64) for name in zero if name not in arrays}
        for name, sums in arrays.items():
            of_array = np.asarray(sums, dtype=np.float64)
            parameters_bar[name] = of_array if np.ndim(parameters[name]) else of_array.sum()
        rows[0] = x0
        return rows, x0_bar + bars[0], {name: parameters_bar[name] for name in zero}


def _packed(
    interface: LatticeInterface, parameters: Mapping[str, Any], sizes: tuple[int, ...], bonds: int
) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]:
    """Return the C struct of the parameters, and the arrays to which the struct points, by parameter.

    The caller must hold a reference to the arrays as long as C uses the struct.
    """
    real: Any = np.float32 if interface.single else np.float64
    arrays = {*interface.at_sites, *interface.at_bonds}
    members = [(name, np.uintp if name in arrays else real) for name in interface.parameters] or [("unused", np.int8)]
    struct, copies = np.zeros(1, dtype=np.dtype(members, align=True)), dict[str, NDArray[Any]]()
    for name in interface.parameters:
        value = parameters[name]
        if name in arrays:
            shape = sizes if name in interface.at_sites else (bonds,)
            copies[name] = np.array(np.broadcast_to(np.asarray(value, dtype=real), shape), order="C")
            value = copies[name].ctypes.data
        struct[name] = value
    return struct, copies
