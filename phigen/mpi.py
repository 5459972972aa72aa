"""Lattices on several processes: domains of planes along the slowest axis, which are exchanged by mpi4py.

    from phigen.mpi import DistributedLattice

    lattice = DistributedLattice("heisenberg.yaml")
    run = lattice.integrate(start, h=0.05, steps=1000, stride=10, sizes=(1000, 1000, 1000), output="frames.npy")

    mpirun -n 8 python script.py

A plane is the set of all sites with one index of the first axis. Each process has the C solver of its planes and of
copies of the neighbouring planes. It receives these from its neighbours just before a sweep reads them, while it
works on the inner planes. States have the bits of `LatticeSolver` for any number of processes. Needs the extra
``mpi``.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from phigen.errors import MissingPackageError, StepError
from phigen.memory import filled
from phigen.reading import opened
from phigen.runtime import arguments
from phigen.runtime.arguments import Beginning
from phigen.runtime.c_lattice import CLattice, CLatticeSession, SweepStage
from phigen.runtime.checkpoint import objection, objection_to_frames
from phigen.runtime.interface import Draws, Floats, row_steps
from phigen.runtime.lattice import LatticeSolver
from phigen.writing import replacing

#: As in the C, whose bits these are: see templates/c/runtime/lattice.c.
STRETCH, FAR_STEPS = 32, 64

#: Arguments for runs in one process, which make parts of steps or copies of the solver; not offered with several
#: processes.
_WHOLE_ONLY = ("until", "every", "at", "stop", "section", "retry")

#: An array over the whole lattice, or a function that gives the planes from one to another, that not among them.
Given = Any


@dataclass(frozen=True, eq=False)
class DistributedRun:
    """Frames of one process: ``t`` and ``energy`` (frames,) of the whole, ``x`` (frames, coordinates, planes, …) of its
    ``planes``, from the first to the one after the last; None where frames went to a file. ``waiting`` are the seconds
    that this process waited for planes of others."""

    t: Floats
    energy: Floats
    x: Floats | None
    planes: tuple[int, int]
    steps: int
    waiting: float


class DistributedLattice:
    """Solver of a lattice on the processes of a communicator, by default on all processes.

    ``source`` is an argument of `phigen.compile`, or a `LatticeSolver` for C in profile fast. The lattice must be a
    grid whose H is split. Raises `ValueError` for other lattices.
    """

    def __init__(self, source: Any, comm: Any = None, order: int | None = None) -> None:
        self.comm = comm if comm is not None else _mpi().COMM_WORLD
        self.solver = source if isinstance(source, LatticeSolver) else self._compiled(source, order)
        backend = self.solver.backend
        if not isinstance(backend, CLattice):
            raise ValueError(f"processes share lattices that are compiled to C, not {self.solver!r}")
        self.stages = backend.stages()
        self.period = self.solver.interface.colour_period

    def _compiled(self, source: Any, order: int | None) -> LatticeSolver:
        from phigen.api import compilation_of, lattice_solver_of

        compilation = compilation_of(source, order=order, profile="fast")
        if self.comm.rank == 0:
            lattice_solver_of(compilation, "c")  # fills the cache
        self.comm.barrier()
        return lattice_solver_of(compilation, "c")

    def integrate(
        self,
        x0: Given,
        h: float,
        steps: int,
        stride: int = 1,
        *,
        t0: float | None = None,
        seed: int | None = None,
        member: int | None = None,
        step0: int | None = None,
        sizes: Sequence[int] | None = None,
        output: str | Path | None = None,
        checkpoints: str | Path | None = None,
        resume: bool = True,
        progress: Callable[[int], Any] | None = None,
        parameters: Mapping[str, Any] | None = None,
        **more: Any,
    ) -> DistributedRun:
        """Integrate as `LatticeSolver.integrate`; all processes call this method with the same arguments.

        ``x0`` is an array (coordinates, *sizes), or a function that gives its planes, x0(from, to) of shape
        (coordinates, to - from, …), and then needs ``sizes``; parameters at sites likewise. Frames go to ``output``, a
        ``.npy`` file that all processes write to. With ``checkpoints``, a path, the state is kept at every frame; the
        same call goes on from it, on any number of processes; ``resume=False`` begins anew, where no interrupted run
        is. Raises on all processes: `StepError`, and `ValueError` where files are of an interrupted run, or of a
        complete one that was to go on.
        """
        for name in _WHOLE_ONLY:
            if name in more and name not in self.solver.interface.parameters:
                hint = "integrate in one process, or to whole steps, and call it again from the last state"
                raise TypeError(f"{name} is not available on several processes, whose rows are whole steps: {hint}")
        if checkpoints and not output:
            raise ValueError("checkpoints= needs output=, where the frames are of a run that was interrupted")
        paths = Path(output) if output else None, Path(checkpoints) if checkpoints else None
        if refused := self.comm.bcast(_objection(*paths, resume=resume) if self.comm.rank == 0 else ""):
            raise ValueError(refused)
        lattice_sizes = tuple(sizes) if sizes is not None else np.shape(x0)[1:]
        h, steps, stride = (
            arguments.step_size(h),
            arguments.count(steps, "steps", 0),
            arguments.count(stride, "stride", 1),
        )
        begin = arguments.start_time(t0, self.solver.interface, more)
        draws = arguments.draws(self.solver.interface, more, {"seed": seed, "member": member, "step0": step0})
        arrays = arguments.together(parameters, more)
        arrays |= self.solver.defaults(
            arrays, lattice_sizes
        )  # of the whole lattice, since a process has some of its planes
        domain = _Domain(self, lattice_sizes, x0, h, arrays, begin, draws)
        marks = row_steps(steps, stride)
        shape = (len(marks), len(self.solver.coordinates), *lattice_sizes)
        checkpoint = (
            _StoredState(domain, Path(checkpoints), [h, steps, stride, begin, *astuple(draws)]) if checkpoints else None
        )
        energy = checkpoint.restored() if checkpoint else []
        frames = _Frames(domain, Path(output) if output else None, shape, new=not energy)
        try:
            for k in range(len(energy), len(marks)):
                domain.advance(int(marks[k]) - domain.steps)
                frames.put(k)
                energy.append(domain.energy())
                if checkpoint and k:
                    checkpoint.save(energy)
                if progress:
                    progress(int(marks[k]))
        except StepError:  # on all processes; the run cannot be gone on with
            frames.close()
            frames.discard()
            if checkpoint:
                checkpoint.remove()
            raise
        except BaseException:
            frames.close()
            raise
        frames.close()
        frames.finish()
        if checkpoint:
            checkpoint.remove()
        t = np.asarray(begin + h * marks, dtype=np.float64)
        return DistributedRun(t, np.array(energy), frames.array, domain.planes, steps, domain.waiting)


class _Domain:
    """The planes of one process, with copies of neighbouring planes; a state that is open lacks the last flow of its
    step."""

    def __init__(
        self,
        lattice: DistributedLattice,
        sizes: tuple[int, ...],
        x0: Given,
        h: float,
        parameters: Mapping[str, Any],
        t0: float,
        draws: Draws,
    ) -> None:
        self.lattice, self.comm, self.sizes, self.h = lattice, lattice.comm, sizes, h
        self.stages: list[SweepStage] = lattice.stages
        self.noisy = bool(lattice.solver.interface.noise)
        self.joined = len(self.stages) - (not self.noisy)
        self.last = max(1, self.joined - 1)
        reach = [max(s.behind for s in self.stages), max(s.ahead for s in self.stages)]
        self.planes = self._share(sizes[0], max(reach))
        self.beside = self._neighbours()
        period = lattice.period
        ghosts = [-(-r // period) * period if b is not None else 0 for r, b in zip(reach, self.beside, strict=True)]
        self.reach = reach
        self.own = (ghosts[0], ghosts[0] + self.planes[1] - self.planes[0])
        self.total = self.own[1] + ghosts[1]
        with_halo = (self.planes[0] - ghosts[0], self.planes[1] + ghosts[1])
        self.values = {name: self._local(value, *with_halo, name) for name, value in parameters.items()}
        start = self._planes_of(x0, *with_halo, axis=1)
        checked = lattice.solver.state(start, "x0")
        values = lattice.solver.values(self.values, {}, checked.shape[1:])
        session = lattice.solver.started(Beginning(checked, h, values, t0, draws))
        assert isinstance(session, CLatticeSession)
        self.session = session
        if self.noisy:  # each site has the random numbers that it has in the whole
            session.set_planes((self.planes[0] - ghosts[0]) % sizes[0], sizes[0])
        self.session.begin(h)
        self.fields = len(lattice.solver.coordinates)
        self.dirty = 0
        self.steps, self.far, self.open = 0, 0, False
        self.saved = self._all()
        self.waiting = 0.0

    # --- who has what

    def _share(self, planes: int, reach: int) -> tuple[int, int]:
        """Return the planes of this process, as evenly distributed as the colour periods allow."""
        period, count, rank = self.lattice.period, self.comm.size, self.comm.rank
        if planes < count * max(reach, period):
            most = planes // max(reach, period)
            raise ValueError(f"{planes} planes are too few for {count} processes; {most} would do")
        units = -(-planes // period)
        first, end = (min(planes, units * r // count * period) for r in (rank, rank + 1))
        return first, end

    def _neighbours(self) -> list[int | None]:
        """Return the processes behind and ahead; None beyond open ends."""
        rank, count, is_open = self.comm.rank, self.comm.size, self.lattice.solver.interface.first_open
        behind = None if is_open and rank == 0 else (rank - 1) % count
        ahead = None if is_open and rank == count - 1 else (rank + 1) % count
        return [behind, ahead]

    def _planes_of(self, values: Given, first: int, end: int, axis: int) -> Floats:
        """The planes first..end of an array, or of a function of planes; periodic beyond the ends."""
        size = self.sizes[0]
        if not callable(values):
            return np.take(np.asarray(values, dtype=np.float64), np.arange(first, end) % size, axis)
        parts = [values(max(first, 0), min(end, size))]
        if first < 0:
            parts.insert(0, values(size + first, size))
        if end > size:
            parts.append(values(0, end - size))
        return np.concatenate([np.asarray(part, dtype=np.float64) for part in parts], axis)

    def _local(self, value: Any, first: int, end: int, name: str) -> Any:
        if name in self.lattice.solver.interface.at_sites and (callable(value) or np.ndim(value)):
            return self._planes_of(value, first, end, axis=0)
        return value

    # --- steps

    def advance(self, steps: int) -> None:
        """Make a number of steps; the state is closed after that. Raises `StepError`."""
        if steps:
            self._put_all(self.saved)
        end, stretch = self.steps + steps, STRETCH
        while self.steps < end:
            chunk = min(end - self.steps, stretch, self.far or STRETCH)
            if self._attempt_steps(chunk):
                continue
            if chunk > 1:
                stretch = 1
            elif self.far == 0:
                self.far, stretch = FAR_STEPS, STRETCH
            else:
                self._apply_last_flow()
                message = (
                    f"{self.lattice.solver.interface.name}: step {self.steps} of size {self.h!r} failed: NOT_FINITE"
                )
                raise StepError(message, step=self.steps, status="NOT_FINITE")
        self._apply_last_flow()
        self._tell_time(self.steps)

    def _tell_time(self, steps: int) -> None:
        if self.lattice.solver.interface.time or self.noisy:
            self.session.passed(self.h, steps)

    def _attempt_steps(self, steps: int) -> bool:
        """Make some steps, or none if they lead to values that are not finite."""
        for step in range(steps):
            self._tell_time(self.steps + step)
            if self.noisy:  # the flows of two steps are not joined
                for stage in range(self.joined):
                    self._stage(stage)
                continue
            self._stage(self.joined if self.last > 1 and (self.open or step) else 0)
            for stage in range(1, self.last):
                self._stage(stage)
        if not self._holds():
            self._put_all(self.saved)
            return False
        self.open = self.joined > 1 and not self.noisy
        self.steps += steps
        self.far = max(0, self.far - steps)
        self.saved = self._all()
        return True

    def _apply_last_flow(self) -> None:
        """Apply the last flow of a step, after saving the state before it."""
        if not self.open:
            return
        self._tell_time(self.steps - 1)
        self._stage(self.joined - 1)
        if not self._holds() and self.far == 0:
            self._put_all(self.saved)
            self._stage(self.joined - 1, far=True)

    def _stage(self, number: int, far: bool = False) -> None:
        """Make one sweep over all own planes: the inner ones while the neighbouring planes are being received."""
        stage, (first, end) = self.stages[number], self.own
        way = 1 if far or self.far else 0
        stale = stage.read & self.dirty
        if stale:
            on_their_way = self._request_halos(stale)
            inner = first + stage.behind, end - stage.ahead
            if inner[0] < inner[1]:
                self.session.sweep(number, way, *inner)
            self._received(on_their_way)
            outer = [(first, inner[0]), (inner[1], end)] if inner[0] < inner[1] else [(first, end)]
            for outer_planes in outer:
                self.session.sweep(number, way, *outer_planes)
        else:
            self.session.sweep(number, way, first, end)
        self.dirty = (self.dirty & ~stale) | stage.changed

    def _request_halos(self, fields: int) -> list[tuple[Any, int, tuple[int, int], Floats]]:
        """Send the fields that the neighbours read, and request theirs."""
        (behind, ahead), (first, end), (reach_behind, reach_ahead) = self.beside, self.own, self.reach
        requests, sent = [], []
        for field in (k for k in range(self.fields) if fields >> k & 1):
            for neighbour, tag, mine, theirs in (
                (behind, 0, (first, first + reach_ahead), (first - reach_behind, first)),
                (ahead, 1, (end - reach_behind, end), (end, end + reach_ahead)),
            ):
                if neighbour is None:
                    continue
                if mine[0] < mine[1]:
                    sent.append(self.comm.Isend(self.session.planes(field, *mine), neighbour, 2 * field + tag))
                if theirs[0] < theirs[1]:
                    buffer = np.empty((theirs[1] - theirs[0], *self.sizes[1:]))
                    # what a neighbour ahead sends backwards has the tag of that
                    requests.append((self.comm.Irecv(buffer, neighbour, 2 * field + 1 - tag), field, theirs, buffer))
        self._sent = sent
        return requests

    def _received(self, requests: Sequence[tuple[Any, int, tuple[int, int], Floats]]) -> None:
        begin = time.perf_counter()
        _mpi().Request.Waitall([request for request, *_ in requests])
        self.waiting += time.perf_counter() - begin
        for _, field, planes, buffer in requests:
            self.session.put_planes(field, *planes, buffer)
        _mpi().Request.Waitall(self._sent)

    # --- the state

    def _holds(self) -> bool:
        return bool(self.comm.allreduce(int(self.session.holds(*self.own)), op=_mpi().MIN))

    def _all(self) -> list[Floats]:
        return [self.session.planes(field, 0, self.total) for field in range(self.fields)]

    def _put_all(self, saved: Sequence[Floats]) -> None:
        for field, values in enumerate(saved):
            self.session.put_planes(field, 0, self.total, values)
        self.dirty = (1 << self.fields) - 1

    def state(self) -> Floats:
        """Planes of this process (coordinates, planes, …)."""
        return np.array([self.session.planes(field, *self.own) for field in range(self.fields)])

    def energy(self) -> float:
        """H of the whole lattice, on all processes: the sum over planes, rounded once."""
        self._received(self._request_halos(self.dirty))
        self.dirty = 0
        density = self.session.density()[self.own[0] : self.own[1]]
        sums = density.reshape(len(density), -1).sum(axis=1)
        return math.fsum(value for part in self.comm.allgather(sums) for value in part.tolist())

    def restore(self, x: Floats, steps: int, full_range: int, is_open: bool) -> None:
        """Continue from a state, of which each process has its planes."""
        for field in range(self.fields):
            self.session.put_planes(field, *self.own, x[field])
        self.dirty = (1 << self.fields) - 1
        self.saved = self._all()
        self.steps, self.far, self.open = steps, full_range, is_open
        self._tell_time(steps)

    def saved_state(self) -> Floats:
        """Planes of this process at the last saved state, from which further steps continue."""
        return np.array([values[self.own[0] : self.own[1]] for values in self.saved])


def _part(path: Path) -> Path:
    """Where frames are until all of them are there."""
    return path.with_name(path.name + ".part")


def _objection(output: Path | None, checkpoints: Path | None, *, resume: bool) -> str:
    """Reason why a run may not begin or continue with the existing files; "" if it may."""
    if checkpoints:
        return objection(checkpoints, output, resume=resume, how="resume=True")
    return objection_to_frames(_part(output)) if output else ""


class _SharedArrayFile:
    """A ``.npy`` file of arrays (…, coordinates, *sizes) that all processes write and read their planes of."""

    def __init__(self, domain: _Domain, path: Path, shape: tuple[int, ...], *, new: bool) -> None:
        self.domain = domain
        if new and domain.comm.rank == 0:
            with path.open("wb") as file:
                np.lib.format.write_array_header_2_0(file, {"descr": "<f8", "fortran_order": False, "shape": shape})
        domain.comm.barrier()
        with opened(path) as file:
            np.lib.format.read_magic(file)
            stored_shape, _, _ = np.lib.format.read_array_header_2_0(file)
            self.start = file.tell()
        if stored_shape != shape:
            raise ValueError(f"{path} does not hold arrays of this run")
        self.path = path
        mpi = _mpi()
        self.file = mpi.File.Open(domain.comm, str(path), mpi.MODE_RDWR)

    def _place(self, block: int) -> int:
        planes = self.domain.sizes[0]
        plane = 8 * math.prod(self.domain.sizes[1:])
        return self.start + (block * planes + self.domain.planes[0]) * plane

    def write(self, k: int, x: Floats) -> None:
        """Write the planes of this process to array k."""
        for field, values in enumerate(x):
            self.file.Write_at_all(self._place(k * len(x) + field), np.ascontiguousarray(values))

    def read(self) -> Floats:
        """Read the planes of this process from the first array."""
        if self.file.Get_size() < self.start + 8 * self.domain.fields * math.prod(self.domain.sizes):
            raise ValueError(f"{self.path} is shorter than a state of this run")
        first, end = self.domain.planes
        x = np.empty((self.domain.fields, end - first, *self.domain.sizes[1:]))
        for field in range(len(x)):
            self.file.Read_at_all(self._place(field), x[field])
        return x

    def close(self) -> None:
        self.file.Close()


class _Frames:
    """Where frames go: an array of each process, or one file."""

    def __init__(self, domain: _Domain, path: Path | None, shape: tuple[int, ...], *, new: bool) -> None:
        self.domain, self.path, self.array = domain, path, None
        first, end = domain.planes
        if path is None:
            self.array = filled(f"{shape[0]} frames", (shape[0], shape[1], end - first, *shape[3:]))
            return
        if path.suffix != ".npy":
            raise ValueError(f"frames of processes go to files that end in .npy, not {str(path)!r}")
        self.part = _part(path)
        self.file = _SharedArrayFile(domain, self.part, shape, new=new)

    def put(self, k: int) -> None:
        x = self.domain.state()
        if self.array is not None:
            self.array[k] = x
        else:
            self.file.write(k, x)

    def close(self) -> None:
        if self.path:
            self.file.close()

    def discard(self) -> None:
        """Remove the incomplete output file."""
        self.domain.comm.barrier()
        if self.path and self.domain.comm.rank == 0:
            self.part.unlink(missing_ok=True)
        self.domain.comm.barrier()

    def finish(self) -> None:
        """Give the file its name."""
        self.domain.comm.barrier()
        if self.path and self.domain.comm.rank == 0:
            self.part.replace(self.path)
        self.domain.comm.barrier()


class _StoredState:
    """A state to go on from, in a file beside its description: two of them in turn, so that one is always whole."""

    def __init__(self, domain: _Domain, path: Path, run: Sequence[float]) -> None:
        self.domain, self.path = domain, path
        numbers = {name: float(v) for name, v in domain.values.items() if not callable(v) and np.ndim(v) == 0}
        identity = {"sizes": list(domain.sizes), "run": list(run), "parameters": numbers}
        self.identity = {"solver": domain.lattice.solver.backend.identity, **identity}

    def _file(self, count: int) -> Path:
        return self.path.with_name(f"{self.path.name}.{count % 2}.npy")

    def save(self, energy: Sequence[float]) -> None:
        """Keep the state after so many frames, then say so."""
        domain, count = self.domain, len(energy)
        state_file = _SharedArrayFile(domain, self._file(count), (domain.fields, *domain.sizes), new=True)
        state_file.write(0, domain.saved_state())
        state_file.close()
        domain.comm.barrier()
        if domain.comm.rank == 0:
            record = {"steps": domain.steps, "far": domain.far, "open": domain.open, "energy": list(energy)}
            with replacing(self.path) as file:
                file.write(json.dumps({"identity": self.identity, **record}).encode())

    def restored(self) -> list[float]:
        """Go on from what was kept; the energies of the frames before. Raises `ValueError` for that of another run."""
        domain = self.domain
        text = domain.comm.bcast(self._text() if domain.comm.rank == 0 else None)
        if not text:
            return []
        saved = json.loads(text)
        if saved["identity"] != self.identity:
            raise ValueError(f"{self.path} was stored by another run; remove it to start again")
        energy = [float(e) for e in saved["energy"]]
        state_file = _SharedArrayFile(domain, self._file(len(energy)), (domain.fields, *domain.sizes), new=False)
        domain.restore(state_file.read(), saved["steps"], saved["far"], saved["open"])
        state_file.close()
        return energy

    def _text(self) -> str:
        if not self.path.exists():
            return ""
        with opened(self.path) as file:
            return file.read().decode()

    def remove(self) -> None:
        """At the end of the run."""
        if self.domain.comm.rank == 0:
            for path in (self.path, self._file(0), self._file(1)):
                path.unlink(missing_ok=True)
        self.domain.comm.barrier()


def _mpi() -> Any:
    try:
        from mpi4py import MPI
    except ImportError:
        raise MissingPackageError("this needs mpi4py\n  hint: pip install mpi4py") from None
    return MPI
