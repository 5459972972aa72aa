"""Solvers of compilations, each made once, and access to the struct of a C solver."""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from many_digits import precisely
from node import asked
from tools import write

from phigen.api import interface_of
from phigen.compilation import Compilation
from phigen.compiler import emit
from phigen.registry import LOADABLE
from phigen.runtime import cache as library_cache
from phigen.runtime import toolchain
from phigen.runtime.c_solver import CSolver
from phigen.runtime.interface import Interface
from phigen.runtime.numpy_solver import NumpySolver
from phigen.runtime.solver import Solver

TARGETS = LOADABLE

COMMAND = "phigen build"

_made: dict[tuple[Any, ...], tuple[Compilation, Any]] = {}


def _once(compilation: Compilation, key: str, make: Callable[[], Any]) -> Any:
    """Return the cached result of ``make`` for a compilation and key. The cache is by identity, since compilations
    cannot be hashed, and keeps the compilation alive.
    """
    place = (key, id(compilation))
    if place not in _made:
        _made[place] = compilation, make()
    return _made[place][1]


def files(compilation: Compilation, target: str) -> Mapping[str, str]:
    """Return the generated files for a target, by file name."""
    command = f"{COMMAND} {compilation.program.name}"
    return _once(compilation, f"files {target}", lambda: emit(compilation.program, target, command))


def single_file(compilation: Compilation) -> Mapping[str, str]:
    """Return the generated C with header and source in one file."""
    return _once(compilation, "single file", lambda: emit(compilation.program, "c", COMMAND, single_file=True))


def library(compilation: Compilation) -> Path:
    """Compile the generated C without warnings and return the path of the library."""
    return library_cache.build(files(compilation, "c"))


def interface(compilation: Compilation) -> Interface:
    """Return the names of coordinates, parameters and observables that the runtime needs."""
    return interface_of(compilation.program)


def solver(compilation: Compilation, target: str) -> Solver:
    """Return a solver in C or NumPy; compiled C comes from the cache."""
    return _once(compilation, f"solver {target} {toolchain.BASE_FLAGS}", lambda: _solver(compilation, target))


def _solver(compilation: Compilation, target: str) -> Solver:
    names = interface(compilation)
    if target == "c":
        return Solver(CSolver(files(compilation, "c"), names), names)
    return Solver(NumpySolver(files(compilation, "numpy")[f"{names.name}.py"], names), names)


def javascript(compilation: Compilation, options: str, statements: str, value: str) -> Any:
    """Run ``statements`` with a solver ``s`` of the generated JavaScript, made with ``options``; return ``value``."""
    (text,) = files(compilation, "js").values()
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder), {"solver.mjs": text})
        code = f"const s = new module.Solver({{ {options} }}); {statements}; return ({value})"
        return asked(Path(folder) / "solver.mjs", code)


class RawC:
    """A generated C library, called as a C program would call it. ``x`` and ``carry``, the state and its compensation
    terms, are views of the solver's struct.
    """

    def __init__(self, compilation: Compilation) -> None:
        self.name, self.n = compilation.program.name, compilation.program.dimension
        self._library = library_cache.load(files(compilation, "c"))
        self._parameters = [p.name for p in compilation.program.parameters]
        self.memory = np.zeros(self.call("solver_size", ctypes.c_size_t), dtype=np.uint8)
        doubles = self.memory[: 16 * self.n].view(np.float64)
        self.x, self.carry = doubles[: self.n], doubles[self.n :]
        counters = self.memory[16 * self.n :][: 2 * ctypes.sizeof(ctypes.c_size_t)].view(np.uintp)
        self.counters = counters  # numbers of steps and of evaluations

    def call(self, function: str, result: Any, *args: Any) -> Any:
        """Call the C function ``NAME_function`` with arguments that are ctypes objects."""
        f = getattr(self._library, f"{self.name}_{function}")
        f.restype = result
        return f(*args)

    @property
    def here(self) -> ctypes.c_void_p:
        """Address of the solver's struct."""
        return ctypes.c_void_p(self.memory.ctypes.data)

    def init(self, x0: Sequence[float], parameters: Mapping[str, float] | None = None) -> int:
        """Call ``NAME_init`` and return its status. For the parameters None it receives a null pointer."""
        start = np.array(x0, dtype=float)
        packed = None
        if parameters is not None:
            array = np.array([parameters[p] for p in self._parameters] or [0.0])
            packed = ctypes.c_void_p(array.ctypes.data)
        return self.call("init", ctypes.c_int, self.here, packed, ctypes.c_void_p(start.ctypes.data))

    def step(self, h: float) -> int:
        """Call ``NAME_step`` and return its status."""
        return self.call("step", ctypes.c_int, self.here, ctypes.c_double(h))

    def integrate(self, h: float, steps: int) -> int:
        """Call ``NAME_integrate`` and return its status."""
        return self.call("integrate", ctypes.c_int, self.here, ctypes.c_double(h), ctypes.c_size_t(steps))

    def kick(self, change: Sequence[float]) -> int:
        """Call ``NAME_kick``, which adds ``change`` to the state, and return its status."""
        array = np.array(change, dtype=float)
        return self.call("kick", ctypes.c_int, self.here, ctypes.c_void_p(array.ctypes.data))

    @precisely
    def exact_state(self) -> list[Any]:
        """Return the state plus its compensation terms, in many digits."""
        return [mpmath.mpf(float(x)) + mpmath.mpf(float(c)) for x, c in zip(self.x, self.carry, strict=True)]
