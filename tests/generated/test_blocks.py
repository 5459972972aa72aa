"""Blocks of steps and groups of members do what single steps do, to round-off."""

from dataclasses import replace
from pathlib import Path

import pytest
from support import COMMAND, NAMES, compiled, run, setting, tool, write

from phigen.compiler import compile_spec, emit
from phigen.targets.c import lanes

#: Where 300 steps multiply round-off. Elsewhere blocks and single steps agree to one unit of the last place for each
#: stage.
GROWING = {"gaussian_moments": 20, "henon_heiles": 20, "kowalevski_top": 20, "pendulum": 20}
GROWING |= {"poisson_not_hamiltonian": 500}  # a start changed by one unit ends 220 units apart

EXERCISE = Path(__file__).with_name("blocks.c")


@pytest.mark.parametrize("name", [n for n in NAMES if lanes.blocks(compiled(n).program)])
def test_blocks_and_groups_equal_single_steps(name, tmp_path):
    exercise(compiled(name), "-O1", tmp_path)


@pytest.mark.parametrize("name", ["rigid_body", "volterra5", "toda3", "kowalevski_top"])
def test_vectorised_blocks_and_groups_equal_single_steps(name, tmp_path):
    """-O1 leaves the loops over lanes as they are, -O3 makes vector instructions of them."""
    exercise(compiled(name), "-O3", tmp_path)


@pytest.mark.parametrize("name", ["rigid_body", "volterra5"])
def test_blocks_of_several_stages_equal_single_steps(name, tmp_path):
    composed = replace(compiled(name).spec, composition="kahan-li")
    compilation = compile_spec(composed, order=6)
    assert len(compilation.program.fractions) > 3
    exercise(compilation, "-O2", tmp_path)


def exercise(compilation, optimisation, folder):
    """Build and run blocks.c for a system."""
    name = compilation.program.name
    write(folder, emit(compilation.program, "c", COMMAND, single_file=True))
    at = setting(compilation)
    definitions = [f"-DNAME={name}", f'-DSOURCE="{name}.c"', f"-DSTEP={at.h!r}"]
    definitions.append(f"-DULPS={GROWING.get(name, len(compilation.program.fractions))}")
    definitions.append("-DSTATE=" + ", ".join(map(repr, at.x)))
    flags = ["-std=c99", optimisation, "-Wall", "-Wextra", "-Werror", "-Wno-unused-function"]
    run([tool("gcc"), *flags, *definitions, "-I.", EXERCISE, "-o", "blocks", "-lm"], folder)
    run([folder / "blocks"], folder)
