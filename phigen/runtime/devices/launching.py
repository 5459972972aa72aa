"""Kernels of a lattice on a device, their launches, and reductions in a fixed order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from phigen.ir.launches import SiteLaunch, SumLaunch
from phigen.runtime.devices.device import Device
from phigen.runtime.devices.site_tables import SiteTables
from phigen.runtime.interface import Floats

#: Number of values that a work item reduces to one value, such as their sum, in one pass. The order of the operations
#: depends only on this number and on the number of values.
_REDUCED = 64

#: Numbers that tell a kernel how to reduce values. A mean is computed as a sum, and divided afterwards.
_KINDS = {"sum": 0, "mean": 0, "product": 1, "max": 2, "min": 3}


#: Number of work items in a group, unless the macro NAME_GROUP defines another number. With CUDA, a block has at most
#: this number of threads.
_GROUP = 128


class Kernels:
    """The kernels of a compiled program by name; each is created on first use.

    The program is compiled for groups of work items that the device can run.
    """

    def __init__(self, device: Device, text: str, name: str, defined: Mapping[str, int]) -> None:
        self._device, self._name = device, name
        group = f"{name}_GROUP"
        if device.group < defined.get(group, _GROUP):
            defined = {**defined, group: 1 << device.group.bit_length() - 1}
        self._program = device.compiled(text, defined)
        self._kernels: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._kernels:
            self._kernels[name] = self._device.kernel(self._program, f"{self._name}_{name}_kernel")
        return self._kernels[name]


class Launcher:
    """Launches the kernels of one lattice. ``tables`` are the tables of the sites. All arrays have the precision of the
    tables.
    """

    def __init__(self, kernels: Kernels, tables: SiteTables) -> None:
        self.device, self.kernels, self.tables, self.real = tables.device, kernels, tables, tables.real
        self._names = tables.interface.launches.arrays
        self.parameters = self.empty(len(tables.interface.launches.numbers) + 1)  # scalar parameters, then the time
        self._sums: Any = None

    def empty(self, numbers: int) -> Any:
        """Return a new buffer for the given number of reals."""
        return self.device.empty(max(1, numbers) * np.dtype(self.real).itemsize)

    def write(self, buffer: Any, values: Any) -> None:
        """Copy numbers into a buffer, in the precision of the lattice."""
        self.device.write(buffer, np.ascontiguousarray(values, dtype=self.real))

    def read(self, buffer: Any, shape: tuple[int, ...]) -> Floats:
        """Return the numbers of a buffer as a float64 array of the given shape."""
        values = np.empty(shape, self.real)
        self.device.read(buffer, values)
        return values.astype(np.float64, copy=False)

    def run(self, launch: SiteLaunch, coefficients: Any, first: int = 0, colour: int = 0, **buffers: Any) -> None:
        """Compute the sums over bonds or pairs that a kernel reads, then launch the kernel.

        The kernel reads the buffer ``coefficients`` from the index ``first`` on. ``colour`` selects sites of a graph.
        ``buffers`` are all arrays of the kernel that are not tables of sites.
        """
        for k, sums in enumerate(launch.sums):
            source = (self.parameters, 0) if sums.of_parameters else (coefficients, first)
            self._launch(sums, (None, self.tables.count), *source, colour, adds=np.int32(k > 0), **buffers)
        self._launch(launch, self.tables.selected(launch), coefficients, first, colour, adds=np.int32(0), **buffers)

    def _launch(
        self,
        launch: SiteLaunch | SumLaunch,
        selection: tuple[Any, int],
        coefficients: Any,
        first: int,
        colour: int,
        **buffers: Any,
    ) -> None:
        sites, items = selection
        if not items:
            return
        arrays = {**self.tables.arrays(launch, colour), **buffers, "sums": self._summed(launch)}
        table_arguments = [arrays.get(name) for name in self._names]
        numbers = [np.int32(items), np.int32(self.tables.count), sites, coefficients, np.int32(first)]
        self.device.launch(self.kernels[launch.kernel], items, [*numbers, *table_arguments])

    def _summed(self, launch: SiteLaunch | SumLaunch) -> Any:
        """Return the buffer for sums over bonds or pairs. All kernels share one buffer, with room for the
        largest sums.
        """
        if self._sums is None and "sums" in self._names:
            launches = self.tables.interface.launches
            all_launches = [*launches.others.values(), *(sweep for part in launches.parts for sweep in part)]
            largest = max((s.values for one_launch in all_launches for s in one_launch.sums), default=1)
            self._sums = self.empty(largest * self.tables.count)
        return self._sums

    def copy(self, source: Any, target: Any, numbers: int) -> None:
        """Copy ``numbers`` numbers from the buffer ``source`` to the buffer ``target``."""
        self.device.launch(self.kernels["copy"], numbers, [np.int32(numbers), source, target])

    def reduced(self, buffer: Any, kinds: Sequence[str], length: int) -> Floats:
        """Reduce each row of ``length`` numbers in a buffer to one number.

        ``kinds`` has the reduction of each row, such as ``sum``. The order of the operations depends on the length
        only, so results have the same bits in every run. NaN in a row gives NaN.
        """
        rows = len(kinds)
        if not rows or not length:
            return np.zeros(rows)
        kind_numbers = self.tables.kinds(tuple(_KINDS[kind] for kind in kinds))
        while length > 1:
            parts = -(-length // _REDUCED)
            target, items = self.empty(rows * parts), rows * parts
            sizes = np.int32(items), np.int32(length), np.int32(parts)
            self.device.launch(self.kernels["reduce"], items, [*sizes, kind_numbers, buffer, target])
            buffer, length = target, parts
        return self.read(buffer, (rows,))
