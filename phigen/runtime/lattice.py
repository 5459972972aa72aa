"""Solvers of lattices of any size, and their trajectories of states (coordinates, *sizes), in memory or in a file."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phigen.display import display
from phigen.errors import ParameterError, StepError
from phigen.geometry.conservation import SITES, Unit, unit_of
from phigen.memory import expect_room
from phigen.runtime import (
    arguments,
    checkpoint,
    ending,
    lattice_ensemble,
    lattice_gradients,
    lattice_series,
    runs,
    spectra,
)
from phigen.runtime.arguments import Beginning
from phigen.runtime.crossings import Function
from phigen.runtime.gradients import Pullback
from phigen.runtime.interface import (
    FIRST_DRAWS,
    BackendError,
    Draws,
    Floats,
    LatticeInterface,
    MissingExtraError,
    Progress,
    row_steps,
)
from phigen.runtime.lattice_course import LatticeCourse, ObservedCourse
from phigen.runtime.lattice_frames import (
    FrameRows,
    Frames,
    GrowingFrames,
    add_member,
    expect_columns,
    stream_path,
    write_whole,
)
from phigen.runtime.lattice_rows import Crossed, IntegrationPlan, strided, timed, timed_in_tau
from phigen.runtime.lattice_run import LatticeRun
from phigen.runtime.lattice_series import LatticeSeries, NumberRows, expect_table, recordable
from phigen.runtime.live import LiveLattice
from phigen.runtime.named import Named
from phigen.runtime.sections import function_of
from phigen.runtime.spectra import Correlation, DynamicSpectrum, Transforms
from phigen.runtime.timed import moved_on
from phigen.writing import replacing

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from phigen.spec.model import Run, Spec
    from phigen.symbolic.expression import Expression

#: Vectorised sin and cos of the C accept only angles up to 10⁸. If a value of the state exceeds this smaller limit, the
#: message about a failed step mentions angles.
_LARGE_ANGLE = 5e7


class LatticeSession(Protocol):
    """Protocol of a lattice that is integrated step by step. If a step fails, `BackendError` is raised, and the state
    before the step remains."""

    @property
    def steps(self) -> int:
        """The number of successful steps since the start."""
        ...

    def state(self) -> Floats:
        """Return a copy of the state (coordinates, *sizes)."""
        ...

    def time(self) -> float:
        """Return the physical time since the start, for a lattice with a monitor."""
        ...

    def hold(self, level: float) -> None:
        """Set the energy level e of a lattice with a monitor; by default e is −H of the initial state."""
        ...

    def advance(self, h: float, steps: int) -> None:
        """Make ``steps`` steps of size ``h``."""
        ...

    def advance_tangent(self, h: float, vectors: Floats, steps: int = 1) -> Floats:
        """Make ``steps`` steps, and return the ``vectors`` (count, coordinates, *sizes) multiplied by the derivatives
        of the steps.

        Raises `MissingExtraError` if the solver was compiled without ``tangent``.
        """
        ...

    def saved(self) -> dict[str, Any]:
        """Return the arrays that `resume` needs, besides the state, to continue this integration bit for bit."""
        ...

    def resume(self, h: float, steps: int, arrays: Mapping[str, Any]) -> None:
        """Continue an integration after ``steps`` steps of size h, from the state with which the session was started.

        ``arrays`` are the result of `saved` at that state.
        """
        ...

    def place(self, x: Floats) -> None:
        """Replace the state by ``x`` (coordinates, *sizes); time, step number and parameters are unchanged.

        With a monitor, the energy level e becomes −H(x). Raises `BackendError` if x is not finite.
        """
        ...

    def kick(self, change: Floats) -> None:
        """Add ``change`` (coordinates, *sizes) to the state. Raises `BackendError` if the sum is not finite."""
        ...

    def hamiltonian(self) -> float:
        """Return H of the state."""
        ...

    def density(self) -> Floats:
        """Return the density of H at the sites (*sizes)."""
        ...

    def casimirs(self) -> Floats:
        """Return an array (Casimirs, *sizes): the density of each Casimir at each site. `reduced` computes the Casimirs
        from the densities.
        """
        ...

    def vector_field(self) -> Floats:
        """Return π∇H (coordinates, *sizes)."""
        ...

    def observables(self) -> Floats:
        """Return the observables that are one number each (observables,)."""
        ...

    def observed_fields(self) -> Floats:
        """Return the observables with a value at each site (fields, *sizes)."""
        ...


class LatticeBackend(Protocol):
    """Protocol of the loaded solver of a lattice, in the language of one target."""

    target: str

    @property
    def identity(self) -> str:
        """A hash of everything that determines the results. Checkpoints store it."""
        ...

    def start(
        self, x0: Floats, parameters: Mapping[str, Any], t0: float = 0.0, draws: Draws = FIRST_DRAWS
    ) -> LatticeSession:
        """Return a session at x0 (coordinates, *sizes), at the time t0."""
        ...

    def threads(self, sites: int) -> int:
        """Return the number of threads that share the work on a lattice of ``sites`` sites."""
        ...

    @property
    def has_pullback(self) -> bool:
        """Whether the solver was compiled with ``adjoint``, and so has `pullback`."""
        ...

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
        """Return the rows (rows, coordinates, *sizes) of a run from the time t0 on, and the cotangents of x0 and of
        parameters.

        ``bars`` are the cotangents of the rows. The cotangents that are returned have the shapes of x0 and of the
        parameters. Raises `MissingExtraError` if the solver was compiled without ``adjoint``.
        """
        ...


@dataclass(frozen=True, eq=False)
class LatticeTrajectory:
    """States of a lattice along one integration, called frames. The first frame is the initial state, the last frame
    the final state.

    ``t`` (frames,) are the times, ``x`` (frames, coordinates, *sizes) the states, as a memory map if they were written
    to a file, and ``energy`` (frames,) the values of H. The integration made ``steps`` steps of size ``h``, with a
    frame after every stride-th step, or at each given time. The last frame is at the end, which may be inside a step.
    ``observed`` (frames, observables) are the observables that are one number each. ``crossings`` has the states at
    which the trajectory crosses the section of the run. ``retried`` are the indices, from 0 on, of those steps that
    failed and were repeated as smaller steps.

    With a monitor (dt = g dτ), ``h`` is a step in τ, and ``tau`` (frames,) has the values of τ. ``tau`` is None without
    a monitor. If the run continues another run, ``joined`` is true and ``tau`` None. ``structure_factor`` and
    ``correlated`` are the results of the keys ``spectrum`` and ``correlation`` of a run; ``origin`` is the provenance
    text for files.
    """

    t: Floats
    x: Floats
    energy: Floats
    steps: int
    h: float
    parameters: Mapping[str, Any]
    coordinates: tuple[str, ...]
    axes: tuple[str, ...]
    solver: LatticeSolver = field(repr=False)
    observed: Floats = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    crossings: LatticeTrajectory | None = field(default=None, repr=False)
    retried: tuple[int, ...] = ()
    tau: Floats | None = None
    joined: bool = False
    structure_factor: DynamicSpectrum | None = field(default=None, repr=False)
    correlated: Correlation | None = field(default=None, repr=False)
    origin: str = field(default="", repr=False)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        sizes = "×".join(map(str, self.x.shape[2:]))
        return f"<LatticeTrajectory of ({', '.join(self.coordinates)}) on {sizes} sites: {len(self)} frames>"

    def _repr_html_(self) -> str:
        """Return a table for notebooks: the first and the last state, and the errors of conserved quantities."""
        return cast(str, display("page of a lattice trajectory")(self))

    def plot(self) -> Figure:
        """Return a figure of the states. The states of a chain are drawn over space and time, those of other lattices
        at some times.

        Panels below show the errors of conserved quantities. Notebooks show the figure; ``.savefig(path)`` writes it.
        Raises `MissingPackageError` without matplotlib.
        """
        return cast("Figure", display("figure of a lattice run")(self, self.changes(), ""))

    def to_xarray(self) -> xr.Dataset:
        """Return an `xarray.Dataset`: ``x`` (t, coordinate, *axes), ``energy`` (t), and the Casimirs
        ``casimir_NAME``.

        Casimirs of each site have the dimensions (t, *axes), others (t). Parameters that are arrays are variables
        ``parameter_NAME``; other parameters are attributes. Raises `MissingPackageError` without xarray.
        """
        from phigen.runtime.exchange import lattice_to_xarray

        return lattice_to_xarray(self)

    def changes(self) -> dict[str, Floats]:
        """Return the absolute changes since the start (frames,) of the energy and of each Casimir, by name.

        The change of the energy is in units of `energy_scale`, and includes the effects of time, forces and noise. For
        a Casimir of each site, the largest change at any site is returned.
        """
        changes = {"energy": np.abs(self.energy - self.energy[0]) / self.energy_scale}
        return changes | self.casimir_changes()

    @property
    def energy_scale(self) -> float:
        """The unit in which errors of the energy are given: |H| at the start or, if that is nearly 0, Σ |energy of a
        site|."""
        return self.energy_unit.size

    @property
    def energy_unit(self) -> Unit:
        """The unit in which errors of the energy are given, with the reason for its choice."""
        when = float(self.t[0]) if self.solver.interface.time else None
        sites = np.abs(self.solver.density(self.x[0], when, parameters=self.parameters)).sum()
        return unit_of(float(self.energy[0]), float(sites), SITES)

    @property
    def casimirs(self) -> dict[str, Floats]:
        """The Casimirs by name: arrays (frames, *sizes) for Casimirs of each site, (frames,) for sums and products over
        sites."""
        rows = list(self._casimirs_by_frame())
        return {name: np.array([row[name] for row in rows]) for name in self.solver.interface.casimirs}

    @property
    def observables(self) -> dict[str, Floats]:
        """The observables of the spec by name: arrays (frames, *sizes) for observables of each site, (frames,) for all
        others."""
        interface = self.solver.interface
        numbers = {name: self.observed[:, k] for k, name in enumerate(interface.observables)}
        if not interface.observed_fields:
            return numbers
        times = self.t.tolist() if interface.time else [None] * len(self)
        frames = zip(self.x, times, strict=True)
        rows = [self.solver.observables(x, t, parameters=self.parameters) for x, t in frames]
        return numbers | {name: np.array([row[name] for row in rows]) for name in interface.observed_fields}

    def _casimirs_by_frame(self) -> Iterator[dict[str, Any]]:
        return (self.solver.casimirs(x, parameters=self.parameters) for x in self.x)

    def casimir_changes(self) -> dict[str, Floats]:
        """Return the absolute change (frames,) of each Casimir since the start, by name.

        For a Casimir of each site, this is the largest change at any site. Frames are read one by one, so that only one
        frame is in memory.
        """
        if not self.solver.interface.casimirs:
            return {}
        frames = self._casimirs_by_frame()
        first = next(frames)
        rows = [dict.fromkeys(first, 0.0)]
        rows += [{name: float(np.abs(row[name] - first[name]).max()) for name in first} for row in frames]
        return {name: np.array([row[name] for row in rows]) for name in first}

    def transforms(self) -> dict[str, tuple[tuple[str, ...], Floats]]:
        """Return the spectrum and the correlation that the run requested as a dict: name → (names of dimensions,
        values).

        The names are ``spectrum``, ``spectrum_q_AXIS``, ``spectrum_omega`` and ``correlation``. A result that the run
        did not request is missing.
        """
        spectrum, pair = self.structure_factor, self.correlated
        arrays = spectrum.variables("spectrum", "spectrum_") if spectrum else {}
        return arrays | ({"correlation": (("distance",), pair.values)} if pair else {})

    def column(self, coordinate: str) -> Floats:
        """Return the values (frames, *sizes) of one coordinate. Raises `KeyError` if there is no coordinate of that
        name."""
        if coordinate not in self.coordinates:
            raise KeyError(f"{coordinate!r} is not a coordinate; there are {', '.join(self.coordinates)}")
        return self.x[:, self.coordinates.index(coordinate)]

    def spectrum(self, of: Sequence[str], *, after: float | None = None) -> DynamicSpectrum:
        """Return the dynamic structure factor S(q, ω) of the coordinates ``of`` on a grid, from the frames of this
        trajectory.

        ``after`` and the errors are documented in `spectra.spectrum`.
        """
        return spectra.spectrum(self, of, after=after)

    def correlation(
        self, of: str, other: str | None = None, *, axis: str | None = None, up_to: int, after: float | None = None
    ) -> Floats:
        """Return ⟨f(r) g(r + d)⟩ − ⟨f⟩⟨g⟩ for d = 0 … ``up_to`` sites, where f and g are coordinates.

        The argument ``of`` is the name of f. The argument ``other`` is the name of g, by default that of f. The
        distance d is along ``axis``, by default the first axis. ``after`` and the errors are documented in
        `spectra.correlation`.
        """
        return spectra.correlation(self, of, other or of, axis or self.axes[0], up_to, after=after)

    def at(self, times: ArrayLike) -> Floats:
        """Return the states (times, coordinates, *sizes) at given times, computed by steps of the method from the
        nearest frame.

        Conventions and errors are those of `phigen.Trajectory.at`.
        """
        return self.solver.states_at(self, arguments.times_within(times, self.t))

    def save(self, path: str | Path) -> None:
        """Write the trajectory to a file in the format that the suffix of the path names.

        A ``.npz`` has the arrays t, x, energy, coordinates, axes, steps, h, observable_NAME and parameter_NAME. A
        ``.npy`` has the frames only. A ``.csv`` has one column for each number of a state, at most 1,000. A ``.zarr``
        has the variables of `to_xarray`. Raises `ValueError` for other suffixes.
        """
        target = stream_path(path)
        if target is None:
            write_whole(Path(path), self)
            return
        if target.suffix == ".npy":
            with replacing(target) as file:
                np.lib.format.write_array(file, np.asarray(self.x), allow_pickle=False)
            return
        with replacing(target) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
            add_member(archive, "x", self.x)
            for name, value in self._further().items():
                add_member(archive, name, value)

    def _further(self) -> dict[str, Any]:
        entries = {"t": self.t, "energy": self.energy, "steps": self.steps, "h": self.h}
        entries |= {"origin": np.array(self.origin)} if self.origin else {}
        entries |= {} if self.tau is None else {"tau": self.tau}
        entries |= {f"observable_{name}": values for name, values in self.observables.items()}
        entries |= {name: values for name, (_, values) in self.transforms().items()}
        name_entries = {"coordinates": np.array(self.coordinates), "axes": np.array(self.axes)}
        return {**entries, **name_entries, **{f"parameter_{name}": value for name, value in self.parameters.items()}}


class LatticeSolver(Named[LatticeBackend, LatticeInterface]):
    """A compiled lattice: ``solver.integrate(x0, h=0.05, steps=1000, stride=10, J=2.0)``, x0 (coordinates, *sizes).

    Parameters are keyword arguments, or entries of ``parameters={…}``. A parameter at sites is an array (*sizes), a
    parameter at bonds an array (bonds,); one number holds for all sites or bonds. Parameters that are not passed have
    the defaults of the spec, evaluated at the sizes of the state. If such a default is a list or a file, but does not
    have one value for each site or bond, `SpecError` is raised. A graph also takes ``bonds`` as an argument, an array
    (bonds, 2) of site numbers, which begin at 0. Wrong arguments raise `ValueError` or `TypeError`, and a failing step
    `phigen.StepError`. Several threads may use a solver.
    """

    def __init__(self, backend: LatticeBackend, interface: LatticeInterface, spec: Spec | None = None) -> None:
        self.backend, self.interface, self.spec = backend, interface, spec

    @property
    def device(self) -> Any:
        """The device that lattices are integrated on, with its ``name`` and ``memory``; None for other targets."""
        return getattr(self.backend, "device", None)

    def __repr__(self) -> str:
        interface = self.interface
        fields = ", ".join(interface.coordinates)
        return f"<LatticeSolver {interface.name}: order {interface.order}, target {self.target}, ({fields})>"

    # --- runs

    def integrate(
        self,
        x0: ArrayLike,
        h: float,
        steps: int | None = None,
        stride: int = 1,
        *,
        until: float | None = None,
        retry: int = 0,
        t0: float | None = None,
        seed: int | None = None,
        member: int | None = None,
        step0: int | None = None,
        output: str | Path | None = None,
        checkpoints: str | Path | None = None,
        resume: bool = True,
        progress: Progress | None = None,
        parameters: Mapping[str, Any] | None = None,
        **by_keyword: Any,
    ) -> LatticeTrajectory:
        """Make ``steps`` steps of size ``h`` from ``x0`` (coordinates, *sizes), and return the trajectory of the
        frames.

        Frames are the states after every ``stride``-th step and after the last. With ``until`` in place of ``steps``,
        the last step is shortened to end at that time. A step that fails is repeated as 2, 4, …, up to 2**retry smaller
        steps. The composition of the smaller steps is a Poisson map, but not the map of the whole step. With a monitor
        (dt = g dτ), ``h`` is a step in τ, and ``gauge=e`` sets the energy level e, by default −H of the start.

        ``t0`` is the time of ``x0``, 0 by default, for Hamiltonians that depend on the time. With noise, the random
        numbers of a site are a function of ``seed``, ``member``, the site, and the number of the step, where ``step0``
        is the number of the first step. ``output`` is the path of a file for the frames. If the path ends in .npy or
        .npz, frames are written one by one. If it ends in .csv, all frames are written at the end, and a state may have
        at most 1,000 numbers.

        ``checkpoints`` is the path of a file in which the state is saved at every frame. A call with the same arguments
        resumes from that state. The file is removed at the end of the run. ``resume=False`` starts a new run, and
        refuses to overwrite the files of an interrupted one. ``progress`` is called after each frame with the number of
        steps done. Raises `StepError`, whose ``trajectory`` ends with the state before the failing step. Raises
        `ValueError` if the call would overwrite files of an interrupted run, or resume a complete run.
        """
        noise_arguments = {"seed": seed, "member": member, "step0": step0}
        beginning = self._beginning(x0, "x0", h, parameters, by_keyword, t0, noise_arguments)
        plan = self._planned(beginning, steps, stride, until, retry)
        storage: Any = {"output": output, "checkpoints": checkpoints, "resume": resume, "progress": progress}
        return self.framed(plan, **storage)

    def _planned(
        self, beginning: Beginning, steps: int | None, stride: int, until: float | None, retry: int
    ) -> IntegrationPlan:
        """Return the plan of an integration over a number of steps, or up to the time ``until``.

        Exactly one of ``steps`` and ``until`` must be passed.
        """
        if (steps is None) == (until is None):
            requirement = "needs the number of steps, or the time until which to integrate"
            raise TypeError(f"integrate {requirement if steps is None else 'takes either steps or until, not both'}")
        stride, retry = arguments.count(stride, "stride", 1), arguments.count(retry, "retry", 0)
        if retry:
            arguments.expect_no_noise("retry", self.interface)
        if until is None:
            return IntegrationPlan(
                beginning, strided(beginning.h, arguments.count(steps or 0, "steps", 0), stride), beginning.t0, retry
            )
        end = ending.at_time(
            ObservedCourse.begun(self, beginning, retry), beginning.h, arguments.end(until, beginning.t0, beginning.h)
        )
        return IntegrationPlan(beginning, strided(beginning.h, end.steps, stride, end), beginning.t0, retry)

    def carried_out(
        self, plan: IntegrationPlan, names: Sequence[str] = (), **options: Any
    ) -> LatticeTrajectory | LatticeSeries:
        """Integrate as planned. Record the quantities ``names`` or, if there are no names, the states.

        ``options`` are the arguments of `numbered` and `framed` about files and progress.
        """
        return self.numbered(plan, names, **options) if names else self.framed(plan, **options)

    def framed(
        self,
        plan: IntegrationPlan,
        *,
        output: str | Path | None = None,
        checkpoints: str | Path | None = None,
        resume: bool = True,
        progress: Progress | None = None,
    ) -> LatticeTrajectory:
        """Integrate as planned, and return the trajectory with a state for each row. Files and errors are those of
        `integrate`."""
        shape, stream = plan.at.x.shape, stream_path(output) if output else None
        table = Path(output) if output and stream is None else None
        if table and table.suffix == ".csv":
            expect_columns(shape)
        if plan.transforms:
            plan.transforms.expect_frames(plan.times, plan.at.h)
        count = len(plan.times)
        frames = Frames(stream, (count, *shape))
        grown = GrowingFrames()
        rows, met = FrameRows(frames, lattice_series.CHECKPOINT_SECONDS if table else 0.0), FrameRows(grown)
        run = LatticeRun(self, plan, rows, met, Path(checkpoints) if checkpoints else None)
        self._expect_place(run, output, frames, resume=resume)

        def made(t: Floats, x: Floats, steps: int) -> LatticeTrajectory:
            crossed = np.array(run.crossed)
            crossings = self._trajectory(crossed, grown.whole(shape), met, steps, plan) if plan.section else None
            retried, continues = tuple(run.course.retried), plan.past is not None
            crossings = crossings and replace(crossings, origin=plan.origin)
            trajectory = replace(self._trajectory(t, x, rows, steps, plan), origin=plan.origin)
            return replace(trajectory, crossings=crossings, retried=retried, tau=run.tau, joined=continues)

        try:
            run.make(progress)
        except BackendError as error:
            frames.discard()
            run.forget()
            last = run.course.sites
            rows.record(last)
            states = np.array([*frames.first(len(rows) - 1), last.state()])
            steps_done = run.course.steps
            clock = run.course.time()
            t = np.append(run.times, plan.begin + (plan.at.h * steps_done if math.isnan(clock) else clock))
            run.numbers.append(float(steps_done))
            failed = made(t, states, steps_done + (plan.past.steps if plan.past else 0))
            raise self.failure(error, plan.at.h, failed, plan.at.values) from error
        trajectory = made(run.times, frames.array, plan.steps)
        if plan.transforms:
            structure_factor, correlated = plan.transforms.of(trajectory)
            trajectory = replace(trajectory, structure_factor=structure_factor, correlated=correlated)
        if table:
            trajectory.save(table)
        frames.finish(trajectory)
        run.forget()
        return trajectory

    def _expect_place(self, run: LatticeRun, output: str | Path | None, frames: Frames | None, *, resume: bool) -> None:
        """Raise `ValueError` if the run would overwrite files of an interrupted run, or resume a run that is complete.

        If the run continues a complete run, it may overwrite the output file of that run.
        """
        if run.checkpoints:
            target = Path(output) if output and run.plan.past is None else None
            refused = checkpoint.objection(run.checkpoints, target, resume=resume, how="resume=True")
        else:
            refused = frames.objection() if frames else ""
        if refused:
            raise ValueError(refused)

    def run(
        self,
        name: str | None = None,
        *,
        x0: ArrayLike | None = None,
        sizes: Sequence[int] | None = None,
        step: float | None = None,
        steps: int | None = None,
        until: float | None = None,
        stride: int | None = None,
        every: float | None = None,
        at: Sequence[float] | None = None,
        retry: int = 0,
        seed: int | None = None,
        output: str | Path | None = None,
        checkpoints: str | Path | None = None,
        progress: Progress | None = None,
        parameters: Mapping[str, Any] | None = None,
        **by_keyword: Any,
    ) -> LatticeTrajectory | LatticeSeries:
        """Integrate a run of the spec, the first by default, and return what `integrate` returns.

        A run whose ``record`` has no ``state`` returns the result of `series`. The initial state, the bonds, and
        parameters at sites and bonds are computed from the formulas, files and random numbers of the run, for its
        ``sizes`` or for the argument ``sizes``. The arguments ``step``, ``steps``, ``until``, ``stride``, ``every``,
        ``at`` and ``seed`` replace the settings of the spec that have these names. ``x0`` (coordinates, *sizes) is the
        initial state; ``retry`` is explained at `integrate`. A run with ``stop`` ends where the expression ``stop``
        first passes through 0. ``crossings`` of the result are crossings of the ``section``. Raises `ValueError` if
        there is no run of that name, and `SpecError` for an initial state that does not fit the sizes.
        """
        from phigen.lattice.states import start_of

        base = runs.run_named(self.spec, name)
        assert self.spec is not None
        settings = runs.Settings(step, steps, until, stride, every, sizes, at)
        changed_run = runs.changed(self.spec, base, settings)
        start = start_of(self.spec, changed_run)
        t0 = float(changed_run.start) if self.interface.time else None
        noise_arguments = {"seed": changed_run.seed if seed is None and self.interface.noise else seed}
        values = start.arguments | arguments.together(parameters, by_keyword)
        beginning = self._beginning(
            start.state if x0 is None else x0, "x0", float(changed_run.step), values, {}, t0, noise_arguments
        )
        plan = self._plan_of(changed_run, beginning, arguments.count(retry, "retry", 0))
        recorded = changed_run.record if changed_run.records_numbers else ()
        return self.carried_out(plan, recorded, output=output, checkpoints=checkpoints, progress=progress)

    def _plan_of(self, run: Run, beginning: Beginning, retry: int) -> IntegrationPlan:
        """Return the plan of a run of the spec; ``beginning`` are the initial values, already checked."""
        if retry or run.is_timed:
            arguments.expect_no_noise("retry" if retry else "every", self.interface)
        end, in_tau = None, self.interface.monitored and run.is_timed
        if run.stop is not None or run.until is not None or in_tau:
            stop = self.function(run.stop, beginning.values) if run.stop is not None else None
            end = runs.end_of(ObservedCourse.begun(self, beginning, retry), run, stop, timed=bool(self.interface.time))
        rows = strided(beginning.h, run.steps, run.stride, end)
        if in_tau and end is not None:
            rows = timed_in_tau(runs.spans_of_run(run, end.span), end)
        elif run.is_timed:
            span = beginning.h * run.steps if end is None else end.span
            rows = timed(beginning.h, run.steps, runs.spans_of_run(run, span), end)
        return IntegrationPlan(
            beginning, rows, beginning.t0, retry, self.section_of(run, beginning.values), self.transforms_of(run)
        )

    def function(self, expression: Expression, values: Mapping[str, Any]) -> Function:
        """Return an expression as a function of observables (rows, observables) and, if the spec has a time, of times
        (rows,).

        The expression may also contain parameters; ``values`` are their values.
        """
        return function_of(expression, self.interface.observables, values, self.interface.time)

    def transforms_of(self, run: Run) -> Transforms | None:
        """Return the settings of the spectrum and of the correlation that a run requests; None if it requests
        neither."""
        requested = run.lattice
        return (
            Transforms(requested.spectrum, requested.correlation)
            if requested and (requested.spectrum or requested.correlation)
            else None
        )

    def section_of(self, run: Run, values: Mapping[str, Any]) -> Crossed | None:
        """Return the section of a run, with its expression as a function of observables; None if the run has no
        section."""
        from phigen.symbolic.readable import readable

        if run.section is None:
            return None
        return Crossed(self.function(run.section, values), run.direction, readable([run.section])[0])

    def series(
        self,
        x0: ArrayLike,
        h: float,
        steps: int | None = None,
        stride: int = 1,
        *,
        of: Sequence[str] | None = None,
        until: float | None = None,
        retry: int = 0,
        t0: float | None = None,
        seed: int | None = None,
        member: int | None = None,
        step0: int | None = None,
        output: str | Path | None = None,
        checkpoints: str | Path | None = None,
        resume: bool = True,
        progress: Progress | None = None,
        parameters: Mapping[str, Any] | None = None,
        **by_keyword: Any,
    ) -> LatticeSeries:
        """Integrate as `integrate` does, but record a few numbers every ``stride`` steps instead of states.

        ``of`` names the numbers: ``energy``, Casimirs that are sums or products over sites, and observables; by default
        the energy and all observables. ``output`` is the path of a file, .csv or .npz, to which the numbers are written
        at the end. With ``checkpoints`` the state and the rows are saved every two seconds. Raises the errors of
        `integrate`; the ``trajectory`` of a `StepError` is the series up to the failure.
        """
        noise_arguments = {"seed": seed, "member": member, "step0": step0}
        beginning = self._beginning(x0, "x0", h, parameters, by_keyword, t0, noise_arguments)
        plan = self._planned(beginning, steps, stride, until, retry)
        names = ("energy", *self.interface.observables) if of is None else of
        return self.numbered(plan, names, output=output, checkpoints=checkpoints, resume=resume, progress=progress)

    def numbered(
        self,
        plan: IntegrationPlan,
        names: Sequence[str],
        *,
        output: str | Path | None = None,
        checkpoints: str | Path | None = None,
        resume: bool = True,
        progress: Progress | None = None,
    ) -> LatticeSeries:
        """Integrate as planned, and record the quantities ``names``.

        The allowed names, the files and the errors are those of `series`.
        """
        recordable_names = recordable(self.interface)
        if strange := [name for name in names if name not in recordable_names]:
            raise ValueError(f"{strange[0]!r} cannot be recorded; there are {', '.join(recordable_names)}")
        target = expect_table(output) if output else None
        rows, met = NumberRows(self.interface, names), NumberRows(self.interface, names)
        identity = {"record": list(names)}
        run = LatticeRun(self, plan, rows, met, Path(checkpoints) if checkpoints else None, identity)
        self._expect_place(run, target, None, resume=resume)

        def made(steps: int, last: Floats) -> LatticeSeries:
            beginning, first = plan.at, plan.at.x if plan.past is None else plan.past.first
            settings = steps, beginning.h, beginning.values
            series = LatticeSeries(run.times, rows.columns, first, last, *settings, self, origin=plan.origin)
            crossings = replace(series, t=np.array(run.crossed), columns=met.columns) if plan.section else None
            return replace(series, crossings=crossings)

        try:
            run.make(progress)
        except BackendError as error:
            steps_done = run.course.steps + (plan.past.steps if plan.past else 0)
            failed = made(steps_done, run.course.sites.state())
            raise self.failure(error, plan.at.h, failed, plan.at.values) from error
        series = made(plan.steps, run.last.state())
        if target:
            series.save(target)
        run.forget()
        return series

    def ends_of(self, series: LatticeSeries) -> LatticeTrajectory:
        """Return a trajectory of two frames: the first and the last state of a series."""
        x, interface = np.array([series.first, series.last]), self.interface
        t = np.array([series.t[0], series.t[-1]])
        when = t.tolist() if interface.time else [None, None]
        energy = [
            self.hamiltonian(state, instant, parameters=series.parameters)
            for state, instant in zip(x, when, strict=True)
        ]
        settings = series.steps, series.h, series.parameters
        return LatticeTrajectory(t, x, np.array(energy), *settings, self.coordinates, interface.axes, self)

    def step(
        self,
        x: ArrayLike,
        h: float,
        *,
        t0: float | None = None,
        seed: int | None = None,
        step0: int | None = None,
        parameters: Mapping[str, Any] | None = None,
        **by_keyword: Any,
    ) -> Floats:
        """Return the state after one step of size ``h`` from the state ``x`` (coordinates, *sizes) at the time
        ``t0``.

        Raises `StepError`.
        """
        beginning = self._beginning(x, "x", h, parameters, by_keyword, t0, {"seed": seed, "step0": step0})
        session = self.started(beginning)
        try:
            session.advance(beginning.h, 1)
        except BackendError as error:
            raise self.failure(error, beginning.h, None, beginning.values) from error
        return session.state()

    def step_tangent(
        self,
        x: ArrayLike,
        h: float,
        vectors: ArrayLike,
        *,
        t0: float | None = None,
        seed: int | None = None,
        step0: int | None = None,
        parameters: Mapping[str, Any] | None = None,
        **by_keyword: Any,
    ) -> tuple[Floats, Floats]:
        """Return the state after one step from ``x``, and the products of the derivative of this step with the
        ``vectors``.

        Vectors have the shape (count, coordinates, *sizes). The derivative is exact to round-off. Raises `StepError`,
        `LimitError` for more vectors than fit into memory, and `TypeError` if the solver was compiled without
        ``tangent=True``.
        """
        for result in self.tangents(
            x, h, 1, vectors, t0=t0, seed=seed, step0=step0, parameters=parameters, **by_keyword
        ):
            return result
        raise AssertionError("one step")

    def tangents(
        self,
        x0: ArrayLike,
        h: float,
        steps: int,
        vectors: ArrayLike,
        stride: int = 1,
        *,
        t0: float | None = None,
        seed: int | None = None,
        step0: int | None = None,
        parameters: Mapping[str, Any] | None = None,
        **by_keyword: Any,
    ) -> Generator[tuple[Floats, Floats], Floats | None, None]:
        """Yield the state and the tangent ``vectors`` after every ``stride`` steps of a trajectory, and after the last.

        Vectors have the shape (count, coordinates, *sizes), and are multiplied by the derivative of each step. Vectors
        that the caller sends to the generator by ``send`` replace the present vectors. Raises the errors of
        `step_tangent`.
        """
        beginning = self._beginning(x0, "x0", h, parameters, by_keyword, t0, {"seed": seed, "step0": step0})
        start, steps = beginning.x, arguments.count(steps, "steps", 0)
        expect_room("tangent vectors", 8 * np.size(vectors))
        propagated = np.array(vectors, dtype=np.float64)
        if (
            propagated.ndim != start.ndim + 1
            or propagated.shape[1:] != start.shape
            or not np.isfinite(propagated).all()
        ):
            shape = ", ".join(map(str, start.shape))
            raise ValueError(f"tangent vectors must be finite and have shape (count, {shape}), not {propagated.shape}")
        session = self.started(beginning)
        for count in np.diff(row_steps(steps, arguments.count(stride, "stride", 1))).tolist():
            try:
                propagated = session.advance_tangent(beginning.h, propagated, count)
            except MissingExtraError:
                hint = "compile it with tangent=True, or write tangent: true in the spec"
                raise TypeError(f"{self.interface.name} was compiled without step_tangent; {hint}") from None
            except BackendError as error:
                raise self.failure(error, beginning.h, None, beginning.values) from error
            sent = yield session.state(), propagated
            propagated = propagated if sent is None else sent

    def ensemble(
        self,
        X0: ArrayLike,
        h: ArrayLike,
        steps: int,
        stride: int | None = None,
        *,
        t0: ArrayLike | None = None,
        seed: int | None = None,
        member: int | None = None,
        step0: int | None = None,
        threads: int | None = None,
        parameters: Mapping[str, Any] | None = None,
        **by_keyword: Any,
    ) -> Floats:
        """Return the final states (members, coordinates, *sizes) of several lattices of the same size.

        ``X0`` has the shape of the result, or is one initial state for all members. ``h``, ``t0`` and parameters may
        have a first axis of members, for instance for an average over disorder. With a ``stride`` the result has a
        further first axis of rows: the states at steps 0, stride, 2·stride, … and at the last. Small lattices are
        divided among ``threads``, by default one for each core; large lattices are integrated one after another, each
        by all threads. With noise, member k uses the random numbers of ``member`` + k. Raises `StepError`: its
        ``members`` are the failed members, and its ``trajectory`` the array of states, in which failed members have
        their last state or, with a stride, NaN in the rows after the failure.
        """
        times = self._times(t0, by_keyword)
        draws = arguments.draws(self.interface, by_keyword, {"seed": seed, "member": member, "step0": step0})
        values = arguments.together(parameters, by_keyword)
        return lattice_ensemble.ensemble(self, X0, h, steps, stride, threads, values, times, draws)

    def _times(self, t0: ArrayLike | None, by_keyword: dict[str, Any]) -> Floats:
        """Return the initial time, by default 0: a number, or an array (members,) if ``t0`` is an array.

        If H does not depend on the time, ``t0`` can only be the value of a parameter with the name t0. This value is
        then added to ``by_keyword``.
        """
        begin = t0 if np.ndim(t0 if t0 is not None else 0) and self.interface.time else None
        alone: Any = t0 if begin is None else 0.0
        first = arguments.start_time(alone, self.interface, by_keyword)
        return np.asarray(first if begin is None else begin, dtype=np.float64)

    def pullback(
        self,
        x0: ArrayLike,
        h: ArrayLike,
        steps: int,
        cotangent: ArrayLike,
        stride: int | None = None,
        *,
        t0: ArrayLike | None = None,
        parameters: Mapping[str, Any] | None = None,
        **by_keyword: Any,
    ) -> Pullback:
        """Return the state after ``steps`` steps, and the derivatives of its scalar product with a ``cotangent``.

        The result is (x1, x0_bar, parameters_bar): the final state, the derivative of the product with respect to
        ``x0``, and the derivatives with respect to the parameters, by name and in the shapes of the parameters. ``x0``
        is (coordinates, *sizes), or has a first axis of members; x1 and the cotangent have the shape of x0. Parameters,
        ``h`` and ``t0`` may have an axis of members too. The derivative with respect to an argument that all members
        share is the sum over members. With a ``stride``, x1 and the cotangent have a further first axis of rows, for
        all frames of `integrate`. Derivatives are exact to round-off. Raises `StepError`, and `TypeError` if the solver
        was compiled without ``adjoint=True``.
        """
        times = self._times(t0, by_keyword)
        values = arguments.together(parameters, by_keyword)
        return lattice_gradients.pullback(self, x0, h, steps, cotangent, stride, times, values)

    def jacobian(self, *_: Any, **__: Any) -> NoReturn:
        """Raise `TypeError`: lattices have `pullback` and `tangents`, but no full Jacobian."""
        hint = "use pullback for the gradient of a number, and tangents or step_tangent for directions"
        raise TypeError(f"{self.interface.name} is a lattice, and lattices have no full Jacobian; {hint}")

    def session(
        self,
        x0: ArrayLike,
        *,
        t0: float | None = None,
        seed: int | None = None,
        member: int | None = None,
        step0: int | None = None,
        parameters: Mapping[str, Any] | None = None,
        **by_keyword: Any,
    ) -> LiveLattice:
        """Return a session at ``x0`` (coordinates, *sizes), whose steps the caller makes: ``.step``, ``.kick``, ``.x``.

        The other arguments are those of `integrate`.
        """
        noise_arguments = {"seed": seed, "member": member, "step0": step0}
        beginning = self._beginning(x0, "x0", None, parameters, by_keyword, t0, noise_arguments)
        return LiveLattice(self, beginning)

    # --- functions of states

    def states_at(self, trajectory: LatticeTrajectory, times: Floats) -> Floats:
        """Return the states (times, coordinates, *sizes) of a trajectory of this solver at given times.

        This is the implementation of `LatticeTrajectory.at`, which documents conventions and errors.
        """
        t, x = trajectory.t, trajectory.x
        if self.interface.noise:
            return arguments.rows_at(t, x, times)
        states = np.empty((len(times), *x.shape[1:]))
        for k, time in enumerate(times.tolist()):
            row = int(np.argmin(np.abs(t - time)))
            begin = float(t[row]) if self.interface.time else 0.0
            level = -float(trajectory.energy[0]) if self.interface.monitored else None
            beginning = Beginning(np.array(x[row]), trajectory.h, trajectory.parameters, begin, level=level)
            try:
                states[k] = moved_on(LatticeCourse(self, beginning), trajectory.h, time - float(t[row])).state()
            except BackendError as error:
                raise self.failure(error, trajectory.h, None, trajectory.parameters) from error
        return states

    def hamiltonian(
        self, x: ArrayLike, t: float | None = None, *, parameters: Mapping[str, Any] | None = None, **by_keyword: Any
    ) -> float:
        """Return H of a state (coordinates, *sizes), at the time ``t`` if H depends on the time."""
        return self._session_at(x, parameters, by_keyword, t).hamiltonian()

    def density(
        self, x: ArrayLike, t: float | None = None, *, parameters: Mapping[str, Any] | None = None, **by_keyword: Any
    ) -> Floats:
        """Return the density of H at the sites (*sizes). The sum over the sites is H."""
        return self._session_at(x, parameters, by_keyword, t).density()

    def casimirs(
        self, x: ArrayLike, *, parameters: Mapping[str, Any] | None = None, **by_keyword: Any
    ) -> dict[str, Any]:
        """Return the Casimirs of a state, by name: arrays (*sizes) for Casimirs of each site, numbers for sums and
        products."""
        interface = self.interface
        densities = self._session_at(x, parameters, by_keyword, 0.0 if self.interface.time else None).casimirs()
        kinds = zip(interface.casimirs, interface.casimir_kinds, densities, strict=True)
        return {name: reduced(kind, values) for name, kind, values in kinds}

    def observables(
        self, x: ArrayLike, t: float | None = None, *, parameters: Mapping[str, Any] | None = None, **by_keyword: Any
    ) -> dict[str, Any]:
        """Return the observables of the spec at a state, by name.

        Observables with a value at each site are arrays (*sizes), all others are numbers.
        """
        interface, session = self.interface, self._session_at(x, parameters, by_keyword, t)
        numbers = dict(zip(interface.observables, session.observables().tolist(), strict=True))
        return numbers | dict(zip(interface.observed_fields, session.observed_fields(), strict=True))

    def vector_field(
        self, x: ArrayLike, t: float | None = None, *, parameters: Mapping[str, Any] | None = None, **by_keyword: Any
    ) -> Floats:
        """Return π∇H at a state (coordinates, *sizes), an array of the same shape."""
        return self._session_at(x, parameters, by_keyword, t).vector_field()

    def _session_at(
        self, x: ArrayLike, parameters: Mapping[str, Any] | None, by_keyword: dict[str, Any], t: float | None = None
    ) -> LatticeSession:
        state = self.state(x, "x")
        times = arguments.times(t, self.interface, (), by_keyword)
        values = self.values(parameters, by_keyword, state.shape[1:])
        return self.started(Beginning(state, 1.0, values, 0.0 if times is None else float(times[0])))

    # --- arguments

    def shape_text(self) -> str:
        """Return the shape of a state as text, for messages."""
        return ", ".join([str(len(self.coordinates)), *(f"N_{axis}" for axis in self.interface.axes)])

    def state(self, x: ArrayLike, argument: str) -> Floats:
        """Return a copy of a state (coordinates, *sizes); ``argument`` is its name in messages.

        Raises `ValueError` for sizes that do not fit the lattice, and for values that are not finite.
        """
        interface = self.interface
        copy = arguments.real(x, argument)
        if copy.ndim != 1 + len(interface.axes) or copy.shape[0] != len(interface.coordinates):
            raise ValueError(f"{argument} must have shape ({self.shape_text()}), not {copy.shape}")
        for axis, size, least, period in zip(
            interface.axes, copy.shape[1:], interface.least, interface.periods, strict=True
        ):
            if size < least:
                raise ValueError(
                    f"{argument} has {size} sites along {axis}; neighbours and brackets need {least} or more"
                )
            if size % period:
                message = f"{argument} has {size} sites along {axis}; the splitting needs multiples of {period}"
                hint = "compile from a spec that has a run of this size, or with scheme='series'"
                raise ValueError(f"{message}; {hint}")
        if not np.isfinite(copy).all():
            index = tuple(np.argwhere(~np.isfinite(copy))[0].tolist())
            site_text = ", ".join(map(str, index[1:]))
            raise ValueError(
                f"{argument} must be finite, but {interface.coordinates[index[0]]} at ({site_text}) is not"
            )
        return copy

    def values(
        self, mapped: Mapping[str, Any] | None, by_keyword: Mapping[str, Any], sizes: Sequence[int]
    ) -> dict[str, Any]:
        """Return the values of all parameters by name: numbers, and arrays over the sites or the bonds.

        For a graph the entry ``bonds`` has the checked bonds. Raises `TypeError` for unknown names, and `ValueError`
        for values that are not admissible.
        """
        interface = self.interface
        everything = arguments.together(mapped, by_keyword)
        everything |= self.defaults(everything, sizes)
        bonds = {"bonds": checked_bonds(everything.pop("bonds", None), sizes[0])} if interface.graph else {}
        shapes = dict.fromkeys(interface.at_sites, tuple(sizes))
        shapes |= dict.fromkeys(interface.at_bonds, (len(bonds["bonds"]),) if bonds else ())
        arrays = {n: v for n, v in everything.items() if n in shapes}
        numbers = {n: v for n, v in everything.items() if n not in shapes}
        values: dict[str, Any] = dict(arguments.parameters(interface, numbers, {}))
        for name, value in arrays.items():
            array = arguments.real(value, f"parameter {name!r}")
            if array.shape not in ((), shapes[name]):
                raise ValueError(f"parameter {name!r} must be a number or have shape {shapes[name]}, not {array.shape}")
            domain = "sites" if name in interface.at_sites else "bonds"
            if not np.isfinite(array).all():
                raise ValueError(f"parameter {name!r} must be finite at all {domain}")
            if violated := arguments.broken_bound(name, array, interface):
                raise ValueError(f"parameter {name!r} must be {violated} at all {domain}")
            if name == interface.masses and not array.flat[0] > 0:
                raise ValueError(
                    f"parameter {name!r} must be positive at the first site, the body about which all others move"
                )
            values[name] = array
        return values | bonds

    def defaults(self, passed_values: Mapping[str, Any], sizes: Sequence[int]) -> dict[str, Floats]:
        """Return default values of parameters that are missing in ``passed_values``, by name.

        Only defaults that depend on the sizes are returned: formulas, lists, files and random numbers. Raises
        `SpecError` if a default does not fit the sizes.
        """
        missing_names = self.interface.required - set(passed_values)
        if not missing_names:
            return {}
        if self.spec is None:
            raise TypeError(
                f"parameter {min(missing_names)!r} has no default for all sizes; give an array, or one number"
            )
        from phigen.lattice.states import defaults_at

        bonds = len(checked_bonds(passed_values.get("bonds"), sizes[0])) if self.interface.graph else 0
        return defaults_at(self.spec, missing_names, tuple(sizes), bonds)

    def _beginning(
        self,
        x: ArrayLike,
        argument: str,
        h: float | None,
        parameters: Mapping[str, Any] | None,
        by_keyword: dict[str, Any],
        t0: float | None,
        noise_arguments: Mapping[str, int | None] = arguments.NONE_DRAWN,
    ) -> Beginning:
        """Return the checked arguments of a trajectory. The step size is NaN if ``h`` is None."""
        begin = arguments.start_time(t0, self.interface, by_keyword)
        draws = arguments.draws(self.interface, by_keyword, noise_arguments)
        level = arguments.level(self.interface, by_keyword)
        start = self.state(x, argument)
        size = math.nan if h is None else arguments.step_size(h)
        return Beginning(start, size, self.values(parameters, by_keyword, start.shape[1:]), begin, draws, level=level)

    def started(self, beginning: Beginning) -> LatticeSession:
        """Return a session that begins with checked arguments. Raises `StepError` if no step is possible with them."""
        try:
            session = self.backend.start(beginning.x, beginning.values, beginning.t0, beginning.draws)
            if beginning.level is not None:
                session.hold(beginning.level)
            return session
        except BackendError as error:
            raise self.failure(error, beginning.h, None, beginning.values, beginning.x) from error

    def failure(
        self, error: BackendError, h: float, so_far: Any, values: Mapping[str, Any], start: Floats | None = None
    ) -> StepError:
        """Return the `StepError` that users get for a failure in the generated code.

        ``so_far`` are the results up to the failure.
        """
        name = self.interface.name
        facts = {"step": error.step, "status": error.status, "trajectory": so_far, "members": error.members}
        if error.status == "BAD_ARGUMENT":
            state = {} if start is None else dict(zip(self.coordinates, start, strict=True))
            if beyond_range := self.interface.single and arguments.beyond_single({**state, **values, "the step h": h}):
                return ParameterError(f"{name}: {beyond_range}", **{**facts, "step": 0})
            numbers = ", ".join(f"{n} = {float(v)!r}" for n, v in values.items() if np.ndim(v) == 0)
            reason = "a coefficient computed from parameters alone is not finite"
            reason += ", or B in H = A + B (monitor: log) is not negative at the start" * self.interface.monitored
            return ParameterError(f"{name}: no step can be made with {numbers}: {reason}", **{**facts, "step": 0})
        step_text = f"step {error.step} of size {h!r} failed" if error.step >= 0 else "a step failed"
        if error.members:
            step_text += (
                f" for {len(error.members)} member(s) of the ensemble ({', '.join(map(str, error.members[:5]))})"
            )
        advice = "the state left the range of the formulas; a smaller step helps, unless the solution ends here"
        if error.step == 0 and error.status == "NOT_FINITE" and (so_far is not None or not self.interface.time):
            advice = self._undefined(error.states[-1], values, None if so_far is None else float(so_far.t[0])) or advice
        in_loops_of_c = error.status == "NOT_FINITE" and self.target == "c" and len(error.states)
        if in_loops_of_c and np.abs(error.states[-1]).max() > _LARGE_ANGLE:
            advice += "; loops of C compute sin and cos of angles up to 1e8"
        return StepError(f"{name}: {step_text}: {error.status}, {advice}", **facts)

    def _undefined(self, x: Floats, values: Mapping[str, Any], t: float | None) -> str:
        """Return a message that names the first site where H is not finite; "" if H is finite everywhere."""
        density = self.density(x, t if self.interface.time else None, parameters=values)
        sites = np.argwhere(~np.isfinite(density))
        if not len(sites):
            return ""
        site = tuple(sites[0].tolist())
        values_text = ", ".join(f"{f} = {float(x[(k, *site)])!r}" for k, f in enumerate(self.coordinates))
        return f"since H is not finite at the start: at the site ({', '.join(map(str, site))}), where {values_text}"

    def _trajectory(
        self, t: Floats, x: Floats, rows: FrameRows, steps: int, plan: IntegrationPlan
    ) -> LatticeTrajectory:
        beginning, axes = plan.at, self.interface.axes
        observed = np.array(rows.observed).reshape(len(t), len(self.interface.observables))
        energy = np.array(rows.energy)
        return LatticeTrajectory(
            t, x, energy, steps, beginning.h, beginning.values, self.coordinates, axes, self, observed
        )


def missing_bonds() -> TypeError:
    """Return the error for a graph that is integrated without ``bonds``."""
    return TypeError("bonds= is missing: a lattice that is a graph needs an array (bonds, 2) of site numbers")


def checked_bonds(bonds: Any, sites: int) -> NDArray[np.int64]:
    """Return bonds as an array (bonds, 2) of pairs of different sites, numbered from 0 to ``sites`` − 1.

    Raises `TypeError` if ``bonds`` is None, and `ValueError` for other arrays.
    """
    if bonds is None:
        raise missing_bonds()
    array = np.asarray(bonds)
    pairs = array.reshape(-1, 2) if array.size == 0 else array
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        raise ValueError(f"bonds must have shape (bonds, 2), not {pairs.shape}")
    integers = pairs.astype(np.int64)
    wrong_bonds = np.flatnonzero((integers != pairs).any(1) | (integers < 0).any(1) | (integers >= sites).any(1))
    wrong_bonds = np.append(wrong_bonds, np.flatnonzero(integers[:, 0] == integers[:, 1]))
    if len(wrong_bonds):
        a, b = pairs[wrong_bonds[0]].tolist()
        raise ValueError(
            f"bond {wrong_bonds[0]} runs from {a} to {b}, but must join two different sites from 0 to {sites - 1}"
        )
    return integers


def reduced(kind: str, densities: Floats) -> Any:
    """Return a Casimir from its densities at the sites: for the kind ``sites`` the densities, for ``sum`` their sum,
    for ``product`` their product."""
    if kind == "sites":
        return densities
    return float(densities.sum() if kind == "sum" else densities.prod())
