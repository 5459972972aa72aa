"""docs/platforms.md: other compilers, other machines, WebAssembly."""

import sys
from pathlib import Path

import pytest
from support import WARNINGS, compiled, files, run, solver, tool, write
from walkthrough import follow

from phigen.runtime import toolchain

pytest.importorskip("ziglang")

DOCS = Path(__file__).resolve().parent.parent / "docs"
ZIG = (sys.executable, "-m", "ziglang", "cc")

MAIN = """#include <stdio.h>

#include "rigid_body.h"

int main(void)
{
    const double x[3] = {1, 0.2, 0.4};
    rigid_body_solver s;
    if (rigid_body_init(&s, NULL, x) || rigid_body_integrate(&s, 0.1, 100)) return 1;
    printf("%.17g %.17g %.17g\\n", s.x[0], s.x[1], s.x[2]);
    return 0;
}
"""


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = tmp_path_factory.mktemp("platforms")
    write(folder, {**files(compiled("rigid_body"), "c"), "main.c": MAIN})
    return folder


@pytest.mark.slow
def test_zig_is_taken_where_there_is_no_other_compiler(monkeypatch, tmp_path):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert toolchain.find().command == ZIG


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nambu_pendulum", "kepler", "lotka_volterra"])
def test_the_newest_clang_has_no_warning(name, tmp_path):
    """zig's is some years newer than that of a distribution, and warns of more."""
    write(tmp_path, files(compiled(name), "c"))
    run([*ZIG, "-std=c99", *WARNINGS, "-c", f"{name}.c", "-o", "a.o"], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("target", ["x86_64-windows-gnu", "aarch64-macos", "aarch64-linux-musl", "wasm32-wasi"])
def test_c_compiles_for_other_systems(target, sources):
    run([*ZIG, "-target", target, "-std=c99", "-O2", *WARNINGS, "-c", "rigid_body.c", "-o", f"{target}.o"], sources)


@pytest.mark.slow
def test_aarch64_gives_what_this_machine_gives(sources):
    emulator = tool("qemu-aarch64-static")
    run([*ZIG, "-target", "aarch64-linux-musl", "-static", "-O2", "main.c", "rigid_body.c", "-o", "arm"], sources)
    found = [float(word) for word in run([emulator, "./arm"], sources).split()]
    assert found == pytest.approx(
        solver(compiled("rigid_body"), "c").integrate([1, 0.2, 0.4], 0.1, 100).x[-1], abs=1e-12
    )


@pytest.mark.slow
def test_the_page_can_be_followed(tmp_path):
    tool("node")
    assert follow(DOCS / "platforms.md", tmp_path) == 3
