"""Coordinates and parameters may have any name, and titles any text."""

import ast
import keyword
import re
import subprocess
from itertools import pairwise

import numpy as np
import pytest
from support import COMMAND, TARGETS, compile_text, compiled, files, run, solver, tool, write

from phigen import resources
from phigen.compiler import emit
from phigen.scheme.steps import Explicit
from phigen.spec.names import ARGUMENTS, SPEC_FUNCTIONS
from phigen.symbolic.symbols import TEMPORARY, Symbol
from phigen.targets.c import phrases
from phigen.targets.header import is_edited, plain
from phigen.targets.names import Scope, identifiers
from phigen.targets.reserved import C_RESERVED, JAVASCRIPT_RESERVED, PYTHON_RESERVED, WINDOWS_MACROS

STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror"]

#: The headers that generated C includes, and all others that a program may include before the header of a solver.
OWN_HEADERS = ["float", "limits", "math", "stddef", "stdint", "string"]
_OTHERS = """assert complex ctype errno fenv inttypes iso646 locale setjmp signal stdalign stdarg stdatomic stdbool
stdio stdlib stdnoreturn tgmath threads time uchar wchar wctype"""
OTHER_HEADERS = _OTHERS.split()
NOT_OF_CPP = ("stdatomic", "tgmath", "threads")

DIALECTS = [
    *(("gcc", "c", standard) for standard in ("c99", "gnu17", "gnu2x")),
    *(("clang", "c", standard) for standard in ("c99", "gnu17", "gnu2x")),
    ("g++", "c++", "c++17"),
    ("g++", "c++", "gnu++20"),
    ("clang++", "c++", "gnu++20"),
]

_AWKWARD = """int double inline restrict _Bool _Complex bool class template this operator new namespace constexpr
co_await typeof lambda def None True import yield match type case self alignas and var let function enum arguments eval
await M_E M_PI M_PIl M_1_PI INT_MAX DBL_MANT_DIG MAXFLOAT linux unix I NULL NAN EDOM errno stdin SIGINT FP_ZERO
FE_INVALID PRId64 CHAR_BIT HUGE_VAL DECIMAL_DIG complex near far min max EOF SIZE_MAX FLT_RADIX INFINITY
__cplusplus __LINE__ __x _X __ _ __debug__ __init__ __proto__ v_X v__
gamma y0 index time main beta signgam
t1 t12 t_1 t1_ t2 u v w a b c d e i j k m n p q r s x y h coef work lane params gauge np parameters state sum size_t
step integrate hamiltonian casimirs DIM ORDER CASIMIRS _filled _sum _values np_ int_ params_ lambda_ I_ I__ out energy
p_x p_p_x phi0 _phi0 tuple list float_ self_ M_E_ x0 steps stride X0 N S O H E_ J alpha jacobian"""

#: Names of every kind that are reserved somewhere, and names that generated code uses itself.
AWKWARD = _AWKWARD.split()


def check_c(compilation, tmp_path):
    """Check that the C compiles without warnings as C99 and with GNU's macros, and its header after all others, also as
    C++.
    """
    name = compilation.program.name
    others = [h for h in OTHER_HEADERS if h not in NOT_OF_CPP]
    after = "".join(f"#include <{h}.h>\n" for h in others) + f'#include "{name}.h"\n'
    write(tmp_path, {**files(compilation, "c"), "after.c": after, "after.cpp": after})
    gcc, gpp = tool("gcc"), tool("g++")
    run([gcc, "-std=c99", *STRICT, "-fsyntax-only", f"{name}.c"], tmp_path)
    run([gcc, "-std=gnu17", *STRICT, "-fsyntax-only", f"{name}.c", "after.c"], tmp_path)
    run([gpp, "-std=gnu++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "after.cpp"], tmp_path)


def preprocessed(compiler, language, standard, headers, *options):
    """Return the output of the preprocessor for the headers."""
    text = "".join(f"#include <{h}.h>\n" for h in headers if language == "c" or h not in NOT_OF_CPP)
    command = [tool(compiler), "-x", language, f"-std={standard}", "-E", *options, "-"]
    return subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize(("compiler", "language", "standard"), DIALECTS)
def test_no_macro_of_the_standard_headers_is_an_identifier(compiler, language, standard):
    defined = preprocessed(compiler, language, standard, OWN_HEADERS + OTHER_HEADERS, "-dM")
    # A macro with parameters is not expanded without a parenthesis, and generated code puts none after names of the
    # model.
    macros = re.findall(r"^#define (\w+)(?!\S)", defined, re.MULTILINE)
    assert {"INT_MAX", "errno", "__STDC_HOSTED__"} < set(macros)
    assert [m for m in macros if m not in C_RESERVED] == []


def test_no_identifier_of_generated_c_is_a_macro_of_windows():
    """The whole solvers of the corpus, and the paragraphs of all others, have no identifier that windows.h defines."""
    root = resources.bundled_specs().parent
    texts = [path.read_text() for path in root.glob("generated/*/*.[ch]")]
    for path in root.glob("tests/golden/*.txt"):
        _, *sections = re.split(r"^==== (.*) ====$", path.read_text(), flags=re.MULTILINE)
        texts += [
            section for file, section in zip(sections[::2], sections[1::2], strict=True) if file.endswith((".c", ".h"))
        ]
    text = "\n".join(texts)
    identifiers_of_c = set(
        re.findall(r"[A-Za-z_]\w*", re.sub(r"/\*.*?\*/|//[^\n]*|\"[^\"\n]*\"", "", text, flags=re.DOTALL))
    )
    assert {"full_range", "size_t", "rigid_body_step"} < identifiers_of_c
    assert identifiers_of_c & WINDOWS_MACROS == set()


@pytest.mark.parametrize("standard", ["c99", "gnu17"])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_what_is_not_reserved_can_stand_in_c(compiler, standard, tmp_path):
    """All other identifiers of the headers are tried as a member and as a variable, with warnings about shadowing."""
    words = set(re.findall(r"[A-Za-z_]\w*", preprocessed(compiler, "c", standard, OWN_HEADERS + OTHER_HEADERS, "-P")))
    names = sorted(w for w in words if w not in C_RESERVED)
    assert {"lgamma", "abs", "div", "clock"} < set(names)
    text = "".join(f"#include <{h}.h>\n" for h in OWN_HEADERS)
    text += "struct all {\n" + "".join(f"    double {n};\n" for n in names) + "};\nextern struct all every;\n"
    for k, n in enumerate(names):
        text += f"double f{k}(double a);\ndouble f{k}(double a) {{ const double {n} = a; return {n} * every.{n}; }}\n"
    write(tmp_path, {"all.c": text})
    run([tool(compiler), f"-std={standard}", *STRICT, "-fsyntax-only", "all.c"], tmp_path)


def test_what_is_not_reserved_can_stand_in_python():
    changed = identifiers([*keyword.kwlist, *keyword.softkwlist, *AWKWARD], PYTHON_RESERVED)
    for identifier in changed.values():
        exec(f"def function(a):\n    {identifier} = a\n    return {identifier}", {})


def test_what_is_not_reserved_can_stand_in_javascript(tmp_path):
    changed = identifiers([*keyword.kwlist, *AWKWARD, *JAVASCRIPT_RESERVED.words], JAVASCRIPT_RESERVED)
    assert changed["gamma"] == "gamma"
    write(tmp_path, {"all.mjs": "".join(f"{{ const {i} = 1; }}\n" for i in changed.values())})
    run([tool("node"), "--check", "all.mjs"], tmp_path)


def quoted(names):
    """Return a YAML list of names."""
    return "[" + ", ".join(f"'{n}'" for n in names) + "]"


def agree(compilation, x0, parameters=None):
    """Check that C and NumPy make the same step, and compute the same vector field."""
    solvers = [solver(compilation, target) for target in TARGETS]
    steps = [s.step(x0, h=0.01, parameters=parameters or {}) for s in solvers]
    fields = [s.vector_field(x0, parameters=parameters or {}) for s in solvers]
    np.testing.assert_allclose(steps[0], steps[1], rtol=1e-14)
    np.testing.assert_allclose(fields[0], fields[1], rtol=1e-14)
    np.testing.assert_allclose((steps[0] - x0) / 0.01, fields[0], rtol=0.2, atol=0.2)
    return steps[0], fields[0]


def chunks(energy, size=60):
    """Return the sum in parts that fit into lines of a spec."""
    terms = energy.split(" + ")
    return [" + ".join(terms[i : i + size]) for i in range(0, len(terms), size)]


@pytest.mark.slow
def test_awkward_names_can_be_coordinates_of_an_explicit_system(tmp_path):
    names = AWKWARD[len(AWKWARD) % 2 :]
    q, p = names[::2], names[1::2]
    energy = " + ".join([f"{b}**2/{k + 1}" for k, b in enumerate(p)] + [f"{a}**4/{k + 2}" for k, a in enumerate(q)])
    text = f"coordinates: {quoted(names)}\npoisson: {{canonical: {{q: {quoted(q)}, p: {quoted(p)}}}}}\n"
    definitions = "definitions:\n" + "".join(f"  part{i}: {e}\n" for i, e in enumerate(chunks(energy)))
    energy = " + ".join(f"part{i}" for i in range(len(chunks(energy))))
    text += f"{definitions}hamiltonian: {energy}\nbirealisation: canonical-euler\norder: 1\n"
    compilation = compile_text(text)
    assert isinstance(compilation.program.step, Explicit)
    check_c(compilation, tmp_path)
    agree(compilation, np.linspace(0.5, 1.5, len(names)))


@pytest.mark.slow
def test_awkward_names_can_be_coordinates_of_an_implicit_system(tmp_path):
    names = ["x", "h", "p", "coef", "params", "t1", "M_E", "_X", "np", "__debug__"]
    rows = [[i - j if (i + j) % 2 else 0 for j in range(len(names))] for i in range(len(names))]
    energy = " + ".join(f"{n}**2*{m}/3 + {n}/{k + 2}" for k, (n, m) in enumerate(pairwise(names)))
    compilation = compile_text(
        f"coordinates: {quoted(names)}\npoisson: {{matrix: {rows}}}\nhamiltonian: {energy}\norder: 2\n"
    )
    check_c(compilation, tmp_path)
    agree(compilation, np.linspace(0.1, 0.2, len(names)))


def test_every_awkward_name_can_be_a_parameter(tmp_path):
    names = [n for n in AWKWARD if n not in (*ARGUMENTS, *SPEC_FUNCTIONS)]
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


def macros_of_solvers(name):
    """Return the phrases and macros of the runtime in C, and the possible names of macros and include guards of a
    solver with this name.
    """
    runtime = (resources.templates() / "c/runtime").glob("*.[ch]")
    defined = {m for file in runtime for m in re.findall(r"#define (PHI_\w+)", file.read_text("utf-8"))}
    every = {m for m in defined | phrases.names() if not m.startswith("PHI_FILE_")}
    of_solver = {m.replace("PHI_", f"{name}_") for m in every}
    return sorted(
        every | of_solver | {f"{name}_DIM", f"{name}_TOLERANCE", f"{name.upper()}_H", f"{name.upper()}_DEVICE_H"}
    )


@pytest.mark.slow
def test_parameters_may_have_the_names_of_all_macros_of_the_runtime(tmp_path):
    names = [*macros_of_solvers("t"), "phi_init", "t_init", "t_cos_lane", "t_matrix_exponential"]
    assert {"PHI_COPY", "t_COPY", "t_RIDGE"} < set(names)
    terms = [f"{n}*u1/{k + 3}" for k, n in enumerate(names)]
    parts = chunks(" + ".join(terms))
    definitions = "definitions:\n" + "".join(f"  part{i}: {e}\n" for i, e in enumerate(parts))
    declared = "".join(f"  {n}: {{value: {k + 1}e-5, description: '{n}, PHI_COPY'}}\n" for k, n in enumerate(names))
    compilation = compile_text(
        f"coordinates: [u1, u2]\nparameters:\n{declared}poisson: {{matrix: [[0, 1], [-1, 0]]}}\n{definitions}"
        f"hamiltonian: u2**2*u1 + {' + '.join(f'part{i}' for i in range(len(parts)))}\norder: 2\n"
    )
    check_c(compilation, tmp_path)
    _, field = agree(compilation, np.array([0.3, 0.2]))
    expected = sum((k + 1) * 1e-5 / (k + 3) for k in range(len(names)))
    np.testing.assert_allclose(-field[1] - 0.04, expected, rtol=1e-12)


def test_coordinates_may_have_the_names_of_macros_and_functions_of_the_solver(tmp_path):
    """Coordinates are local variables of functions that call other functions of the solver."""
    compilation = compile_text(
        "coordinates: [PHI_COPY, t_versin, T_H, t_DIM]\nparameters: {PHI_UNROLL: 2, phi_x: 3, t_TOLERANCE: 1}\n"
        "poisson: {canonical: {q: [PHI_COPY, T_H], p: [t_versin, t_DIM]}}\norder: 2\nprofile: fast\n"
        "hamiltonian: t_versin**2/phi_x + t_DIM**2*t_TOLERANCE - PHI_UNROLL*cos(PHI_COPY) + T_H**2*t_versin\n"
    )
    check_c(compilation, tmp_path)
    agree(compilation, np.array([0.1, 0.2, 0.3, 0.4]))


def test_the_header_says_which_parameter_a_changed_member_is():
    compilation = compile_text(
        "coordinates: [q, p]\nparameters: {M_E: {value: 5.97, description: mass}, M_E_: 1, k: 2}\n"
        "poisson: {matrix: [[0, 1], [-1, 0]]}\nhamiltonian: M_E*k*q + M_E_*p\norder: 1\n"
    )
    header = " ".join(files(compilation, "c")["t.h"].split())
    assert "double M_E__; /* M_E: mass */" in header
    assert "double M_E_; /* default 1.0 */" in header
    assert "double k; /* default 2.0 */" in header


def test_names_may_be_those_of_momenta_and_of_functions_that_are_called(tmp_path):
    """Generated code has the name `p_x` for ∂S/∂x, which many use for a momentum, and calls `fabs` for abs."""
    compilation = compile_text(
        "coordinates: [x, p_x, fabs, pow]\nparameters: {k: 2}\n"
        "poisson: {canonical: {q: [x, fabs], p: [p_x, pow]}}\n"
        "hamiltonian: p_x**2*x + pow**3*fabs + x**2*fabs + abs(x - fabs)**k\norder: 2\n"
    )
    assert {"fabs(", "pow("} < set(re.findall(r"\w+\(", files(compilation, "c")["t.c"]))
    check_c(compilation, tmp_path)
    agree(compilation, np.array([0.3, 0.2, 0.5, 0.1]))


def test_no_parameter_has_the_name_of_an_argument_of_the_generated_module():
    tree = ast.parse(files(compiled("rigid_body"), "numpy")["rigid_body.py"])
    offered = [n for n in tree.body if isinstance(n, ast.FunctionDef) and not n.name.startswith("_") and n.args.kwarg]
    arguments = {a.arg for function in offered for a in function.args.args}
    assert "gauge" in arguments
    assert arguments <= ARGUMENTS


def test_names_that_can_stand_stand_and_others_change_as_documented():
    names = ["int", "int_", "k", "_X", "v_X", "M_1", "M_E", "SIGMA", "E1", "gamma"]
    safe_names = identifiers(names, C_RESERVED)
    changed = {"int": "int__", "_X": "v_X_", "M_E": "M_E_"}
    assert list(safe_names.items()) == [(n, changed.get(n, n)) for n in names]


def test_scope_gives_distinct_identifiers_that_are_not_reserved():
    scope = Scope(C_RESERVED | ["x"])
    temporaries = [Symbol(TEMPORARY, 1), Symbol(TEMPORARY, 2)]
    names = ["int", "int_", "t1", *temporaries, "x", "x_", Symbol("a", "b"), "a_b", "I", "_X", "v_X"]
    chosen_names = [scope[n] for n in names]
    assert len(set(chosen_names)) == len(names)
    assert not [g for g in chosen_names if g in C_RESERVED or g == "x"]
    assert all(re.fullmatch(r"[A-Za-z_]\w*", g) for g in chosen_names)
    assert scope[Symbol(TEMPORARY, 1)] == "t1"
    assert [scope[n] for n in names] == chosen_names


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


def test_titles_and_descriptions_are_harmless(tmp_path):
    """Without comments, the code equals that of a spec without title and descriptions; changes of its text are still
    detected.
    """
    bare = titled("")
    code = without_comments(bare, tmp_path)
    for title in TITLES:
        compilation = titled(title)
        assert without_comments(compilation, tmp_path) == code
        for target in TARGETS:
            for text in emit(compilation.program, target, COMMAND).values():
                assert not is_edited(text)
                assert is_edited(text + "\n")


def titled(title):
    """Return a small system with this title, and with a parameter that has it as description."""
    escaped = title.replace("'", "''")
    return compile_text(
        f"title: '{escaped}'\ncoordinates: [q, p]\nparameters: {{k: {{value: 1, description: '{escaped}'}}}}\n"
        "poisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: k*q**2 + p**2\norder: 1\n"
    )


def without_comments(compilation, folder):
    """Return the tokens of the C without comments and with trigraphs replaced, and the syntax tree of the Python."""
    sources = files(compilation, "c") | files(compilation, "numpy")
    texts = {name: re.sub(r"[0-9a-f]{64}", "", text) for name, text in sources.items()}
    write(folder, texts)
    command = [tool("gcc"), "-std=c99", "-Wall", "-Werror", "-E", "-P", "t.c"]
    tree = ast.parse(texts["t.py"])
    docstrings = [n for n in ast.walk(tree) if isinstance(n, ast.Module | ast.FunctionDef) and ast.get_docstring(n)]
    for node in docstrings:
        node.body.pop(0)
    return run(command, folder), ast.dump(tree)


def test_plain_text_has_no_marks_of_any_language():
    assert plain("a */ b /* c ??/ d \\ e\nf\tg\u202eh") == "a * / b / * c ? ?/ d / e f g h"
