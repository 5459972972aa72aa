"""Protocol of back ends. A back end is the loaded solver of a system in one target language; `Solver` calls it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from phigen.runtime.interface import FIRST_DRAWS, Draws, Floats
from phigen.runtime.members import Members
from phigen.runtime.session import Session


class Backend(Protocol):
    """Loaded solver of a system, in one target language.

    States are float64 arrays whose last axis is the coordinates. ``parameters`` holds the value of every parameter, in
    the order of declaration. The caller has checked all arguments. A failing step raises `BackendError`. If the
    Hamiltonian depends on the time, ``t0`` is the initial time, and ``t`` (rows,) are the times of the states.
    Otherwise ``t0`` is 0 and ``t`` is None.
    """

    target: str

    @property
    def identity(self) -> str:
        """A hash of the code of the solver: solvers with equal hashes compute equal results, and load each other's
        sessions."""
        ...

    def start(
        self,
        x0: Floats,
        parameters: Mapping[str, float],
        t0: float = 0.0,
        first: Floats | None = None,
        draws: Draws = FIRST_DRAWS,
    ) -> Session:
        """Return a session (a trajectory that is computed step by step) with the state x0 (DIM,) at the time
        t0.

        ``first`` (numbers,) is the initial attitude and position, by default the identity and the origin. ``draws``
        selects the random numbers of the noise.
        """
        ...

    def restored(self, saved: bytes, parameters: Mapping[str, float]) -> Session:
        """Return the session that `Session.saved` stored as the bytes ``saved``.

        The back end that stored the session must have the same `identity` as this one.
        """
        ...

    def with_gauge(self, gauge: Floats) -> Backend:
        """Return a back end that subtracts fixed multiples of Casimirs from H; ``gauge`` has one number for each
        Casimir."""
        ...

    def ensemble(self, members: Members, threads: int | None = None, attitudes: Floats | None = None) -> Floats:
        """Return the final states (members, DIM) of an ensemble or, with a stride, its frames (rows, members,
        DIM).

        ``threads`` is the number of threads, None for one per core. ``attitudes`` is an array (rows, members,
        components); the components are those of an attitude and a position. The first row contains the initial
        attitudes. The other rows receive the attitudes of the frames. Without a stride, ``attitudes`` has two rows; the
        second row receives the final attitudes.
        """
        ...

    @property
    def has_ensemble(self) -> bool:
        """Whether the solver was compiled with `ensemble`."""
        ...

    @property
    def has_pullback(self) -> bool:
        """Whether the solver was compiled with ``adjoint``, and so has `pullback`."""
        ...

    def pullback(self, members: Members, bars: Floats, threads: int | None = None) -> tuple[Floats, Floats, Floats]:
        """Return the stored states (rows, members, DIM), and the cotangents of initial states and parameters.

        ``bars`` are the cotangents of the stored states. The cotangents of the initial states are (members, DIM), those
        of the parameters (parameters, members). Raises `MissingExtraError` if the solver was compiled without
        ``adjoint``.
        """
        ...

    def hamiltonian(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """Return H of the states (rows, DIM), shape (rows,)."""
        ...

    def casimirs(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """Return the Casimirs of the states (rows, DIM), shape (rows, number of Casimirs)."""
        ...

    def vector_field(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """Return π∇H (rows, DIM) at the states (rows, DIM)."""
        ...

    def observables(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """Return the observables of the spec at the states (rows, DIM), shape (rows, number of observables)."""
        ...

    def noise_fields(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """Return the vector field σπ∇g of each source of noise at the states (rows, DIM), shape (rows, sources, DIM).

        σ is the amplitude of the source, and g its Hamiltonian.
        """
        ...

    def rate(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """Return the monitor g = dt/dτ at the states (rows, DIM), shape (rows,). Needs a solver with a monitor."""
        ...
