"""What the runtime asks of a back end: a loaded solver of one target."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from phigen.runtime.interface import FIRST_DRAWS, Draws, Floats
from phigen.runtime.members import Members
from phigen.runtime.session import Session


class Backend(Protocol):
    """A loaded solver.

    States are float64 arrays whose last axis is the coordinates. ``parameters`` holds every parameter, in the order
    of declaration. Arguments were checked by the caller. A failing step raises `BackendError`. The times ``t0`` of a
    start and ``t`` (rows,) of states are given where the Hamiltonian depends on the time, and 0 and None else.
    """

    target: str

    @property
    def identity(self) -> str:
        """A hash of all that decides the results, and what bytes of a session mean."""
        ...

    def start(
        self,
        x0: Floats,
        parameters: Mapping[str, float],
        t0: float = 0.0,
        first: Floats | None = None,
        draws: Draws = FIRST_DRAWS,
    ) -> Session:
        """A session at x0 (DIM,), with an attitude and position ``first`` (numbers,); None for the identity.

        ``draws`` are the random numbers of its noise.
        """
        ...

    def restored(self, saved: bytes, parameters: Mapping[str, float]) -> Session:
        """The session whose `Session.saved` bytes these are, made by a back end of the same `identity`."""
        ...

    def with_gauge(self, gauge: Floats) -> Backend:
        """A back end whose trajectories all have the given gauge, one value for each Casimir of the gauge."""
        ...

    def ensemble(self, members: Members, threads: int | None = None, turned: Floats | None = None) -> Floats:
        """Final states (members, DIM), or frames (rows, members, DIM); in so many threads, None for all cores.

        ``turned`` (rows, members, numbers) has the attitudes that members begin with in its first row, and gets those
        of the frames in the others; where no frames are asked for it has two rows, and gets those of the final states.
        """
        ...

    def pullback(self, members: Members, bars: Floats, threads: int | None = None) -> tuple[Floats, Floats, Floats]:
        """Rows of states (rows, members, DIM), those of the stride, and what their cotangents ``bars`` come back to.

        These are (members, DIM) and (parameters, members). Raises `MissingExtraError` without the extra ``adjoint``.
        """
        ...

    def hamiltonian(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """H of the states (rows, DIM), shape (rows,)."""
        ...

    def casimirs(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """Casimirs of the states (rows, DIM), shape (rows, number of Casimirs)."""
        ...

    def vector_field(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """π∇H at the states (rows, DIM), the same shape."""
        ...

    def observables(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """Return the observables of the spec at the states (rows, DIM), shape (rows, number of observables)."""
        ...

    def noise_fields(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """σπ∇g of each source of noise at the states (rows, DIM), shape (rows, sources, DIM)."""
        ...

    def rate(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """dt/dτ at the states (rows, DIM), shape (rows,), of a monitored solver."""
        ...
