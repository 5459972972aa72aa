"""Solvers of ordinary systems on devices: ensembles are integrated on the device, single trajectories on the host."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from phigen import registry
from phigen.errors import DeviceError, PhigenWarning
from phigen.runtime.backend import Backend
from phigen.runtime.devices.device import CHOICE, Device, OutOfMemoryError
from phigen.runtime.devices.launching import Kernels
from phigen.runtime.devices.opening import device_of
from phigen.runtime.interface import FIRST_DRAWS, Draws, Floats, Interface, status_name
from phigen.runtime.members import Members
from phigen.runtime.session import Session

#: Fraction of the device memory that a batch of members may use. The rest is for other programs, and for values that
#: registers cannot hold.
_SHARE = 0.5

#: Largest number of steps for each compute unit in one launch, summed over members. A launch then takes about a second.
#: Python handles Ctrl-C only between launches, and operating systems may end kernels that run too long.
_STEPS_PER_UNIT = 1 << 24

#: Smallest number of members for each compute unit in one launch. While one member waits for memory, others compute.
_MEMBERS_PER_UNIT = 2048

#: Largest number of bytes outside of registers that each member can have in the cache of a card. A multiprocessor runs
#: 256 members at once if each uses 255 registers. Together these members have 128 kB of cache.
_LOCAL_BYTES = 512


class DeviceSolver:
    """Solver that integrates ensembles on a device, and leaves all other computations to the solver ``host``.

    The object is a `phigen.runtime.backend.Backend`. ``files`` contain the generated header for devices. ``defined``
    are macros for the header, such as NAME_GROUP, the number of work items in a group. This number does not affect
    results.
    """

    def __init__(
        self,
        files: Mapping[str, str],
        interface: Interface,
        target: str,
        host: Backend,
        gauge: Floats | None = None,
        index: int | None = None,
    ) -> None:
        self.interface, self.target, self._index = interface, target, index
        self._files, self._host, self._gauge = dict(files), host, gauge
        self.defined: dict[str, int] = {}
        self._real: Any = np.float32 if interface.single else np.float64
        self._header = files[f"{interface.name}_device.h"]
        self._compiled: dict[bool, Kernels] = {}

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return _loaded_again, (self._files, self.interface, self.target, self._gauge, self._index)

    @property
    def device(self) -> Device:
        """The device, opened in the present process on first use."""
        return device_of(self.target, self._index)

    @property
    def identity(self) -> str:
        text = f"{self._header}\n{self.device.name}\n{self._host.identity}"
        return hashlib.sha256(text.encode()).hexdigest()[:40]

    def with_gauge(self, gauge: Floats) -> DeviceSolver:
        host = self._host.with_gauge(gauge)
        return DeviceSolver(self._files, self.interface, self.target, host, np.ascontiguousarray(gauge), self._index)

    def ensemble(self, members: Members, threads: int | None = None, attitudes: Floats | None = None) -> Floats:
        """Return the final states or frames of an ensemble; see `phigen.runtime.backend.Backend.ensemble`.

        Members are integrated in batches that fit into the memory of the device. ``threads`` has no effect. Raises
        `TypeError` if ``attitudes`` is passed, and `DeviceError` if the device fails. The ``trajectory`` of the
        `DeviceError` contains the results so far, and NaN for members without a result.
        """
        if attitudes is not None:
            raise TypeError(f"target {self.target} computes no attitudes of ensembles; compile for target c")
        if not len(members):
            return self._host.ensemble(members, threads)  # raises an error if the parameters are not admissible
        frames, final = members.frames() if members.stride else None, np.full(members.x0.shape, np.nan)
        if frames is not None:
            frames[1:] = np.nan
        common, coefficients = self._has_common_coefficients(members), list[Any]()
        status, members_done, batch = np.zeros(len(members), dtype=np.uint8), 0, self._batch(members)
        while members_done < len(members):
            part = slice(members_done, min(members_done + batch, len(members)))
            try:
                if common and not coefficients:
                    coefficients.append(self._coefficients(members))
                self._integrate(members.part(part), final[part], status[part], frames, part, coefficients)
                members_done = part.stop
            except OutOfMemoryError as error:
                if batch == 1:
                    message = f"{self.device.name} has too little memory for one member: {error}"
                    hint = f"close programs that use the device, or set {CHOICE} to another device"
                    larger = "take a larger stride, " if members.stride else ""
                    raise self._failure(message, larger + hint, final, frames, members_done) from None
                batch //= 2
            except DeviceError as error:
                hint = f"start Python again; set {CHOICE} to another device if this one fails again"
                raise self._failure(str(error), hint, final, frames, members_done) from error
        failures = {int(m): status_name(int(status[m])) for m in np.flatnonzero(status)}
        if frames is not None and members.steps % members.stride:
            frames[-1] = np.where(status[:, np.newaxis] == 0, final, np.nan)
        return members.checked(final if frames is None else frames, failures)

    def _failure(self, message: str, hint: str, final: Floats, frames: Floats | None, members_done: int) -> DeviceError:
        rest = f"; members from {members_done} on were not integrated" if members_done else ""
        failed = DeviceError(f"{self.interface.name}: {message}{rest}\n  hint: {hint}")
        failed.trajectory = final if frames is None else frames
        return failed

    def _batch(self, members: Members) -> int:
        """Return the number of members in a launch: as many as fit into memory, but at most about a second of work.

        A launch may take longer if it has at most `_MEMBERS_PER_UNIT` members for each compute unit.
        """
        device, rows = self.device, members.steps // members.stride if members.stride else 0
        size = np.dtype(self._real).itemsize
        of_member = size * (self.interface.dimension * (rows + 1) + len(members.parameters) + 3) + 1
        frames = max(1, size * self.interface.dimension * rows)
        fitting = int(min(device.memory * _SHARE // of_member, device.largest // frames))
        batch_of_short_runs = max(
            device.units * _MEMBERS_PER_UNIT, device.units * _STEPS_PER_UNIT // max(1, members.steps)
        )
        return max(1, min(fitting, batch_of_short_runs, len(members)))

    def _integrate(
        self,
        members: Members,
        final: Floats,
        status: NDArray[np.uint8],
        frames: Floats | None,
        part: slice,
        coefficients: Sequence[Any],
    ) -> None:
        """Integrate the members of one launch, and store their results in ``final``, ``status`` and ``frames``.

        ``part`` is the slice of these members in the ensemble. If all members share their coefficients,
        ``coefficients`` is a list of one kernel argument; otherwise it is empty.
        """
        device, count, size = self.device, len(members), np.dtype(self._real).itemsize
        x = np.ascontiguousarray(members.x0.T, dtype=self._real)
        rows = members.steps // members.stride if frames is not None else 0
        states, ended = self._written(x), device.empty(count)
        result = device.empty(rows * x.size * size) if rows else None
        parameters = self._shared_or_each(self._parameters(members))
        arguments: list[Any] = [*coefficients, np.uint64(count), *parameters, states]
        if self.interface.time:
            arguments += self._shared_or_each(np.atleast_1d(members.t0))
        elif self._holds_gauge:
            arguments += [self._gauge_argument(), np.int32(0)]
        arguments += [*self._shared_or_each(np.atleast_1d(members.h)), np.uint64(members.steps)]
        if self.interface.noise:
            first = np.uint32(members.paths[0])
            arguments += [np.uint64(members.draws.seed), first, np.uint64(members.draws.step)]
        arguments += [np.uint64(max(1, members.stride)), result, ended]
        device.launch(self._kernels(common=bool(coefficients))["ensemble"], count, arguments)
        device.read(ended, status)
        device.read(states, x)
        final[:] = x.T
        if rows and frames is not None:
            stored_rows = np.empty((rows, *x.shape), self._real)
            device.read(result, stored_rows)
            frames[1 : rows + 1, part] = stored_rows.transpose(0, 2, 1)

    def _kernels(self, *, common: bool) -> Kernels:
        """Return the compiled kernels for members that share one set of coefficients or, without ``common``, have one
        set each.
        """
        if common not in self._compiled:
            defined = {**self._group(), **self.defined, **({f"{self.interface.name}_COMMON": 1} if common else {})}
            self._compiled[common] = Kernels(self.device, self._header, self.interface.name, defined)
            self._warn_of_local_memory(self._compiled[common]["ensemble"])
        return self._compiled[common]

    def _group(self) -> dict[str, int]:
        """Return macros that make groups of work items smaller; {} if the usual size is possible.

        Groups must be smaller if the predictors of their members need more shared memory than the device has.
        """
        launch = self.interface.ensemble
        if not launch.predictors:
            return {}
        fitting = self.device.shared // (np.dtype(self._real).itemsize * launch.predictors)
        smaller = {f"{self.interface.name}_GROUP": 1 << max(0, fitting.bit_length() - 1)}
        return smaller if fitting < launch.group else {}

    def _warn_of_local_memory(self, kernel: Any) -> None:
        """Warn that steps are slow if the values of a member do not fit into the registers and the cache of the
        card."""
        if self.device.is_card and (size := self.device.local_bytes(kernel)) > _LOCAL_BYTES:
            message = f"{self.interface.name}: each member uses {size} bytes of {self.device.name} besides registers"
            hint = "give all members the same parameters and step, take a lower order, or scheme: splitting"
            warnings.warn(f"{message}, which is slow; {hint}", PhigenWarning, stacklevel=2)

    def _has_common_coefficients(self, members: Members) -> bool:
        """Whether all members can share one set of coefficients, which is then an argument of the kernel.

        Sharing needs equal parameters, equal step sizes, and equal multiples of the Casimirs that are subtracted from
        H.
        """
        same = np.ndim(members.h) == 0 and not any(np.ndim(v) for v in members.parameters.values())
        has_chosen_gauge = self._holds_gauge and self._gauge is None
        return bool(same and not has_chosen_gauge and self.interface.ensemble.coefficients)

    def _coefficients(self, members: Members) -> Any:
        """Compute the coefficients that all members share, and return the kernel argument that contains them."""
        coefficients = np.empty(self.interface.ensemble.coefficients, self._real)
        buffer = self.device.empty(coefficients.nbytes)
        parameters, h = (self._shared_or_each(v)[0] for v in (self._parameters(members), np.atleast_1d(members.h)))
        gauge = [self._gauge_argument()] if self._holds_gauge else []
        self.device.launch(self._kernels(common=True)["coefficients"], 1, [parameters, *gauge, h, buffer])
        self.device.read(buffer, coefficients)
        return self.device.constants(coefficients)

    def _gauge_argument(self) -> Any:
        """Return a buffer with the multiples of Casimirs to subtract from H, if they are fixed for all members.

        Returns None if the kernel chooses the multiples from each initial state.
        """
        return None if self._gauge is None else self._written(np.array(self._gauge, self._real))

    @property
    def _holds_gauge(self) -> bool:
        return self.interface.ensemble.gauges > 0

    def _parameters(self, members: Members) -> Floats:
        """Return the parameters as an array (members, parameters), or (1, parameters) if all members share them.

        A system without parameters has one unused number.
        """
        values = list(members.parameters.values()) or [np.zeros(())]
        count = len(members) if any(np.ndim(v) for v in values) else 1
        return np.stack([np.broadcast_to(v, (count,)) for v in values], axis=-1)

    def _shared_or_each(self, values: Floats) -> list[Any]:
        """Return a buffer of values, and a flag: 1 if each member has its own value, 0 if all members share one
        value.
        """
        return [self._written(np.ascontiguousarray(values, dtype=self._real)), np.int32(len(values) > 1)]

    def _written(self, array: NDArray[Any]) -> Any:
        buffer = self.device.empty(array.nbytes)
        self.device.write(buffer, array)
        return buffer

    def start(
        self,
        x0: Floats,
        parameters: Mapping[str, float],
        t0: float = 0.0,
        first: Floats | None = None,
        draws: Draws = FIRST_DRAWS,
    ) -> Session:
        """Return a session at x0 on the host, since the device only integrates ensembles."""
        return self._host.start(x0, parameters, t0, first, draws)

    def restored(self, saved: bytes, parameters: Mapping[str, float]) -> Session:
        return self._host.restored(saved, parameters)

    @property
    def has_ensemble(self) -> bool:
        return True

    @property
    def has_pullback(self) -> bool:
        return self._host.has_pullback

    def pullback(self, members: Members, bars: Floats, threads: int | None = None) -> tuple[Floats, Floats, Floats]:
        """Return the pullback of an ensemble, computed on the host; see `phigen.runtime.backend.Backend.pullback`."""
        return self._host.pullback(members, bars, threads)

    def hamiltonian(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        return self._host.hamiltonian(x, parameters, t)

    def casimirs(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        return self._host.casimirs(x, parameters)

    def vector_field(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        return self._host.vector_field(x, parameters, t)

    def observables(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        return self._host.observables(x, parameters, t)

    def noise_fields(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        return self._host.noise_fields(x, parameters, t)

    def rate(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        return self._host.rate(x, parameters)


def _loaded_again(
    files: Mapping[str, str], interface: Interface, target: str, gauge: Floats | None, index: int | None
) -> DeviceSolver:
    """Return a solver from its pickled data, on a device that is opened in the present process."""
    solver = cast(DeviceSolver, registry.find(target).load(files, interface, device=index))
    return solver if gauge is None else solver.with_gauge(gauge)
