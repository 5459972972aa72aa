"""The C of ordinary systems with derivatives compiles without a warning, in combinations that few systems have."""

import pytest
from support import WARNINGS, run, tool, write

from phigen import spec
from phigen.compiler import compile_spec, emit

pytestmark = pytest.mark.usefixtures("as_users_compile")

OSCILLATOR = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 + q**4/4\n"
BODY = "coordinates: [x, y, z]\npoisson: {lie_algebra: {name: so(3)}}\nhamiltonian: x**2/2 + y**2 + z**2/5 + x\n"
WITH_A = "parameters: {a: 1.5}\n"
SERIES, MONITOR, TIME = "scheme: series\n", "monitor: 1 + q**2\n", "time: t\n"

SYSTEMS = {
    "monitor, no parameters": OSCILLATOR + MONITOR,
    "monitor": OSCILLATOR.replace("q**4", "a*q**4") + WITH_A + MONITOR,
    "monitor of a splitting, no parameters": OSCILLATOR.replace("+ q**4/4", "- exp(q)")
    + "monitor: log\nscheme: splitting\n",
    "series, no parameters": OSCILLATOR + SERIES,
    "series, lanes off": OSCILLATOR + SERIES + "solver: {lanes: false}\n",
    "series, time": OSCILLATOR.replace("/4", "*(1 + cos(t)/9)") + TIME + SERIES,
    "series, composed": BODY + SERIES + "order: 4\ncomposition: suzuki\n",
    "path": BODY + "birealisation: karasev\n",
    "path, zero brackets": "coordinates: [x, y]\npoisson: {log_canonical: [[0, 0], [0, 0]]}\n"
    "hamiltonian: cos(x + y)\nbirealisation: karasev\ngauge: none\n",
    "pendulum": OSCILLATOR.replace("q**4/4", "cos(q)") + "scheme: splitting\norder: 2\ncomposition: none\n",
    "splitting": BODY + "scheme: splitting\n",
}
WITHOUT = [frozenset[str](), frozenset(["recurrences"]), frozenset(["lanes"]), frozenset(["members"])]

#: Cases: a system, the parts that are left out, and the profile. One system suffices for the interaction of the parts.
FEW = [
    ("monitor, no parameters", WITHOUT[0], "fast"),
    ("monitor, no parameters", WITHOUT[0], "small"),
    ("monitor", WITHOUT[1], "fast"),
    ("series, no parameters", WITHOUT[1], "fast"),
    ("pendulum", frozenset(["members"]), "fast"),
    ("path, zero brackets", WITHOUT[0], "fast"),
]


def expect_clean(name, folder, compilers, **options):
    """Compile the C with all warnings as C, or as C++."""
    compilation = compile_spec(spec.loads(f"phigen: 1\nname: t\n{SYSTEMS[name]}"), **options)
    write(folder, emit(compilation.program, "c", "phigen build"))
    for compiler in compilers:
        language = ["-x", "c++", "-std=c++17"] if compiler.endswith("++") else ["-std=c99"]
        run([tool(compiler), *language, *WARNINGS, "-fsyntax-only", "t.c"], folder)


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "without", "profile"), FEW)
def test_gradients_compile_whatever_is_left_out(name, without, profile, tmp_path):
    expect_clean(name, tmp_path, ("gcc", "clang"), adjoint=True, without=without, profile=profile)


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
def test_code_compiles_with_and_without_each_part(name, tmp_path):
    """All parts are left out of code with gradients, and one part at a time of code with tangent maps; clang reports
    the same warnings as gcc.
    """
    turn = [*SYSTEMS].index(name)
    for without in WITHOUT:
        expect_clean(name, tmp_path, ("clang",), without=without, profile="fast", adjoint=True)
    both, tangent = ({"without": WITHOUT[(turn + k) % 4], "profile": "fast", "tangent": True} for k in (0, 1))
    expect_clean(name, tmp_path, ("gcc", "clang"), adjoint=True, **both)
    expect_clean(name, tmp_path, ("clang",), **tangent)
    expect_clean(name, tmp_path, ("clang",), profile="small", tangent=True)
    expect_clean(name, tmp_path, ("gcc", "clang", "g++"), profile="small", adjoint=True, tangent=turn % 2 == 0)
