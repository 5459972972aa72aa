"""C in single precision: its text, its results, and refusals."""

import ctypes
import re
import warnings
from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest
from many_digits import in_many_digits
from support import as_given, first_run, run, setting, slow_but, small, solver, spec_of, tool, write

import phigen
from phigen.api import lattice_solver_of
from phigen.compiler import compile_spec, emit
from phigen.lattice.states import start_of
from phigen.study.single_precision import COARSER, ONE_STEP
from phigen.targets.c.real import FLOAT

WRITTEN = {
    "types, literals, functions, limits": (
        "static double f(double x) { return 0.1 * sin(x) + fmax(DBL_MIN, 2.0 * a.sin) - HUGE_VAL; }",
        "static float f(float x) { return 0.1f * sinf(x) + fmaxf(FLT_MIN, 2.0f * a.sin) - HUGE_VALF; }",
    ),
    "whole numbers, and names with digits": ("(double)(0x41e5U + 3) / k_1e5", "(float)(0x41e5U + 3) / k_1e5"),
    "comments and texts": ('/* a double, 1.0 */ "sin(1.0)"', '/* a double, 1.0 */ "sin(1.0)"'),
    "what is single already": ("float a = 0.5f, b = sqrtf(2.0f);", "float a = 0.5f, b = sqrtf(2.0f);"),
    "beyond the range": ("x + 1e-300 + 0x1p-1000 + 1e200", "x + 1.1754944e-38f + 1.1754944e-38f + 3.4028235e+38f"),
    "thresholds": (
        "#define A 1e-17 /* a */\n#define B 0.25\nx < 1e-17",
        "#define A 2e-08f /* a */\n#define B 0.25f\nx < 1e-17f",
    ),
}

#: Systems with Newton steps and a gauge, paths, composed splittings, a monitor, noise, Gauss collocation; lattices that
#: call functions in rows, with stiff steps, or on a graph.
SYSTEMS = ("rigid_body", "nambu_pendulum", "henon_heiles", "kepler_eccentric", "thermal_spin", "kowalevski_gauss")
LATTICES = ("sine_gordon", "toda", "kdv", "food_web")

#: Functions of the library in double precision.
DOUBLE = re.compile(
    r"^ +U (sin|cos|tan|exp|expm1|log|log1p|pow|sqrt|fabs|fmin|fmax|floor|copysign|cbrt|sinh|cosh)$", re.M
)


@pytest.mark.parametrize("case", WRITTEN)
def test_what_is_written(case):
    number, expected = WRITTEN[case]
    assert FLOAT.spelt(number) == expected


@cache
def in_single(name, **extras):
    """Return the compilation of a system of the corpus in single precision, and in double precision with the same short
    code.
    """
    double_compilation = small(as_given(name)) if not extras else compile_spec(spec_of(name), **extras, profile="small")
    program = replace(double_compilation.program, extras=replace(double_compilation.program.extras, real="float"))
    return replace(double_compilation, program=program), double_compilation


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", [*SYSTEMS, *LATTICES])
def test_there_is_no_double_in_it(name, tmp_path):
    """The code has no promotion to double, no conversion back, and no function of the library that takes doubles."""
    write(tmp_path, emit(in_single(name)[0].program, "c", ""))
    flags = ["-std=c99", "-O0", "-Wall", "-Wextra", "-Werror", "-Wdouble-promotion", "-Wfloat-conversion"]
    run([tool("gcc"), *flags, "-Wno-unknown-pragmas", "-c", f"{name}.c"], tmp_path)
    assert not DOUBLE.search(run([tool("nm"), "-u", f"{name}.o"], tmp_path))
    assert not re.search(r"\bdouble\b", re.sub(r"/\*.*?\*/", "", (tmp_path / f"{name}.c").read_text(), flags=re.S))


def numbers(compilation):
    run_ = first_run(compilation)
    more = {"t0": float(run_.start)} if compilation.spec.time else {}
    return setting(compilation), {**setting(compilation).parameters, **more}


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", SYSTEMS)
def test_steps_are_those_of_double_precision_to_its_digits(name):
    """Compare states after a hundred steps, and Casimirs separately; the tolerance is the precision of numbers with 24
    bits.
    """
    (single, other), (at, parameters) = in_single(name), numbers(in_single(name)[0])
    start = np.array(at.x, dtype=np.float32).astype(float)
    in_floats, right = (solver(c, "c").integrate(start, at.h, 100, **parameters) for c in (single, other))
    difference = np.abs(in_floats.x - right.x).max() / np.abs(right.x).max()
    assert 1e-9 < difference < 100 * ONE_STEP
    for name, values in in_floats.casimirs.items():
        assert np.ptp(values) <= COARSER * 1e-14 * max(1.0, np.abs(right.casimirs[name]).max())


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", LATTICES)
def test_lattices_move_as_in_double_precision(name):
    (single, other), run_ = in_single(name), first_run(in_single(name)[0])
    start = start_of(single.spec, run_)
    in_floats, right = (
        lattice_solver_of(c, "c").integrate(start.state, float(run_.step), 50, parameters=start.arguments)
        for c in (single, other)
    )
    assert 1e-9 < np.abs(in_floats.x - right.x).max() / np.abs(right.x).max() < 50 * ONE_STEP


@pytest.mark.parametrize("name", slow_but(["rigid_body"], ["rigid_body", "nambu_pendulum", "kowalevski_gauss"]))
def test_derivatives_are_those_of_double_precision(name):
    """Compare the tangent map of a step and gradients of a run; paths are traced one by one."""
    (single, other), (at, parameters) = in_single(name, tangent=True, adjoint=True), numbers(in_single(name)[0])
    (_, tangent), (_, right) = (solver(c, "c").step_tangent(at.x, at.h, **parameters) for c in (single, other))
    assert 1e-9 < np.abs(tangent - right).max() < ONE_STEP
    bar = np.resize([1.0, 2.0, -1.0], len(at.x))
    bars = [solver(c, "c").pullback(at.x, h=at.h, steps=20, cotangent=bar, **parameters)[1:] for c in (single, other)]
    (x_bar, of), (x_right, of_right) = bars
    assert np.abs(x_bar - x_right).max() < 20 * ONE_STEP * np.abs(x_right).max()
    assert all(abs(of[p] - of_right[p]) < 20 * ONE_STEP * max(1.0, abs(of_right[p])) for p in of_right)


def test_a_session_and_an_ensemble():
    (single, other), (at, parameters) = in_single("rigid_body"), numbers(in_single("rigid_body")[0])
    states = np.array([at.x, at.x[::-1]])
    in_floats, right = (solver(c, "c").ensemble(states, at.h, 30, **parameters) for c in (single, other))
    assert np.abs(in_floats - right).max() < 30 * ONE_STEP
    moved = []
    for compilation in (single, other):
        session = solver(compilation, "c").session(at.x, **parameters)
        session.step(at.h)
        session.kick([0.1, 0.0, -0.1])
        session.step(at.h)
        moved.append(session.x)
    assert np.abs(moved[0] - moved[1]).max() < 10 * ONE_STEP


def test_it_stays_on_the_leaf_for_a_million_steps():
    """As in double precision, rounding errors of Casimirs do not accumulate."""
    single, _ = in_single("rigid_body")
    at, parameters = numbers(single)
    run = solver(single, "c").integrate(at.x, at.h, 1_000_000, stride=10_000, **parameters)
    assert np.ptp(run.casimirs["C"]) / np.abs(run.casimirs["C"]).max() < 1e-6


LARGE = """phigen: 1
name: large
coordinates: [q, p]
parameters: {k: 1}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: (p**2 + k*q**2)/2
order: 2
real: float
"""


@pytest.mark.parametrize(
    ("wrong", "said"), [({"x": 1e39}, "q = 1e+39"), ({"k": -1e39}, "k = -1e+39"), ({"h": 1e39}, "the step h = 1e+39")]
)
def test_a_number_beyond_single_precision_is_named_and_costs_its_member_alone(tmp_path, wrong, said):
    """NumPy must not warn in addition."""
    (tmp_path / "large.yaml").write_text(LARGE, encoding="utf-8")
    solver = phigen.compile(tmp_path / "large.yaml", target="c")
    numbers_given = {"x": 1.0, "k": 1.0, "h": 0.1} | wrong
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(phigen.ParameterError, match=re.escape(said)):
            solver.integrate([numbers_given["x"], 0], numbers_given["h"], 3, k=numbers_given["k"])
        k, h = np.array([1, numbers_given["k"], 2]), np.array([0.1, numbers_given["h"], 0.2])
        with pytest.raises(phigen.ParameterError, match=rf"{re.escape(said)}.*\(member 1\)") as failure:
            solver.ensemble([[1, 0], [numbers_given["x"], 0], [0.5, 0]], h, 3, k=k)
    assert failure.value.members == (1,)
    ends = solver.ensemble([[1, 0], [0.5, 0]], h[::2], 3, k=k[::2])
    assert failure.value.trajectory[::2] == pytest.approx(ends, rel=1e-6)


def test_a_site_beyond_single_precision_is_named():
    solver = lattice_solver_of(in_single("toda")[0], "c")
    x = np.ones((2, 8))
    x[1, 3] = -1e39
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(phigen.ParameterError, match=r"b = -1e\+39 is too large for single precision"):
            solver.integrate(x, 0.1, 1)
        with pytest.raises(phigen.StepError, match=r"1 member\(s\).*b = -1e\+39 is too large") as failure:
            solver.ensemble(np.array([np.ones((2, 8)), x]), 0.1, 1)
    assert failure.value.members == (1,)
    assert np.isfinite(failure.value.trajectory[0]).all()


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize(
    ("name", "functions"),
    [("rigid_body", ("phi0", "phi1")), ("satellite_wheels", ("cosroot", "sinroot", "sin", "versin"))],
)
def test_functions_have_the_length_that_24_bits_need(name, functions, tmp_path):
    """Tables end at terms below rounding, no coefficient is replaced by a limit, and all digits are right."""
    compilation = compile_spec(spec_of(name), profile="small", real="float")
    files = emit(compilation.program, "c", "x")
    wrapped = [f"float at_{f}(float s);\nfloat at_{f}(float s) {{ return {name}_{f}(s); }}\n" for f in functions]
    write(tmp_path, {f"{name}.h": files[f"{name}.h"], "all.c": files[f"{name}.c"] + "".join(wrapped)})
    run([tool("cc"), "-std=c99", "-O1", "-fPIC", "-shared", "all.c", "-o", "all.so", "-lm"], tmp_path)
    library = ctypes.CDLL(str(tmp_path / "all.so"))
    for f in functions:
        body = re.search(rf"\b{name}_{f}\(float \w+\)\n\{{(.*?)\n\}}", files[f"{name}.c"], re.DOTALL)[1]
        smallest = min(float(v) for v in re.findall(r"\d[\d.]*e-\d+", body))
        assert smallest > 1e-21
        assert body.count("e-") < 40
        at = getattr(library, f"at_{f}")
        at.restype, at.argtypes = ctypes.c_float, [ctypes.c_float]
        for s in np.linspace(-0.99, 0.99, 40).astype(np.float32):
            with mpmath.workdps(30):
                exact = float(in_many_digits(f, float(s)))
            assert abs(at(s) - exact) <= 3 * np.spacing(np.float32(abs(exact) or 1e-30))
