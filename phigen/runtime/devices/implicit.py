"""Implicit steps of lattices on devices. A generated NumPy module makes the steps, with arrays that lie on the
device.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phigen.runtime.devices.device_array import DeviceArray
from phigen.runtime.devices.lattice_sessions import DeviceLatticeSession, resumable
from phigen.runtime.interface import BackendError
from phigen.runtime.modules import load_module
from phigen.targets.c.real import THRESHOLD, threshold


class ImplicitSession(DeviceLatticeSession):
    """A session of a lattice on a device, for steps with implicit equations."""

    def __init__(self, backend: Any, *arguments: Any, timed: bool) -> None:
        super().__init__(backend, *arguments, timed=timed)
        self._stepping = backend.stepping
        self._sites.on_device = self
        self._written: Any = None

    def advance(self, h: float, steps: int) -> None:
        self.prepare(h)
        predictors: dict[Any, Any] = {}
        with np.errstate(all="ignore"):
            for _ in range(steps):
                self._advance_once(predictors)

    def _advance_once(self, predictors: dict[Any, Any]) -> None:
        with resumable(self.steps):
            self._upload()
            state = DeviceArray(self._launcher, self._fields, self._shape)
            try:
                following = self._stepping._advance(self._sites, self._rows, state, predictors)
            except self._stepping.FailedError as failed:
                self._tell_time()
                raise BackendError(str(failed), self.steps, self._x[None].copy()) from None
        self._fields, self._host = following.buffer, None
        self.steps += 1
        self._tell_time()

    def evaluated(self, name: str, coefficients: Any, start: Any, x: Any, varied: Any = None) -> DeviceArray:
        """Evaluate the kernel ``name`` of an implicit stage at the iterate ``x``, and return the result, on the
        device.

        ``coefficients`` are the coefficients of the stage, and ``start`` is the state before the stage. The kernel that
        computes a directional derivative also needs the direction, ``varied``.
        """
        if self._written is not coefficients:
            self._write_coefficients([coefficients])
            self._written = coefficients
        self._write_parameters()
        launch, result = self._interface.launches.others[name], self._launcher.empty(self._size)
        variation = varied.buffer if varied is not None else None
        arrays = {"x": x.buffer, "start": start.buffer, "varied": variation, "dw": self._increments}
        if self._interface.noise:
            self._launcher.write(self._increments, self._sites.dw)
        self._launcher.run(launch, self._coefficients, out=result, **arrays)
        return DeviceArray(self._launcher, result, self._shape)


def stepping_module(text: str, name: str, *, single: bool) -> Any:
    """Return the NumPy module of a lattice, in which kernels on a device compute the functions of the implicit
    equation.

    With ``single``, thresholds of the iteration are those of the C in single precision.
    """
    module: Any = load_module(text, name)
    module._relax = lambda coef, start, x, sites: sites.on_device.evaluated("relax", coef, start, x)
    module._increment = lambda coef, start, x, sites: sites.on_device.evaluated("increment", coef, start, x)
    module._slope = lambda coef, start, x, v, sites: sites.on_device.evaluated("slope", coef, start, x, v)
    for constant, value in list(vars(module).items()) if single else ():
        if constant.isupper() and isinstance(value, float) and 0.0 < value < THRESHOLD:
            setattr(module, constant, threshold(value))
    return module
