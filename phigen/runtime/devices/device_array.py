"""Arrays on a device, with those operations of NumPy that implicit steps of lattices use."""

from __future__ import annotations

from typing import Any

import numpy as np

from phigen.runtime.devices.launching import Launcher
from phigen.runtime.interface import Floats

#: Name of an operation in NumPy → number that selects this operation in the kernel ``combine``.
_OPERATIONS = {"add": 0, "subtract": 1, "multiply": 2, "divide": 3, "absolute": 4, "isfinite": 5}


class DeviceArray(np.lib.mixins.NDArrayOperatorsMixin):
    """Immutable array (coordinates, *sizes) on a device, which supports arithmetic like an array of NumPy.

    The second operand of an operation is an array of the same shape on the device, one number, or one number for each
    coordinate.
    """

    def __init__(self, launcher: Launcher, buffer: Any, shape: tuple[int, ...]) -> None:
        self.launcher, self.buffer, self.shape = launcher, buffer, shape

    @property
    def ndim(self) -> int:
        """The number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """The number of entries."""
        return int(np.prod(self.shape))

    def __array_ufunc__(self, ufunc: Any, method: str, *operands: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            return NotImplemented
        if ufunc is np.power and operands[1] == 2:
            return self * self
        if ufunc.__name__ not in _OPERATIONS:
            return NotImplemented
        swapped = not isinstance(operands[0], DeviceArray)
        left, right = (operands[1], operands[0]) if swapped else (operands[0], operands[-1])
        return left._combined(_OPERATIONS[ufunc.__name__], right, swapped=swapped)

    def _combined(self, operation: int, operand: Any, *, swapped: bool) -> DeviceArray:
        value, of_rows, rows = 0.0, self.buffer, 0
        if isinstance(operand, DeviceArray):
            of_rows = operand.buffer
        elif np.ndim(operand) == 0:
            value, rows = float(operand), 2
        else:
            of_rows, rows = self.launcher.tables.written(operand, self.launcher.real), 1
        result = self.launcher.empty(self.size)
        numbers = (self.size, self.size // self.shape[0], operation, rows, int(swapped))
        launch_arguments = [*map(np.int32, numbers), self.launcher.real(value), self.buffer, of_rows, result]
        self.launcher.device.launch(self.launcher.kernels["combine"], self.size, launch_arguments)
        return DeviceArray(self.launcher, result, self.shape)

    def max(self, axis: Any = None) -> Any:
        """Return the largest entry or, if ``axis`` lists all axes but the first, the largest entry for each
        coordinate."""
        return self._reduced("max", axis)

    def sum(self, axis: Any = None) -> Any:
        """Return the sum of all entries or, if ``axis`` lists all axes but the first, the sum for each coordinate."""
        return self._reduced("sum", axis)

    def all(self) -> bool:
        """Return whether all entries differ from 0."""
        return bool(self._reduced("min", None))

    def _reduced(self, kind: str, axis: Any) -> Any:
        rows = 1 if axis is None else self.shape[0]
        values = self.launcher.reduced(self.buffer, [kind] * rows, self.size // rows)
        return float(values[0]) if axis is None else values

    def read(self) -> Floats:
        """Return a copy of the entries as a NumPy array."""
        return self.launcher.read(self.buffer, self.shape)
