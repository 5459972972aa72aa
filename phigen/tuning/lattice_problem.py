"""Tuning problems of lattices. Their states are flattened to one dimension, as the search for settings needs them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from phigen.api import lattice_solver_of
from phigen.compilation import Compilation
from phigen.errors import SpecError
from phigen.geometry.conservation import SITES, Unit, unit_of
from phigen.lattice.cell import GRID, Cell
from phigen.lattice.states import Start, start_of
from phigen.runtime.lattice import LatticeBackend, LatticeSession
from phigen.spec.model import Run, Spec
from phigen.spec.names import BIREALISATIONS
from phigen.study import classical, race
from phigen.symbolic.arrays import Floats
from phigen.tuning.problem import Candidate, Problem, rounding_of
from phigen.tuning.settings import CHOICES, FORMULAS, OWN, SPLITTING, Setting, direct

#: A grid with more sites than this is replaced by a smaller one, on which methods are measured.
MOST_SITES = 10_000
#: MOST_NUMBERS: largest number of values (states times coordinates) that are stored for one run. MOST_COMPARED: largest
#: number of coordinates with which orbits are compared with a reference solution.
MOST_NUMBERS, MOST_COMPARED = 2**24, 2**13
#: Largest number of states at which the energy of one run is evaluated. Each evaluation is a call from Python, and goes
#: over all sites.
LATTICE_ROWS = 1024


@dataclass
class FlatSession:
    """Session of a lattice solver, for single steps. Its states are flattened to (DIM,).

    Its methods are those of `phigen.runtime.session.Course`.
    """

    session: LatticeSession

    @property
    def steps(self) -> int:
        """Number of successful steps since the start."""
        return self.session.steps

    def state(self) -> Floats:
        """Return a copy of the current state (DIM,)."""
        return self.session.state().reshape(-1)

    def advance(self, h: float, steps: int) -> None:
        """Make ``steps`` steps of size ``h``."""
        self.session.advance(h, steps)

    def branch(self) -> FlatSession:
        """Raise `NotImplementedError`: copies of sessions of lattices are not needed here."""
        raise NotImplementedError


@dataclass(frozen=True)
class FlatLattice:
    """Solver of a lattice of one size, with states flattened to (DIM,).

    Its methods are those of `phigen.runtime.backend.Backend`.
    """

    backend: LatticeBackend
    shape: tuple[int, ...]
    _seen: list[LatticeSession] = field(default_factory=list)

    def start(self, x0: Floats, parameters: Mapping[str, Any]) -> FlatSession:
        """Return a session that starts from the state ``x0`` (DIM,)."""
        return FlatSession(self.backend.start(x0.reshape(self.shape), parameters))

    def vector_field(self, states: Floats, parameters: Mapping[str, Any]) -> Floats:
        """Return the right-hand side of the equations of motion at states (rows, DIM)."""
        return np.array([self._evaluation_session(x, parameters).vector_field().reshape(-1) for x in states])

    def energies(self, states: Floats, parameters: Mapping[str, Any]) -> Floats:
        """Return the energies H (rows,) of states (rows, DIM)."""
        return np.array([self._evaluation_session(x, parameters).hamiltonian() for x in states])

    def terms(self, x: Floats, parameters: Mapping[str, Any]) -> float:
        """Return the sum of |energy of a site| over all sites, at a state ``x`` (DIM,)."""
        return float(np.abs(self._evaluation_session(x, parameters).density()).sum())

    def _evaluation_session(self, x: Floats, parameters: Mapping[str, Any]) -> LatticeSession:
        """Return a session at the state ``x``, in which functions of states are evaluated; it is reused if possible."""
        state = x.reshape(self.shape)
        if not self._seen:
            self._seen.append(self.backend.start(state, parameters))
            return self._seen[0]
        try:
            self._seen[0].place(state)
        except TypeError:  # code with the profile small cannot replace the state of a session, so a new one is made
            return self.backend.start(state, parameters)
        return self._seen[0]


@dataclass(frozen=True)
class LatticeProblem(Problem):
    """Tuning problem of a lattice with given sizes and parameter arrays.

    ``seer`` is the solver that evaluates energies. ``whole`` are the sizes of the lattice in the run of the spec. If
    methods are measured on a smaller lattice, ``sizes`` are smaller than ``whole``.
    """

    cell: Cell = field(kw_only=True)
    whole: tuple[int, ...] = field(kw_only=True)
    seer: FlatLattice = field(kw_only=True)

    @property
    def name(self) -> str:
        """Name of the lattice."""
        return self.cell.name

    @property
    def unit(self) -> Unit:
        """Unit in which energy errors are measured."""
        energy = float(self.seer.energies(self.start[None], self.parameters)[0])
        return unit_of(energy, self.seer.terms(self.start, self.parameters), SITES)

    @property
    def most_rows(self) -> int:
        """Largest number of states at which the energy of one run is evaluated; fewer for large lattices."""
        return min(LATTICE_ROWS, max(64, MOST_NUMBERS // len(self.start)))

    @property
    def evens_out(self) -> bool:
        """Whether monitors may be tried: never for lattices."""
        return False

    def energies(self, states: Floats) -> Floats:
        """Return the energies H (rows,) of states (rows, DIM); NaN for states that are not finite."""
        finite = np.isfinite(states).all(axis=1)
        energies = np.full(len(states), np.nan)
        energies[finite] = self.seer.energies(states[finite], self.parameters)
        return energies

    def method(self, solver: Any) -> Candidate:
        """Return an object that makes runs with a lattice solver, from the initial state of this problem."""
        flat: Any = FlatLattice(solver, self.seer.shape)
        return Candidate(flat, self)

    def guesses(self, current: Setting) -> list[Setting]:
        """Return the settings to measure first: the setting of the spec at orders 2 and 4, splittings, and series.

        The series is tried with each bi-realisation that might apply to the brackets of a site.
        """
        local = self.cell.is_local
        kinds = [k for k in BIREALISATIONS if k not in (*FORMULAS, *CHOICES, "karasev")] if local else ["auto"]
        splittings = [Setting(SPLITTING, order, "none", "auto") for order in (4, 6)]
        first = [replace(current, order=order, composition=direct(current)) for order in (2, 4)]
        all_settings = [*splittings, *(Setting(kind, 4, OWN, "auto") for kind in kinds)]
        return [s for s in (*first, *(s for s in all_settings if s.chart != current.chart)) if s != current]

    def classical(self, compilation: Compilation, names: Sequence[str], state: Floats) -> race.Race:
        """Return classical methods in NumPy that start from ``state``; the solver evaluates the vector field."""

        def slope(x: Floats) -> Floats:
            velocity: Floats = self.seer.vector_field(x[None], self.parameters)[0]
            return velocity

        def runner(name: str) -> race.Runner:
            def run(h: float, steps: int, repeats: int) -> Floats | None:
                for _ in range(repeats):
                    end: Floats = classical.integrate(name, slope, state, h, steps, steps)[-1]
                return end if np.isfinite(end).all() else None

            return run

        return race.Race({name: runner(name) for name in names}, lambda repeats: None, "NumPy")


def lattice_problem(
    compilation: Compilation, run: Run, settings: Mapping[str, float], step: float, span: float, direction: float
) -> LatticeProblem:
    """Return the tuning problem of a run of a lattice; ``settings`` are values that replace values of parameters of the
    run.

    ``step`` and ``span`` are the step size and the duration of the run, both positive; ``direction`` is 1 or −1. A run
    on a large grid is measured on a smaller grid if possible. Raises `SpecError` if the run cannot start.
    """
    spec, cell = compilation.spec, compilation.by_sweeps().cell
    solver = lattice_solver_of(compilation)
    start = start_of(spec, run)
    interface = solver.interface
    sizes = _fewer(start.sizes, interface.least, interface.periods) if cell.relation == GRID else start.sizes
    reduced_start = start if sizes == start.sizes else _start_with_sizes(spec, run, sizes) or start
    flat = FlatLattice(solver.backend, reduced_start.state.shape)
    values = solver.values({**reduced_start.arguments, **settings}, {}, reduced_start.sizes)
    return LatticeProblem(
        reduced_start.state.reshape(-1), values, step, span, direction, reduced_start.sizes,
        rounding=rounding_of(compilation), cell=cell, whole=start.sizes, seer=flat,
    )  # fmt: skip


def _fewer(sizes: Sequence[int], least: Sequence[int], periods: Sequence[int]) -> tuple[int, ...]:
    """Return sizes of a grid with at most about `MOST_SITES` sites. The largest of ``sizes`` is halved repeatedly.

    Each size remains a multiple of its entry in ``periods``, and does not fall below its entry in ``least``.
    """
    reduced = list(sizes)
    while np.prod(reduced) > MOST_SITES:
        axis = int(np.argmax(reduced))
        halved = -(-reduced[axis] // 2 // periods[axis]) * periods[axis]
        if halved < max(least[axis], 4) or halved >= reduced[axis]:
            break
        reduced[axis] = halved
    return tuple(reduced)


def _start_with_sizes(spec: Spec, run: Run, sizes: tuple[int, ...]) -> Start | None:
    """Return initial state and parameters of the run on a grid of other sizes; None if the run has arrays of fixed
    sizes.
    """
    assert run.lattice is not None
    try:
        return start_of(spec, replace(run, lattice=replace(run.lattice, sizes=sizes)))
    except SpecError:
        return None
