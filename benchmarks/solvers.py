"""Compilation of phigen's solvers and of other methods in C to shared libraries, each with a function `measure_run`."""

from __future__ import annotations

import ctypes
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache as cached
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import sympy

from benchmarks.problems import Problem
from phigen import spec as specs
from phigen.compiler import compile_proved, emit
from phigen.errors import Diagnostic, LimitError
from phigen.runtime import cache

C_FILES = Path(__file__).parent / "c"

#: Solvers with more lines of C are not compiled, since that would take minutes.
LINES = 12_000

STATUSES = {0: "ok", 1: "no convergence", 2: "singular", 3: "not finite", 4: "bad argument", 100: "too slow"}

_HALF = (
    0.13020248308889008088, 0.56116298177510838456, -0.38947496264484728641, 0.15884190655515560090,
    -0.39590389413323757734, 0.18453964097831570709, 0.25837438768632204729, 0.29501172360931029887,
)  # fmt: skip
#: Kahan and Li's composition of order 8 (17 stages), Math. Comp. 66 (1997) 1089–1099.
KAHAN_LI = (*_HALF, 1 - 2 * sum(_HALF), *reversed(_HALF))


@dataclass(frozen=True)
class Run:
    """Result of one integration: the states at the ends of all chunks, its cost, and "ok" or the reason of the
    failure."""

    states: np.ndarray
    seconds: float
    steps: int
    evaluations: float
    status: str


#: Function of the initial state, the step size, the number of steps of a chunk, the number of chunks, and the seconds
#: after which the run ends. Adaptive methods receive a tolerance and the time of a chunk in place of the second and
#: third argument.
Runner = Callable[[Sequence[float], float, Any, int, float], Run]


@dataclass(frozen=True)
class Method:
    """Method of integration. If it is ``step_based``, its setting is a step size, else (heyoka, step control) a
    tolerance."""

    name: str
    run: Runner
    order: int
    family: str = "peer"
    step_based: bool = True
    note: str = ""
    row: str = ""
    """The row of tables in which the method appears; by default its name."""
    variant: str = ""
    """A label that distinguishes methods in the same row, which shows the fastest of them."""


# phigen ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Built:
    """Compiled solver of phigen: its library, the seconds that phigen and the C compiler took, lines of its header.

    ``exact`` says whether a step is the exact flow of H.
    """

    library: ctypes.CDLL
    generating: float
    compiling: float
    summary: str
    exact: bool


@cached
def build_phigen(text: str) -> Built:
    """Return the compiled solver for the text of a spec. Raises `PhigenError` if phigen or `LINES` refuses it."""
    start = time.perf_counter()
    program = compile_proved(specs.loads(text, "bench.yaml")).program
    schedule = program.step.flow_schedule
    exact = schedule is not None and len(schedule.flows) == 1
    source = emit(program, "c", "", single_file=True)["bench.c"]
    middle = time.perf_counter()
    if (lines := source.count("\n")) > LINES:
        raise LimitError([Diagnostic(f"{lines:,} lines of C are too many to compile here")])
    main = (
        "#define _POSIX_C_SOURCE 199309L\n"
        '#include "common.h"\n#pragma GCC visibility push(hidden)\n#include "bench.h"\n#pragma GCC visibility pop\n'
        '#include "run_phigen.h"\n'
    )
    library = cache.load({"main.c": main, "bench.h": source, **texts("common.h", "run_phigen.h")})
    summary = "; ".join(line[2:].strip() for line in source.splitlines()[3:8] if ":" in line)
    return Built(library, middle - start, time.perf_counter() - middle, summary, exact)


def phigen_method(problem: Problem, order: int, method: str) -> Method:
    built = build_phigen(problem.spec(order, method))
    label = f"phigen {order}, {method}"
    return Method(
        label,
        runner_of(built.library, 0),
        order,
        "phigen",
        note=built.summary,
        row=f"phigen, {method}",
        variant=f"order {order}",
    )


# Peers in C --------------------------------------------------------------------------------------------------------


def peer_names(problem: Problem) -> dict[str, tuple[str, int]]:
    """Return the C functions of all other methods that apply to a problem: name → title and order."""
    names = {
        "rk4": ("RK4 in C", 4),
        "dop853": ("DOP853 in C", 8),
        "dop853_compensated": ("DOP853 with compensated sums, in C", 8),
        "gauss1": ("implicit midpoint in C", 2),
    }
    if problem.quadratic:
        names |= {"kahan": ("Kahan in C", 2), "kahan_kl8": ("Kahan, Kahan–Li 8, in C", 8)}
    if problem.splitting:
        names |= {"splitting": ("Poisson splitting in C", 2), "splitting_kl8": ("splitting, Kahan–Li 8, in C", 8)}
    return names


def c_peers(problem: Problem) -> list[Method]:
    names = peer_names(problem)
    library = cache.load({"main.c": _peer_source(problem, list(names)), **texts()})
    peers = {
        name: Method(title, runner_of(library, i), order) for i, (name, (title, order)) in enumerate(names.items())
    }
    compensated = replace(peers["dop853_compensated"], row="DOP853 in C", variant="compensated")
    return [*(peers | {"dop853_compensated": compensated}).values(), _controlled(library)]


def dop853_in_vectors(problem: Problem) -> Method:
    """Return DOP853 in C with the sums over its stages computed by SIMD, for problems with more coordinates."""
    lines = [
        "#define _POSIX_C_SOURCE 199309L",
        '#include "common.h"',
        field_source(problem, jacobian=False),
        tables(("dop853",)),
        '#include "dop853_vectors.h"',
        "static struct { int failed; long evaluations; } gauss;\nstatic void reset(void) {}",
        "static void (*const methods[])(real *, double, long) = { dop853_vectors };",
        '#include "run_peers.h"\n',
    ]
    library = cache.load({"main.c": "\n".join(lines), **texts()})
    return Method("DOP853 in C, vectors", runner_of(library, 0), 8)


def reference(problem: Problem, horizon: float, chunks: int) -> tuple[np.ndarray, float]:
    """Return the states at the ends of the chunks by the Gauss method of order 16 in long double, and their
    uncertainty.

    The uncertainty is the largest difference from a run with larger steps.
    """
    library = cache.load({"main.c": _reference_source(problem), **texts()})
    run = runner_of(library, 0)
    chunk = math.ceil(horizon / chunks / problem.typical)
    coarse, fine = (
        run(problem.start, horizon / chunks / steps, steps, chunks, math.inf) for steps in (chunk, chunk + chunk // 3)
    )
    return fine.states, float(np.abs(fine.states - coarse.states).max())


def vector_peers(problem: Problem, width: int = 4) -> ctypes.CDLL:
    """Return the library of RK4 and DOP853 for ensembles, with ``width`` members at once; only for polynomial vector
    fields."""
    main = "\n".join(
        [
            f"#define _POSIX_C_SOURCE 199309L\n#define WIDTH {width}",
            f"typedef double lanes __attribute__((vector_size({8 * width})));\n#define REAL lanes",
            '#include "common.h"',
            field_source(problem, jacobian=False),
            tables(("rk4", "dop853")),
            '#include "runge_kutta.h"',
            "static void (*const methods[])(real *, double, long) = { rk4, dop853 };",
            '#include "run_ensemble.h"\n',
        ]
    )
    return cache.load({"main.c": main, **texts()})


def _peer_source(problem: Problem, names: Sequence[str]) -> str:
    parts = [
        "#define _POSIX_C_SOURCE 199309L\n#define ROUNDING 1.5e-16",
        '#include "common.h"',
        field_source(problem, jacobian=problem.quadratic),
        tables(("rk4", "dop853", "gauss1")),
        array("kahan_li8", KAHAN_LI),
        '#include "runge_kutta.h"\n#include "gauss.h"\n#include "compose.h"\nGAUSS(gauss1, 1)',
        '#include "step_control.h"',
        "static void reset(void)\n{\n    memset(&gauss, 0, sizeof gauss);\n    memset(carry, 0, sizeof carry);\n}",
    ]
    if problem.quadratic:
        parts.append('#include "kahan.h"')
    if problem.splitting:
        parts += [f"#define {name} ({value!r})" for name, value in problem.constants.items()]
        parts.append(f'#include "elementary.h"\n#include "splitting_{problem.splitting}.h"')
        for name, fractions in (("splitting", "whole_step"), ("splitting_kl8", "kahan_li8")):
            parts.append(f"COMPOSE_SPLITTING({name}, OUTER, INNER, {fractions})")
    parts.append(f"static void (*const methods[])(real *, double, long) = {{ {', '.join(names)} }};")
    return "\n".join([*parts, '#include "run_peers.h"\n'])


def _reference_source(problem: Problem) -> str:
    return "\n".join(
        [
            "#define _POSIX_C_SOURCE 199309L\n#include <tgmath.h>\n#define REAL long double\n#define ROUNDING 1e-19L",
            '#include "common.h"',
            field_source(problem, jacobian=False),
            tables(("gauss8",)),
            '#include "gauss.h"\nGAUSS(gauss8, 8)',
            "static void reset(void) { memset(&gauss, 0, sizeof gauss); }",
            "static void (*const methods[])(real *, double, long) = { gauss8 };",
            '#include "run_peers.h"\n',
        ]
    )


def field_source(problem: Problem, *, jacobian: bool) -> str:
    """Return the C of the vector field, and for Kahan's method of its Jacobian, without repeated subexpressions."""
    x = "\n".join(f"    const real {c} = x[{i}];" for i, c in enumerate(problem.coordinates))
    lines = [f"#define DIM {problem.dimension}", "INLINE void field(const real x[DIM], real f[DIM])\n{", x]
    lines += [*_assignments(problem.field, [f"f[{i}]" for i in range(problem.dimension)]), "}"]
    if jacobian:
        entries = sympy.Matrix(problem.field).jacobian(problem.symbols)
        targets = [f"J[{i}][{j}]" for i in range(problem.dimension) for j in range(problem.dimension)]
        lines += ["INLINE void jacobian(const real x[DIM], real J[DIM][DIM])\n{", x]
        lines += [*_assignments([sympy.factor_terms(e) for e in entries], targets), "}"]
    return "\n".join(lines)


def _assignments(expressions: Sequence[sympy.Expr], targets: Sequence[str]) -> list[str]:
    shared, left = sympy.cse(expressions, symbols=sympy.numbered_symbols("t"))
    code = [f"    const real {name} = {sympy.ccode(value)};" for name, value in shared]
    zero = "0 * x[0]" if not all(left) else "0"  # if the C type real is a SIMD vector, so is this zero
    return [*code, *(f"    {t} = {sympy.ccode(e) if e != 0 else zero};" for t, e in zip(targets, left, strict=True))]


def tables(names: Sequence[str]) -> str:
    tables = {"rk4": _rk4, "dop853": _dop853}
    lines = ["#define MOST_STAGES 16"]
    for name in names:
        if name in tables:
            a, b, estimates = tables[name]()
            lines += [array(f"{name}_a", a.ravel()), array(f"{name}_b", b)]
            lines += [array(f"{name}_{part}", values) for part, values in estimates.items()]
        else:
            for part, values in _gauss(int(name.removeprefix("gauss"))).items():
                lines.append(f"static const real {name}_{part}[] = {{ {', '.join(values)} }};")
    return "\n".join(lines)


Tables = tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]
"""Matrix and weights of a Runge–Kutta method, and weights of its error estimates by name."""


def _rk4() -> Tables:
    a = np.zeros((4, 4))
    a[1, 0] = a[2, 1] = 0.5
    a[3, 2] = 1.0
    return a, np.array([1, 2, 2, 1]) / 6, {}


def _dop853() -> Tables:
    from scipy.integrate._ivp import dop853_coefficients as table

    return table.A[:12, :12], table.B, {"e3": table.E3[:12], "e5": table.E5[:12]}


def _gauss(stages: int) -> dict[str, list[str]]:
    """Return the coefficients of a Gauss method as C constants with 25 digits.

    ``extrapolation`` evaluates the collocation polynomial at the stages of the next step.
    """
    with mpmath.workdps(40):
        t = sympy.Symbol("t")
        shifted = sympy.Poly(sympy.legendre(stages, 2 * t - 1), t)
        roots = mpmath.polyroots([mpmath.mpf(c.p) / c.q for c in shifted.all_coeffs()], maxsteps=200, extraprec=200)
        c = sorted(mpmath.re(r) for r in roots)

        def basis(j: int, s: Any) -> Any:
            return mpmath.fprod((s - c[m]) / (c[j] - c[m]) for m in range(stages) if m != j)

        def integral(j: int, end: Any) -> Any:
            return mpmath.quad(lambda s: basis(j, s), [0, end])

        parts = {
            "a": [integral(j, ci) for ci in c for j in range(stages)],
            "b": [integral(j, 1) for j in range(stages)],
            "extrapolation": [basis(j, 1 + ci) for ci in c for j in range(stages)],
        }
        return {name: [mpmath.nstr(v, 25, strip_zeros=False) + "L" for v in part] for name, part in parts.items()}


def array(name: str, values: Sequence[float] | np.ndarray) -> str:
    return f"static const double {name}[] = {{ {', '.join(repr(float(v)) for v in values)} }};"


def texts(*names: str) -> dict[str, str]:
    files = [C_FILES / n for n in names] or sorted(C_FILES.glob("*.h"))
    return {f.name: f.read_text(encoding="utf-8") for f in files}


def _controlled(library: ctypes.CDLL) -> Method:
    """Return DOP853 with step size control, from the same library as the methods without."""
    function = library.measure_controlled
    function.restype = ctypes.c_int
    double, pointer = ctypes.c_double, ctypes.c_void_p
    function.argtypes = (pointer, double, double, ctypes.c_long, double, pointer, pointer, pointer, pointer)

    def run(start: Sequence[float], tolerance: float, chunk: float, chunks: int, limit: float) -> Run:
        x0, (seconds, evaluations, steps) = np.array(start, dtype=np.float64), np.zeros((3, 1))
        states = np.full((chunks, len(x0)), np.nan)
        status = function(
            x0.ctypes.data, tolerance, chunk, chunks, min(limit, 1e9),
            states.ctypes.data, seconds.ctypes.data, evaluations.ctypes.data, steps.ctypes.data,
        )  # fmt: skip
        return Run(states, float(seconds[0]), int(steps[0]), float(evaluations[0]), STATUSES.get(status, str(status)))

    return Method("DOP853 with step control, in C", run, 8, step_based=False)


def runner_of(library: ctypes.CDLL, index: int) -> Runner:
    function = library.measure_run
    function.restype = ctypes.c_int
    double, pointer, long = ctypes.c_double, ctypes.c_void_p, ctypes.c_long
    function.argtypes = (ctypes.c_int, pointer, double, long, long, double, pointer, pointer, pointer)

    def run(start: Sequence[float], h: float, chunk: int, chunks: int, limit: float) -> Run:
        x0 = np.array(start, dtype=np.float64)
        states = np.full((chunks, len(x0)), np.nan)
        seconds, evaluations = np.zeros(1), np.zeros(1)
        status = function(
            index, x0.ctypes.data, h, chunk, chunks, min(limit, 1e9),
            states.ctypes.data, seconds.ctypes.data, evaluations.ctypes.data,
        )  # fmt: skip
        return Run(states, float(seconds[0]), chunk * chunks, float(evaluations[0]), STATUSES.get(status, str(status)))

    return run
