"""Generated C with other compilers, for other machines and for WebAssembly, as docs/platforms.md describes."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support import WARNINGS, compiled, files, run, setting, solver, tool, write
from walkthrough import follow

from phigen.runtime import toolchain
from phigen.targets.reserved import WINDOWS_MACROS

pytest.importorskip("ziglang")

DOCS = Path(__file__).resolve().parent.parent / "docs"
ZIG = (sys.executable, "-m", "ziglang", "cc")

#: A program that needs no C library, since compiling one for another machine takes a minute: it integrates and writes
#: the bytes of the state to standard output.
MAIN = """#include "maxwell_bloch.h"

void *memmove(void *to, const void *from, size_t count)
{
    volatile char *end = to;
    if (to < from) for (size_t k = 0; k < count; ++k) end[k] = ((const char *)from)[k];
    else while (count-- > 0) end[count] = ((const char *)from)[count];
    return to;
}

void *memcpy(void *to, const void *from, size_t count) { return memmove(to, from, count); }

void *memset(void *to, int value, size_t count)
{
    for (size_t k = 0; k < count; ++k) ((volatile char *)to)[k] = (char)value;
    return to;
}

static long call_system(long number, long a, long b, long c)
{
    register long x8 __asm__("x8") = number, x0 __asm__("x0") = a, x1 __asm__("x1") = b, x2 __asm__("x2") = c;
    __asm__ volatile("svc 0" : "+r"(x0) : "r"(x8), "r"(x1), "r"(x2) : "memory");
    return x0;
}

void _start(void)
{
    static maxwell_bloch_solver s;
    const double x[maxwell_bloch_DIM] = {START};
    int status = maxwell_bloch_init(&s, NULL, x);
    if (status == 0) status = maxwell_bloch_integrate(&s, STEP, 100);
    call_system(64, 1, (long)s.x, sizeof s.x); /* write */
    call_system(93, status, 0, 0);             /* exit */
}
"""


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = tmp_path_factory.mktemp("platforms")
    write(folder, files(compiled("rigid_body"), "c"))
    return folder


@pytest.mark.slow
@pytest.mark.skipif(
    "PHIGEN_ALL_PLATFORMS" not in os.environ,
    reason="PHIGEN_ALL_PLATFORMS is not set; zig would first build the C library of each platform",
)
def test_zig_is_taken_where_there_is_no_other_compiler(monkeypatch, tmp_path):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert toolchain.find().command == ZIG


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nambu_pendulum", "kepler", "lotka_volterra"])
def test_the_newest_clang_has_no_warning(name, tmp_path):
    """The clang of zig is newer than that of Linux distributions and has more warnings."""
    write(tmp_path, files(compiled(name), "c"))
    run([*ZIG, "-std=c99", *WARNINGS, "-c", f"{name}.c", "-o", "a.o"], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("target", ["x86_64-windows-gnu", "aarch64-macos", "aarch64-linux-musl", "wasm32-wasi"])
def test_c_compiles_for_other_systems(target, sources):
    run([*ZIG, "-target", target, "-std=c99", "-O2", *WARNINGS, "-c", "rigid_body.c", "-o", f"{target}.o"], sources)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["heisenberg", "rigid_body", "kepler_eccentric"])
def test_c_compiles_after_windows_h(name, tmp_path):
    """windows.h defines far, near and other common words as macros, some of them empty."""
    write(tmp_path, files(compiled(name), "c"))
    write(tmp_path, {"main.c": f'#include <windows.h>\n#include "{name}.h"\n#include "{name}.c"\n'})
    run([*ZIG, "-target", "x86_64-windows-gnu", "-std=c99", "-Werror", "-c", "main.c", "-o", "a.o"], tmp_path)


@pytest.mark.slow
def test_macros_of_windows_are_reserved():
    """The list of the module is part of the macros of windows.h, except those of headers that it leaves out."""
    command = [*ZIG, "-target", "x86_64-windows-gnu", "-x", "c", "-dM", "-E", "-"]
    text = subprocess.run(command, input="#include <windows.h>", capture_output=True, text=True, check=True).stdout
    defined = set(re.findall(r"^#define (\w+)(?!\S)", text, re.MULTILINE))
    assert WINDOWS_MACROS - defined <= {"small"}


@pytest.mark.slow
def test_aarch64_gives_what_this_machine_gives(tmp_path):
    """An emulated ARM processor gives the same results as this machine, for Newton's iteration and for blocks of steps
    in SIMD lanes.
    """
    emulator, at = tool("qemu-aarch64-static"), setting(compiled("maxwell_bloch"))
    write(tmp_path, {**files(compiled("maxwell_bloch"), "c"), "main.c": MAIN})
    numbers = [f"-DSTART={','.join(map(repr, at.x))}", f"-DSTEP={at.h!r}"]
    for name in ("main", "maxwell_bloch"):
        flags = ["-std=gnu99", "-O2", "-fno-sanitize=all", "-fno-math-errno", *numbers]
        run([*ZIG, "-target", "aarch64-linux-musl", *flags, "-c", f"{name}.c", "-o", f"{name}.o"], tmp_path)
    run([*ZIG[:-1], "ld.lld", "-static", "main.o", "maxwell_bloch.o", "-o", "arm"], tmp_path)
    process = np.frombuffer(subprocess.run([emulator, "./arm"], cwd=tmp_path, capture_output=True, check=True).stdout)
    right = solver(compiled("maxwell_bloch"), "c").integrate(at.x, at.h, 100).x[-1]
    assert process == pytest.approx(right, abs=1e-12)


@pytest.mark.slow
def test_the_page_can_be_followed(tmp_path):
    tool("node")
    assert follow(DOCS / "platforms.md", tmp_path) == 4
