"""Tables of sites, stored on a device: arrays of neighbours, bonds, parameters at sites, and selected sites."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.ir.launches import SiteLaunch, SumLaunch
from phigen.runtime.devices.device import Device
from phigen.runtime.interface import LatticeInterface


@dataclass
class SiteTables:
    """Tables of sites: arrays on a device that the kernels of one lattice read, besides the state.

    ``sites`` is the object in the lattice's NumPy module that describes the sites; ``real`` is the type of numbers. A
    table is copied to the device when a kernel first reads it. ``of_sizes`` has the tables that depend only on the
    sizes; lattices of equal sizes share these tables.
    """

    device: Device
    sites: Any
    sizes: tuple[int, ...]
    interface: LatticeInterface
    real: Any
    of_sizes: dict[Any, Any]
    _stored: dict[Any, Any] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """The number of sites."""
        return int(np.prod(self.sizes))

    def selected(self, launch: SiteLaunch) -> tuple[Any, int]:
        """Return a buffer with the indices of the sites on which a launch works, and the length of this buffer.

        If the launch works on all sites, the result is None and the number of sites.
        """
        if launch.colour is None and not launch.inside and launch.window is None:
            return None, self.count
        key = "sites", launch.colour, launch.inside, launch.window is not None
        if key not in self.of_sizes:
            mask = np.ones(self.sizes, dtype=bool)
            if launch.window is not None:
                mask &= self.sites.beside
            elif launch.inside:
                mask &= ~self.sites.beside
            if launch.colour is not None and launch.window is None:
                weights, site_indices = self.interface.colour_weights, np.indices(self.sizes)
                mask &= sum(w * p for w, p in zip(weights, site_indices, strict=True)) % self.interface.colours == (
                    launch.colour
                )
            numbers = np.flatnonzero(mask)
            self.of_sizes[key] = self.written(numbers, np.int32), len(numbers)
        buffer, count = self.of_sizes[key]
        return buffer, count

    def arrays(self, launch: SiteLaunch | SumLaunch, colour: int) -> Mapping[str, Any]:
        """Return the colour, and the tables that a kernel reads, by the names of the kernel's arguments."""
        starts, other_sites, at_bonds = None, None, None
        if isinstance(launch, SumLaunch) and self.interface.graph:
            starts, other_sites, at_bonds = self._bonds(launch, colour)
        return {
            "neighbours": self._of_sizes("neighbours", np.int32, self._neighbours),
            "weights": self._of_sizes("weights", self.real, self._weights),
            "at_sites": self._own("at_sites", self.real, self._at_sites),
            "on_seams": self._on_seams(launch.window if isinstance(launch, SiteLaunch) else None),
            "starts": starts,
            "others": other_sites,
            "at_bonds": at_bonds,
            "colours": self._own("colours", np.int32, lambda: [getattr(self.sites, "colours", np.zeros(0))]),
            "colour": np.int32(colour),
        }

    def kinds(self, numbers: tuple[int, ...]) -> Any:
        """Return a buffer with ``numbers``, which tell a kernel how to reduce values (sum, product, …)."""
        return self._of_sizes(("kinds", numbers), np.int32, lambda: [np.array(numbers)])

    def written(self, values: Any, kind: Any) -> Any:
        """Return a new buffer with the given values; one zero is appended, since buffers must not be empty."""
        array = np.ascontiguousarray(np.append(np.ravel(values), 0), dtype=kind)
        buffer = self.device.empty(array.nbytes)
        self.device.write(buffer, array)
        return buffer

    def _of_sizes(self, key: Any, kind: Any, rows: Any) -> Any:
        return _stored(self.of_sizes, key, lambda: self.written(_joined(rows()), kind))

    def _own(self, key: Any, kind: Any, rows: Any) -> Any:
        return _stored(self._stored, key, lambda: self.written(_joined(rows()), kind))

    def _neighbours(self) -> list[NDArray[Any]]:
        numbers = np.arange(self.count).reshape(self.sizes)
        return [self.sites.shifted(numbers, *offset) for offset in self.interface.launches.neighbours]

    def _weights(self) -> list[NDArray[Any]]:
        bounds = self.interface.launches.bounds
        return [np.broadcast_to(self.sites.present(*chain.from_iterable(b)), self.sizes) for b in bounds]

    def _at_sites(self) -> list[NDArray[Any]]:
        return [np.broadcast_to(self.sites.parameters[name], self.sizes) for name in self.interface.at_sites]

    def _on_seams(self, window: int | None) -> Any:
        """Return a buffer with the weights, 1 or 0, of terms near boundary seams, for each site.

        ``window`` states the seams on which the terms begin, as in `phigen.ir.nodes.Selection`. If ``window`` is None,
        the result is None.
        """
        if window is None:
            return None
        seams = self.interface.launches.seams
        return self._of_sizes(
            ("on_seams", window),
            self.real,
            lambda: [
                np.broadcast_to(self.sites.begins(window, colour, *offset), self.sizes) for colour, offset in seams
            ],
        )

    def _bonds(self, launch: SumLaunch, colour: int) -> tuple[Any, Any, Any]:
        """Return the bonds of a graph, sorted by site, as three buffers.

        The buffers contain the index of the first bond of each site, the partner site of each bond, and the parameters
        of each bond.
        """
        key = "bonds", launch.end, launch.chosen, colour if launch.chosen else 0
        if key not in self._stored:
            self.sites.colour = colour
            own_ends, other_ends, bond = self.sites.bonds(launch.end, launch.chosen)
            order = np.argsort(own_ends, kind="stable")
            starts = np.append(0, np.cumsum(np.bincount(own_ends, minlength=self.count)))
            parameters = [
                np.broadcast_to(self.sites.parameters[n], len(self.sites.ends)) for n in self.interface.at_bonds
            ]
            at_bonds = _joined([values[bond[order]] for values in parameters])
            self._stored[key] = (
                self.written(starts, np.int32),
                self.written(other_ends[order], np.int32),
                self.written(at_bonds, self.real),
            )
        bonds: tuple[Any, Any, Any] = self._stored[key]
        return bonds


def _joined(rows: Sequence[NDArray[Any]]) -> NDArray[Any]:
    return np.concatenate([np.zeros(0), *(np.ravel(row) for row in rows)])


def _stored(tables: dict[Any, Any], key: Any, values: Any) -> Any:
    if key not in tables:
        tables[key] = values()
    return tables[key]
