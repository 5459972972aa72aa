"""C of lattices with derivatives compiles without warnings, for parts that few lattices have; compiled as C++
it links.
"""

import pytest
from support import WARNINGS, run, tool, write

from phigen import spec
from phigen.compiler import compile_spec, emit

pytestmark = pytest.mark.usefixtures("as_users_compile")

GRID = "lattice: {axes: [i], boundary: periodic}\n"
PLANE = "lattice: {axes: [i, j], boundary: open}\n"
PAIRS, GRAPH = "lattice: {pairs: all}\n", "lattice: {graph: links}\n"
OSCILLATORS = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
#: A lattice whose third coordinate has no brackets, so that no sweep updates it.
BESIDE = "coordinates: [q, p, z]\npoisson: {canonical: {q: [q], p: [p]}}\n"
HEISENBERG = 'coordinates: [u0, u1, u2]\npoisson: {lie_algebra: {name: "heisenberg(1)"}}\n'
SERIES = "scheme: series\n"

LATTICES = {
    "of a stage nothing is handed to others": GRID + BESIDE + SERIES + "hamiltonian: p**2/2 + q**2/2 + z*z[i+1]\n",
    "of pairs nothing moves": PAIRS + BESIDE + SERIES + 'hamiltonian: {sites: q**2*p, pairs: "cos(z[a] - z[b])"}\n',
    "there are no pairs in H": PAIRS + OSCILLATORS + SERIES + "hamiltonian: {sites: cos(p) + cos(q)}\n",
    "of bonds nothing moves": GRAPH + HEISENBERG + 'hamiltonian: {sites: u0**2/2 + u1**4, bonds: "u2[a]*u2[b]"}\n',
    "neighbours are read in reverse alone": GRID
    + HEISENBERG
    + "hamiltonian: u0**2/2 + u1**2/4 + u2**2/3 + u1*u1[i-1]/4\n",
    "forces move nothing": GRAPH
    + HEISENBERG
    + 'hamiltonian: {sites: u1**2/3, bonds: "u1[a]*u1[b]/3"}\nforces: {covector: {u2: -u0/9}}\n',
    "rows are not handed over": PLANE + OSCILLATORS + "hamiltonian: p**2/2 + q**4/4\n",
    "coefficients alone call functions": GRID
    + OSCILLATORS
    + "time: t\nhamiltonian: p**2/2 + cos(3*t)*(q[i+1] - q)**2/2\n",
}
EXTRAS = ({"adjoint": True}, {"tangent": True, "adjoint": True}, {"tangent": True}, {})


def text_of(lattice):
    return f"phigen: 1\nname: t\norder: 2\n{LATTICES[lattice]}"


def expect_clean(compilation, folder, *compilers):
    """Write the C, and compile it as C or C++ with all warnings as errors."""
    write(folder, emit(compilation.program, "c", "phigen build"))
    for compiler in compilers:
        language = ["-x", "c++", "-std=c++17"] if compiler.endswith("++") else ["-std=c99"]
        run([tool(compiler), *language, *WARNINGS, "-fsyntax-only", "t.c"], folder)


@pytest.mark.parametrize("profile", ["fast", "small"])
def test_lattices_without_brackets_compile(profile, tmp_path):
    text = PAIRS + "coordinates: [x]\npoisson: {matrix: [[0]]}\nhamiltonian: {sites: x}\n"
    compilation = compile_spec(spec.loads(f"phigen: 1\nname: t\n{text}"), profile=profile)
    expect_clean(compilation, tmp_path, "gcc")


@pytest.mark.thin(2)
@pytest.mark.parametrize("lattice", LATTICES)
def test_lattices_with_parts_that_have_no_use_compile(lattice, tmp_path):
    compilation = compile_spec(spec.loads(text_of(lattice)), adjoint=True, profile="fast")
    expect_clean(compilation, tmp_path, "clang")


@pytest.mark.slow
@pytest.mark.parametrize("lattice", LATTICES)
def test_lattices_with_parts_that_have_no_use_compile_with_all_extras(lattice, tmp_path):
    """Clang gives the warnings of gcc too; gcc compiles the code with the most parts, as C and as C++."""
    for profile, most in (("fast", EXTRAS[1]), ("small", EXTRAS[0])):
        for extras in EXTRAS:
            compilation = compile_spec(spec.loads(text_of(lattice)), **extras, profile=profile)
            expect_clean(compilation, tmp_path, *(("gcc", "clang", "g++") if extras == most else ("clang",)))


MAIN = """#include "t.h"
int main(void)
{
    int bad = 0;
%s
    return bad;
}
"""


def test_lattices_in_cpp_link_with_openmp_and_take_no_solver_for_a_bad_argument(tmp_path):
    """Call all functions that return a status, of a lattice with a splitting, which has most of them."""
    text = text_of("neighbours are read in reverse alone") + "without: []\n"
    compilation = compile_spec(spec.loads(text), tangent=True, adjoint=True, profile="fast")
    files = emit(compilation.program, "c", "phigen build")
    tests = [
        f"    bad += t_{name}({', '.join(['0'] * count)}) != t_BAD_ARGUMENT;"
        for name, count in functions_with_status(files["t.h"])
    ]
    assert len(tests) > 8
    assert any("t_resume(" in line for line in tests)
    write(tmp_path, {**files, "main.c": MAIN % "\n".join(tests)})
    run([tool("g++"), "-x", "c++", "-fopenmp", "-O0", "main.c", "t.c", "-o", "main", "-lm"], tmp_path)
    run([tmp_path / "main"], tmp_path)


def functions_with_status(header):
    """Return the names of the functions that return a status and take a solver, with their numbers of arguments."""
    flat = " ".join(header.split())
    for declaration in flat.split("t_status t_")[1:]:
        name, _, arguments = declaration.partition("(")
        if arguments.startswith(("t_solver *", "const t_solver *")):
            of_functions = arguments.split(");")[0]
            yield name, of_functions.count(",") + 1
