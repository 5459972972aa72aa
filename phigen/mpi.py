"""Lattices on several processes, each of which integrates a part of the sites; needs the extra ``mpi``.

    from phigen.mpi import DistributedLattice

    lattice = DistributedLattice("heisenberg.yaml")
    run = lattice.integrate(start, h=0.05, steps=1000, stride=10, sizes=(1000, 1000, 1000), output="frames.npy")

    mpirun -n 8 python script.py

A plane is the set of all sites with one index of the first axis. Each process has adjacent planes, and runs the C
solver on its planes and on copies of the neighbouring planes (a halo). If a sweep (an update of sites) reads the halo,
the process first requests the halo from the neighbouring processes, by mpi4py. Until the halo has arrived, the process
updates its inner planes. The states are bitwise equal to the states of `LatticeSolver`, for any number of processes.
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

#: STRETCH is the number of steps between two checks that all values are finite. If a check fails, the steps are
#: repeated one by one. From the first step that fails again, FAR_STEPS steps use functions that are valid for all
#: arguments. The numbers are those of templates/c/runtime/lattice.c, so that runs on one and on several processes are
#: bitwise equal.
STRETCH, FAR_STEPS = 32, 64

#: Arguments of `LatticeSolver.integrate` that are refused on several processes. They need parts of steps, or copies of
#: the solver.
_WHOLE_ONLY = ("until", "every", "at", "stop", "section", "retry")

#: An array over the whole lattice, or a function. The function f(first, end) returns the planes first … end − 1 of the
#: array. A plane is the set of all sites with one index of the first axis.
Given = Any


@dataclass(frozen=True, eq=False)
class DistributedRun:
    """Results of a run on several processes; each process has an object of its own.

    ``t`` and ``energy`` (frames,) refer to the whole lattice. ``x`` (frames, coordinates, planes, …) has the planes of
    this process, ``planes[0]`` … ``planes[1]`` − 1. If frames went to a file, ``x`` is None. ``waiting`` is the time in
    seconds that this process waited for planes of its neighbours.
    """

    t: Floats
    energy: Floats
    x: Floats | None
    planes: tuple[int, int]
    steps: int
    waiting: float


class DistributedLattice:
    """Solver of a lattice whose sites are divided among the processes of an MPI communicator.

    ``source`` is an argument of `phigen.compile`, or a `LatticeSolver` for C in profile fast. ``comm`` is the
    communicator, by default that of all processes. The lattice must be a grid with scheme splitting. Raises
    `ValueError` for other lattices.
    """

    def __init__(self, source: Any, comm: Any = None, order: int | None = None) -> None:
        self.comm = comm if comm is not None else _mpi().COMM_WORLD
        self.solver = source if isinstance(source, LatticeSolver) else self._compiled(source, order)
        backend = self.solver.backend
        if not isinstance(backend, CLattice):
            raise ValueError(f"DistributedLattice needs a lattice that is compiled to C, not {self.solver!r}")
        self.stages = backend.stages()
        self.period = self.solver.interface.colour_period

    def _compiled(self, source: Any, order: int | None) -> LatticeSolver:
        from phigen.api import compilation_of, lattice_solver_of

        compilation = compilation_of(source, order=order, profile="fast")
        if self.comm.rank == 0:
            lattice_solver_of(compilation, "c")  # puts the compiled C into the cache, for all other processes
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

        ``x0`` is an array (coordinates, *sizes), or a function. A call x0(first, end) returns an array (coordinates,
        end − first, …) with the planes first … end − 1, where a plane is the set of all sites with one index of the
        first axis. If ``x0`` is a function, ``sizes`` is required. Parameters at sites may be functions as
        well. Frames are written to ``output``, a ``.npy`` file that all processes share.

        ``checkpoints`` is a path. The state is stored there with every frame. If a run is interrupted, the same call
        continues it, on any number of processes. With ``resume=False``, files of an interrupted run are an error
        instead.

        Raises on all processes: `StepError` if a step fails, and `ValueError` if existing files do not allow the run to
        begin or to continue.
        """
        for name in _WHOLE_ONLY:
            if name in more and name not in self.solver.interface.parameters:
                hint = "integrate in one process, or make a number of whole steps and continue from the last state"
                raise TypeError(
                    f"{name} is not available on several processes, which store rows after whole steps only: {hint}"
                )
        if checkpoints and not output:
            raise ValueError("checkpoints= needs output=, the file with the earlier frames of an interrupted run")
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
        )  # defaults are computed for the whole lattice, since this process has only some of its planes
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
        except StepError:  # raised on all processes. The run cannot be continued, so its files are removed.
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
    """The part of a lattice on one process: its planes, copies of neighbouring planes, and the steps of the planes. A
    plane is the set of all sites with one index of the first axis.

    The last flow of a step is merged with the first flow of the next step. So the last flow is not applied at once;
    until it is applied, ``open`` is true.
    """

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
        if self.noisy:  # the random numbers of a site depend on its position in the whole lattice
            session.set_planes((self.planes[0] - ghosts[0]) % sizes[0], sizes[0])
        self.session.begin(h)
        self.fields = len(lattice.solver.coordinates)
        self.dirty = 0
        self.steps, self.far, self.open = 0, 0, False
        self.saved = self._all()
        self.waiting = 0.0

    # --- distribution of planes

    def _share(self, planes: int, reach: int) -> tuple[int, int]:
        """Return the index of the first plane of this process, and that of the plane after the last one.

        The colours of sites repeat after some number of planes. Each process but the last has a multiple of this number
        of planes. The processes have nearly equal numbers of planes.
        """
        period, count, rank = self.lattice.period, self.comm.size, self.comm.rank
        if planes < count * max(reach, period):
            most = planes // max(reach, period)
            raise ValueError(
                f"{planes} sites along the first axis are too few for {count} processes; at most {most} are possible"
            )
        units = -(-planes // period)
        first, end = (min(planes, units * r // count * period) for r in (rank, rank + 1))
        return first, end

    def _neighbours(self) -> list[int | None]:
        """Return the ranks of the processes whose planes lie before, and after, the planes of this process.

        A rank is None if the planes of this process end at an open end of the lattice.
        """
        rank, count, is_open = self.comm.rank, self.comm.size, self.lattice.solver.interface.first_open
        behind = None if is_open and rank == 0 else (rank - 1) % count
        ahead = None if is_open and rank == count - 1 else (rank + 1) % count
        return [behind, ahead]

    def _planes_of(self, values: Given, first: int, end: int, axis: int) -> Floats:
        """Return the planes first … end − 1 of ``values``, an array or a function. Indices outside the lattice wrap
        around.
        """
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
        """Return the planes first … end − 1 of a parameter at sites; other parameters are returned unchanged."""
        if name in self.lattice.solver.interface.at_sites and (callable(value) or np.ndim(value)):
            return self._planes_of(value, first, end, axis=0)
        return value

    # --- steps

    def advance(self, steps: int) -> None:
        """Make ``steps`` steps. Raises `StepError`.

        The last flow of a step is merged with the first flow of the next step. After all steps, the last flow of the
        last step is applied alone.
        """
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
        self._set_solver_time(self.steps)

    def _set_solver_time(self, steps: int) -> None:
        """Set the time and the number of steps in the solver, if H or the noise depends on them."""
        if self.lattice.solver.interface.time or self.noisy:
            self.session.passed(self.h, steps)

    def _attempt_steps(self, steps: int) -> bool:
        """Make ``steps`` steps and return True; if a value is not finite, restore the saved state and return False."""
        for step in range(steps):
            self._set_solver_time(self.steps + step)
            if self.noisy:  # with noise, no flows of different steps are merged
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
        """Apply the last flow of the last step, if it is still missing. The attribute ``saved`` does not change."""
        if not self.open:
            return
        self._set_solver_time(self.steps - 1)
        self._stage(self.joined - 1)
        if not self._holds() and self.far == 0:
            self._put_all(self.saved)
            self._stage(self.joined - 1, far=True)

    def _stage(self, number: int, far: bool = False) -> None:
        """Make one sweep (an update of sites) over all planes of this process.

        If ``far`` is true, the sweep uses functions that are valid for all arguments. If the sweep reads halos (copies
        of neighbouring planes) that are out of date, the halos are requested first. The inner planes are updated while
        the halos are being received, and the outer planes after that.
        """
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
        """Send the planes that neighbouring processes read, and request planes from them.

        ``fields`` is a bit mask of the coordinates to be exchanged. Returns a tuple for each message to be received:
        (request, coordinate, planes of the halo, buffer). The halo consists of the copies of neighbouring planes.
        """
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
                    # Tags: 2 * field for messages from the process ahead, 2 * field + 1 for messages from the process
                    # behind.
                    requests.append((self.comm.Irecv(buffer, neighbour, 2 * field + 1 - tag), field, theirs, buffer))
        self._sent = sent
        return requests

    def _received(self, requests: Sequence[tuple[Any, int, tuple[int, int], Floats]]) -> None:
        """Wait for the requested planes of neighbouring processes, and copy them into the halos."""
        begin = time.perf_counter()
        _mpi().Request.Waitall([request for request, *_ in requests])
        self.waiting += time.perf_counter() - begin
        for _, field, planes, buffer in requests:
            self.session.put_planes(field, *planes, buffer)
        _mpi().Request.Waitall(self._sent)

    # --- the state

    def _holds(self) -> bool:
        """Whether all values of the state are finite, on all processes."""
        return bool(self.comm.allreduce(int(self.session.holds(*self.own)), op=_mpi().MIN))

    def _all(self) -> list[Floats]:
        return [self.session.planes(field, 0, self.total) for field in range(self.fields)]

    def _put_all(self, saved: Sequence[Floats]) -> None:
        for field, values in enumerate(saved):
            self.session.put_planes(field, 0, self.total, values)
        self.dirty = (1 << self.fields) - 1

    def state(self) -> Floats:
        """The state on the planes of this process, (coordinates, planes, …)."""
        return np.array([self.session.planes(field, *self.own) for field in range(self.fields)])

    def energy(self) -> float:
        """Return H of the whole lattice, on all processes. The sums over single planes are added by `math.fsum`."""
        self._received(self._request_halos(self.dirty))
        self.dirty = 0
        density = self.session.density()[self.own[0] : self.own[1]]
        sums = density.reshape(len(density), -1).sum(axis=1)
        return math.fsum(value for part in self.comm.allgather(sums) for value in part.tolist())

    def restore(self, x: Floats, steps: int, full_range: int, is_open: bool) -> None:
        """Continue from a stored state; ``x`` (coordinates, planes, …) has the planes of this process.

        ``steps``, ``full_range`` and ``is_open`` are the values that the attributes ``steps``, ``far`` and ``open`` had
        when the state was stored.
        """
        for field in range(self.fields):
            self.session.put_planes(field, *self.own, x[field])
        self.dirty = (1 << self.fields) - 1
        self.saved = self._all()
        self.steps, self.far, self.open = steps, full_range, is_open
        self._set_solver_time(steps)

    def saved_state(self) -> Floats:
        """Return this process's planes of ``saved``, the state from which further steps continue.

        If ``open`` is true, the last flow of the last step is missing in this state.
        """
        return np.array([values[self.own[0] : self.own[1]] for values in self.saved])


def _part(path: Path) -> Path:
    """Return the path of the file of frames while the run is incomplete."""
    return path.with_name(path.name + ".part")


def _objection(output: Path | None, checkpoints: Path | None, *, resume: bool) -> str:
    """Return the reason why existing files do not allow a run to begin or to continue; "" if they allow it."""
    if checkpoints:
        return objection(checkpoints, output, resume=resume, how="resume=True")
    return objection_to_frames(_part(output)) if output else ""


class _SharedArrayFile:
    """File ``.npy`` with an array (…, coordinates, *sizes). Each process writes and reads its own planes."""

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
        """Return the offset, in bytes, at which block ``block`` of the file has the planes of this process.

        There is one block for each state in the file and each coordinate.
        """
        planes = self.domain.sizes[0]
        plane = 8 * math.prod(self.domain.sizes[1:])
        return self.start + (block * planes + self.domain.planes[0]) * plane

    def write(self, k: int, x: Floats) -> None:
        """Write the planes of this process as part of state number ``k``."""
        for field, values in enumerate(x):
            self.file.Write_at_all(self._place(k * len(x) + field), np.ascontiguousarray(values))

    def read(self) -> Floats:
        """Return the planes of this process in the first state of the file."""
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
    """Frames of a run. They are in one file for all processes or, without a path, in an array of each process."""

    def __init__(self, domain: _Domain, path: Path | None, shape: tuple[int, ...], *, new: bool) -> None:
        self.domain, self.path, self.array = domain, path, None
        first, end = domain.planes
        if path is None:
            self.array = filled(f"{shape[0]} frames", (shape[0], shape[1], end - first, *shape[3:]))
            return
        if path.suffix != ".npy":
            raise ValueError(f"output= must be a file that ends in .npy, not {str(path)!r}")
        self.part = _part(path)
        self.file = _SharedArrayFile(domain, self.part, shape, new=new)

    def put(self, k: int) -> None:
        """Store the present state as frame ``k``."""
        x = self.domain.state()
        if self.array is not None:
            self.array[k] = x
        else:
            self.file.write(k, x)

    def close(self) -> None:
        if self.path:
            self.file.close()

    def discard(self) -> None:
        """Remove the output file of a run that failed."""
        self.domain.comm.barrier()
        if self.path and self.domain.comm.rank == 0:
            self.part.unlink(missing_ok=True)
        self.domain.comm.barrier()

    def finish(self) -> None:
        """Rename the complete file of frames to its final path."""
        self.domain.comm.barrier()
        if self.path and self.domain.comm.rank == 0:
            self.part.replace(self.path)
        self.domain.comm.barrier()


class _StoredState:
    """Files with the state of a run, from which the run can be continued after an interruption.

    A JSON file at ``path`` describes the state. The values of the state are in one of two further files, which are
    written alternately, so that the last complete state is never overwritten.
    """

    def __init__(self, domain: _Domain, path: Path, run: Sequence[float]) -> None:
        self.domain, self.path = domain, path
        numbers = {name: float(v) for name, v in domain.values.items() if not callable(v) and np.ndim(v) == 0}
        identity = {"sizes": list(domain.sizes), "run": list(run), "parameters": numbers}
        self.identity = {"solver": domain.lattice.solver.backend.identity, **identity}

    def _file(self, count: int) -> Path:
        """Return the path of the file for the state after ``count`` frames. Two paths are used alternately."""
        return self.path.with_name(f"{self.path.name}.{count % 2}.npy")

    def save(self, energy: Sequence[float]) -> None:
        """Store the present state, and then its description. ``energy`` has the energies of all frames until now."""
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
        """Restore the stored state, and return the energies of all frames up to this state; [] if nothing is stored.

        Raises `ValueError` if another run has stored the state.
        """
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
        """Return the text of the JSON file that describes the stored state; "" if there is none."""
        if not self.path.exists():
            return ""
        with opened(self.path) as file:
            return file.read().decode()

    def remove(self) -> None:
        """Remove all files of the stored state, on all processes together."""
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
