"""Generated C compiles without warnings with all compilers, calls only functions of libm, and passes the sanitizers."""

from itertools import product
from pathlib import Path

import pytest
from support import (
    ALIKE,
    NAMES,
    QUICK,
    WARNINGS,
    as_given,
    compile_text,
    compiled,
    files,
    library,
    run,
    setting,
    single_file,
    slow_but,
    spec_of,
    tool,
    write,
)

from phigen import resources
from phigen.compiler import compile_spec, emit

pytestmark = [pytest.mark.usefixtures("as_users_compile"), pytest.mark.corpus]

_CPP_FLAGS = "-std=c++11 -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wold-style-cast -Werror"
_SANITIZERS = "-std=c99 -O0 -g1 -fsanitize=address,undefined -fno-sanitize-recover=all"
#: Checks of pointers other than bounds, which are left out: they take three quarters of the time of the sanitizers.
#: Kernels, which differ between systems, pass no pointers on; the runtime does, and it is the same for all systems with
#: a kind of step.
_OF_POINTERS = "-fno-sanitize=null,alignment,pointer-overflow"
EXERCISE = Path(__file__).with_name("exercise.c")
GENERATED = Path(__file__).resolve().parents[2] / "generated"

#: Symbols that a generated library may import.
_LIBM = "exp expm1 fmax log sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh pow sqrt cbrt fabs sincos"
ALLOWED = {*_LIBM.split(), "memcpy", "memset", "memcmp", "memmove"}


@pytest.fixture
def sources(name, tmp_path):
    """Return a folder with the generated files of a system; the single-file form is in a folder of its own."""
    write(tmp_path, files(compiled(name), "c"))
    (tmp_path / "single").mkdir()
    write(tmp_path / "single", single_file(compiled(name)))
    return tmp_path


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.slow  # `test_all_solvers_can_be_one_translation_unit` compiles all systems
def test_c_compiles_without_a_warning(name, sources):
    """The fixture of libraries compiles with all warnings of gcc, including those of -O3. Clang gives all of its
    warnings before it optimises; `test_fast_code_with_derivatives_is_cpp_as_well` compiles further systems with clang.
    """
    assert library(compiled(name)).exists()
    assert not list((sources / "single").glob("*.h"))
    for folder in (sources, sources / "single"):
        run([tool("clang"), "-std=c99", *WARNINGS, "-fsyntax-only", f"{name}.c"], folder)
    run([tool("gcc"), "-std=c99", *WARNINGS, "-fsyntax-only", f"{name}.c"], sources / "single")


@pytest.mark.parametrize("name", ["lotka_volterra", "nambu_pendulum"])
def test_single_file_needs_no_other(name, sources):
    run([tool("clang"), "-std=c99", *WARNINGS, "-fsyntax-only", f"{name}.c"], sources / "single")


#: Compilers and systems whose headers differ by more than names: an explicit step, and a gauge.
HEADERS = [("g++", "rigid_body"), ("clang++", "pendulum_euler")]


@pytest.mark.parametrize(("compiler", "name"), slow_but(HEADERS, product(["g++", "clang++"], NAMES)))
def test_header_compiles_as_cpp(name, compiler, sources):
    user = f'#include "{name}.h"\n#include "{name}.h"\nint main() {{ return {name}_solver_size() ? 0 : 1; }}\n'
    write(sources, {"user.cpp": user})
    run([tool(compiler), *_CPP_FLAGS.split(), "-fsyntax-only", "user.cpp"], sources)


#: Compilers and standards. In C++20 compilers warn of arithmetic with constants of different enumerations.
STANDARDS = [*product(["g++", "clang++"], ["c++17", "c++20"])]


@pytest.mark.parametrize(("compiler", "standard"), slow_but(STANDARDS[:1], STANDARDS))
def test_all_c_is_cpp_as_well(compiler, standard, tmp_path):
    """Some projects compile C files as C++, as Microsoft's compiler does by default; it has no ``restrict`` in brackets
    of arrays.
    """
    solvers = sorted(GENERATED.glob("*/*.c"))
    after = "#include <stdlib.h>\nint restrict = 0; /* a macro no longer */\n"
    write(tmp_path, {"all.cpp": "".join(f'#include "{path}"\n' for path in solvers) + after})
    run([tool(compiler), f"-std={standard}", *WARNINGS, "-Wvla", "-fsyntax-only", "all.cpp"], tmp_path)


#: Systems with gradients: a lattice, an implicit step in SIMD lanes, an explicit step, and a splitting.
BACK = ["klein_gordon", "lotka_volterra", "pendulum_euler", "kepler"]


def test_splittings_with_derivatives_are_cpp_as_well(tmp_path):
    compilation = compile_spec(spec_of("rigid_body"), scheme="splitting", tangent=True, adjoint=True)
    files = emit(compilation.program, "c", "phigen")
    assert "rigid_body_pull_group(" in files["rigid_body.c"]
    write(tmp_path, files)
    run([tool("g++"), "-x", "c++", "-std=c++20", *WARNINGS, "-fsyntax-only", "rigid_body.c"], tmp_path)


#: Systems whose code with derivatives has the same parts as that of others. The code of the planets takes 17 s to
#: compile.
LIKE_OTHERS = {*ALIKE, "planets"} - {*BACK, *QUICK}


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    "name",
    slow_but(BACK, sorted({*resources.bundled()} - LIKE_OTHERS))
    + [pytest.param(name, marks=pytest.mark.exhaustive) for name in sorted(LIKE_OTHERS)],
)
def test_fast_code_with_derivatives_is_cpp_as_well(name, tmp_path):
    """Each compiler is called with one standard; `test_all_c_is_cpp_as_well` covers both standards. Only clang reports
    inline functions that are not called. Kernels are the same in C and C++, and the runtime is the same for all systems
    with a kind of step.
    """
    specification = spec_of(name)
    extras = {
        "tangent": not specification.lattice,
        "adjoint": not (specification.noise or (specification.lattice and specification.monitor)),
    }
    write(tmp_path, emit(compile_spec(specification, **extras, profile="fast").program, "c", "phigen"))
    every = [("clang", "c", "c99"), ("clang++", "c++", "c++17"), ("g++", "c++", "c++20")]
    for compiler, language, standard in every if name in (*QUICK, *BACK) else every[:1]:
        run([tool(compiler), "-x", language, f"-std={standard}", *WARNINGS, "-fsyntax-only", f"{name}.c"], tmp_path)


@pytest.mark.parametrize("compiler", slow_but(["clang"], ["gcc", "clang"]))
def test_all_solvers_can_be_one_translation_unit(compiler, tmp_path):
    """No two solvers share a name, including static names and macros."""
    solvers = sorted(GENERATED.glob("*/*.c"))
    write(tmp_path, {"all.c": "".join(f'#include "{path}"\n' for path in solvers)})
    assert len(solvers) >= 10
    run([tool(compiler), "-std=c99", *WARNINGS, "-fsyntax-only", "all.c"], tmp_path)


def symbols_in(path):
    """Return the pairs (kind, symbol) of an object file."""
    return {tuple(line.split()[-2:]) for line in run([tool("nm"), path], path.parent).splitlines()}


@pytest.fixture(scope="session")
def of_every_library(tmp_path_factory):
    """Symbols that the compiler itself adds to every library."""
    folder = tmp_path_factory.mktemp("empty")
    write(folder, {"empty.c": "extern int nothing;\n"})
    run([tool("gcc"), "-fPIC", "-shared", "empty.c", "-o", "empty.so"], folder)
    return symbols_in(folder / "empty.so")


@pytest.mark.thin(3, of_all=1)
@pytest.mark.parametrize("name", NAMES)
def test_library_has_no_state_and_needs_only_libm(name, of_every_library):
    """The library uses no heap, no input or output, and no writable globals: it is reentrant."""
    symbols = symbols_in(library(compiled(name))) - of_every_library
    undefined = {symbol.partition("@")[0] for kind, symbol in symbols if kind == "U"}
    assert undefined <= ALLOWED
    assert not [symbol for kind, symbol in symbols if kind in "BbDdCcSs"], "writable data"
    exported = {symbol for kind, symbol in symbols if kind.isupper() and kind != "U"}
    assert exported
    assert all(symbol.startswith(f"{name}_") for symbol in exported)


def build_exercise(compilation, folder, *command):
    """Compile exercise.c for a system, and return the path of the program."""
    at, name = setting(compilation), compilation.program.name
    definitions = [f"-DNAME={name}", f'-DHEADER="{name}.h"', f"-DSTEP={at.h!r}"]
    definitions.append("-DSTATE=" + ", ".join(map(repr, at.x)))
    run([*command, *definitions, "-I.", EXERCISE, f"{name}.c", "-o", "exercise", "-lm"], folder)
    return folder / "exercise"


def check_with_sanitizers(compiler, compilation, folder, *without):
    more = ["-fsanitize=float-cast-overflow"] if compiler == "clang" else []
    flags = [*_SANITIZERS.split(), *more, *without]
    program = build_exercise(compilation, folder, tool(compiler), *flags, "-Wall", "-Wextra", "-Werror")
    run([program], folder, ASAN_OPTIONS="detect_leaks=0:detect_stack_use_after_return=1")


#: Compilers and systems, one for each kind of step, with one stage and with several. Clang needs half the time of gcc
#: for code with sanitizers, and its sanitizers report the same faults.
FEW = [("clang", name) for name in ("ablowitz_ladik3", "nambu_pendulum", "pendulum_euler", "rigid_body")]
#: Further systems, with other kinds of bi-realisations, an attitude, or many coordinates. Kernels, which differ between
#: all systems, pass no pointers on.
FURTHER_SYSTEMS = ["guiding_centre", "lagrange_top", "lotka_volterra", "pendulum", "poisson_not_hamiltonian"]
ALL = [*FEW, *product(["clang"], FURTHER_SYSTEMS), ("gcc", "lotka_volterra"), ("gcc", "nambu_pendulum")]


@pytest.mark.thin(3)
@pytest.mark.parametrize(("compiler", "name"), slow_but(FEW, ALL))
def test_whole_interface_is_clean_under_sanitizers(compiler, name, sources):
    check_with_sanitizers(compiler, compiled(name), sources, *([] if name in QUICK else [_OF_POINTERS]))


POWERS = """coordinates: [x, y]
poisson: {brackets: {x: {y: (2 + x)**(3/2)}}}
hamiltonian: x**2/2 + y**2/2
birealisation: karasev
runs: {r: {initial: [0.5, 0.2], step: 0.05, steps: 1}}
"""

#: Further cases: splittings, whose C shares little with that of implicit steps; powers along paths; Gauss collocation
#: in batches of members, for all unknowns and for some.
FURTHER = {name: lambda name=name: compiled(name, 4, "splitting") for name in ("kepler", "toda3_quadratic")}
FURTHER |= {
    "kowalevski_top": lambda: compiled("kowalevski_top", 6, "splitting"),
    "powers": lambda: compile_text(POWERS),
    "kowalevski_gauss": lambda: compiled("kowalevski_gauss", 8),
    "henon_heiles": lambda: compiled("henon_heiles", 4, "gauss"),
}


@pytest.mark.parametrize("case", slow_but(["kepler", "powers"], FURTHER))
def test_further_code_is_clean_under_sanitizers(case, tmp_path):
    compilation = FURTHER[case]()
    write(tmp_path, files(compilation, "c"))
    check_with_sanitizers("clang", compilation, tmp_path)


@pytest.mark.thin(1)
@pytest.mark.parametrize("name", slow_but(["toda3"], ["toda3", "nambu_pendulum", "pendulum_euler"]))
def test_whole_interface_is_clean_under_valgrind(name, sources):
    """Valgrind reports uninitialised memory, which the sanitizers do not."""
    valgrind = tool("valgrind")
    program = build_exercise(compiled(name), sources, tool("gcc"), "-std=c99", "-O1", "-g")
    run([valgrind, "--error-exitcode=9", "--quiet", "--track-origins=yes", program], sources)


#: Systems for checks of initialisation: lattices on a graph, a chain and rows of sites; then kinds of steps that the
#: quick systems lack: Gauss collocation, splittings, forces, noise.
INITIALISED = ["food_web", "kdv", "heisenberg"]
#: Orders other than the default; at order 8, Gauss collocation has batches of members too.
INITIALISED_AT = {"kowalevski_gauss": 8}
FURTHER_KINDS = ["kowalevski_gauss", "satellite_wheels", "landau_lifshitz", "thermal_spin", "kepler_eccentric"]


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", slow_but(INITIALISED, [*INITIALISED, *FURTHER_KINDS]))
def test_compilers_see_that_all_is_initialised(name, tmp_path):
    """gcc with -O1 analyses functions, but less far than with higher optimisation; clang checks whether all paths to a
    use assign the variable.
    """
    compilation = compiled(name, INITIALISED_AT[name]) if name in INITIALISED_AT else as_given(name)
    write(tmp_path, files(compilation, "c"))
    run([tool("gcc"), "-std=c99", "-O1", *WARNINGS, "-c", f"{name}.c", "-o", "object.o"], tmp_path)
    run([tool("clang"), "-std=c99", "-Wconditional-uninitialized", "-Werror", "-fsyntax-only", f"{name}.c"], tmp_path)
