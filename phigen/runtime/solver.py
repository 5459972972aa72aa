"""Solvers of ordinary systems: they check arguments, call generated code, and return trajectories."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from phigen.errors import ParameterError, StepError
from phigen.runtime import arguments, gradients, runs
from phigen.runtime.arguments import Beginning
from phigen.runtime.backend import Backend
from phigen.runtime.crossings import SIGNS, CrossingFinder, Function, Section
from phigen.runtime.gradients import Jacobian, Pullback
from phigen.runtime.interface import BackendError, Floats, Interface, MissingExtraError, Progress, row_steps
from phigen.runtime.live import LiveSession
from phigen.runtime.members import Members
from phigen.runtime.named import Named
from phigen.runtime.prescribed_noise import PrescribedNoise
from phigen.runtime.retrying import Retrying
from phigen.runtime.sections import function_of
from phigen.runtime.session import Followed, Session, rows_along
from phigen.runtime.timed import along_until, states_at
from phigen.runtime.trajectory import Trajectory, Turned, turned_into

if TYPE_CHECKING:
    from phigen.spec.model import Run, Spec

_ADVICE = {
    "NO_CONVERGENCE": "the equations of the implicit step were not solved; a smaller step helps",
    "SINGULAR": "the equations of the implicit step are singular; a smaller step helps",
    "NOT_FINITE": "the state left the range of the formulas; a smaller step helps, unless the solution ends here",
}


@dataclass(frozen=True)
class Marks:
    """Data of the rows of a trajectory, in addition to the states.

    ``tau`` (rows,) is h times the number of steps. With a monitor (rescaled time: dt = g dτ) this is the rescaled time
    τ, and ``passed`` (rows,) is the physical time since the start. A row of ``turned`` has the components of an
    attitude and a position. ``steps`` is the number of steps of the whole trajectory. ``retried`` are the indices, from
    0 on, of those steps that failed and were repeated as smaller steps.
    """

    tau: Floats
    passed: Floats
    turned: Floats
    steps: int
    retried: tuple[int, ...] = ()


class Solver(Named[Backend, Interface]):
    """A compiled system: ``solver.integrate(x0, h=0.05, steps=1000, stride=10, mass=2)``.

    Parameters of the system are keyword arguments, or entries of ``parameters={…}``, which also takes names that clash
    with other arguments. Parameters that are not passed have the defaults of the spec. Wrong arguments raise
    `ValueError` or `TypeError`, and a failing step `phigen.StepError`. Parameters with which no step is possible, such
    as a zero divisor, raise `phigen.ParameterError`, which is a `ValueError` and a `StepError`. Several threads may use
    a solver. Solvers can be copied and pickled; C that is not in the cache is then compiled again.
    """

    def __init__(self, backend: Backend, interface: Interface, spec: Spec | None = None) -> None:
        self.backend = backend
        self.interface = interface
        self.spec = spec

    @property
    def device(self) -> Any:
        """The device that ensembles run on, with its ``name`` and its ``memory`` in bytes; None if the solver uses no
        device.
        """
        return getattr(self.backend, "device", None)

    def __repr__(self) -> str:
        facts = self.interface
        return f"<Solver {facts.name}: order {facts.order}, target {self.target}, ({', '.join(facts.coordinates)})>"

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
        attitude0: ArrayLike | None = None,
        position0: ArrayLike | None = None,
        seed: int | None = None,
        member: int | None = None,
        step0: int | None = None,
        increments: ArrayLike | None = None,
        progress: Progress | None = None,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> Trajectory:
        """Make ``steps`` steps of size ``h`` from ``x0`` (DIM,), and return every ``stride``-th state and the last as a
        trajectory.

        A negative ``h`` integrates backwards in time; with a monitor (rescaled time: dt = g dτ), ``h`` is a step in τ.
        ``t0`` is the time of ``x0``, 0 by default, for Hamiltonians that depend on the time. With ``until`` in place of
        ``steps``, the last step is shortened to end at that time. A failing step is repeated as 2, 4, …, up to 2**retry
        smaller steps. The composition of the smaller steps is a Poisson map and keeps the Casimirs; it differs from the
        map of the whole step. ``attitude0`` and ``position0`` are initial values for systems that reconstruct them, by
        default the identity and the origin.

        With noise, the random numbers are a function of ``seed``, ``member`` and the number of the step, where
        ``step0`` is the number of the first step; all three are 0 by default. Instead, increments of the noise can be
        passed as ``increments``, an array with a row of increments for each step. ``progress`` is called from time to
        time with the number of steps done. Raises `StepError`, whose ``trajectory`` ends with the state before the
        failing step.
        """
        noise_arguments = {"seed": seed, "member": member, "step0": step0}
        beginning = self._beginning(x0, "x0", h, parameters, by_keyword, t0, noise_arguments, (attitude0, position0))
        stride, retry = arguments.count(stride, "stride", 1), arguments.count(retry, "retry", 0)
        if retry:
            arguments.expect_no_noise("retry", self.interface)
        session = self._started(beginning)
        followed: Followed = session
        if increments is not None:
            rows = arguments.increments(increments, self.interface)
            followed, steps = PrescribedNoise(session, rows), len(rows) if steps is None else steps
            if steps > len(rows) or until is not None:
                raise ValueError(f"increments are given for {len(rows)} steps only")
        course = Retrying(followed, retry)
        times, elements = dict[int, float](), dict[int, Floats]()

        def see(row: int) -> None:
            times[row], elements[row] = course.time(), course.element()

        def trajectory(states: Floats, steps_done: int) -> Trajectory:
            tau: Floats = beginning.h * row_steps(steps_done, stride).astype(np.float64)
            attitudes = np.array(list(elements.values()))
            marks = Marks(tau, np.array(list(times.values())), attitudes, steps_done, tuple(course.retried))
            return self._trajectory(states, marks, beginning)

        if steps is None and until is None:
            raise TypeError("integrate needs the number of steps, or the time until which to integrate")
        if steps is not None and until is not None:
            raise TypeError("integrate takes either steps or until, not both")
        if until is not None:
            return self._until(course, arguments.end(until, beginning.t0, beginning.h), stride, beginning)
        steps = arguments.count(steps if steps is not None else 0, "steps", 0)
        try:
            states = rows_along(course, beginning.h, steps, stride, progress, see)
        except BackendError as error:
            raise self.failure(error, beginning.h, trajectory(error.states, error.step), beginning.values) from error
        return trajectory(states, steps)

    def run(
        self,
        name: str | None = None,
        *,
        x0: ArrayLike | None = None,
        step: float | None = None,
        steps: int | None = None,
        until: float | None = None,
        stride: int | None = None,
        every: float | None = None,
        at: Sequence[float] | None = None,
        seed: int | None = None,
        progress: Progress | None = None,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> Trajectory:
        """Integrate a run of the spec, the first by default, and return what `integrate` returns.

        Arguments replace settings of the spec. ``x0`` (DIM,) is the initial state, ``step`` the step size. The run ends
        after ``steps`` steps or at the time ``until``; a run with ``stop`` ends at the first zero of the expression
        ``stop``. Rows are stored every ``stride`` steps, at intervals of ``every``, or at the times ``at``. ``seed`` is
        the seed of the noise. Parameters, and initial values of coordinates, are given by name. Raises `ValueError` if
        there is no run of that name; `runs` lists the names.
        """
        spec, settings = self.spec, runs.Settings(step, steps, until, stride, every, at=at)
        base = runs.run_named(spec, name)
        assert spec is not None
        run_ = runs.changed(spec, base, settings)
        initial = {c: by_keyword.pop(c) for c in self.interface.coordinates if c in by_keyword}
        if x0 is not None and initial:
            raise TypeError(f"a run takes either x0 or initial values such as {next(iter(initial))}, not both")
        of_run = zip(self.interface.coordinates, run_.initial, strict=True)
        start = [initial.get(c, float(value)) for c, value in of_run] if x0 is None else x0
        values: dict[str, float] = {n: float(v) for n, v in run_.parameters.items()}
        values |= arguments.together(parameters, by_keyword)
        t0 = float(run_.start) if self.interface.time else None
        noise_arguments = {"seed": run_.seed if seed is None and self.interface.noise else seed}
        if run_.stop is None and not run_.is_timed:
            length: dict[str, Any] = {"steps": run_.steps} if run_.until is None else {"until": float(run_.until)}
            return self.integrate(
                start, float(run_.step), stride=run_.stride, t0=t0, seed=noise_arguments["seed"], progress=progress,
                parameters=values, **length,
            )  # fmt: skip
        arguments.expect_no_noise("every", self.interface)
        return self._rows(run_, self._beginning(start, "x0", float(run_.step), values, {}, t0, noise_arguments))

    def _rows(self, run: Run, beginning: Beginning) -> Trajectory:
        """Return the trajectory of a run that ends at a zero of a function, or that has rows at given times.

        `run` calls `integrate` for all other runs.
        """
        names = self.interface
        stop = function_of(run.stop, names.coordinates, beginning.values, names.time) if run.stop is not None else None
        session = self._started(beginning)
        end = runs.end_of(session, run, stop, timed=bool(names.time))
        rows: list[tuple[Floats, float, float, Floats]] = []

        def trajectory() -> Trajectory:
            x, tau, times, element = (np.array(column) for column in zip(*rows, strict=True))
            return self._trajectory(x, Marks(tau, times, element, end.steps + end.part), beginning)

        try:
            for row_session, steps_done in runs.rows_of(session, run, end):
                rows.append((row_session.state(), steps_done * beginning.h, row_session.time(), row_session.element()))
        except BackendError as error:
            raise self.failure(error, beginning.h, trajectory(), beginning.values) from error
        return trajectory()

    def _until(self, course: Retrying, span: float, stride: int, beginning: Beginning) -> Trajectory:
        """Return the trajectory of `integrate` over the time ``span``, with a last step that is shortened to end at
        that time."""
        rows: list[tuple[Floats, float, float, Floats, int, tuple[int, ...]]] = []

        def see(session: Retrying, tau: float) -> None:
            rows.append(
                (session.state(), tau, session.time(), session.element(), session.steps, tuple(session.retried))
            )

        def trajectory() -> Trajectory:
            x, tau, times, attitudes, steps, retried = zip(*rows, strict=True)
            marks = Marks(np.array(tau), np.array(times), np.array(attitudes), steps[-1], retried[-1])
            return self._trajectory(np.array(x), marks, beginning)

        try:
            along_until(course, beginning.h, span, stride, see)
        except BackendError as error:
            raise self.failure(error, beginning.h, trajectory(), beginning.values) from error
        return trajectory()

    def session(
        self,
        x0: ArrayLike,
        *,
        t0: float | None = None,
        attitude0: ArrayLike | None = None,
        position0: ArrayLike | None = None,
        seed: int | None = None,
        member: int | None = None,
        step0: int | None = None,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> LiveSession:
        """Return a session at ``x0`` (DIM,), whose steps the caller makes: ``.step(h)``, ``.kick(dx)``, ``.x``.

        The other arguments are those of `integrate`.
        """
        noise_arguments = {"seed": seed, "member": member, "step0": step0}
        beginning = self._beginning(x0, "x0", None, parameters, by_keyword, t0, noise_arguments, (attitude0, position0))
        return LiveSession(self, self._started(beginning), beginning.values, beginning.t0)

    def states_at(self, trajectory: Trajectory, times: Floats) -> Floats:
        """Return the states (times, DIM) of a trajectory of this solver at given times; see `Trajectory.at`."""
        if self.interface.noise:
            return arguments.rows_at(trajectory.t, trajectory.x, times)
        values, h = dict(trajectory.parameters), trajectory.h
        begin = float(trajectory.t[0]) if self.interface.time else 0.0
        first = self._started(Beginning(trajectory.x[0], h, values, begin))

        def place(row: int) -> Session:
            if self.interface.time:
                return self.backend.start(trajectory.x[row], values, float(trajectory.t[row]))
            return first.placed(trajectory.x[row])

        try:
            return states_at(place, trajectory.t, trajectory.x, h, times)
        except BackendError as error:
            raise self.failure(error, h, None, values) from error

    def step(
        self,
        x: ArrayLike,
        h: float,
        *,
        t0: float | None = None,
        seed: int | None = None,
        step0: int | None = None,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> Floats:
        """Return the state (DIM,) after one step of size ``h`` from the state ``x`` (DIM,) at the time ``t0``. Raises
        `StepError`.
        """
        beginning = self._beginning(x, "x", h, parameters, by_keyword, t0, {"seed": seed, "step0": step0})
        session = self._started(beginning)
        try:
            session.advance(beginning.h, 1)
        except BackendError as error:
            raise self.failure(error, beginning.h, None, beginning.values) from error
        return session.state()

    def step_tangent(
        self,
        x: ArrayLike,
        h: float,
        *,
        t0: float | None = None,
        seed: int | None = None,
        step0: int | None = None,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> tuple[Floats, Floats]:
        """Return the state (DIM,) after one step from ``x`` (DIM,), and its derivative (DIM, DIM) with respect to
        ``x``.

        Row i of the derivative is the gradient of the new coordinate i. The derivative is exact to round-off. The gauge
        (the multiples of Casimirs that the solver subtracts from H) is held fixed. Raises `StepError`, and `TypeError`
        if the solver was compiled without ``tangent=True``.
        """
        beginning = self._beginning(x, "x", h, parameters, by_keyword, t0, {"seed": seed, "step0": step0})
        session = self._started(beginning)
        tangent = self._with_tangent(session, beginning)
        return session.state(), tangent

    def tangents(
        self,
        x0: ArrayLike,
        h: float,
        steps: int,
        *,
        t0: float | None = None,
        seed: int | None = None,
        member: int | None = None,
        step0: int | None = None,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> Iterator[tuple[Floats, Floats]]:
        """Yield the state (DIM,) after each step of a trajectory, and the derivative (DIM, DIM) of that step.

        The steps are those of `integrate`. Raises the errors of `step_tangent`.
        """
        beginning = self._beginning(
            x0, "x0", h, parameters, by_keyword, t0, {"seed": seed, "member": member, "step0": step0}
        )
        steps = arguments.count(steps, "steps", 0)
        session = self._started(beginning)
        for _ in range(steps):
            tangent = self._with_tangent(session, beginning)
            yield session.state(), tangent

    def section(
        self,
        x0: ArrayLike,
        h: float,
        steps: int,
        g: Function,
        *,
        direction: str = "rising",
        t0: float | None = None,
        progress: Progress | None = None,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> Section:
        """Return the zeros of ``g`` along the trajectory of ``steps`` steps of size ``h`` from ``x0`` (DIM,).

        ``g`` maps states (rows, DIM), and their times (rows,) if the Hamiltonian depends on the time, to values
        (rows,). Each zero is located to round-off; a step of the solver leads to it, so no state is interpolated.
        ``direction`` is ``rising``, ``falling`` or ``both``. A start with g = 0 counts if g leaves zero in that
        direction. Raises `StepError`, whose ``trajectory`` is the `Section` until the failure.
        """
        arguments.expect_no_noise("section", self.interface)
        beginning = self._beginning(x0, "x0", h, parameters, by_keyword, t0)
        steps = arguments.count(steps, "steps", 0)
        zeros: list[tuple[float, Floats]] = []
        if direction not in SIGNS:
            raise ValueError(f"direction must be {', '.join(SIGNS)}, not {direction!r}")
        finder = CrossingFinder[Session](
            g, beginning.h, beginning.t0, timed=bool(self.interface.time), direction=direction
        )
        session = self._started(beginning)
        try:
            for _, crossings in finder.follow(session, steps, lambda: session.advance(beginning.h, 1)):
                zeros += crossings
                if progress:
                    progress(session.steps)
        except BackendError as error:
            raise self.failure(error, beginning.h, self._section(zeros), beginning.values) from error
        return self._section(zeros)

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
        parameters: Mapping[str, ArrayLike] | None = None,
        **by_keyword: ArrayLike,
    ) -> Floats:
        """Return the final states (members, DIM) of an ensemble with the initial states ``X0`` (members, DIM).

        ``X0`` may be one state (DIM,) for all members. Parameters, ``h`` and the initial time ``t0`` are numbers, or
        arrays (members,). With a ``stride`` the result is (rows, members, DIM): the states at steps 0, stride,
        2·stride, … and at the last. With noise, member k uses the random numbers of ``member`` + k, from ``step0`` on;
        to continue an ensemble, pass the number of its steps as ``step0``. Members are divided among ``threads``, by
        default one for each core; the result has the same bits for any number of threads. Raises `StepError` if a
        member fails: its ``members`` are the failed members, and its ``trajectory`` the array of states, in which
        failed members have their last state or, with a stride, NaN in the rows after the failure.
        """
        noise_arguments = {"seed": seed, "member": member, "step0": step0}
        members = self._members(X0, h, steps, stride, t0, noise_arguments, parameters, by_keyword)
        return self._integrate_members(members, threads, self.backend.ensemble)

    def attitudes(
        self,
        X0: ArrayLike,
        h: ArrayLike,
        steps: int,
        stride: int | None = None,
        *,
        attitude0: ArrayLike | None = None,
        position0: ArrayLike | None = None,
        t0: ArrayLike | None = None,
        seed: int | None = None,
        member: int | None = None,
        step0: int | None = None,
        threads: int | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        **by_keyword: ArrayLike,
    ) -> Turned:
        """Return the states of `ensemble` together with attitudes and positions: (x, attitude, position).

        An attitude is a quaternion (4,) or a matrix (n, n). A position is an array (3,). If the spec has no positions,
        the third result is None. Arrays of attitudes and positions have the leading axes of x: (members, …), with a
        ``stride`` (rows, members, …). ``attitude0`` and ``position0`` are initial values, one for all members or
        (members, …), by default the identity and the origin. The results of each member have the bits that `integrate`
        returns for this member. Raises the errors of `ensemble`, with all three results in ``trajectory``, and
        `TypeError` if the spec does not say ``reconstruct``.
        """
        noise_arguments = {"seed": seed, "member": member, "step0": step0}
        requested = self._members(X0, h, steps, stride, t0, noise_arguments, parameters, by_keyword)
        rows = len(row_steps(requested.steps, requested.stride or max(requested.steps, 1)))
        elements = np.full((rows, len(requested), self.interface.element), np.nan)
        elements[0] = arguments.firsts(attitude0, position0, self.interface, len(requested))

        def with_attitudes(x: Floats) -> Turned:
            attitude, position = turned_into(self.interface, elements if requested.stride else elements[-1])
            assert attitude is not None
            return Turned(x, attitude, position)

        try:
            x = self._integrate_members(
                requested, threads, lambda members, most: self.backend.ensemble(members, most, elements)
            )
        except StepError as error:
            error.trajectory = with_attitudes(error.trajectory)
            raise
        return with_attitudes(x)

    def pullback(
        self,
        x0: ArrayLike,
        h: ArrayLike,
        steps: int,
        cotangent: ArrayLike,
        stride: int | None = None,
        *,
        t0: ArrayLike | None = None,
        threads: int | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        **by_keyword: ArrayLike,
    ) -> Pullback:
        """Return the state after ``steps`` steps, and the derivatives of its scalar product with a ``cotangent``.

        The result is (x1, x0_bar, parameters_bar): the final state, the derivative of the product with respect to
        ``x0``, and the derivatives with respect to the parameters, by name. ``x0`` is (DIM,) or (members, DIM); x1 and
        the cotangent have the shape of x0. One state (DIM,) with arrays of parameters is the initial state of all
        members; x0_bar then has a row for each member. With a ``stride``, x1 and the cotangent are (rows, …), for all
        rows of `integrate`. Parameters, h and t0 are numbers or (members,); the derivative with respect to a number
        that all members share is the sum over members. ``threads`` is explained at `ensemble`.

        Derivatives are exact to round-off. The gauge (the multiples of Casimirs that are subtracted from H) is held
        fixed. With a monitor (rescaled time: dt = g dτ), the energy level e = −H(x0) is differentiated with respect to
        x0. There are no derivatives of times and attitudes. Raises `StepError`, and `TypeError` if the solver was
        compiled without ``adjoint=True``.
        """
        values = arguments.together(parameters, by_keyword)
        threads = threads if threads is None else arguments.count(threads, "threads", 1)
        return gradients.pullback(self, x0, h, steps, cotangent, stride, t0, threads, values)

    def jacobian(
        self,
        x0: ArrayLike,
        h: float,
        steps: int = 1,
        *,
        t0: float | None = None,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> Jacobian:
        """Return the state (DIM,) after ``steps`` steps from ``x0`` (DIM,), and its derivatives with respect to x0 and
        to each parameter.

        The derivative with respect to x0 is (DIM, DIM), with row i for coordinate i. The derivatives with respect to
        parameters are (DIM,), by name. The method calls `pullback` once for each coordinate; see there for the
        arguments and the errors.
        """
        start, h = arguments.state(x0, "x0", self.interface), arguments.step_size(h)
        for name, value in arguments.together(parameters, by_keyword).items():
            arguments.number(value, f"parameter {name!r}")
        options: dict[str, Any] = {"t0": t0, "parameters": parameters, **by_keyword}
        rows = [self.pullback(start, h, steps, side, **options) for side in np.eye(len(start))]
        names = rows[0].parameters_bar
        return Jacobian(
            rows[0].x1,
            np.array([row.x0_bar for row in rows]),
            {name: np.array([row.parameters_bar[name] for row in rows]) for name in names},
        )

    def hamiltonian(
        self,
        x: ArrayLike,
        t: ArrayLike | None = None,
        *,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> Floats:
        """Return H of the states ``x`` (…, DIM), shape (…).

        If H depends on the time, ``t`` are the times of the states, a number or an array (…).
        """
        states = arguments.states(x, "x", self.interface)
        rows = states.reshape(-1, self.interface.dimension)
        when = arguments.times(t, self.interface, states.shape[:-1], by_keyword)
        return self.backend.hamiltonian(rows, self.values(parameters, by_keyword), when).reshape(states.shape[:-1])

    def casimirs(
        self, x: ArrayLike, *, parameters: Mapping[str, float] | None = None, **by_keyword: float
    ) -> dict[str, Floats]:
        """Return the Casimirs of the states ``x`` (…, DIM), by name, each of shape (…)."""
        states = arguments.states(x, "x", self.interface)
        rows = states.reshape(-1, self.interface.dimension)
        values = self.backend.casimirs(rows, self.values(parameters, by_keyword))
        return {name: values[:, i].reshape(states.shape[:-1]) for i, name in enumerate(self.interface.casimirs)}

    def vector_field(
        self,
        x: ArrayLike,
        t: ArrayLike | None = None,
        *,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> Floats:
        """Return π∇H at the states ``x`` (…, DIM), an array of the same shape.

        If H depends on the time, ``t`` are the times of the states, a number or an array (…).
        """
        states = arguments.states(x, "x", self.interface)
        rows = states.reshape(-1, self.interface.dimension)
        when = arguments.times(t, self.interface, states.shape[:-1], by_keyword)
        return self.backend.vector_field(rows, self.values(parameters, by_keyword), when).reshape(states.shape)

    def noise_fields(
        self,
        x: ArrayLike,
        t: ArrayLike | None = None,
        *,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> Floats:
        """Return the vector field σπ∇g of each source of noise at the states ``x`` (…, DIM), shape (…, sources, DIM).

        σ is the amplitude of the source, and g its Hamiltonian.
        """
        states = arguments.states(x, "x", self.interface)
        rows = states.reshape(-1, self.interface.dimension)
        when = arguments.times(t, self.interface, states.shape[:-1], by_keyword)
        fields = self.backend.noise_fields(rows, self.values(parameters, by_keyword), when)
        return fields.reshape(*states.shape[:-1], len(self.interface.noise), self.interface.dimension)

    def observables(
        self,
        x: ArrayLike,
        t: ArrayLike | None = None,
        *,
        parameters: Mapping[str, float] | None = None,
        **by_keyword: float,
    ) -> dict[str, Floats]:
        """Return the observables of the spec at the states ``x`` (…, DIM), by name, each of shape (…).

        If the spec has a time, ``t`` are the times of the states, a number or an array (…).
        """
        states = arguments.states(x, "x", self.interface)
        rows = states.reshape(-1, self.interface.dimension)
        when = arguments.times(t, self.interface, states.shape[:-1], by_keyword)
        values = self.backend.observables(rows, self.values(parameters, by_keyword), when)
        return {name: values[:, i].reshape(states.shape[:-1]) for i, name in enumerate(self.interface.observables)}

    def observed(self, x: Floats, t: Floats, parameters: Mapping[str, float]) -> Floats:
        """Return the observables (rows, observables) of the states (rows, DIM) of a trajectory at its times (rows,)."""
        return self.backend.observables(x, parameters, t if self.interface.time else None)

    def energies(self, x: Floats, t: Floats, parameters: Mapping[str, float]) -> Floats:
        """Return H (rows,) of the states (rows, DIM) of a trajectory at its times (rows,)."""
        return self.backend.hamiltonian(x, parameters, t if self.interface.time else None)

    def _trajectory(self, x: Floats, marks: Marks, beginning: Beginning) -> Trajectory:
        casimirs = self.backend.casimirs(x, beginning.values)
        t = marks.passed if self.interface.monitored else beginning.t0 + marks.tau
        attitude, position = turned_into(self.interface, marks.turned)
        observed = self.observed(x, t, beginning.values)
        return Trajectory(
            tau=marks.tau if self.interface.monitored else t,
            retried=marks.retried,
            solver=self,
            t=t,
            x=x,
            energy=self.energies(x, t, beginning.values),
            casimirs={name: casimirs[:, i] for i, name in enumerate(self.interface.casimirs)},
            steps=marks.steps,
            h=beginning.h,
            parameters=beginning.values,
            coordinates=self.interface.coordinates,
            attitude=attitude,
            position=position,
            observables={name: observed[:, i] for i, name in enumerate(self.interface.observables)},
        )

    def _beginning(
        self,
        x: ArrayLike,
        argument: str,
        h: float | None,
        parameters: Mapping[str, float] | None,
        by_keyword: dict[str, float],
        t0: float | None,
        noise_arguments: Mapping[str, int | None] = arguments.NONE_DRAWN,
        first: tuple[ArrayLike | None, ArrayLike | None] = (None, None),
    ) -> Beginning:
        """Return the checked arguments of a trajectory. The step size is NaN if ``h`` is None."""
        begin = arguments.start_time(t0, self.interface, by_keyword)
        draws = arguments.draws(self.interface, by_keyword, noise_arguments)
        values = self.values(parameters, by_keyword)
        start = arguments.state(x, argument, self.interface)
        size = math.nan if h is None else arguments.step_size(h)
        return Beginning(start, size, values, begin, draws, arguments.first(*first, self.interface))

    def _members(
        self,
        X0: ArrayLike,
        h: ArrayLike,
        steps: int,
        stride: int | None,
        t0: ArrayLike | None,
        noise_arguments: Mapping[str, int | None],
        parameters: Mapping[str, ArrayLike] | None,
        by_keyword: Mapping[str, ArrayLike],
    ) -> Members:
        """Return the checked arguments of an ensemble."""
        keywords: dict[str, Any] = dict(by_keyword)
        draws = arguments.draws(self.interface, keywords, noise_arguments)
        return arguments.ensemble(X0, h, steps, stride, t0, parameters, keywords, self.interface, draws)

    def _integrate_members(
        self, requested: Members, threads: int | None, make: Callable[[Members, int | None], Floats]
    ) -> Floats:
        """Return the states of an ensemble, which ``make`` integrates. Raises `StepError` if members fail.

        ``make`` receives the members and the number of threads.
        """
        max_threads = threads if threads is None else arguments.count(threads, "threads", 1)
        try:
            return make(requested, max_threads)
        except BackendError as error:
            m = error.members[0] if error.members else 0
            h, values, _ = requested.numbers(m)
            raise self.failure(error, h, error.states, values, requested.x0[m] if len(requested) else None) from error

    def _started(self, beginning: Beginning) -> Session:
        try:
            return self.backend.start(beginning.x, beginning.values, beginning.t0, beginning.first, beginning.draws)
        except BackendError as error:
            raise self.failure(error, beginning.h, None, beginning.values, beginning.x) from error

    def _with_tangent(self, session: Session, beginning: Beginning) -> Floats:
        try:
            return session.advance_tangent(beginning.h)
        except MissingExtraError:
            hint = "compile it with tangent=True, or write tangent: true in the spec"
            raise TypeError(f"{self.interface.name} was compiled without step_tangent; {hint}") from None
        except BackendError as error:
            raise self.failure(error, beginning.h, None, beginning.values) from error

    def _section(self, crossings: Sequence[tuple[float, Floats]]) -> Section:
        t, x = np.array([t for t, _ in crossings]), np.array([x for _, x in crossings])
        return Section(t, x.reshape(-1, self.interface.dimension), self.coordinates)

    def failure(
        self,
        error: BackendError,
        h: float,
        trajectory: Trajectory | Section | Floats | None,
        parameters: Mapping[str, float],
        start: Floats | None = None,
    ) -> StepError:
        """Return the `StepError` that users get for a failure in the generated code.

        Its message names the step and the parameters. ``trajectory`` are the results up to the failure. ``start``
        (DIM,) is the initial state; for ensembles, the initial state of the first member that failed.
        """
        name = self.interface.name
        if error.status == "BAD_ARGUMENT":
            state = {} if start is None else dict(zip(self.coordinates, start.tolist(), strict=True))
            if beyond_range := self.interface.single and arguments.beyond_single(
                {**state, **parameters, "the step h": h}
            ):
                message = f"{name}: {beyond_range}" + (f" (member {error.members[0]})" if error.members else "")
                return ParameterError(
                    message, step=0, status=error.status, trajectory=trajectory, members=error.members
                )
            # The message lists only the parameters, since the other arguments were checked before.
            settings = ", ".join(f"{name} = {value!r}" for name, value in parameters.items())
            message = f"{name}: no step can be made"
            if settings:
                message += f" with {settings}: a coefficient computed from parameters alone is not finite"
            if self.interface.monitored:
                message += f"{', or' if settings else ':'} the monitor is not positive at the start"
            return ParameterError(message, step=0, status=error.status, trajectory=trajectory, members=error.members)
        step_text = f"{name}: step {error.step} of size {h!r} failed" if error.step >= 0 else f"{name}: a step failed"
        if error.members:
            members_text = ", ".join(map(str, error.members[:5])) + (", …" if len(error.members) > 5 else "")
            step_text += f" for {len(error.members)} member(s) of the ensemble ({members_text})"
        elif error.step >= 0 and isinstance(trajectory, Trajectory):
            reached = trajectory.t[-1] if self.interface.monitored else trajectory.t[0] + error.step * h
            step_text += f" at t = {reached:.12g}"
        message = f"{step_text}: {error.status}" + (f", {_ADVICE[error.status]}" if error.status in _ADVICE else "")
        return StepError(message, step=error.step, status=error.status, trajectory=trajectory, members=error.members)

    def values(self, mapped: Mapping[str, float] | None, by_keyword: Mapping[str, float]) -> dict[str, float]:
        """Return the values of all parameters by name, from a mapping and keyword arguments; the errors are those of
        `arguments.parameters`."""
        return arguments.parameters(self.interface, mapped, by_keyword)
