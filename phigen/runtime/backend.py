"""Protocol of back ends: the loaded solver of one target, as the runtime calls it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from phigen.runtime.interface import FIRST_DRAWS, Draws, Floats
from phigen.runtime.members import Members
from phigen.runtime.session import Session


class Backend(Protocol):
    """A loaded solver.

    States are float64 arrays whose last axis is the coordinates. ``parameters`` holds every parameter, in the order of
    declaration. The caller has checked all arguments. A failing step raises `BackendError`. If the Hamiltonian depends
    on the time, ``t0`` is the initial time and ``t`` (rows,) are the times of states; otherwise they are 0 and None.
    """

    target: str

    @property
    def identity(self) -> str:
        """A hash of everything that determines the results and the format of saved sessions."""
        ...

    def start(
        self,
        x0: Floats,
        parameters: Mapping[str, float],
        t0: float = 0.0,
        first: Floats | None = None,
        draws: Draws = FIRST_DRAWS,
    ) -> Session:
        """Return a session at x0 (DIM,).

        ``first`` (numbers,) is the initial attitude and position, by default the identity and the origin. ``draws``
        select the random numbers of the noise.
        """
        ...

    def restored(self, saved: bytes, parameters: Mapping[str, float]) -> Session:
        """Return the session that `Session.saved` stored as the bytes ``saved``, by a back end of the same
        `identity`."""
        ...

    def with_gauge(self, gauge: Floats) -> Backend:
        """Return a back end whose trajectories use a fixed gauge: one value for each Casimir of the gauge."""
        ...

    def ensemble(self, members: Members, threads: int | None = None, attitudes: Floats | None = None) -> Floats:
        """Return final states (members, DIM), or frames (rows, members, DIM); ``threads`` None uses all cores.

        ``attitudes`` (rows, members, numbers) contains the initial attitudes in its first row. The attitudes of the
        frames are written into the other rows. Without frames it has two rows, and the second receives the final
        attitudes.
        """
        ...

    @property
    def has_pullback(self) -> bool:
        """Whether the generated code has the extra ``adjoint``."""
        ...

    def pullback(self, members: Members, bars: Floats, threads: int | None = None) -> tuple[Floats, Floats, Floats]:
        """Return the stored states (rows, members, DIM), and the pullback of their cotangents ``bars`` to the start.

        The pullback consists of the cotangents of the initial states (members, DIM) and of the parameters (parameters,
        members). Raises `MissingExtraError` without the extra ``adjoint``.
        """
        ...

    def hamiltonian(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """Return H of the states (rows, DIM), shape (rows,)."""
        ...

    def casimirs(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """Return the Casimirs of the states (rows, DIM), shape (rows, number of Casimirs)."""
        ...

    def vector_field(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """Return π∇H at the states (rows, DIM), the same shape."""
        ...

    def observables(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """Return the observables of the spec at the states (rows, DIM), shape (rows, number of observables)."""
        ...

    def noise_fields(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """Return σπ∇g of each source of noise at the states (rows, DIM), shape (rows, sources, DIM)."""
        ...

    def rate(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """Return dt/dτ at the states (rows, DIM), shape (rows,), for a solver with a monitor."""
        ...
