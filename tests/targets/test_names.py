"""Coordinates and parameters may be called anything; titles may contain anything."""

import keyword
import re
import shutil
import subprocess
from itertools import pairwise

import numpy as np
import pytest
from support import COMMAND, TARGETS, compile_text, files, solver

from phigen.compiler import emit
from phigen.scheme.steps import Explicit
from phigen.spec.names import ARGUMENTS, SPEC_FUNCTIONS
from phigen.symbolic.symbols import TEMPORARY, Symbol
from phigen.targets.header import is_edited, plain
from phigen.targets.names import C_RESERVED, PYTHON_RESERVED, Scope

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror"]

#: Names that the templates use for variables, arguments and functions of their own.
_LOCALS = """s h x x0 y a b c d i j k m n p q t u v w t1 t2 t_1 w0 c0 h_ np coef state point work params parameters
delta
increment displacement jacobian increment_jacobian matrix side solution reciprocal size norm ratio factor pivot best
swap status worst member members steps stride out energy params_ int_ lambda_ NAME t1_ change total added carry guess
lag lags offset rows before least previous growth remaining regular iteration correction scale following rest good
failed memory done shape again open_ value values _values _filled _sum __init__ beta gamma S N O H E_ J alpha tuple
list dict len range isinstance array float linux unix I p_x p_p_x phi0 _phi0 slope mean piece"""
LOCALS = _LOCALS.split()

#: Functions of specs cannot be names of the same spec.
AWKWARD = sorted(
    {*C_RESERVED, *PYTHON_RESERVED, *LOCALS, *keyword.kwlist, *keyword.softkwlist} - {"E", "pi", *SPEC_FUNCTIONS}
)


def check_c(compilation, tmp_path):
    """The C files compile without a warning, and the header as C++ (where `linux` is a macro)."""
    name = compilation.program.name
    for file, text in files(compilation, "c").items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    commands = [
        ["gcc", *STRICT, "-fsyntax-only", f"{name}.c"],
        ["g++", "-std=gnu++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c++", f"{name}.h"],
    ]
    for command in commands:
        if shutil.which(command[0]) is None:
            pytest.skip(f"{command[0]} is not installed")
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:2000]


def quoted(names):
    """A YAML list of names."""
    return "[" + ", ".join(f"'{n}'" for n in names) + "]"


def agree(compilation, x0, parameters=None):
    """C and NumPy make the same step, and compute the same vector field."""
    solvers = [solver(compilation, target) for target in TARGETS]
    steps = [s.step(x0, h=0.01, parameters=parameters or {}) for s in solvers]
    fields = [s.vector_field(x0, parameters=parameters or {}) for s in solvers]
    np.testing.assert_allclose(steps[0], steps[1], rtol=1e-14)
    np.testing.assert_allclose(fields[0], fields[1], rtol=1e-14)
    np.testing.assert_allclose((steps[0] - x0) / 0.01, fields[0], rtol=0.2, atol=0.2)
    return steps[0], fields[0]


@pytest.mark.parametrize("start", [0, 150])
def test_awkward_names_can_be_coordinates_of_an_explicit_system(start, tmp_path):
    names = AWKWARD[start : start + 200]
    names = names[len(names) % 2 :]
    half = len(names) // 2
    q, p = names[:half], names[half:]
    energy = " + ".join([f"{b}**2/{k + 1}" for k, b in enumerate(p)] + [f"{a}**4/{k + 2}" for k, a in enumerate(q)])
    text = f"coordinates: {quoted(names)}\npoisson: {{canonical: {{q: {quoted(q)}, p: {quoted(p)}}}}}\n"
    definitions = "definitions:\n" + "".join(f"  part{i}: {e}\n" for i, e in enumerate(chunks(energy)))
    energy = " + ".join(f"part{i}" for i in range(len(chunks(energy))))
    text += f"{definitions}hamiltonian: {energy}\nbirealisation: canonical-euler\norder: 1\n"
    compilation = compile_text(text)
    assert isinstance(compilation.program.step, Explicit)
    check_c(compilation, tmp_path)
    agree(compilation, np.linspace(0.5, 1.5, len(names)))


def chunks(energy, size=60):
    """The sum in pieces that fit into one line of a spec."""
    terms = energy.split(" + ")
    return [" + ".join(terms[i : i + size]) for i in range(0, len(terms), size)]


@pytest.mark.parametrize("start", range(0, len(LOCALS), 12))
def test_awkward_names_can_be_coordinates_of_an_implicit_system(start, tmp_path):
    names = [n for n in LOCALS[start : start + 12] if n != "E"]
    rows = [[i - j if (i + j) % 2 else 0 for j in range(len(names))] for i in range(len(names))]
    energy = " + ".join(f"{n}**2*{m}/3 + {n}/{k + 2}" for k, (n, m) in enumerate(pairwise(names)))
    compilation = compile_text(
        f"coordinates: {quoted(names)}\npoisson: {{matrix: {rows}}}\nhamiltonian: {energy}\norder: 2\n"
    )
    check_c(compilation, tmp_path)
    agree(compilation, np.linspace(0.1, 0.2, len(names)))


def test_every_awkward_name_can_be_a_parameter(tmp_path):
    names = [n for n in AWKWARD if n not in ARGUMENTS and n not in ("u1", "u2")]
    terms = " + ".join(f"{n}*u1/{k + 3}" for k, n in enumerate(names))
    parts = chunks(terms)
    definitions = "definitions:\n" + "".join(f"  part{i}: {e}\n" for i, e in enumerate(parts))
    declared = "".join(f"  '{n}': {k + 1}e-3\n" for k, n in enumerate(names))
    compilation = compile_text(
        f"coordinates: [u1, u2]\nparameters:\n{declared}poisson: {{matrix: [[0, 1], [-1, 0]]}}\n{definitions}"
        f"hamiltonian: u2**2*u1 + {' + '.join(f'part{i}' for i in range(len(parts)))}\norder: 2\n"
    )
    check_c(compilation, tmp_path)
    _, field = agree(compilation, np.array([0.3, 0.2]))
    expected = sum((k + 1) * 1e-3 / (k + 3) for k in range(len(names)))
    np.testing.assert_allclose(-field[1] - 0.04, expected, rtol=1e-12)
    changed = {names[7]: 100.0}
    _, moved = agree(compilation, np.array([0.3, 0.2]), changed)
    np.testing.assert_allclose(field[1] - moved[1], (100 - 8e-3) / 10, rtol=1e-12)


def test_a_coordinate_may_be_called_like_the_momentum_of_another(tmp_path):
    """The generated code names ∂S/∂x `p_x`, which is what many call the momentum."""
    compilation = compile_text(
        "coordinates: [x, p_x, p_p_x, h]\npoisson: {canonical: {q: [x, p_p_x], p: [p_x, h]}}\n"
        "hamiltonian: p_x**2*x + p_p_x**3*h + x**2*p_p_x\norder: 4\n"
    )
    check_c(compilation, tmp_path)
    agree(compilation, np.array([0.3, 0.2, 0.5, 0.1]))


@pytest.mark.parametrize("names", [["int", "int_"], ["t1", "t1_"], ["I", "I_", "I__"]], ids=str)
@pytest.mark.parametrize("role", ["coordinates", "parameters"])
def test_names_that_differ_by_the_underscore_that_saves_them_stay_apart(names, role, tmp_path):
    coordinates = names if role == "coordinates" else ["u", "v", "w"]
    declared = "" if role == "coordinates" else "parameters: {" + ", ".join(f"'{n}': 2" for n in names) + "}\n"
    energy = " + ".join(f"{n}*{c}**{k + 2}" for k, (n, c) in enumerate(zip(names, coordinates, strict=False)))
    rows = [[i - j if (i + j) % 2 else 0 for j in range(len(coordinates))] for i in range(len(coordinates))]
    compilation = compile_text(
        f"coordinates: {quoted(coordinates)}\n{declared}poisson: {{matrix: {rows}}}\nhamiltonian: {energy}\norder: 2\n"
    )
    check_c(compilation, tmp_path)
    parameters = {n: 1.0 + k for k, n in enumerate(names)} if declared else {}
    agree(compilation, np.linspace(0.1, 0.2, len(coordinates)), parameters)


def test_scope_gives_distinct_identifiers_that_are_not_reserved():
    scope = Scope(C_RESERVED)
    names = ["int", "int_", "t1", Symbol(TEMPORARY, 1), Symbol(TEMPORARY, 2), "x", "x_", Symbol("a", "b"), "a_b", "I"]
    given = [scope[n] for n in names]
    assert len(set(given)) == len(names)
    assert not set(given) & C_RESERVED
    assert all(re.fullmatch(r"[A-Za-z_]\w*", g) for g in given)
    assert scope[Symbol(TEMPORARY, 1)] == "t1"
    assert [scope[n] for n in names] == given


TITLES = [
    "ends the comment */ int evil; /*",
    "trigraph ??/ and ??=",
    "ends with a backslash \\",
    "quotes \" and ' and `",
    "triple \"\"\" quotes '''",
    "line\\nbreak",
    "braces {{ 7*7 }} {% for x in y %} {# comment #}",
    "percent %s %n and format {0} {x}",
    "Hénon–Heiles, ẋ = π∇H, 東京",
    "// a comment in a comment",
    '*/ """ \\',
]


@pytest.mark.parametrize("title", TITLES)
def test_titles_and_descriptions_are_harmless(title, tmp_path):
    escaped = title.replace("'", "''")
    compilation = compile_text(
        f"title: '{escaped}'\ncoordinates: [q, p]\nparameters: {{k: {{value: 1, description: '{escaped}'}}}}\n"
        "poisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: k*q**2 + p**2\norder: 2\n"
    )
    check_c(compilation, tmp_path)
    agree(compilation, np.array([0.3, 0.2]))
    for target in TARGETS:
        for text in emit(compilation.program, target, COMMAND).values():
            assert "49" not in text.split("DO NOT EDIT")[0].split("sha256")[0]
            assert not is_edited(text)
            assert is_edited(text + "\n")


def test_plain_text_has_no_marks_of_any_language():
    assert plain("a */ b /* c ??/ d \\ e\nf\tg\u202eh") == "a * / b / * c ? ?/ d / e f g h"
