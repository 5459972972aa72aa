"""A very eccentric orbit over many periods: ``monitor: log`` and the series with ``monitor: r2**(3/4)`` beside DOP853
with step control, compiled, and heyoka.

``python -m benchmarks.eccentric [PERIODS]`` prints the table of docs/benchmarks.md. Times are CPU time on one core.
Errors of phigen are those of all steps, where they are largest near the planet; of the others at eight times a period.
"""

from __future__ import annotations

import ctypes
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.integrate._ivp import dop853_coefficients as tableau

import phigen
from phigen import spec
from phigen.api import solver_of
from phigen.compiler import compile_spec
from phigen.runtime import toolchain

ECCENTRICITY, OBLATENESS = 0.99, 1e-6
START = [1 - ECCENTRICITY, 0.0, 0.0, math.sqrt((1 + ECCENTRICITY) / (1 - ECCENTRICITY))]
PERIOD = 2 * math.pi
#: Where energies are looked at, for each period.
SAMPLES = 8

Row = tuple[str, str, float, float, float]

DOP853 = """
#include <math.h>
#include <string.h>
enum {{ N = 4, S = 12 }};
static const double A[S][S] = {{ {a} }}, B[S] = {{ {b} }}, E3[S + 1] = {{ {e3} }}, E5[S + 1] = {{ {e5} }};
static void field(double eps, const double x[N], double f[N])
{{
    const double r2 = x[0] * x[0] + x[1] * x[1], r = sqrt(r2), u = 1.0 / (r2 * r), w = 1.5 * eps * u / r2;
    const double ratio = 5.0 * x[1] * x[1] / r2;
    f[0] = x[2];
    f[1] = x[3];
    f[2] = -x[0] * (u + w * (1.0 - ratio));
    f[3] = -x[1] * (u + w * (3.0 - ratio));
}}
/* From x at 0 to the time end, with the local errors asked for; the number of steps. */
long integrate(double eps, double x[N], double end, double tol, double *h)
{{
    double k[S + 1][N], y[N], t = 0.0;
    long steps = 0;
    field(eps, x, k[0]);
    while (t < end) {{
        const double size = t + *h > end ? end - t : *h;
        for (int s = 1; s <= S; ++s) {{
            for (int i = 0; i < N; ++i) {{
                double sum = 0.0;
                for (int j = 0; j < s; ++j) sum += (s < S ? A[s][j] : B[j]) * k[j][i];
                y[i] = x[i] + size * sum;
            }}
            field(eps, y, k[s]);
        }}
        double five = 0.0, three = 0.0;
        for (int i = 0; i < N; ++i) {{
            double a = 0.0, b = 0.0;
            const double scale = tol + tol * fmax(fabs(x[i]), fabs(y[i]));
            for (int s = 0; s <= S; ++s) {{
                a += E5[s] * k[s][i];
                b += E3[s] * k[s][i];
            }}
            five += a * a / (scale * scale);
            three += b * b / (scale * scale);
        }}
        const double error = five > 0.0 ? size * five / sqrt((five + 0.01 * three) * N) : 0.0;
        const double factor = error > 0.0 ? 0.9 * pow(error, -0.125) : 10.0;
        if (error < 1.0) {{
            t += size;
            memcpy(x, y, sizeof y);
            memcpy(k[0], k[S], sizeof k[0]);
            ++steps;
            if (size >= *h || factor < 1.0) *h = size * fmin(10.0, factor);
        }} else {{
            *h = size * fmax(0.2, factor);
        }}
    }}
    return steps;
}}
"""


def energy(x: np.ndarray) -> np.ndarray:
    """H of states (rows, 4)."""
    r2 = x[:, 0] ** 2 + x[:, 1] ** 2
    quadrupole = OBLATENESS / (2 * r2**1.5) * (1 - 3 * x[:, 1] ** 2 / r2)
    found: np.ndarray = (x[:, 2] ** 2 + x[:, 3] ** 2) / 2 - r2**-0.5 - quadrupole
    return found


def worst(x: np.ndarray) -> tuple[float, float]:
    """The largest relative errors of the energy in the first tenth and at all."""
    errors = np.abs(energy(x) / energy(np.array([START]))[0] - 1)
    return float(errors[: max(2, len(errors) // 10)].max()), float(errors.max())


def of_phigen(periods: int) -> Iterator[Row]:
    """``monitor: log``, order 8."""
    solver = phigen.compile("kepler_eccentric")
    for steps in (480, 640, 960, 1280):
        h, total = PERIOD / steps, periods * steps
        begin = time.process_time()
        solver.integrate(START, h, total, total, oblateness=OBLATENESS)
        taken = time.process_time() - begin
        found = solver.integrate(START, h, total, oblateness=OBLATENESS)
        yield ("phigen, order 8, log", f"{steps} steps a period", *worst(found.x), taken)


def of_series(periods: int) -> Iterator[Row]:
    """The series with dt = r^(3/2) dτ, steps of order 2 composed to the orders 6, 8 and 10."""
    text = (Path(__file__).parents[1] / "specs" / "kepler_eccentric.yaml").read_text()
    changes = {"scheme: splitting": "scheme: series", "monitor: log": "monitor: r2**(3/4)", "profile: small": ""}
    for old, new in changes.items():
        text = text.replace(old, new)
    for order, per in ((6, 60), (6, 100), (8, 40), (8, 60), (8, 80), (10, 24)):
        solver = solver_of(compile_spec(spec.loads(text), order=order), "c")
        h = PERIOD / per
        few = solver.integrate(START, h, 50 * per, 50 * per, oblateness=OBLATENESS).t[-1]
        total = round(periods * PERIOD * 50 * per / few)
        begin = time.process_time()
        solver.integrate(START, h, total, total, oblateness=OBLATENESS)
        taken = time.process_time() - begin
        found = solver.integrate(START, h, total, oblateness=OBLATENESS)
        yield (f"phigen, order {order}, series", f"{total / periods:.0f} steps a period", *worst(found.x), taken)


def of_dop853(periods: int) -> Iterator[Row]:
    """DOP853 with the step control of its authors, in C with the flags of phigen."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        rows = ", ".join("{" + ", ".join(repr(float(v)) for v in row[:12]) + "}" for row in tableau.A[:12])
        listed = {n: ", ".join(repr(float(v)) for v in values) for n, values in
                  (("b", tableau.B), ("e3", tableau.E3), ("e5", tableau.E5))}  # fmt: skip
        (path / "dop853.c").write_text(DOP853.format(a=rows, **listed))
        command = [
            *toolchain.find().command,
            "-std=c99",
            "-O3",
            "-march=native",
            "-ffp-contract=fast",
            "-shared",
            "-fPIC",
        ]
        subprocess.run([*command, "dop853.c", "-o", "dop853.so", "-lm"], cwd=path, check=True)
        library = ctypes.CDLL(str(path / "dop853.so"))
        library.integrate.restype = ctypes.c_long
        library.integrate.argtypes = [
            ctypes.c_double,
            ctypes.c_void_p,
            ctypes.c_double,
            ctypes.c_double,
            ctypes.c_void_p,
        ]
        for tolerance in (1e-9, 1e-11, 1e-13, 1e-15):
            x, h, rows_of = np.array(START), np.array([1e-4]), [START]
            begin, steps = time.process_time(), 0
            for _ in range(periods * SAMPLES):
                steps += library.integrate(OBLATENESS, x.ctypes.data, PERIOD / SAMPLES, tolerance, h.ctypes.data)
                rows_of.append(x.tolist())
            taken = time.process_time() - begin
            said = f"tolerance {tolerance:g}: {steps / periods:.0f} steps a period"
            yield ("DOP853", said, *worst(np.array(rows_of)), taken)


def of_heyoka(periods: int) -> Iterator[Row]:
    """heyoka's Taylor method, where it is installed."""
    try:
        import heyoka as hy
    except ImportError:
        return
    x, y, u, v = hy.make_vars("x", "y", "u", "v")
    r2 = x * x + y * y
    potential = r2**-0.5 + OBLATENESS * 0.5 * r2**-1.5 * (1 - 3 * y * y / r2)
    system = [(x, u), (y, v), (u, hy.diff(potential, x)), (v, hy.diff(potential, y))]
    for tolerance in (1e-8, 1e-10, 1e-13, 2e-16):
        taylor, rows_of, steps = hy.taylor_adaptive(system, START, tol=tolerance), [START], 0
        begin = time.process_time()
        for k in range(1, periods * SAMPLES + 1):
            steps += taylor.propagate_until(k * PERIOD / SAMPLES)[3]
            rows_of.append(taylor.state.tolist())
        taken = time.process_time() - begin
        said = f"tolerance {tolerance:g}: {steps / periods:.0f} steps a period"
        yield ("heyoka", said, *worst(np.array(rows_of)), taken)


def main() -> None:
    periods = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    print(f"| {periods} periods | | energy: first tenth | all | s |\n|---|---|---|---|---|")
    for rows in (of_phigen, of_series, of_dop853, of_heyoka):
        for name, said, first, whole, taken in rows(periods):
            print(f"| {name} | {said} | {first:.1e} | {whole:.1e} | {taken:.2f} |", flush=True)


if __name__ == "__main__":
    main()
