"""Sessions of lattices on devices. The state stays on the device, which also computes energies and observables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from phigen.errors import DeviceError
from phigen.runtime.devices.device import OutOfMemoryError
from phigen.runtime.devices.launching import Launcher
from phigen.runtime.interface import BackendError, Floats
from phigen.runtime.numpy_lattice import NumpyLatticeSession

#: Number of steps between two checks that all values are finite. If a check fails, these steps are repeated one by one
#: to find the first that fails.
_STEPS_PER_LOOK = 64


class DeviceLatticeSession(NumpyLatticeSession):
    """A session of a lattice whose state lies on a device, and is copied to the host when it is read.

    The functions of the generated NumPy module, which compute coefficients, run on the host.
    """

    def __init__(self, backend: Any, *arguments: Any, timed: bool) -> None:
        self._interface, self._device = backend.interface, backend.device
        self._host: Floats | None = None
        self._shape: tuple[int, ...] = arguments[1].shape
        self._size = int(np.prod(self._shape))
        self._on_device = False
        super().__init__(*arguments, timed=timed)
        self._launcher: Launcher = backend.launcher(self._sites, self._shape[1:])
        stored_count = self._size * (2 if self._interface.compensated else 1)  # the state and its compensation terms
        self._fields, self._before = (self._launcher.empty(stored_count) for _ in range(2))
        self._stored = stored_count
        self._flag = self._device.empty(4)
        self._increments = self._launcher.empty(self._launcher.tables.count * max(1, len(self._interface.noise)))
        self._parameters: list[float] = []  # values in the buffer on the device
        self._coefficients: Any = None
        self._row = 0

    @property
    def _x(self) -> Floats:
        """The state as an array on the host; it is copied from the device if necessary."""
        if self._host is None:
            self._host = self._launcher.read(self._fields, self._shape)
        return self._host

    @_x.setter
    def _x(self, value: Floats) -> None:
        self._host, self._on_device = np.ascontiguousarray(value), False

    def _upload(self, compensation: Floats | None = None) -> None:
        """Copy the state and its compensation terms (0 by default) to the device, unless the device already has this
        state.
        """
        if self._on_device:
            return
        state = self._x.ravel()
        if self._interface.compensated:
            state = np.append(state, np.zeros(self._size) if compensation is None else compensation.ravel())
        self._launcher.write(self._fields, state)
        self._on_device = True

    def saved(self) -> dict[str, Any]:
        if not self._interface.compensated:
            return super().saved()
        self._upload()
        return {**super().saved(), "compensation": self._launcher.read(self._fields, (2, *self._shape))[1]}

    def resume(self, h: float, steps: int, arrays: Mapping[str, Any]) -> None:
        super().resume(h, steps, arrays)
        self._upload(arrays.get("compensation"))

    def advance(self, h: float, steps: int) -> None:
        """Make ``steps`` steps of size ``h``. Raises `BackendError` if a step fails, and `DeviceError` if the device
        fails."""
        self.prepare(h)
        left = steps
        while left:
            count = min(left, _STEPS_PER_LOOK)
            first_step = self.steps
            with resumable(first_step):
                self._upload()
                self._launcher.copy(self._fields, self._before, self._stored)
                self._make(count)
                if self._failed():
                    self.steps = first_step
                    self._restore()
                    self._make_until_failure()
            left -= count

    def _restore(self) -> None:
        self._launcher.copy(self._before, self._fields, self._stored)
        self._host = None

    def _make_until_failure(self) -> None:
        """Make steps until one fails, with a check after each. Raises `BackendError`, with the state before the failing
        step."""
        while True:
            self._launcher.copy(self._fields, self._before, self._stored)
            self._make(1)
            if self._failed():
                self.steps -= 1
                self._tell_time()
                self._restore()
                raise BackendError("NOT_FINITE", self.steps, self._x[None].copy())

    def _make(self, steps: int) -> None:
        """Make steps without a check that the results are finite."""
        self._host = None
        module, rows = self._module, self._rows
        constant = not (hasattr(module, "_renewed") or hasattr(module, "_draw"))
        flows = self._flows()
        if constant:
            self._write_coefficients(rows)
        for _ in range(steps):
            self._tell_time()
            if hasattr(module, "_renewed"):
                rows = module._renewed(self._sites, self._rows)
            if not constant:
                self._write_coefficients(rows)
            for number, (part, colour, row) in enumerate(flows):
                if hasattr(module, "_draw") and number in (0, len(module.SCHEDULE) - len(module.SOURCES)):
                    self._launcher.write(self._increments, module._draw(self._sites, int(number > 0)))
                arrays = {"x": self._fields, "dw": self._increments}
                for sweep in self._interface.launches.parts[part]:
                    self._launcher.run(sweep, self._coefficients, row * self._row, colour, **arrays)
            self.steps += 1
        self._tell_time()

    def _flows(self) -> list[tuple[int, int, int]]:
        """Return the flows of a step in order, as triples (part, colour, row).

        ``part`` is the number of a part of H, and ``colour`` a colour of sites. ``row`` is the index of the
        coefficients of the flow. The colour is 0 for lattices that are not graphs.
        """
        if hasattr(self._module, "BY_COLOUR"):
            return [(part, colour, row) for (part, colour), row in self._sites.schedule]
        return [(part, 0, row) for part, row in self._module.SCHEDULE]

    def _write_coefficients(self, rows: Sequence[Sequence[Any]]) -> None:
        """Copy the coefficients of all flows of a step to the device."""
        values = np.asarray(rows, dtype=np.float64).reshape(len(rows), -1)
        self._row = values.shape[1]
        if self._coefficients is None:
            self._coefficients = self._launcher.empty(values.size)
        self._launcher.write(self._coefficients, values)

    def _failed(self) -> bool:
        flag = np.zeros(1, dtype=np.int32)
        self._device.write(self._flag, flag)
        kernel = self._launcher.kernels["failed"]
        self._device.launch(kernel, self._size, [np.int32(self._size), self._fields, self._flag])
        self._device.read(self._flag, flag)
        return bool(flag[0])

    # --- functions of the state

    def _evaluated(self, name: str) -> tuple[Any, int]:
        """Evaluate a kernel at all sites. Return two values: a buffer with the outputs, and the number of outputs per
        site.

        The result is (None, 0) if there is no kernel with this name.
        """
        launch = self._interface.launches.others.get(name)
        if launch is None:
            return None, 0
        self._upload()
        self._write_parameters()
        result = self._launcher.empty(launch.outputs * self._launcher.tables.count)
        self._launcher.run(launch, self._launcher.parameters, x=self._fields, out=result)
        return result, launch.outputs

    def _write_parameters(self) -> None:
        """Copy the parameters that are numbers, and the time, to the device, if they have changed."""
        values = [float(self._sites.parameters[name]) for name in self._interface.launches.numbers]
        values.append(float(self._sites.t) if self._timed else 0.0)
        if values != self._parameters:
            self._launcher.write(self._launcher.parameters, values)
            self._parameters = values

    def _fields_of(self, name: str) -> Floats:
        """Evaluate a kernel at all sites, and return its outputs (outputs, *sizes)."""
        with resumable(self.steps):
            result, outputs = self._evaluated(name)
            sizes = self._shape[1:]
            return self._launcher.read(result, (outputs, *sizes)) if outputs else np.empty((0, *sizes))

    def _numbers_of(self, name: str, kinds: Sequence[str]) -> Floats:
        """Evaluate a kernel at all sites, and reduce each output over the sites to one number.

        ``kinds`` has a reduction for each output, such as ``sum``.
        """
        with resumable(self.steps):
            result, _ = self._evaluated(name)
            return self._launcher.reduced(result, kinds, self._launcher.tables.count)

    def hamiltonian(self) -> float:
        """Return H of the state."""
        return float(self._numbers_of("energy", ["sum"])[0])

    def density(self) -> Floats:
        """Return the density of H at the sites (*sizes)."""
        return self._fields_of("energy").reshape(self._shape[1:])

    def casimirs(self) -> Any:
        """Return a value for each Casimir: an array of densities (*sizes) if each site has its own Casimir, else a
        number.
        """
        kinds = self._interface.casimir_kinds
        if "sites" in kinds:
            fields = self._fields_of("casimirs")
        numbers = self._numbers_of("casimirs", ["max" if kind == "sites" else kind for kind in kinds])
        return [fields[k] if kind == "sites" else numbers[k] for k, kind in enumerate(kinds)]

    def vector_field(self) -> Floats:
        """Return π∇H (coordinates, *sizes)."""
        return self._fields_of("vector_field")

    def observables(self) -> Floats:
        """Return the observables that are one number each (observables,)."""
        reductions, count = self._interface.launches.reductions, self._launcher.tables.count
        if not reductions:
            return np.empty(0)
        values = self._numbers_of("observables", [kind for kind, _ in reductions])
        counts = {"sites": count, "bonds": len(getattr(self._sites, "ends", ())), "pairs": count * (count - 1) / 2}
        divisors = [counts[domain] if kind == "mean" else 1.0 for kind, domain in reductions]
        with np.errstate(all="ignore"):
            quotients: Floats = values / np.array(divisors)
        return quotients

    def observed_fields(self) -> Floats:
        """Return the observables with a value at each site (fields, *sizes)."""
        return self._fields_of("observed_fields")


@contextmanager
def resumable(steps: int) -> Iterator[None]:
    """Return a context in which errors of the device are raised as `DeviceError`.

    The message has the number ``steps`` of the steps made so far, and a hint that a run with checkpoints can be
    resumed.
    """
    try:
        yield
    except (DeviceError, OutOfMemoryError) as error:
        hint = "with checkpoints=, integrate stores the state at each frame, and resumes from there"
        raise DeviceError(f"after step {steps}: {error}\n  hint: {hint}") from error
