"""Lattices with a monitor, integrated on devices.

The duration of each flow follows from the energy of a part of H, which the device sums over the sites.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phigen.runtime.devices.lattice_sessions import DeviceLatticeSession, resumable
from phigen.runtime.interface import BackendError, Floats
from phigen.runtime.modules import load_module


class MonitoredSession(DeviceLatticeSession):
    """A session of a lattice with a monitor (dt = g dτ): steps are equal in τ, not in time t.

    The duration of a flow depends on one number, which the device sends to the host.
    """

    def __init__(self, backend: Any, *arguments: Any, timed: bool) -> None:
        self._monitoring = backend.monitoring
        super().__init__(backend, *arguments, timed=timed)
        self._sites.on_device = self
        self._sites.clock = 0.0, 0.0
        self._hold_level()

    def _begin(self) -> None:
        """Do nothing. The energy level is computed at the end of ``__init__``, when the arrays on the device exist."""

    def _hold_level(self) -> None:
        """Set the energy level e to −H of the state. Raises `BackendError` unless g > 0 at the state."""
        with np.errstate(all="ignore"):
            try:
                self._sites.level = self._monitoring._level(self._sites, None)
            except ValueError:
                raise BackendError("BAD_ARGUMENT", self.steps, self._x[None].copy()) from None

    def part_energy(self, part: int) -> float:
        """Return the energy of a part of H, summed over the sites on the device."""
        return float(self._numbers_of(f"part{part + 1}", ["sum"])[0])

    def place(self, x: Floats) -> None:
        if not np.isfinite(x).all():
            raise BackendError("BAD_ARGUMENT", self.steps, self._x[None].copy())
        previous, self._x = self._x, x
        try:
            self._hold_level()
        except BackendError:
            self._x = previous
            raise

    def advance(self, h: float, steps: int) -> None:
        self.prepare(h)
        for _ in range(steps):
            with resumable(self.steps), np.errstate(all="ignore"):
                self._advance_once()
            self.steps += 1

    def _advance_once(self) -> None:
        """Make one step. If the step fails, restore the state before the step, and raise `BackendError`."""
        self._upload()
        self._launcher.copy(self._fields, self._before, self._stored)
        start_clock = self._sites.clock
        try:
            self._make(1)
            failed = self._failed()
        except self._monitoring.FailedError:
            failed = True
        if failed:
            self._sites.clock = start_clock
            self._restore()
            raise BackendError("NOT_FINITE", self.steps, self._x[None].copy())

    def _make(self, steps: int) -> None:
        """Make steps without a check that the results are finite."""
        self._host = None
        module, sites = self._monitoring, self._sites
        correction_times = [[0.0]] if hasattr(module, "_late") else []
        for part, row in module.SCHEDULE * steps:
            time = self._rows[row] / module._rate(sites, part, None)
            self._write_coefficients([module._prepare(sites.parameters, time, *correction_times)])
            for sweep in self._interface.launches.parts[part]:
                self._launcher.run(sweep, self._coefficients, x=self._fields, dw=self._increments)
            if part != module.NEGATIVE:
                sites.clock = module._passed(sites.clock, time)


def monitoring_module(text: str, name: str) -> Any:
    """Load the generated NumPy module of a lattice.

    In the module, the function for the energy of a part of H is replaced by one that calls a kernel on the device.
    """
    module: Any = load_module(text, name)
    module._part_energy = lambda sites, part, x: sites.on_device.part_energy(part)
    return module
