"""Generated C compiles without a warning everywhere, uses nothing but libm, and runs clean under the sanitizers."""

from pathlib import Path

import pytest
from support import COMMAND, NAMES, compiled, run, setting, tool, write

from phigen.compiler import emit

_FLAGS = "-std=c99 -Wall -Wextra -Wpedantic -Wconversion -Wdouble-promotion -Wshadow -Werror"
_CPP_FLAGS = "-std=c++11 -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wold-style-cast -Werror"
_SANITIZERS = "-std=c99 -O0 -g -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer"
EXERCISE = Path(__file__).with_name("exercise.c")

#: What an object may need from outside.
_LIBM = "exp expm1 fmax log sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh pow sqrt cbrt fabs sincos"
ALLOWED = {*_LIBM.split(), "memcpy", "memset", "memcmp", "memmove", "_GLOBAL_OFFSET_TABLE_"}


@pytest.fixture
def sources(name, tmp_path):
    """A folder with the generated files of a system; the single file in a folder of its own."""
    write(tmp_path, emit(compiled(name).program, "c", COMMAND))
    (tmp_path / "single").mkdir()
    write(tmp_path / "single", emit(compiled(name).program, "c", COMMAND, single_file=True))
    return tmp_path


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_c_compiles_without_a_warning(name, compiler, sources):
    command = [tool(compiler), *_FLAGS.split(), "-O1", "-c", f"{name}.c", "-o", f"{name}.o"]
    run(command, sources)
    run([*command[:-2], "-fsyntax-only"], sources / "single")
    assert not list((sources / "single").glob("*.h"))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_header_compiles_as_cpp(name, compiler, sources):
    user = f'#include "{name}.h"\n#include "{name}.h"\nint main() {{ return {name}_solver_size() ? 0 : 1; }}\n'
    write(sources, {"user.cpp": user})
    run([tool(compiler), *_CPP_FLAGS.split(), "-fsyntax-only", "user.cpp"], sources)


@pytest.mark.parametrize("name", NAMES)
def test_object_has_no_state_and_needs_only_libm(name, sources):
    """No heap, no input or output, no writable globals: reentrant."""
    run([tool("gcc"), "-std=c99", "-O2", "-c", f"{name}.c"], sources)
    symbols = [line.split()[-2:] for line in run([tool("nm"), f"{name}.o"], sources).splitlines()]
    undefined = {symbol for kind, symbol in symbols if kind == "U"}
    assert undefined <= ALLOWED
    assert not [symbol for kind, symbol in symbols if kind in "BbDdCcSs"], "writable data"
    exported = {symbol for kind, symbol in symbols if kind.isupper() and kind != "U"}
    assert all(symbol.startswith(f"{name}_") for symbol in exported)


def build_exercise(name, folder, *command):
    """The program of exercise.c for a system."""
    at = setting(compiled(name))
    definitions = [f"-DNAME={name}", f'-DHEADER="{name}.h"', f"-DSTEP={at.h!r}"]
    definitions.append("-DSTATE=" + ", ".join(map(repr, at.x)))
    run([*command, *definitions, "-I.", EXERCISE, f"{name}.c", "-o", "exercise", "-lm"], folder)
    return folder / "exercise"


@pytest.mark.parametrize("name", NAMES)
def test_whole_interface_is_clean_under_sanitizers(name, sources):
    program = build_exercise(name, sources, tool("gcc"), *_SANITIZERS.split(), "-Wall", "-Wextra", "-Werror")
    run([program], sources, ASAN_OPTIONS="detect_leaks=0:detect_stack_use_after_return=1")


@pytest.mark.parametrize("name", ["lotka_volterra", "rigid_body", "ablowitz_ladik3"])
def test_whole_interface_is_clean_under_the_sanitizers_of_clang(name, sources):
    flags = [*_SANITIZERS.split(), "-fsanitize=float-cast-overflow"]
    run([build_exercise(name, sources, tool("clang"), *flags)], sources, ASAN_OPTIONS="detect_leaks=0")


@pytest.mark.parametrize("name", ["so4_manakov"])
def test_whole_interface_is_clean_under_valgrind(name, sources):
    """Uninitialised memory in particular, which the sanitizers do not see."""
    valgrind = tool("valgrind")
    program = build_exercise(name, sources, tool("gcc"), "-std=c99", "-O1", "-g")
    run([valgrind, "--error-exitcode=9", "--quiet", "--track-origins=yes", program], sources)
