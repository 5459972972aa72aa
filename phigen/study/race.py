"""Runs of the solver and of classical methods, for a fair comparison of their times.

In Python a classical method would spend its time in the interpreter. So all methods are written in one C file, which is
compiled with the same flags, and in which the vector field can be inlined. Without a compiler all methods run in
Python.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from phigen.compilation import Compilation
from phigen.compiler import emit
from phigen.errors import StepError
from phigen.runtime import cache
from phigen.runtime.solver import Solver
from phigen.study import classical, dop853
from phigen.study.methods import extended, field_of
from phigen.study.monitored import field_in_tau
from phigen.symbolic.arrays import Floats

#: Label of the phigen solver among the methods.
OWN = "phigen"

#: Butcher tableaux of the explicit methods, as pairs (rows of the matrix, weights). The first row is left out, since it
#: is 0. Rows and weights map the index of a stage to its coefficient.
TABLEAUX: Mapping[str, tuple[Sequence[Mapping[int, float]], Mapping[int, float]]] = {
    "euler": ((), {0: 1.0}),
    "rk2": (({0: 0.5},), {1: 1.0}),
    "rk4": (({0: 0.5}, {1: 0.5}, {2: 1.0}), {0: 1 / 6, 1: 1 / 3, 2: 1 / 3, 3: 1 / 6}),
    "dop853": (dop853.A[1:], dop853.B),
}

#: Function of (h, steps, repetitions). It repeats a run, and returns the final state, or None if a step fails.
Runner = Callable[[float, int, int], Floats | None]


@dataclass(frozen=True)
class Race:
    """Methods to compare, as functions that run them.

    ``runners`` has these functions by label. All of them are written in ``language``, which is ``C`` or ``Python``.
    ``set_up(n)`` repeats n times the work that the solver does once for each trajectory. ``clock`` is the variable in
    which steps have equal size, t or τ.
    """

    runners: Mapping[str, Runner]
    set_up: Callable[[int], object]
    language: str
    clock: str = "t"


def compiled(
    compilation: Compilation, methods: Sequence[str], start: Floats, parameters: Mapping[str, float], t0: float = 0.0
) -> Race:
    """Return the functions that run the solver and the classical ``methods``, in C and double precision.

    Implicit methods are left out. With a monitor, all methods make steps of equal size in τ. Raises `ToolchainError` if
    the C cannot be compiled.
    """
    from phigen.targets.rendering import render

    compilation = compilation.in_double
    name = compilation.program.name
    files = emit(compilation.program, "c", "phigen report")
    explicit = [m for m in methods if m in TABLEAUX]
    timed = bool(compilation.program.time)
    values: dict[str, object] = {"name": name, "methods": [_printed(m, timed=timed) for m in explicit], "time": timed}
    monitored = compilation.program.monitor is not None
    values |= {"monitored": monitored, "field": f"{name}_race_field" if monitored else f"{name}_vector_field"}
    values |= {"start": f", {t0!r}" * timed, "now": f"{t0!r} + (double)n * h, " * timed}
    source = render("timing", "race.c", values)
    library = cache.load({f"{name}.h": files[f"{name}.h"], f"{name}.inc": files[f"{name}.c"], f"{name}_race.c": source})
    packed = np.array(list(parameters.values()) or [0.0])

    pointer, size = ctypes.c_void_p, ctypes.c_size_t
    length, begin = getattr(library, f"{name}_race_size"), getattr(library, f"{name}_race_start")
    length.restype, length.argtypes = size, ()
    begin.restype, begin.argtypes = ctypes.c_int, (pointer, pointer, size, pointer)
    scratch = np.zeros(-(-length() // 8))

    def set_up(repeats: int) -> int:
        return int(begin(packed.ctypes.data, start.ctypes.data, repeats, scratch.ctypes.data))

    def runner(method: str, packed_start: Floats) -> Runner:
        function = getattr(library, f"{name}_race_{method}")
        function.restype, function.argtypes = ctypes.c_int, (pointer, pointer, ctypes.c_double, size, size, pointer)

        def run(h: float, steps: int, repeats: int) -> Floats | None:
            x = np.empty_like(start)
            failed = function(packed_start.ctypes.data, start.ctypes.data, h, steps, repeats, x.ctypes.data)
            return None if failed else x

        return run

    solver_runner = runner(OWN, scratch) if set_up(1) == 0 else lambda h, steps, repeats: None
    return Race(
        {OWN: solver_runner, **{m: runner(m, packed) for m in explicit}}, set_up, "C", "τ" if monitored else "t"
    )


def interpreted(
    solver: Solver, methods: Sequence[str], start: Floats, parameters: Mapping[str, float], t0: float = 0.0
) -> Race:
    """Return the functions that run the solver and the ``methods``, all in Python.

    With a monitor, all methods make steps of equal size in τ.
    """

    begin = t0 if solver.interface.time else None

    def own(h: float, steps: int, repeats: int) -> Floats | None:
        try:
            for _ in range(repeats):
                end: Floats = solver.integrate(start, h, steps, steps, t0=begin, parameters=parameters).x[-1]
        except StepError:
            return None
        return end

    field = field_in_tau(solver, parameters) if solver.interface.monitored else field_of(solver, parameters)
    first = extended(solver, start, t0)

    def runner(method: str) -> Runner:
        def run(h: float, steps: int, repeats: int) -> Floats | None:
            for _ in range(repeats):
                end: Floats = classical.integrate(method, field, first, h, steps, steps)[-1, : len(start)]
            return end if np.isfinite(end).all() else None

        return run

    runners = {OWN: own, **{method: runner(method) for method in methods}}
    return Race(runners, lambda repeats: None, "Python", "τ" if solver.interface.monitored else "t")


def _printed(method: str, *, timed: bool) -> tuple[str, int, list[tuple[int, str, str]], str]:
    rows, weights = TABLEAUX[method]
    stages = [(i, _sum(row), f"t + {sum(row.values())!r} * h, " * timed) for i, row in enumerate(rows, start=1)]
    return method, len(rows) + 1, stages, _sum(weights)


def _sum(weights: Mapping[int, float]) -> str:
    return " + ".join(f"{w!r} * k[{j}][i]" for j, w in weights.items())
