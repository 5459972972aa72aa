"""Certificates of steps: their bounds hold for the compiled C and are not far too large, and changed certificates are
refused.
"""

from __future__ import annotations

import ast
import copy
import ctypes
import dataclasses
import io
import json
import math
import random
import re
import shutil
import subprocess
import sys
import tempfile
import tokenize
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import pytest
from differential.ordinary import draw_ordinary
from flint import arb
from many_digits import PreciseStep
from systems import compile_anew, slow_but, spec_of

import phigen.certify.checker
from phigen.certify.checker import (
    COEFFICIENTS,
    LIBM,
    SERIES,
    TERMS,
    Evaluation,
    RefusedError,
    digest,
    interval,
    replayed,
    step,
)
from phigen.certify.problem import problem_of
from phigen.certify.prove import NoCertificateError, StepProblem, certified, described, precise
from phigen.certify.reader import GeneratedC, _block, _called
from phigen.certify.samples import ExactMap, observed
from phigen.certify.stages import LEAST_RATE
from phigen.compiler import compile_spec, emit
from phigen.errors import SpecError
from phigen.runtime import cache as compiled
from phigen.spec import loads
from phigen.spec.model import Spec

#: Systems for each kind of step, with changes of the default domain or step: an explicit step, Newton's method for four
#: kinds of brackets, a time, a Casimir gauge, a splitting, a monitor, and paths.
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
    "charged_particle": {},
}

#: For each system, the largest accepted ratio of the bound to the observed error (12 if not listed), in the coordinate
#: where this ratio is smallest. The ratio is large if many terms cancel, because the bound adds their absolute values.
VACUOUS = {"kepler_eccentric": 40}


def problem(name: str) -> tuple[StepProblem, dict[str, str]]:
    """Return what a certificate is to prove for a system of the corpus (domain, step, parameters and more), with the
    changes in `SYSTEMS`, and the C files.
    """
    stated, files = problem_of_spec(spec_of(name))
    return dataclasses.replace(stated, **SYSTEMS.get(name, {})), files


def problem_of_spec(spec: Spec) -> tuple[StepProblem, dict[str, str]]:
    """Return what a certificate is to prove for a spec, and the C files. The domain is a box of ±1 % around the start
    of the first run.
    """
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


@cache
def exact_map(name: str) -> dict[str, Any]:
    return described(problem(name)[0], exact=True)


def library(files: dict[str, str]) -> Any:
    return compiled.load(files)


@pytest.mark.thin(1)
@pytest.mark.parametrize("name", slow_but(["pendulum", "charged_particle"], of=SYSTEMS))
def test_steps_of_the_compiled_c_are_within_the_bound(name: str) -> None:
    c, files = certificate(name)
    worst = observed(c, exact_map(name), library(files), 2 if c["kind"] == "path" else 8)
    pairs = list(zip(worst, c["bound"], strict=True))
    assert all(error <= bound for error, bound in pairs)
    assert min(bound / error for error, bound in pairs if error > 0) < VACUOUS.get(name, 12)
    text = files[f"{name}.c"].encode()
    with precise():
        assert "of the exact map" in replayed(c, text)


def test_predicted_starts_of_newtons_method_are_covered() -> None:
    """Later steps of a trajectory start Newton's method from an extrapolation of earlier steps. They stay within the
    bound, too.
    """
    c, files = certificate("pendulum")
    start = copy.deepcopy(c)
    for k in range(1, 12):  # after ten steps the predictor uses differences of order 9
        state = _after(start, library(files), [0.4, 0.2], k)
        exact = ExactMap(exact_map("pendulum"))([arb(a) + arb(b) for a, b in zip(*state[0], strict=True)], 0.0)
        errors = [float(abs(arb(a) + arb(b) - e)) for a, b, e in zip(*state[1], exact, strict=True)]
        assert all(e <= bound for e, bound in zip(errors, c["bound"], strict=True))


def _after(c: dict[str, Any], lib: Any, x: list[float], steps: int) -> list[tuple[list[float], list[float]]]:
    """Return the state and the compensation terms after ``steps`` steps of a solver, and those after one more step."""
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
    """The exact map that is read from the C agrees with the map computed from α, β and S_h in many digits, without the
    C.
    """
    c, _ = certificate(name)
    precise_step = PreciseStep(compile_spec(spec_of(name)), c["parameters"], c["step"])
    x = [(a + 2 * b) / 3 for a, b in c["domain"]]
    expected, reached = precise_step(x), ExactMap(exact_map(name))(x, 0.0)
    with mpmath.workdps(50):
        differences = [
            abs(a - mpmath.mpf(b.mid().str(45, radius=False))) for a, b in zip(expected, reached, strict=True)
        ]
    # Parameters such as 1/10 are the same doubles in both computations, and other numbers are rational, so the maps
    # agree to many more digits than doubles have.
    assert max(differences) < 1e-38


def leaves(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths (keys and indices) to all values in a certificate."""
    if isinstance(value, dict | list):
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        return [leaf for key, below in pairs for leaf in leaves(below, (*path, key))]
    return [path]


def test_a_certificate_in_which_any_value_was_changed_is_refused() -> None:
    """For each field of a certificate, one value is changed. The digest in the certificate then no longer fits."""
    whole, files = certificate("pendulum")
    fields = {tuple(key for key in path if isinstance(key, str)): path for path in leaves(whole)}
    for path in fields.values():
        c = copy.deepcopy(whole)
        record = c
        for key in path[:-1]:
            record = record[key]
        value = record[path[-1]]
        record[path[-1]] = value + "x" if isinstance(value, str) else value + 1
        with pytest.raises(RefusedError, match="was changed"):
            replayed(c, files["pendulum.c"].encode())


Tampering = Callable[[dict[str, Any]], None]
TAMPERED: dict[str, tuple[Tampering, str]] = {
    "a smaller bound": (lambda c: c["bound"].__setitem__(0, c["bound"][0] / 2), "is claimed"),
    "a larger domain": (lambda c: c["domain"][0].__setitem__(1, 3.0), ""),
    "a box without the solution": (lambda c: leaf(c)["u"].__setitem__(0, [0.0, 0.1]), "Krawczyk"),
    "a box too narrow": (lambda c: leaf(c)["u"].__setitem__(0, [0.0, 1.0]), "Krawczyk"),
    "iterates nearer than starts": (lambda c: leaf(c)["reach"].__setitem__(0, 1e-9), "out of reach"),
    "another parameter": (lambda c: c["parameters"].__setitem__("g", 100.0), ""),
    "another step": (lambda c: c.__setitem__("step", 0.3), ""),
    "another C": (lambda c: c.__setitem__("c_sha256", "0" * 64), "another C file"),
    "functions of a worse libm": (lambda c: c.__setitem__("ulps", 1000.0), "is claimed"),
    "a looser stop": (lambda c: stage(c)["stops"][0].__setitem__("now", 1e-5), "is claimed"),
    "a Jacobian that is not one": (lambda c: stage(c)["matrix"].reverse(), "not the derivative"),
    "another gain": (lambda c: stage(c)["gain"].reverse(), "not the derivative"),
    "a division outside": (
        lambda c: c.__setitem__("tree", {"axis": 0, "at": 9.0, "parts": [c["tree"], c["tree"]]}),
        "divided outside",
    ),
    "a part of the domain left out": (
        lambda c: c.__setitem__("tree", {"axis": 0, "at": 0.9, "parts": [c["tree"], {"stages": []}]}),
        "",
    ),
}


def leaf(c: dict[str, Any]) -> Any:
    return c["tree"]["stages"][0]


def stage(c: dict[str, Any]) -> Any:
    return c["stages"][0]


@pytest.mark.parametrize("how", TAMPERED)
def test_a_certificate_that_claims_too_much_is_refused_with_the_right_digest_too(how: str) -> None:
    whole, files = certificate("pendulum")
    c, (tamper, words) = copy.deepcopy(whole), TAMPERED[how]
    tamper(c)
    c["sha256"] = digest(c)
    with precise(), pytest.raises((RefusedError, ValueError)) as refusal:
        replayed(c, files["pendulum.c"].encode())
    assert words in str(refusal.value)


OTHERS: dict[str, tuple[str, Tampering, str]] = {
    "a shorter polynomial": ("rigid_body", lambda c: shortened(c), "is claimed"),
    "a polynomial beyond its radius": ("rigid_body", lambda c: polynomial_of(c).update(radius=1e-9), "reaches"),
    "another gauge": ("rigid_body", lambda c: c["gauge"].__setitem__(0, 50.0), ""),
    "a path that leaves its box": (
        "charged_particle", lambda c: leaf(c)["path"].__setitem__(0, c["domain"][0]), "leave its box",
    ),
    "too many terms seen": (
        "charged_particle", lambda c: stage(c).update(seen=[stage(c)["hidden"][0][0]]), "end early",
    ),
    "too few terms hidden": (
        "charged_particle", lambda c: stage(c)["hidden"].append([stage(c)["seen"][0], stage(c)["seen_above"]]), "late",
    ),
}  # fmt: skip


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("how", OTHERS)
def test_certificates_with_polynomials_and_paths_that_claim_too_much_are_refused(how: str) -> None:
    name, tamper, words = OTHERS[how]
    whole, files = certificate(name)
    c = copy.deepcopy(whole)
    tamper(c)
    c["sha256"] = digest(c)
    with precise(), pytest.raises(RefusedError) as refusal:
        replayed(c, files[f"{name}.c"].encode())
    assert words in str(refusal.value)


def polynomial_of(c: dict[str, Any]) -> Any:
    return next(iter(c["series"].values()))


def shortened(c: dict[str, Any]) -> None:
    """Set the linear coefficient of the first polynomial in a certificate to 0."""
    numbers = [op for op in polynomial_of(c)["operations"] if op[0] == "number"]
    sorted(numbers, key=lambda op: -abs(op[1]))[1][1] = 0.0


def test_the_checker_needs_nothing_of_phigen(tmp_path: Path) -> None:
    c, files = certificate("pendulum")
    shutil.copy(str(phigen.certify.checker.__file__), tmp_path / "checker.py")
    (tmp_path / "c.json").write_text(json.dumps(c))
    (tmp_path / "pendulum.c").write_text(files["pendulum.c"])
    code = "import sys, runpy; sys.modules['phigen'] = None; sys.argv = ['checker.py', 'c.json', 'pendulum.c']\n"
    code += "runpy.run_path('checker.py', run_name='__main__')"
    process = subprocess.run(
        [sys.executable, "-I", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (process.returncode, process.stderr) == (0, "")
    assert "pendulum: 1 box; a step is within" in process.stdout


def code_lines(text: str) -> dict[str, int]:
    """Return the number of lines with code, without comments and docstrings, by top-level function or class. The key ""
    stands for all other lines.
    """
    tree, numbers = ast.parse(text), set[int]()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT):
            numbers |= {*range(token.start[0], token.end[0] + 1)} if token.string else set()
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            numbers -= {*range(body[0].lineno, body[0].end_lineno + 1)}
    named = [node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    counts = {n.name: sum(n.lineno <= k <= n.end_lineno for k in numbers) for n in named}
    return counts | {"": len(numbers) - sum(counts.values())}


def test_the_page_says_what_the_lines_of_the_checker_are_for() -> None:
    counts = code_lines(Path(phigen.certify.checker.__file__).read_text(encoding="utf-8"))
    page = (Path(phigen.__file__).parents[1] / "docs/certify.md").read_text(encoding="utf-8")
    (total,) = map(int, re.findall(r"with (\d+) lines\s+of\s+code", page))
    rows = re.findall(r"^\| (\d+) \| [^|]* \| ([^|]*) \|$", page, re.MULTILINE)
    named = [re.findall(r"`(\w+)`", functions) for _, functions in rows]
    assert total == sum(counts.values()) == sum(int(number) for number, _ in rows)
    assert sorted(name for names in named for name in names) == sorted(counts.keys() - {""})
    for (number, functions), names in zip(rows, named, strict=True):
        assert int(number) == sum(counts[name] for name in names) + ("other lines" in functions) * counts[""], functions


def test_a_jacobian_that_is_not_the_derivative_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bound relies on Newton's last correction being right to first order. A wrong Jacobian would make an error of
    this order, so it is refused.
    """
    stated, _ = problem("pendulum")
    text = stated.text.replace("increment_jacobian[0] = ", "increment_jacobian[0] = 1e-9 + ")
    with pytest.raises(RefusedError, match="Jacobian is not the derivative"):
        certified(dataclasses.replace(stated, text=text), 4)


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("pendulum", {"step": 30.0}, "no certificate after 0 boxes"),
        ("kepler", {"domain": [[-0.1, 0.1], [-0.1, 0.1], [0, 0.1], [0, 0.1]]}, "no certificate after"),
        ("pendulum", {"within": 1e-6}, "more than the accepted"),
    ],
)
def test_what_cannot_be_certified_is_refused_with_a_hint(name: str, changes: dict[str, Any], words: str) -> None:
    stated, _ = problem(name)
    with pytest.raises(NoCertificateError, match=words) as refusal:
        certified(dataclasses.replace(stated, **changes), 4)
    assert "smaller box" in refusal.value.hint


@pytest.mark.slow
def test_boxes_are_divided_where_one_is_too_large() -> None:
    stated, files = problem("predator_prey")
    wide = dataclasses.replace(stated, domain=[[4, 12], [4, 12]])
    c = certified(wide, 200)
    assert c["boxes"] > 1
    with precise():
        assert f"{c['boxes']} boxes" in replayed(json.loads(json.dumps(c)), files["predator_prey.c"].encode())
    worst = observed(c, described(wide, exact=True), library(files), 8, seed=3)
    assert all(error <= bound for error, bound in zip(worst, c["bound"], strict=True))


OSCILLATOR = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\norder: 2\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hamiltonian: p**2/2 + q**2/2\nnoise: {kick: {hamiltonian: q, amplitude: 0.1}}\n", "noise"),
        ("hamiltonian: p**2/2 + q**2/2\nreal: float\n", "double precision"),
    ],
)
def test_systems_that_certificates_do_not_cover_are_refused(text: str, words: str) -> None:
    compilation = compile_anew(OSCILLATOR + text)
    with pytest.raises(SpecError, match=words):
        problem_of(compilation, "", 0.1, {}, [0.1, 0.2], [[0, 1], [0, 1]], [0, 0], 1.0, math.inf)


def test_coefficients_of_series_fall_as_the_rest_assumes() -> None:
    for name in SERIES:
        sizes = [abs(float(c)) for c in COEFFICIENTS[name]]
        assert all(size <= 2.0 ** (1 - n) for n, size in enumerate(sizes)), name
        # The coefficients of the other functions decrease like inverse factorials. Those of phi decrease like powers of
        # 1/(4π²), since its nearest pole is 4π².
        if not name.startswith("phi"):
            assert sizes[TERMS - 2] + sizes[TERMS - 1] < 2.0**-TERMS


@pytest.mark.parametrize("name", sorted(LIBM))
def test_functions_and_derivatives_of_libm(name: str) -> None:
    f, slope = LIBM[name]
    for x in (0.3, 0.9, 1.7):
        assert float(f(arb(x))) == pytest.approx(getattr(math, name)(x), rel=1e-15)
        assert float((f(arb(x + 1e-6)) - f(arb(x - 1e-6))) / 2e-6) == pytest.approx(float(slope(arb(x))), rel=1e-8)


def test_bounds_of_random_expressions_hold_for_every_value() -> None:
    """Random sequences of operations in double precision: the errors stay within the bound, and some come near it."""
    draw, most = random.Random(7), 0.0
    apply: dict[str, Callable[..., float]] = {
        "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
        "sin": math.sin, "neg": lambda a: -a,
    }  # fmt: skip
    for _ in range(40):
        starts = [draw.uniform(0.5, 2) for _ in range(3)]
        operations: list[list[Any]] = [["start", i] for i in range(3)]
        floats = list(starts)
        for _ in range(25):
            op = draw.choice(list(apply))
            operands = [draw.randrange(len(floats)) for _ in range(1 if op in ("sin", "neg") else 2)]
            if any(abs(floats[i]) > 1e6 or abs(floats[i]) < 1e-3 for i in operands):
                continue
            operations.append([op, *operands])
            floats.append(apply[op](*(floats[i] for i in operands)))
        with precise():
            boxes = [arb(s).union(arb(s * 1.001)) for s in starts]
            try:
                _, bounds = Evaluation({"ulps": 1.0}, operations, {"start": boxes}).outputs([len(operations) - 1], {})
            except RefusedError:
                continue
            exact = Evaluation({"ulps": 1.0}, operations, {"start": [arb(s) for s in starts]}, exact=True).x[-1]
            error, bound = abs(arb(floats[-1]) - exact), bounds[0, 0]
        assert error <= bound
        most = max(most, float(error / bound)) if bound > 0 else most
    assert most > 0.02


def test_derivatives_are_limits_of_differences() -> None:
    """The derivatives of each operation by each of its operands agree with difference quotients."""
    operations = [["u", 0], ["u", 1], ["mul", 0, 1], ["div", 0, 1], ["sub", 2, 3], ["mul", 0, 0], ["neg", 5],
                  ["add", 4, 6], ["exp", 7], ["add", 1, 0], ["div", 8, 9]]  # fmt: skip

    def run(x: Any, y: Any) -> Evaluation:
        return Evaluation({"ulps": 1.0}, operations, {"u": [arb(x), arb(y)]}, exact=True)

    with precise():
        slopes, h = run("0.7", "1.3").outputs([10], {"u": 2})[2], arb("1e-9")
        by_a = (run(arb("0.7") + h, "1.3").x[-1] - run(arb("0.7") - h, "1.3").x[-1]) / (2 * h)
        by_b = (run("0.7", arb("1.3") + h).x[-1] - run("0.7", arb("1.3") - h).x[-1]) / (2 * h)
        assert abs(slopes[0, 0] - by_a) < 1e-12
        assert abs(slopes[0, 1] - by_b) < 1e-12


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("name", ["pendulum_euler", "satellite_wheels"])
def test_operations_in_double_precision_have_the_bits_of_the_c(name: str) -> None:
    """The list of operations in a certificate, executed in double precision, gives the bits of the C. This holds for
    steps without iterations, if the C is compiled without fused multiply-add.
    """
    c, files = certificate(name)
    (only,) = c["stages"]
    n, middle = len(c["domain"]), [(a + b) / 2 for a, b in c["domain"]]
    values: list[float] = []
    apply: dict[str, Callable[..., float]] = {
        "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
        "neg": lambda a: -a,
    }  # fmt: skip
    for op, *a in only["operations"]:
        if op in ("number", "exact"):
            values.append(a[0])
        elif op == "constant":
            values.append(c[a[0]] if len(a) == 1 else c[a[0]][a[1]])
        elif op in ("x", "start"):
            values.append(middle[a[0]])
        elif op == "carry":
            values.append(0.0)
        elif op in c["series"]:
            values.append(polynomial_value(c["series"][op], values[a[0]]))
        else:
            values.append((apply[op] if op in apply else getattr(math, op))(*(values[i] for i in a)))
    change = [values[k] for k in only["change"]]
    expected = [(x + d, d - ((x + d) - x)) for x, d in zip(middle, change, strict=True)]
    state = _after(c, library(files), middle, 1)[0]
    assert [x for x, _ in expected] == state[0][:n]


def polynomial_value(series: dict[str, Any], s: float) -> float:
    assert abs(s) < series["radius"]
    values: list[float] = []
    for op, *a in series["operations"]:
        operands = [values[i] for i in a] if op not in ("s", "number") else []
        values.append(
            s if op == "s" else a[0] if op == "number" else -operands[0] if op == "neg"
            else operands[0] + operands[1] if op == "add" else operands[0] - operands[1] if op == "sub"
            else operands[0] * operands[1]
        )  # fmt: skip
    return values[-1]


def test_truncation_of_a_polynomial_counts() -> None:
    """If cos(√s) is replaced by two terms of its series, the bound contains the third term, and little more."""
    polynomial = {
        "name": "cosroot", "radius": 1.0, "beyond": False,
        "operations": [["s", 0], ["number", -0.5], ["mul", 1, 0], ["number", 1.0], ["add", 3, 2]],
    }  # fmt: skip
    with precise():
        c = {"ulps": 1.0, "carry": 1.01, "series": {"series:cosroot": polynomial}}
        run = Evaluation(c, [["start", 0], ["series:cosroot", 0]], {"start": [arb("0.5")]})
        error = run.outputs([1], {})[1][0, 0]
        assert math.cos(math.sqrt(0.5)) - 0.75 <= float(error) < 1.1 * 0.5**2 / 24


def test_bound_covers_kernels_that_ignore_the_compensation_term() -> None:
    """The kernel computes the increment x − 1 without rounding error for x near 1. But it reads x without the
    compensation term (carry), while the exact map is taken at x + carry; the bound must contain this difference.
    """
    operations = [["x", 0], ["number", 1.0], ["sub", 0, 1]]
    c = {"series": {}, "ulps": 1.0, "carry": 1.01, "step": 1.0, "stages": [{"operations": operations, "change": [2]}]}
    with precise():
        (bound,), _ = step(c, [interval((1.0, 1.001))], arb(0), {"stages": [{}]})
        assert 2.0**-53 <= float(bound) < 1.1 * 2.0**-53


def test_errors_of_a_stage_reach_flows_of_the_next_stage() -> None:
    """The first stage gives q a large error. In the second stage a drift q += p is followed by a kick p −= 4q, which
    reads q as start + displacement. So the error of p must be four times that of q.
    """
    first = [["x", 0], ["number", 1e6], ["add", 0, 1], ["sub", 2, 1], ["number", 0.0]]
    drift = [["x", 1], ["carry", 0], ["add", 1, 0], ["start", 0], ["add", 3, 2]]
    kick = [["number", -4.0], ["mul", 4, 5], ["carry", 1], ["add", 7, 6]]
    stages = [{"operations": first, "change": [3, 4]}, {"operations": drift + kick, "change": [2, 8]}]
    c = {"series": {}, "ulps": 1.0, "carry": 1.01, "step": 1.0, "stages": stages}
    with precise():
        (of_q, of_p), _ = step(c, [interval((1.0, 1.1)), interval((1.0, 1.1))], arb(0), {"stages": [{}, {}]})
        assert float(of_q) > 1e-10
        assert float(of_p) > 3.99 * float(of_q)


def test_functions_of_libm_beyond_their_polynomials_are_covered() -> None:
    """The domain of the pendulum contains the angle 1, at which the C changes from a polynomial to the function of
    libm.
    """
    stated, files = problem("pendulum_euler")
    stated = dataclasses.replace(stated, domain=[[0.9, 1.3], [-0.1, 0.1]])
    c = json.loads(json.dumps(certified(stated, 4)))
    assert all(e <= b for e, b in zip(observed(c, c, library(files), 40), c["bound"], strict=True))


@pytest.mark.parametrize(("name", "motion"), [("rigid_body", "free rigid body"), ("kepler", "Kepler motion")])
def test_exact_flows_without_enclosures_are_refused_by_name(name: str, motion: str) -> None:
    spec = spec_of(name).overridden(scheme="splitting", order=4)
    with pytest.raises(SpecError, match=f"do not cover the exact flow of a {motion}"):
        problem_of_spec(spec)


def test_steps_with_a_corrector_are_those_of_a_run_of_one() -> None:
    spec = loads(CORRECTED)
    stated, files = problem_of_spec(spec)
    c = json.loads(json.dumps(certified(stated, 4)))
    assert len(c["stages"]) == 3
    pairs = list(zip(observed(c, c, library(files), 8), c["bound"], strict=True))
    assert all(error <= bound for error, bound in pairs)
    assert min(bound / error for error, bound in pairs if error > 0) < 12


NAMES = """
phigen: 1
name: names
coordinates: [await, p]
poisson: {canonical: {q: [await], p: [p]}}
parameters: {lambda: 1.5, int: 0.7, I: 0.3, v_int: 2}
hamiltonian: lambda*p**2/2 + int*await**2/8 + I*await + v_int*await*p/9
order: 2
runs: {one: {initial: [0.3, 0.2], step: 0.1, steps: 10}}
"""


@pytest.mark.parametrize("scheme", ["series", "splitting"])
def test_names_may_be_keywords_of_python_or_c(scheme: str) -> None:
    stated, files = problem_of_spec(loads(NAMES).overridden(scheme=scheme))
    c = json.loads(json.dumps(certified(stated, 4)))
    assert c["parameters"] == {"lambda": 1.5, "int": 0.7, "I": 0.3, "v_int": 2}
    assert all(
        error <= bound < 1e-14 for error, bound in zip(observed(c, c, library(files), 8), c["bound"], strict=True)
    )


@pytest.mark.parametrize("name", ["driven", "corrected"])
def test_splittings_with_gradients_have_the_same_bounds(name: str) -> None:
    text = {"driven": DRIVEN, "corrected": CORRECTED}[name]
    plain, _ = problem_of_spec(loads(text))
    stated, files = problem_of_spec(loads(f"{text}adjoint: true\n"))
    assert "tape" in stated.text
    c = json.loads(json.dumps(certified(stated, 4)))
    assert c["bound"] == certified(plain, 4)["bound"]
    assert all(error <= bound for error, bound in zip(observed(c, c, library(files), 8), c["bound"], strict=True))


CORRECTED = """
phigen: 1
name: corrected
coordinates: [x, y, px, py]
poisson: {canonical: {q: [x, y], p: [px, py]}}
parameters: {eps: {value: 0.001, small: true}}
hamiltonian: (px**2 + py**2)/2 + eps*cos(x)*cos(y)
scheme: splitting
order: 2
composition: wisdom-holman-5
runs: {one: {initial: [1, 0, 0, 1.1], step: 0.1, steps: 10}}
"""

DRIVEN = """
phigen: 1
name: driven
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q) + q*sin(t)/3
time: t
order: 4
scheme: splitting
runs: {one: {initial: [0.3, 0.2], step: 0.1, steps: 10}}
"""


def test_splittings_that_depend_on_the_time_are_within_the_bound() -> None:
    """The C calls two functions that compute a sine: that of libm for the time, and a polynomial for q."""
    stated, files = problem_of_spec(loads(DRIVEN))
    c = json.loads(json.dumps(certified(stated, 4)))
    operations = {op for op, *_ in c["stages"][0]["operations"]}
    assert {"sin", "series:sin", "t"} <= operations
    pairs = list(zip(observed(c, c, library(files), 8), c["bound"], strict=True))
    assert all(error <= bound for error, bound in pairs)
    assert min(bound / error for error, bound in pairs if error > 0) < 12


@pytest.mark.parametrize("seed", slow_but([12], of=(2, 12, 15)))
def test_steps_of_random_systems_are_within_the_bound(seed: int) -> None:
    """Random systems with splittings, Gauss collocation and Newton's method."""
    stated, files = random_problem(seed)
    c = json.loads(json.dumps(certified(stated, 4)))
    worst = observed(c, described(stated, exact=True), library(files), 4)
    assert all(error <= bound for error, bound in zip(worst, c["bound"], strict=True))


def random_problem(seed: int) -> tuple[StepProblem, dict[str, str]]:
    system = draw_ordinary(seed)
    compilation = compile_spec(loads(system.text), profile="small")
    files = emit(compilation.program, "c", "phigen certify")
    parameters = {name: float(value) for name, (value, _) in system.parameters.items()}
    domain, span = [[v - 1e-3, v + 1e-3] for v in system.start], [0.0, 0.5 * system.timed]
    text = files[f"{compilation.program.name}.c"]
    return problem_of(compilation, text, 0.02, parameters, system.start, domain, span, 1.0, math.inf), files


def test_sweeps_that_do_not_contract_are_refused() -> None:
    stated, _ = random_problem(12)
    with pytest.raises(NoCertificateError, match="no certificate after 0 boxes"):
        certified(dataclasses.replace(stated, step=20.0), 1)


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
    assert any(op == ["constant", "step"] for op in c["stages"][0]["operations"])
    pairs = list(zip(observed(c, c, library(files), 8), c["bound"], strict=True))
    assert all(error <= bound for error, bound in pairs)
    assert max(bound / error for error, bound in pairs if error > 0) < 200


@pytest.mark.parametrize(
    "line",
    ["flow0(coef(), x, displacement, start);", "flow0(coef + nothing, x, displacement, start);", "coef += 2**9;"],
)
def test_schedules_with_other_statements_are_refused(line: str) -> None:
    statements = _block(iter([line]))
    with pytest.raises(RefusedError, match="whole numbers"):
        _called(statements, {"coef": 0, "ROW": 1}, [])


def test_schedules_of_endless_loops_are_refused() -> None:
    with pytest.raises(RefusedError):
        _block(iter(["for (int k = 0; k < 99999999999; ++k) {", "}"]))


def test_the_runtime_has_the_lines_that_the_proofs_assume() -> None:
    """docs/certify.md proves properties of these functions of the C runtime. If this test fails after a change, the
    proofs on that page must be checked again.
    """
    expect_phrases(
        "pendulum",
        {
            "attempt": ("((y[i] - s->x[i]) + displacement[i]) - s->carry[i]", "size * size *", "rest[i] -= slope"),
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
                "rate > fmax(STALLED, 1.5 * *usual)",
                "change <= NEARLY_ROUNDING",
            ),
            "change_of": (
                "(after[k][i] - before[k][i]) * (after[k][i] - before[k][i])",
                "if (k + 1 == PLAIN) sum[i] *= 1.0 / square",
                "return total(sum) / (double)NODES",
            ),
        },
    )
    expect_phrases(
        "guiding_centre",
        {
            "attempt": (
                "previous < NEARLY_SOLVED && size > SHRINKING * previous",
                "if (size <= SOLVED || stalled)",
                "p[i] -= residual[i]",
            ),
            "piece": (
                "fabs(start[i]) + fabs(change[i]) + LEAST_SHARE * norm",
                "if (small_terms >= 2 && holds(coef, p, end, slope)) return 1",
            ),
        },
    )


def expect_phrases(name: str, phrases: dict[str, tuple[str, ...]]) -> None:
    source = GeneratedC(problem(name)[1][f"{name}.c"], name)
    for function, texts in phrases.items():
        matched = source.function(function)
        assert matched
        assert all(text in " ".join(matched[1].split()) for text in texts), function


def test_a_rate_that_gauss_solvers_remember_is_above_the_one_assumed() -> None:
    _, files = problem("kowalevski_gauss")
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
