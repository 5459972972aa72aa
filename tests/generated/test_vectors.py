"""Loops over lanes and sites are vectorised: the reports of compilers show this without timing."""

import platform
import re
from dataclasses import replace

import pytest
from support import run, spec_of, tool, write

from phigen.compiler import compile_spec, emit
from phigen.runtime import toolchain

pytestmark = pytest.mark.skipif(platform.machine() != "x86_64", reason="other processors have other vectors")

#: Flags as phigen uses them, with vectors of four doubles on any processor.
FLAGS = ["-std=c99", "-O3", "-march=haswell", *toolchain.TUNING_FLAGS[1:]]
#: For each kind of code in lanes: how it is compiled, and the functions that do most of the work.
CASES = {
    "equations": ("rigid_body", {}, "evaluate_lanes linearise_lanes invert_lanes apply foresee group_foresee"),
    "paths": ("nambu_pendulum", {}, "curvature_lanes momentum_lanes values_lanes along_mean_lanes follow add_terms"),
    "explicit": ("pendulum_euler", {"adjoint": True}, "explicit_lanes explicit_adjoint_lanes stage_lanes gain_lanes"),
    "flows": (
        "toda3", {"scheme": "splitting"},
        "add_lanes change1_lanes change2_lanes change1_full_range_lanes settle_lanes",
    ),
    "flows back": (
        "rigid_body", {"scheme": "splitting", "adjoint": True},
        "flow1_adjoint_lanes flow2_adjoint_full_range_lanes gain_lanes",
    ),
    "sites": (
        "heisenberg", {},
        "sweep1_near sweep1_full_range sweep2_near sweep3_full_range vector_field_row energy_row",
    ),
    "sites back": ("klein_gordon", {"adjoint": True}, "sweep1 sweep2 sweep1_back sweep2_back"),
    "pairs": ("outer_planets", {}, "pair_forces sweep1 sweep2"),
    "equations of sites": ("kdv", {}, "slope relax increment"),
}  # fmt: skip
#: Compositions of some cases, by name: rotations in place of one exact flow.
COMPOSITIONS = {"flows back": "blanes-moan"}


#: Cases for clang. It unrolls the equations of implicit steps into scalar code first, and vectorises the result, which
#: its report does not show.
CLANG = [("clang", case) for case in ("explicit", "flows", "flows back", "sites back", "pairs")]


@pytest.mark.thin(5, of_all=2)
@pytest.mark.parametrize(("compiler", "case"), [*(("gcc", case) for case in CASES), *CLANG])
def test_loops_over_lanes_become_vectors(compiler, case, tmp_path):
    name, asked, functions = CASES[case]
    compilation = compile_spec(
        replace(spec_of(name), composition=COMPOSITIONS.get(case, "auto")), profile="fast", **asked
    )
    write(tmp_path, emit(compilation.program, "c", "phigen"))
    marked = marked_loops((tmp_path / f"{name}.c").read_text(encoding="utf-8"))
    assert {f"{name}_{function}" for function in functions.split()} - {*marked.values()} == set()
    vectorised = vectors(compiler, tmp_path / f"{name}.c")
    assert {f"{function}, line {line}" for line, function in marked.items() if line not in vectorised} == set()


def marked_loops(code):
    """Return, for each line with a loop that the code marks for vectorisation, the function that contains it."""
    loops, function = {}, ""
    lines = code.splitlines()
    for number, line in enumerate(lines, 1):
        if start := re.match(r"[a-z].*?\b(\w+)\((?!\*)", line):
            function = start[1]
        if re.fullmatch(r" +\w+_EACH_(LANE|SITE)", line):
            assert lines[number].lstrip().startswith("for ("), lines[number]
            loops[number + 1] = function
    return loops


#: Options with which a compiler writes its report on loops into a file, and the text of the report for a vectorised
#: loop.
ASKED = {
    "gcc": (["-fopt-info-vec-optimized=told"], r"\.c:(\d+):\d+: optimized: loop vectorized"),
    "clang": (
        ["-fsave-optimization-record", "-foptimization-record-file=told"],
        r"--- !Passed\nPass: +loop-vectorize\nName: +Vectorized\nDebugLoc: .*Line: (\d+)",
    ),
}


def vectors(compiler, path):
    """Return the lines of loops that the compiler vectorises."""
    options, said = ASKED[compiler]
    run([tool(compiler), *FLAGS, *options, "-c", path.name, "-o", "vectors.o"], path.parent)
    return {int(line) for line in re.findall(said, (path.parent / "told").read_text(encoding="utf-8"))}
