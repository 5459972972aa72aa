"""Certificates of steps: they hold for the compiled C, say something, and are refused where they were tampered with."""

from __future__ import annotations

import copy
import ctypes
import dataclasses
import json
import math
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from flint import arb, arb_mat
from many_digits import PreciseStep
from systems import compile_anew, slow_but, spec_of

import phigen.certify.checker
from phigen.certify.checker import krawczyk
from phigen.certify.checker.explicit_steps import explicit
from phigen.certify.checker.reader import GeneratedC, _block, _called
from phigen.certify.checker.replay import replayed
from phigen.certify.checker.rounding import (
    LIBM,
    SERIES,
    TERMS,
    RefusedError,
    Tape,
    coefficients,
    interval,
    play,
)
from phigen.certify.problem import problem_of
from phigen.certify.prove import LEAST_RATE, StepProblem, certified, precise
from phigen.certify.samples import exact_step, observed
from phigen.compiler import compile_spec, emit
from phigen.errors import SpecError
from phigen.runtime import cache as compiled
from phigen.spec import loads
from phigen.spec.model import Spec

#: Systems of different kinds, with changes of the default problem: by a formula, by Newton's method for four kinds of
#: brackets, with the time, with a Casimir gauge, by flows, with a monitor, by Gauss collocation.
SYSTEMS: dict[str, dict[str, Any]] = {
    "pendulum_euler": {},
    "pendulum": {"domain": [[-1, 1], [-1.5, 1.5]]},
    "predator_prey": {},
    "henon_heiles": {},
    "rigid_body": {},
    "duffing": {},
    "seasonal_predator_prey": {},
    "toda3": {},
    "kepler": {},
    "satellite_wheels": {},
    "kepler_eccentric": {
        "domain": [[0.0499, 0.0501], [-0.0001, 0.0001], [-0.0001, 0.0001], [6.2449, 6.2451]],
        "step": 0.01,
    },
    "kowalevski_gauss": {"step": 0.05},
}

#: Largest ratio of the bound to the error that was observed, in the coordinate where it is least: a bound beyond says
#: nothing. Gauss methods may stop later than they do, and the sizes of many terms that cancel are added up.
VACUOUS = {"kepler_eccentric": 40, "kowalevski_gauss": 200}


def problem(name: str) -> tuple[StepProblem, dict[str, str]]:
    """The problem of a system of the corpus, and its C."""
    stated, files = problem_of_spec(spec_of(name))
    return dataclasses.replace(stated, **SYSTEMS[name]), files


def problem_of_spec(spec: Spec) -> tuple[StepProblem, dict[str, str]]:
    """The problem of a spec, in boxes of 1 % around the start of its first run, and its C."""
    compilation = compile_spec(spec, profile="small")
    files = emit(compilation.program, "c", "phigen certify")
    run = next(iter(spec.runs.values()))
    start = [float(v) for v in run.initial]
    domain = [[v - 0.01 * max(1, abs(v)), v + 0.01 * max(1, abs(v))] for v in start]
    t = float(run.start)
    time = [t, t + 5] if compilation.program.time else [t, t]
    stated = problem_of(
        compilation,
        files[f"{spec.name}.c"],
        float(run.step),
        spec.parameters_of(run),
        start,
        domain,
        time,
        1.0,
        math.inf,
    )
    return stated, files


@cache
def certificate(name: str) -> tuple[dict[str, Any], dict[str, str]]:
    stated, files = problem(name)
    return json.loads(json.dumps(certified(stated, 64))), files


def library(files: dict[str, str]) -> Any:
    return compiled.load(files)


@pytest.mark.parametrize("name", slow_but(["pendulum", "kowalevski_gauss"], of=SYSTEMS))
def test_steps_of_the_compiled_c_are_within_the_bound(name: str) -> None:
    c, files = certificate(name)
    worst = observed(c, library(files), 8)
    pairs = list(zip(worst, c["bound"], strict=True))
    assert all(error <= bound for error, bound in pairs)
    assert min(bound / error for error, bound in pairs if error > 0) < VACUOUS.get(name, 12)
    text = files[f"{name}.c"].encode()
    with precise():
        assert "of the exact map" in replayed(c, text)


def test_predicted_starts_of_newtons_method_are_covered() -> None:
    """The steps of a trajectory, whose iterations start with what is extrapolated, stay within the bound."""
    c, files = certificate("pendulum")
    start = copy.deepcopy(c)
    for k in range(1, 12):  # the predictor has differences of order 9 after ten steps
        state = _after(start, library(files), [0.4, 0.2], k)
        exact = exact_step(c, [arb(a) + arb(b) for a, b in zip(*state[0], strict=True)], 0.0)
        errors = [float(abs(arb(a) + arb(b) - e)) for a, b, e in zip(*state[1], exact, strict=True)]
        assert all(e <= bound for e, bound in zip(errors, c["bound"], strict=True))


def _after(c: dict[str, Any], lib: Any, x: list[float], steps: int) -> list[tuple[list[float], list[float]]]:
    """State and compensation after some steps of one solver, and after one more."""
    n, name = len(x), c["name"]
    size = getattr(lib, f"{name}_solver_size")
    size.restype = ctypes.c_size_t
    room = ctypes.create_string_buffer(size())
    assert getattr(lib, f"{name}_init")(room, None, (ctypes.c_double * n)(*x)) == 0
    view = (ctypes.c_double * (2 * n)).from_buffer(room)
    states = []
    for count in (steps, 1):
        assert getattr(lib, f"{name}_integrate")(room, ctypes.c_double(c["step"]), ctypes.c_size_t(count)) == 0
        states.append((list(view[:n]), list(view[n:])))
    return states


@pytest.mark.parametrize("name", ["pendulum", "predator_prey"])
def test_the_exact_map_is_that_of_the_formulas(name: str) -> None:
    """The map of the certificate, read from the C, is that of α, β and S_h, which share nothing with the C."""
    c, _ = certificate(name)
    step = PreciseStep(compile_spec(spec_of(name)), c["parameters"], c["step"])
    x = [(a + 2 * b) / 3 for a, b in c["domain"]]
    expected, reached = step(x), exact_step(c, x, 0.0)
    with mpmath.workdps(50):
        differences = [
            abs(a - mpmath.mpf(b.mid().str(45, radius=False))) for a, b in zip(expected, reached, strict=True)
        ]
    # numbers such as 1/10 are written as doubles in the parameters of both; S_h has rational numbers only
    assert max(differences) < 1e-38


Tampering = Callable[[dict[str, Any]], None]
TAMPERED: dict[str, tuple[Tampering, str]] = {
    "a smaller bound": (lambda c: c["bound"].__setitem__(0, c["bound"][0] / 2), "is claimed"),
    "a larger domain": (lambda c: c["domain"][0].__setitem__(1, 3.0), ""),
    "another box of the solution": (lambda c: c["tree"]["y"][0].__setitem__(0, [0.0, 0.1]), ""),
    "another parameter": (lambda c: c["parameters"].__setitem__("g", 100.0), ""),
    "another step": (lambda c: c.__setitem__("step", 0.3), ""),
    "another C": (lambda c: c.__setitem__("c_sha256", "0" * 64), "another C file"),
    "an operation left out": (lambda c: c["kernels"]["linearise"]["operations"].__setitem__(5, ["number", 0.0]), "C"),
    "a looser stop": (lambda c: c.__setitem__("tolerance", 1e-30), "those of the C"),
    "a division outside": (
        lambda c: c.__setitem__("tree", {"axis": 0, "at": 9.0, "parts": [c["tree"], c["tree"]]}),
        "divided outside",
    ),
}


@pytest.mark.parametrize("how", TAMPERED)
def test_a_tampered_certificate_is_refused(how: str) -> None:
    whole, files = certificate("pendulum")
    c, (tamper, words) = copy.deepcopy(whole), TAMPERED[how]
    tamper(c)
    with precise(), pytest.raises(RefusedError) as refusal:
        replayed(c, files["pendulum.c"].encode())
    assert words in str(refusal.value)


def test_the_checker_needs_nothing_of_phigen(tmp_path: Path) -> None:
    c, files = certificate("pendulum")
    shutil.copytree(Path(phigen.certify.checker.__file__).parent, tmp_path / "checker")
    (tmp_path / "c.json").write_text(json.dumps(c))
    (tmp_path / "pendulum.c").write_text(files["pendulum.c"])
    code = "import sys; sys.modules['phigen'] = None; sys.path.insert(0, '.')\n"
    code += "from checker.replay import main; sys.exit(main('c.json', 'pendulum.c'))"
    done = subprocess.run([sys.executable, "-I", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "pendulum: 1 boxes; a step is within" in done.stdout


def test_a_jacobian_that_is_not_the_derivative_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last correction counts to first order, so a wrong Jacobian would be as large an error."""
    stated, _ = problem("pendulum")
    text = stated.text.replace("increment_jacobian[0] = ", "increment_jacobian[0] = 1e-9 + ")
    with pytest.raises(RefusedError, match="Jacobian is not the derivative"):
        certified(dataclasses.replace(stated, text=text), 4)


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("pendulum", {"step": 30.0}, "no certificate after 0 boxes"),
        ("kepler", {"domain": [[-0.1, 0.1], [-0.1, 0.1], [0, 0.1], [0, 0.1]]}, "no certificate after"),
        ("kowalevski_gauss", {"step": 0.5}, "sweeps over the stages"),
        ("pendulum", {"within": 1e-6}, "are asked for"),
    ],
)
def test_what_cannot_be_certified_is_refused_with_a_hint(name: str, changes: dict[str, Any], words: str) -> None:
    stated, _ = problem(name)
    with pytest.raises(RefusedError, match=words) as refusal:
        certified(dataclasses.replace(stated, **changes), 4)
    assert "smaller box" in refusal.value.hint


def test_boxes_are_divided_where_one_is_too_large() -> None:
    stated, files = problem("predator_prey")
    wide = dataclasses.replace(stated, domain=[[3, 20], [3, 20]])
    c = certified(wide, 200)
    assert c["boxes"] > 1
    with precise():
        assert f"{c['boxes']} boxes" in replayed(json.loads(json.dumps(c)), files["predator_prey.c"].encode())
    worst = observed(c, library(files), 8, seed=3)
    assert all(error <= bound for error, bound in zip(worst, c["bound"], strict=True))


OSCILLATOR = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\norder: 2\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hamiltonian: p**2/2 + q**2/2\nnoise: {kick: {hamiltonian: q, amplitude: 0.1}}\n", "noise"),
        ("hamiltonian: p**2/2 + q**2/2*cos(t)\ntime: t\nscheme: splitting\n", "splittings of an H that depends on"),
    ],
)
def test_systems_that_certificates_do_not_cover_are_refused(text: str, words: str) -> None:
    compilation = compile_anew(OSCILLATOR + text)
    with pytest.raises(SpecError, match=words):
        problem_of(compilation, "", 0.1, {}, [0.1, 0.2], [[0, 1], [0, 1]], [0, 0], 1.0, math.inf)


def test_coefficients_of_series_fall_as_the_rest_assumes() -> None:
    for name in SERIES:
        sizes = [abs(float(c)) for c in coefficients(name)]
        assert all(size <= 2.0 ** (1 - n) for n, size in enumerate(sizes)), name
        if not name.startswith("phi"):  # the factorials go on falling; phi has its nearest pole at 4 pi^2
            assert sizes[TERMS - 2] + sizes[TERMS - 1] < 2.0**-TERMS


@pytest.mark.parametrize("name", sorted(LIBM))
def test_functions_and_derivatives_of_libm(name: str) -> None:
    f, slope = LIBM[name]
    for x in (0.3, 0.9, 1.7):
        assert float(f(arb(x))) == pytest.approx(getattr(math, name)(x), rel=1e-15)
        assert float((f(arb(x + 1e-6)) - f(arb(x - 1e-6))) / 2e-6) == pytest.approx(float(slope(arb(x))), rel=1e-8)


def test_bounds_of_random_expressions_hold_for_every_value() -> None:
    """Straight lines of random operations: computed with doubles, they stay within the bound, and near it."""
    draw, most = random.Random(7), 0.0
    for _ in range(40):
        with precise():
            tape = Tape({}, 1.0)
            starts = [draw.uniform(0.5, 2) for _ in range(3)]
            values, exact = [tape.value(arb(s).union(arb(s * 1.001))) for s in starts], [arb(s) for s in starts]
            floats = list(starts)
            for _ in range(25):
                i, j, op = draw.randrange(len(floats)), draw.randrange(len(floats)), draw.choice("+-*/s")
                if (op == "/" and 0 in values[j].x) or abs(floats[i]) > 1e6:
                    continue
                if op == "s":
                    values.append(tape.function("sin", values[i]))
                    floats.append(math.sin(floats[i]))
                    exact.append(exact[i].sin())
                    continue
                apply = {"+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b}.get(
                    op, lambda a, b: a / b
                )
                for row in (values, floats, exact):
                    row.append(apply(row[i], row[j]))
            try:
                bound = tape.error(values[-1])
            except RefusedError:
                continue
            error = abs(arb(floats[-1]) - exact[-1])  # the ball of the exact value is far below a rounding
        assert error <= bound
        most = max(most, float(error / bound)) if bound > 0 else most
    assert most > 0.02


def test_derivatives_are_limits_of_differences() -> None:
    """Of each operation, by each operand."""
    with precise():

        def value(x: Any, y: Any) -> tuple[Tape, Any, Any, Any]:
            tape = Tape({}, 1.0, exact=True)
            a, b = tape.value(arb(x)), tape.value(arb(y))
            return tape, a, b, tape.function("exp", (a * b - a / b) + (-a * a)) / (b + a)

        tape, a, b, result = value("0.7", "1.3")
        slopes, h = tape.derivatives(result), arb("1e-9")
        by_a = (value(arb("0.7") + h, "1.3")[3].x - value(arb("0.7") - h, "1.3")[3].x) / (2 * h)
        by_b = (value("0.7", arb("1.3") + h)[3].x - value("0.7", arb("1.3") - h)[3].x) / (2 * h)
        assert abs(slopes[a.index] - by_a) < 1e-12
        assert abs(slopes[b.index] - by_b) < 1e-12


def test_corrections_miss_no_more_than_the_bound_says() -> None:
    """The correction that doubles give at the solution, where the rounding of the residual decides."""
    c, _ = certificate("henon_heiles")
    draw, n = random.Random(5), len(c["domain"])
    *X, T = [interval(d) for d in [*c["domain"], c["time"]]]
    with precise():
        Y = [interval(y) for y in c["tree"]["y"][0]]
        correction = krawczyk.Correction(*krawczyk.linearised(c, Y, T, 0))
        centre = krawczyk.linearised(c, [arb(v.mid()) for v in Y], T, 0)[2]["displacement"]
        correction.expect_one_solution(krawczyk.column(X), krawczyk.column(v.x for v in centre))
    worst = 0.0
    for _ in range(40):
        x = [draw.uniform(*d) for d in c["domain"]]
        with precise():
            solution = x
            for _ in range(6):
                _, _, out = krawczyk.linearised(c, [arb(v) for v in solution], T, 0, exact=True)
                matrix = arb_mat(n, n, [v.x for v in out["jacobian"]])
                residual = [[arb(s) - arb(v) + d.x] for s, v, d in zip(solution, x, out["displacement"], strict=True)]
                delta = matrix.solve(arb_mat(residual)).entries()
                solution = [(arb(s) - d).mid() for s, d in zip(solution, delta, strict=True)]
            y = [float(s) for s in solution]
            e = [arb(a) - b for a, b in zip(y, solution, strict=True)]
        h, number = c["step"], lambda c, _=None: c
        coef = play(c["kernels"]["prepare"], number, params=c["parameters"], gauge=[], h=[h])["coef"]
        out = play(c["kernels"]["linearise"], number, coef=coef, y=y)
        side = [(a - b) + d for a, b, d in zip(y, x, out["displacement"], strict=True)]
        computed = np.linalg.solve(np.reshape(out["jacobian"], (n, n)), side)
        with precise():
            bound = correction.missed(krawczyk.column(abs(v) for v in e)).entries()
            errors = [abs(arb(d) - v) for d, v in zip(computed, e, strict=True)]
            assert all(error <= b for error, b in zip(errors, bound, strict=True))
            worst = max(worst, *(float(error / b) for error, b in zip(errors, bound, strict=True)))
    assert worst > 0.02


def test_truncation_of_a_polynomial_counts() -> None:
    """cos(sqrt(s)) by two terms is wrong by the third."""
    polynomial = {
        "radius": 1.0,
        "operations": [["input", "s", 0], ["number", -0.5], ["mul", 1, 0], ["number", 1.0], ["add", 3, 2]],
        "outputs": {"value": [4]},
    }
    with precise():
        tape = Tape({"series:cosroot": polynomial}, 1.0)
        error = tape.error(tape.function("series:cosroot", tape.value(arb("0.5"))))
        assert math.cos(math.sqrt(0.5)) - 0.75 <= float(error) < 1.1 * 0.5**2 / 24


def test_kernels_that_read_the_state_without_its_carry_are_wrong_by_it() -> None:
    """The increment x - 1 has no rounding near 1, but the C computes it from x, and the map of x + carry differs."""
    operations = [["input", "state", 0], ["number", 1.0], ["sub", 0, 1]]
    kernels = {
        "prepare": {"operations": [], "outputs": {"coef": []}},
        "explicit": {"operations": operations, "outputs": {"increment": [2]}},
    }
    c = {"series": {}, "ulps": 1.0, "step": 1.0, "fractions": [1.0], "parameters": {}, "gauge": [], "kernels": kernels}
    with precise():
        (bound,), _ = explicit(c, [interval((1.0, 1.001))], arb(0), {})
        assert 2.0**-53 <= float(bound) < 1.1 * 2.0**-53


def test_the_runtime_is_the_one_that_the_theorems_are_about() -> None:
    """Functions of the runtime that docs/certify.md proves things about. After a change read that page again."""
    expect_phrases(
        "pendulum",
        {
            "attempt": ("((y[i] - s->x[i]) + displacement[i]) - s->carry[i]", "size * size *", "small[i] -= slope"),
            "advance": ("(s->x[i] - (sum - added)) + (change[i] - added)", "lost - (x[i] - sum)"),
            "solve": ("factor = matrix[i * DIM + k] / pivot", "side[i] -= factor * side[k]"),
            "size": ("fabs(delta[i]) / (fabs(y[i]) + FLOOR * norm + DBL_MIN)",),
        },
    )
    expect_phrases(
        "kowalevski_gauss",
        {
            "collocate": ("square * (past->rate * past->rate) <= SOLVED * SOLVED",),
            "judge": (
                "slow && change <= ROUNDING",
                "rate > fmax(STALLED, 1.5 * past->rate)",
                "change <= NEARLY_ROUNDING",
            ),
            "change_of": ("(even + odd) / (double)NODES",),
        },
    )


def test_kicks_with_modified_potential_are_within_the_bound() -> None:
    top = """
phigen: 1
name: two_tops
coordinates: [m1, m2, m3, g1, g2, g3]
poisson: {lie_algebra: {name: se(3), sign: minus}}
hamiltonian: (m1**2 + m2**2)/2 + 5*m3**2/4 + 7*g3/10 + g1**2/10
scheme: splitting
order: 6
runs: {swing: {initial: [0.1, 0.4, 1, 0, 0.6, 0.8], step: 0.2, steps: 10}}
"""
    stated, files = problem_of_spec(loads(top))
    c = json.loads(json.dumps(certified(stated, 64)))
    assert len(c["multiples"]) == len(c["fractions"])
    assert any(c["multiples"])
    pairs = list(zip(observed(c, library(files), 8), c["bound"], strict=True))
    assert all(error <= bound for error, bound in pairs)
    assert max(bound / error for error, bound in pairs if error > 0) < 200


@pytest.mark.parametrize(
    "line", ["flow0(coef(), x, moved, start);", "flow0(coef + nothing, x, moved, start);", "coef += 2**9;"]
)
def test_schedules_with_other_statements_are_refused(line: str) -> None:
    statements = _block(iter([line]))
    with pytest.raises(RefusedError, match="whole numbers"):
        _called(statements, {"coef": 0, "ROW": 1}, [])


def test_schedules_of_endless_loops_are_refused() -> None:
    with pytest.raises(RefusedError):
        _block(iter(["for (int k = 0; k < 99999999999; ++k) {", "}"]))


def expect_phrases(name: str, phrases: dict[str, tuple[str, ...]]) -> None:
    source = GeneratedC(certificate(name)[1][f"{name}.c"], name)
    for function, texts in phrases.items():
        matched = source.function(function)
        assert matched
        assert all(text in " ".join(matched[1].split()) for text in texts), function


def test_a_rate_that_gauss_solvers_remember_is_above_the_one_assumed() -> None:
    _, files = certificate("kowalevski_gauss")
    code = f"""#include <stdio.h>
#include "kowalevski_gauss.h"
int main(void) {{
    const double steps[3] = {{ 0.5, 0.05, 0.005 }}, x0[6] = {{ 1, 0.5, 0.8, 0.6, 0, 0.8 }};
    double least = 1.0;
    for (int i = 0; i < 3; ++i) {{
        kowalevski_gauss_solver s;
        kowalevski_gauss_init(&s, NULL, x0);
        for (int k = 0; k < 2000; ++k) {{
            if (kowalevski_gauss_step(&s, steps[i]) != kowalevski_gauss_OK) return 1;
            if (s.history.rate < least) least = s.history.rate;
        }}
    }}
    return least < {LEAST_RATE};
}}
"""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in {**files, "main.c": code}.items():
            (Path(folder) / name).write_text(text)
        built = ["cc", "-std=c99", "-O1", "main.c", "kowalevski_gauss.c", "-lm", "-o", "main"]
        subprocess.run(built, cwd=folder, check=True, capture_output=True)
        assert subprocess.run([str(Path(folder) / "main")], check=False).returncode == 0
