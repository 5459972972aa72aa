"""The C runtime in templates/c/runtime, compiled with a pendulum that is written by hand, without the generator."""

import re
from math import sin
from pathlib import Path

import pytest
from support import run, tool, write

from phigen import resources
from phigen.scheme.policies import POLICIES
from phigen.targets.c import phrases, states
from phigen.targets.c.files import CALLS, CONDITIONS, guard
from phigen.targets.c.layout import WIDTH, fitted
from phigen.targets.policies import C

BY_HAND = Path(__file__).with_name("pendulum_by_hand")
CHAIN = Path(__file__).with_name("chain_by_hand")
RUNTIME = resources.templates() / "c/runtime"
LEFT_OUT = ["-I.", "-include", "left_out.h"]
INCLUDED = [f"-I{BY_HAND}", f"-I{RUNTIME}", *LEFT_OUT]
WARNINGS = ("all", "extra", "pedantic", "conversion", "double-promotion", "shadow", "no-unused-function", "error")
OF_LATTICES = ("lattice", "rows", "graph")
#: Prefix of files of the FMU layer, which is printed for one model; tests/fmu compile it with the same warnings.
OF_MODELS = ("fmu",)
#: Prefix of files for devices; tests/devices compile them in their languages.
OF_DEVICES = ("device",)
STRICT = ["-std=c99", *(f"-W{warning}" for warning in WARNINGS)]

#: Options of the sanitisers. -O1 would take four times as long, and checks of pointer arithmetic a third more;
#: tests/generated/test_compilers.py has these checks.
SANITISED = ["-O0", "-fsanitize=address,undefined", "-fno-sanitize=pointer-overflow", "-fno-sanitize-recover"]

IMPLICIT = [
    ("NEWTON",),
    ("NEWTON", "FAST"),
    ("NEWTON", "TANGENT"),
    ("NEWTON", "COMPOSED"),
    ("NEWTON", "COMPOSED", "FAST"),
    ("NEWTON", "COMPOSED", "ADJOINT", "TANGENT"),
    ("NEWTON", "FAST", "ADJOINT"),
]
IMPLICIT += [("PATH", *more) for _, *more in IMPLICIT]
IMPLICIT += [("NEWTON", "GAUGE"), ("NEWTON", "GAUGE", "FAST", "ADJOINT"), ("GAUSS", "ADJOINT")]
EXPLICIT = [(kind, *more) for kind in ("EXPLICIT", "SPLITTING") for more in ((), ("FAST",), ("TANGENT",), ("ADJOINT",))]
EXPLICIT += [(kind, "FAST", "ADJOINT") for kind in ("EXPLICIT", "SPLITTING")]


@pytest.fixture(autouse=True)
def printed(tmp_path):
    """Return a folder with headers that replace those of the emitter: constants, phrases, files that are left out."""
    sizes = ("DIFFERENCES", "DIRECTIONS")
    texts = {name: C.text(policy, sizes) for name, policy in POLICIES.items()}
    lines = ['#include "declarations.h"']
    for file, condition in CONDITIONS.items():
        negated = re.sub(r"\b([A-Z])", r"PHI_\1", condition)
        lines.append(f"#if !({negated}) && !defined({guard(file)})\n#define {guard(file)}\n#endif")
    for function, condition in CALLS.items():
        negated = re.sub(r"\b([A-Z])", r"PHI_\1", condition)
        lines.append(f"#if !({negated})\n#define {function}(...) ((void)0)\n#endif")
    write(tmp_path, {file: states.header(file) + "\n" for file in states.PARTS})
    texts |= {"left_out": "\n".join(lines), "phrases": phrases.header()}
    write(
        tmp_path, {f"{name}.h": f"#ifndef {name}_H\n#define {name}_H\n{text}\n#endif\n" for name, text in texts.items()}
    )


def defined(switches):
    """Return the compiler options for switches."""
    return [f"-DPHI_{switch}=1" for switch in switches]


#: Sets of switches: each switch with one kind of step that has code for it, and all compatible ones together.
#: tests/generated/test_compilers.py checks the fast code of implicit steps.
FEW = [(kind, *more) for kind in ("NEWTON", "PATH") for more in ((), ("COMPOSED", "ADJOINT", "TANGENT"))]
FEW += [("NEWTON", "GAUGE"), ("NEWTON", "FAST", "ADJOINT"), ("EXPLICIT",), ("EXPLICIT", "FAST", "ADJOINT")]
FEW += [("EXPLICIT", "ADJOINT"), ("SPLITTING", "FAST", "ADJOINT"), ("SPLITTING", "TANGENT"), ("GAUSS", "ADJOINT")]


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    "switches",
    [pytest.param(s, marks=() if s in FEW else pytest.mark.slow, id=" ".join(s)) for s in [*IMPLICIT, *EXPLICIT]],
)
def test_pendulum_by_hand_moves_as_it_should(switches, tmp_path):
    """Check with the sanitisers: energy, time, reversibility, steps in one call and one by one, failures, the tangent
    map (see main.c).
    """
    main = [*defined(switches), *INCLUDED, BY_HAND / "main.c", "-o", "main", "-lm"]
    run([tool("gcc"), *STRICT, *SANITISED, *main], tmp_path)
    printed = [float(v) for v in run([tmp_path / "main"], tmp_path).split()]
    if switches in IMPLICIT:
        assert printed == pytest.approx(midpoint_rule(), abs=1e-3 if "COMPOSED" in switches else 1e-12)


def midpoint_rule(steps=10, h=0.05, g=1.5):
    """Return q and p after steps of the implicit midpoint rule, solved by fixed-point iteration."""
    q, p = 1.0, 0.2
    for _ in range(steps):
        a, b = q, p
        for _ in range(60):
            a, b = q + h / 2 * b, p - h / 2 * g * sin(a)
        q, p = 2 * a - q, 2 * b - p
    return [q, p]


@pytest.mark.parametrize(
    "switches", [("NEWTON", "COMPOSED", "FAST"), ("PATH", "FAST"), ("SPLITTING", "FAST")], ids=" ".join
)
def test_runtime_compiles_without_a_warning_by_clang(switches, tmp_path):
    run([tool("clang"), *STRICT, "-fsyntax-only", *defined(switches), *INCLUDED, BY_HAND / "main.c"], tmp_path)


def test_pendula_of_a_lattice_by_hand_move_as_they_should(tmp_path):
    """Check with the sanitisers: energy, reversibility, the field, failures, sizes that are not allowed (see
    main.c).
    """
    main = ["-I", CHAIN, "-I", RUNTIME, *LEFT_OUT, CHAIN / "main.c", "-o", "main", "-lm"]
    run([tool("gcc"), *STRICT, *SANITISED, *main], tmp_path)
    assert run([tmp_path / "main"], tmp_path) == "ok\n"


@pytest.mark.parametrize("flags", [["-O2"], ["-O2", "-fopenmp=libgomp"]], ids=" ".join)
def test_lattices_compile_without_a_warning_by_clang(flags, tmp_path):
    """The test compiles without OpenMP, since clang may have no omp.h."""
    main = [*flags, "-I", CHAIN, "-I", RUNTIME, *LEFT_OUT, CHAIN / "main.c"]
    run([tool("clang"), *STRICT, "-fsyntax-only", *main], tmp_path)


def test_code_of_lattices_needs_no_library_but_that_of_c():
    for name in ("heisenberg", "toda"):
        text = (resources.templates().parent / "generated" / name / f"{name}.c").read_text(encoding="utf-8")
        headers = {line for line in text.splitlines() if line.startswith("#include <")}
        assert headers <= {"#include <float.h>", "#include <math.h>", "#include <stdint.h>", "#include <string.h>"}


@pytest.mark.parametrize("name", ["lattice.c", "rows.c", "lane_functions.c", "status.c"])
def test_each_file_of_lattices_compiles_by_itself(name, tmp_path):
    run([tool("gcc"), *STRICT, "-fsyntax-only", "-I", CHAIN, "-I", RUNTIME, *LEFT_OUT, RUNTIME / name], tmp_path)


@pytest.mark.thin(3, of_all=1)
@pytest.mark.parametrize(
    "path",
    [p for p in sorted(RUNTIME.glob("*.c")) if not p.name.startswith(OF_LATTICES + OF_MODELS + OF_DEVICES)],
    ids=lambda p: p.name,
)
def test_each_file_of_the_runtime_compiles_by_itself(path, tmp_path):
    """A file that is included in the middle of another one is compiled with that file."""
    while whole := whole_of(path):
        path = whole
    kinds = {"batches.c": "SPLITTING", "adjoint_segments.c": "SPLITTING", "explicit.c": "EXPLICIT", "path.c": "PATH"}
    kinds |= dict.fromkeys(("path_lanes.c", "expansion_lanes.c", "adjoint_lanes.c"), "PATH")
    kinds |= dict.fromkeys(("gauss.c", "adjoint_gauss.c"), "GAUSS")
    kinds |= {f"tangent_{kind.lower()}.c": kind for kind in ("EXPLICIT", "GAUSS", "PATH", "SPLITTING")}
    structs = {
        "gauge.c": ["GAUGE"],
        "level.c": ["GAUGE"],
        "attitude.c": ["ATTITUDE"],
        "attitudes.c": ["COMPOSED", "ATTITUDE", "ATTITUDES"],
        "noise.c": ["NOISE"],
        "philox.c": ["NOISE"],
    }
    kind = kinds.get(path.name, "NEWTON")
    switches = defined((kind, "FAST", "TANGENT", "ADJOINT", *structs.get(path.name, ())))
    run([tool("gcc"), *STRICT, "-fsyntax-only", *switches, *INCLUDED, path], tmp_path)


def whole_of(path):
    """Return the file that includes a part in its middle and is itself named at the head of the part, if there
    is one.
    """
    included = [RUNTIME / file for file in re.findall(r'#include "(\w+\.c)"', head(path))]
    here = f'#include "{path.name}"'
    return next((f for f in included if here in f.read_text(encoding="utf-8") and here not in head(f)), None)


def head(path):
    """Return the lines before the first line of code or comment."""
    return re.match(r"(#.*\n|\n)*", path.read_text(encoding="utf-8"))[0]


@pytest.mark.parametrize("more", [(), ("SPATIAL",), ("MATRICES",), ("MATRICES", "SPATIAL")], ids=" ".join)
def test_attitudes_compile_with_every_kind_of_group(more, tmp_path):
    switches = defined(("NEWTON", "COMPOSED", "FAST", "ATTITUDE", "ATTITUDES", *more))
    run([tool("gcc"), *STRICT, "-fsyntax-only", *switches, *INCLUDED, RUNTIME / "runtime.c"], tmp_path)


def test_long_lines_are_broken_where_a_reader_would():
    long = "    const double value = " + " + ".join(f"(first{k} * second{k})" for k in range(9)) + "; /* said */"
    lines = fitted(long).split("\n")
    assert lines[0] == "    /* said */"
    assert lines[2].startswith("        + (first")
    assert max(map(len, lines)) <= WIDTH
    assert " ".join(line.strip() for line in lines[1:]) == long.strip().removesuffix(" /* said */")


def test_lines_are_broken_before_what_binds_least():
    first, second = "a" * 60, "d" * 40
    assert fitted(f"    const double value = {first} * b + c * {second};").split("\n") == [
        f"    const double value = {first} * b",
        f"        + c * {second};",
    ]


def test_conditions_are_broken_before_comparisons_rather_than_behind():
    """A break between two comparisons is preferred to both."""
    wide, wider = "a" * 40, "b" * 62
    assert fitted(f"    if ({wide} && {wider} >= 1) return 0;").split("\n")[1] == f"        && {wider} >= 1) return 0;"
    assert fitted(f"    if ({wider} + {wide[:30]} >= 12345) return;").split("\n")[1].strip() == ">= 12345) return;"


def test_loops_are_broken_behind_their_heads():
    head = "    for (size_t k = 0; k < count; ++k)"
    assert fitted(f"{head} place[k] = first + ({'a' * 45} + k) * block;").split("\n")[0] == head


def test_a_function_on_a_line_that_is_too_long_gets_lines_of_its_own():
    head = f"static int {'f' * 60}(const double *{'x' * 20})"
    assert fitted(f"{head} {{ return *{'x' * 20} > 0.0; }}").split("\n") == [
        head,
        "{",
        f"    return *{'x' * 20} > 0.0;",
        "}",
    ]


def test_long_lines_of_macros_end_with_backslashes():
    name = "f" * 60
    macro = f"#define N_SET(type) \\\n    void {name}(type x) \\\n    {{ \\\n        {name}(x, {name}); \\\n    }}"
    lines = fitted(f"{macro}\nint after;").split("\n")
    assert max(map(len, lines)) <= WIDTH
    assert [line.endswith(" \\") for line in lines] == [True] * (len(lines) - 2) + [False] * 2
    words = " ".join(line.removesuffix("\\") for line in lines).split()
    assert words == f"{macro}\nint after;".replace("\\", " ").split()
