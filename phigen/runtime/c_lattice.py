"""The generated C of a lattice, called through ctypes."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

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
from phigen.runtime.memory import expect_room, filled

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

#: Those of graphs, where they differ.
_OF_GRAPHS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "work_size": (_SIZE, (_POINTER, _SIZE)),
    "init": (_INT, (_POINTER,) * 6),
}

#: Those that know the time: of grids and pairs, and of graphs. Those of noise.
_PASSED: dict[str, tuple[Any, tuple[Any, ...]]] = {"passed": (_INT, (_POINTER, _DOUBLE, _SIZE))}
_IN_TIME = {**_PASSED, "init_at": (_INT, (_POINTER,) * 4 + (_DOUBLE, _POINTER))}
_GRAPH_IN_TIME = {**_PASSED, "init_at": (_INT, (_POINTER,) * 5 + (_DOUBLE, _POINTER))}
_NOISY = {**_PASSED, "set_noise": (_INT, (_POINTER, ctypes.c_uint64, ctypes.c_uint32, ctypes.c_uint64))}

#: What splittings have, and steps by hand where they are offered.
_OFFERED: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "tangent_size": (_SIZE, (_POINTER, _SIZE)),
    "integrate_tangent": (_INT, (_POINTER, _DOUBLE, _SIZE, _SIZE, _POINTER, _POINTER)),
    "trail_size": (_SIZE, (_POINTER, _SIZE)),
    "pullback": (_INT, (_POINTER, _DOUBLE, _SIZE, _SIZE, *(_POINTER,) * 5, _SIZE)),
    "ask": (None, (_POINTER, _POINTER)),
    "saved": (_INT, (_POINTER, _POINTER, _POINTER)),
    "resume": (_INT, (_POINTER, _DOUBLE, _POINTER, _SIZE)),
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
}

#: Numbers that the trail of a segment takes at most, unless it is one step: those that the cache of a core holds.
KEPT = 1 << 18

#: States that segments of a run begin with for which a pullback has room, however large they are.
STATES = 8

#: Steps in whose number the trail is measured, since several may keep one state.
LEGS = 64

#: Bytes of the trail of a run that is kept as a whole, or whose segments are all made once more, at most.
TWICE = 1 << 26

#: Site updates between two calls: Python can deliver a keyboard interrupt then.
_UPDATES_PER_CALL = 1 << 26


class Stage(ctypes.Structure):
    """What one sweep of a step reads and changes: planes beside those swept, and fields as bits."""

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
    """A lattice on its way, in memory of its own. See `phigen.runtime.lattice.LatticeSession`."""

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
        self._kept = 2 if interface.compensated else 1
        self._dear = interface.dear
        sizes = np.array(x0.shape[1:], dtype=np.uintp)
        self._struct = np.zeros(functions.solver_size(), dtype=np.uint8)
        bonds = np.ascontiguousarray(parameters.get("bonds", ()), dtype=np.uintp).reshape(-1, 2)
        given = np.array([len(bonds), bonds.ctypes.data], dtype=np.uintp)  # the struct of bonds
        needed = functions.work_size(sizes.ctypes.data, *([len(bonds)] if interface.graph else []))
        expect_room(f"the arrays of a solver of {' × '.join(map(str, sizes))} sites", needed)
        self._beside = np.zeros(0, dtype=np.uint8)  # for tangent vectors
        self._work = np.zeros(max(needed, 64), dtype=np.uint8)
        self._address = self._struct.ctypes.data
        with np.errstate(over="ignore"):  # which is found infinite
            first = np.ascontiguousarray(x0, dtype=self._real)
            packed, kept = _packed(interface, parameters, x0.shape[1:], len(bonds))
        arrays = [a.ctypes.data for a in (packed, sizes, *([given] if interface.graph else []), first)]
        begin, last = (functions.init_at, (t0,)) if interface.time else (functions.init, ())
        status = begin(self._address, *arrays, *last, self._work.ctypes.data)
        del kept
        if status:
            raise BackendError(status_name(status), 0, x0[None])
        if interface.noise:
            self._expect_done(functions.set_noise(self._address, draws.seed, draws.member, draws.step))

    @property
    def steps(self) -> int:
        """Good steps since the start."""
        return self._before + int(self._c.solver_steps_done(self._address))

    def state(self) -> Floats:
        """A copy of the state (coordinates, *sizes)."""
        return self._filled(self._c.state, self._shape)

    def advance(self, h: float, steps: int) -> None:
        """Make so many steps."""
        most = max(1, _UPDATES_PER_CALL // int(np.prod(self._shape[1:])))
        while steps > 0:
            now = min(steps, most)
            status = self._c.integrate(self._address, h, now)
            if status:
                raise BackendError(status_name(status), self.steps, self.state()[None])
            steps -= now

    def advance_tangent(self, h: float, vectors: Floats, steps: int = 1) -> Floats:
        """Make so many steps, which carry vectors along."""
        if not hasattr(self._c, "integrate_tangent"):
            raise MissingExtraError("step_tangent")
        carried = np.array(vectors, dtype=self._real, order="C")
        needed = self._c.tangent_size(self._address, len(carried))
        if len(self._beside) < needed:
            expect_room(f"the arrays of {len(carried)} tangent vectors", needed)
            self._beside = np.zeros(needed, dtype=np.uint8)
        status = self._c.integrate_tangent(
            self._address, h, steps, len(carried), carried.ctypes.data, self._beside.ctypes.data
        )
        if status:
            raise BackendError(status_name(status), self.steps, self.state()[None])
        return np.asarray(carried, dtype=np.float64)

    def pull_back(self, h: float, steps: int, stride: int, bars: Floats, found: int) -> tuple[Floats, Floats]:
        """The rows of a run, and the cotangent of the state, from those of all rows but the first.

        ``found`` is the address of a struct, to which the cotangents of parameters are added.
        """
        given = np.ascontiguousarray(bars[1:], dtype=self._real)
        rows, x0_bar = filled(f"{len(bars)} frames", bars.shape, self._real), np.empty(self._shape, self._real)
        most, least = (int(self._c.trail_size(self._address, n)) for n in (steps, 1))
        state, of_step = x0_bar.nbytes, (int(self._c.trail_size(self._address, 1 + LEGS)) - least) // LEGS
        twice = least + 3 * math.isqrt(steps * state * of_step)  # segments that are made once more have room by this
        wanted = most if self._dear or of_step < state else twice  # where sweeps are undone, all is worth its room
        room = max(KEPT * x0_bar.itemsize, least + STATES * 2 * state, min(TWICE, wanted))
        size = max(least, min(most or least, room))
        expect_room("what is kept of steps to go back", size)
        trail = np.empty(size, dtype=np.uint8)
        pointers = (rows[1:].ctypes.data, given.ctypes.data, x0_bar.ctypes.data, found, trail.ctypes.data)
        with interruptible(lambda question: self._c.ask(self._address, question)):
            status = self._c.pullback(self._address, h, steps, stride, *pointers, size)
        if status:
            self.advance(h, steps)  # tells where
            raise BackendError(status_name(status), 0, self.state()[None])
        return np.asarray(rows, dtype=np.float64), np.asarray(x0_bar, dtype=np.float64)

    def hamiltonian(self) -> float:
        """H of the state."""
        return float(self._c.hamiltonian(self._address))

    def density(self) -> Floats:
        """The density of H at the sites (*sizes)."""
        return self._filled(self._c.density, self._shape[1:])

    def casimirs(self) -> Floats:
        """The densities of the Casimirs (Casimirs, *sizes)."""
        return self._filled(self._c.casimirs, (self._casimirs, *self._shape[1:]))

    def vector_field(self) -> Floats:
        """π∇H (coordinates, *sizes)."""
        return self._filled(self._c.vector_field, self._shape)

    def observables(self) -> Floats:
        """Observables that are one number each (observables,)."""
        observed, _ = self._observed
        return self._filled(self._c.observables, (observed,)) if observed else np.empty(0)

    def observed_fields(self) -> Floats:
        """Observables with a value at each site (fields, *sizes)."""
        shape = (self._observed[1], *self._shape[1:])
        return self._filled(self._c.observed_fields, shape) if shape[0] else np.empty(shape)

    def saved(self) -> dict[str, Any]:
        """What `resume` goes on from with the same bits, beside the state."""
        if not hasattr(self._c, "saved"):
            return {}
        x = np.empty((self._kept * self._shape[0], *self._shape[1:]), self._real)
        far = np.zeros(1, dtype=np.uintp)
        is_open = self._c.saved(self._address, x.ctypes.data, far.ctypes.data)
        return {"before": x, "far": far} if is_open else {"far": far}

    def resume(self, h: float, steps: int, kept: Mapping[str, Any]) -> None:
        """Go on from what was saved."""
        if hasattr(self._c, "passed"):
            self.passed(h, steps)
        else:
            self._before = steps
        if "far" in kept:
            x = np.ascontiguousarray(kept["before"], dtype=self._real) if "before" in kept else None
            self._expect_done(
                self._c.resume(self._address, h, x.ctypes.data if x is not None else None, int(kept["far"][0]))
            )

    def place(self, x: Floats) -> None:
        """Stand at ``x`` (coordinates, *sizes). Raises `BackendError` where that is not finite."""
        self._moved("set_state", x)

    def kick(self, change: Floats) -> None:
        """Move the state by ``change`` (coordinates, *sizes). Raises `BackendError` where that is not finite."""
        self._moved("kick", change)

    def _moved(self, name: str, given: Floats) -> None:
        function = getattr(self._c, name, None)
        if function is None:
            raise TypeError("this lattice was compiled without kicks; profile fast includes them")
        x = np.ascontiguousarray(given, dtype=self._real)
        status = function(self._address, x.ctypes.data)
        if status:
            raise BackendError(status_name(status), self.steps, self.state()[None])

    def passed(self, h: float, steps: int) -> None:
        """Count so many steps of size h as made; of lattices with a time, or noise."""
        self._expect_done(self._c.passed(self._address, h, steps))

    # --- steps by hand: see NAME.h

    def set_planes(self, first: int, planes: int) -> None:
        """Say that the first plane here is that number of so many; of lattices with noise."""
        self._expect_done(self._c.set_planes(self._address, first, planes))

    def begin(self, h: float) -> None:
        """Set the step size."""
        self._expect_done(self._c.begin(self._address, h))

    def sweep(self, stage: int, far: int, first: int, end: int) -> None:
        """One sweep over the planes from ``first``, before ``end``."""
        self._expect_done(self._c.sweep(self._address, stage, far, first, end))

    def planes(self, field: int, first: int, end: int) -> Floats:
        """A copy of some planes of a field."""
        out = np.empty((end - first, *self._shape[2:]), self._real)
        self._expect_done(self._c.planes(self._address, field, first, end, out.ctypes.data))
        return out

    def put_planes(self, field: int, first: int, end: int, values: Floats) -> None:
        """Put other values of a field in place of those of some planes."""
        with np.errstate(over="ignore"):
            values = np.ascontiguousarray(values, dtype=self._real)
        self._expect_done(self._c.put_planes(self._address, field, first, end, values.ctypes.data))

    def holds(self, first: int, end: int) -> bool:
        """Whether all values of some planes are finite."""
        return bool(self._c.holds(self._address, first, end))

    @staticmethod
    def _expect_done(status: int) -> None:
        if status:
            raise ValueError(f"no such stage, planes or step: {status_name(status)}")

    def _filled(self, function: Any, shape: tuple[int, ...]) -> Floats:
        out = np.empty(shape, self._real)
        function(self._address, out.ctypes.data)
        return out.astype(np.float64, copy=False)


class CLattice:
    """The back end over the shared library of generated files (name → text). See `phigen.runtime.lattice`."""

    target = "c"

    def __init__(self, files: Mapping[str, str], interface: LatticeInterface) -> None:
        self.interface, self._files = interface, dict(files)
        self._library = cache.load(files, threads=True)
        wanted = _SIGNATURES | (_OF_GRAPHS if interface.graph else {})
        wanted |= (_GRAPH_IN_TIME if interface.graph else _IN_TIME) if interface.time else {}
        wanted |= _NOISY if interface.noise else {}
        self._c = bound(self._library, interface.name, wanted, _OFFERED, single=interface.single)

    def threads(self, sites: int) -> int:
        """Return the number of threads that share the work on so many sites."""
        if not self.interface.is_shared(sites):
            return 1
        most = getattr(self._library, "omp_get_max_threads", None)  # of the OpenMP that it is linked with
        return int(most()) if most else 1

    def stages(self) -> list[Stage]:
        """The sweeps of a step in order, then the last and the first together, which are apart where there is noise.

        Raises `ValueError` if they are not offered.
        """
        if not hasattr(self._c, "stages"):
            raise ValueError(
                f"{self.interface.name} has no caller-driven stepping: that needs a split lattice on a grid, "
                "without a seam, compiled with profile fast"
            )
        found = [Stage() for _ in range(self._c.stages() + (not self.interface.noise))]
        for k, stage in enumerate(found):
            self._c.describe(k, ctypes.addressof(stage))
        return found

    def __reduce__(self) -> tuple[type[CLattice], tuple[Any, ...]]:
        return CLattice, (self._files, self.interface)

    @property
    def identity(self) -> str:
        """A hash of all that decides the results."""
        return cache.key_of(self._library)

    def start(
        self, x0: Floats, parameters: Mapping[str, Any], t0: float = 0.0, draws: Draws = FIRST_DRAWS
    ) -> CLatticeSession:
        """A session at x0 (coordinates, *sizes), at the time t0."""
        return CLatticeSession(self._c, self.interface, x0, parameters, t0, draws)

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
        """See `phigen.runtime.lattice.LatticeBackend`."""
        if not hasattr(self._c, "pullback"):
            raise MissingExtraError("pullback")
        zero = dict.fromkeys(self.interface.parameters, 0.0)
        struct, arrays = _packed(self.interface, zero, x0.shape[1:], len(parameters.get("bonds", ())))
        rows, x0_bar = self.start(x0, parameters, t0).pull_back(h, steps, stride, bars, struct.ctypes.data)
        found = {name: np.asarray(struct[name][0], dtype=np.float64) for name in zero if name not in arrays}
        for name, own in arrays.items():
            of_array = np.asarray(own, dtype=np.float64)
            found[name] = of_array if np.ndim(parameters[name]) else of_array.sum()
        rows[0] = x0
        return rows, x0_bar + bars[0], {name: found[name] for name in zero}


def _packed(
    interface: LatticeInterface, parameters: Mapping[str, Any], sizes: tuple[int, ...], bonds: int
) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]:
    """The struct of parameters, and the arrays that it points to, which are copies."""
    real: Any = np.float32 if interface.single else np.float64
    arrays = {*interface.at_sites, *interface.at_bonds}
    members = [(name, np.uintp if name in arrays else real) for name in interface.parameters] or [("unused", np.int8)]
    struct, kept = np.zeros(1, dtype=np.dtype(members, align=True)), dict[str, NDArray[Any]]()
    for name in interface.parameters:
        value = parameters[name]
        if name in arrays:
            shape = sizes if name in interface.at_sites else (bonds,)
            kept[name] = np.array(np.broadcast_to(np.asarray(value, dtype=real), shape), order="C")
            value = kept[name].ctypes.data
        struct[name] = value
    return struct, kept
