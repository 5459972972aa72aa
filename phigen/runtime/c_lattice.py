"""The generated C of a lattice, called through ctypes."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.errors import ToolchainError
from phigen.runtime import cache
from phigen.runtime.interface import BackendError, Floats, LatticeInterface, status_name

_POINTER, _DOUBLE, _SIZE, _INT = ctypes.c_void_p, ctypes.c_double, ctypes.c_size_t, ctypes.c_int
_SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "solver_size": (_SIZE, ()),
    "solver_steps_done": (_SIZE, (_POINTER,)),
    "work_size": (_SIZE, (_POINTER,)),
    "init": (_INT, (_POINTER, _POINTER, _POINTER, _POINTER, _POINTER)),
    "integrate": (_INT, (_POINTER, _DOUBLE, _SIZE)),
    "state": (None, (_POINTER, _POINTER)),
    "hamiltonian": (_DOUBLE, (_POINTER,)),
    "density": (None, (_POINTER, _POINTER)),
    "casimirs": (None, (_POINTER, _POINTER)),
    "vector_field": (None, (_POINTER, _POINTER)),
}

#: Those of graphs, where they differ.
_OF_GRAPHS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "work_size": (_SIZE, (_POINTER, _SIZE)),
    "init": (_INT, (_POINTER,) * 6),
}

#: Site updates between two calls: Python can deliver a keyboard interrupt then.
_UPDATES_PER_CALL = 1 << 26


class CLatticeSession:
    """A lattice on its way, in memory of its own. See `phigen.runtime.lattice.LatticeSession`."""

    def __init__(self, functions: Any, interface: LatticeInterface, x0: Floats, parameters: Mapping[str, Any]) -> None:
        self._c, self._shape = functions, x0.shape
        self._casimirs = len(interface.casimirs)
        sizes = np.array(x0.shape[1:], dtype=np.uintp)
        self._struct = np.zeros(functions.solver_size(), dtype=np.uint8)
        bonds = np.ascontiguousarray(parameters.get("bonds", ()), dtype=np.uintp).reshape(-1, 2)
        given = np.array([len(bonds), bonds.ctypes.data], dtype=np.uintp)  # the struct of bonds
        needed = functions.work_size(sizes.ctypes.data, *([len(bonds)] if interface.graph else []))
        self._work = np.zeros(max(needed, 64), dtype=np.uint8)
        self._address = self._struct.ctypes.data
        first = np.ascontiguousarray(x0, dtype=np.float64)
        packed, kept = _packed(interface, parameters, x0.shape[1:], len(bonds))
        arrays = [packed, sizes, *([given] if interface.graph else []), first, self._work]
        status = functions.init(self._address, *(a.ctypes.data for a in arrays))
        del kept
        if status:
            raise BackendError(status_name(status), 0, first[None])

    @property
    def steps(self) -> int:
        """Good steps since the start."""
        return int(self._c.solver_steps_done(self._address))

    def state(self) -> Floats:
        """A copy of the state (coordinates, *sizes)."""
        return self._filled(self._c.state, self._shape)

    def advance(self, h: float, steps: int) -> None:
        """Make so many steps."""
        most = max(1, _UPDATES_PER_CALL // int(np.prod(self._shape[1:])))
        while steps > 0:
            now = min(steps, most)
            status = self._c.integrate(self._address, h, now)
            if status:
                raise BackendError(status_name(status), self.steps, self.state()[None])
            steps -= now

    def hamiltonian(self) -> float:
        """H of the state."""
        return float(self._c.hamiltonian(self._address))

    def density(self) -> Floats:
        """The density of H at the sites (*sizes)."""
        return self._filled(self._c.density, self._shape[1:])

    def casimirs(self) -> Floats:
        """The densities of the Casimirs (Casimirs, *sizes)."""
        return self._filled(self._c.casimirs, (self._casimirs, *self._shape[1:]))

    def vector_field(self) -> Floats:
        """π∇H (coordinates, *sizes)."""
        return self._filled(self._c.vector_field, self._shape)

    def _filled(self, function: Any, shape: tuple[int, ...]) -> Floats:
        out = np.empty(shape)
        function(self._address, out.ctypes.data)
        return out


class CLattice:
    """The back end over the shared library of generated files (name → text). See `phigen.runtime.lattice`."""

    target = "c"

    def __init__(self, files: Mapping[str, str], interface: LatticeInterface) -> None:
        self.interface, self._files = interface, dict(files)
        self._library = cache.load(files, threads=True)
        self._c: Any = SimpleNamespace()
        for name, (result, arguments) in (_SIGNATURES | (_OF_GRAPHS if interface.graph else {})).items():
            function = getattr(self._library, f"{interface.name}_{name}", None)
            if function is None:
                raise ToolchainError(
                    f"the compiled solver has no function {interface.name}_{name}\n"
                    "  hint: whatever CC names did not compile what it was given; try gcc or clang"
                )
            function.restype, function.argtypes = result, arguments
            setattr(self._c, name, function)

    def __reduce__(self) -> tuple[type[CLattice], tuple[Any, ...]]:
        return CLattice, (self._files, self.interface)

    @property
    def identity(self) -> str:
        """A hash of all that decides the results."""
        return cache.key_of(self._library)

    def start(self, x0: Floats, parameters: Mapping[str, Any]) -> CLatticeSession:
        """A session at x0 (coordinates, *sizes)."""
        return CLatticeSession(self._c, self.interface, x0, parameters)


def _packed(
    interface: LatticeInterface, parameters: Mapping[str, Any], sizes: tuple[int, ...], bonds: int
) -> tuple[NDArray[np.uint64], list[Floats]]:
    """The struct of parameters, whose members all take eight bytes, and the arrays that it points to."""
    words, kept = np.zeros(max(1, len(interface.parameters)), dtype=np.uint64), list[Floats]()
    for k, name in enumerate(interface.parameters):
        value = parameters[name]
        if name in interface.at_sites or name in interface.at_bonds:
            shape = sizes if name in interface.at_sites else (bonds,)
            kept.append(np.ascontiguousarray(np.broadcast_to(np.asarray(value, dtype=np.float64), shape)))
            words[k] = kept[-1].ctypes.data
        else:
            words[k : k + 1].view(np.float64)[0] = float(value)
    return words, kept
