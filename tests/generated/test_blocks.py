"""Blocks of steps and groups of members agree with single steps to round-off."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import (
    COMMAND,
    NAMES,
    QUICK,
    compile_text,
    compiled,
    run,
    setting,
    slow_but,
    solver,
    tool,
    write,
)  # fmt: skip

from phigen.compiler import compile_spec, emit
from phigen.lanes.in_lanes import Blocks, in_lanes

#: Factors by which the instability of a motion multiplies round-off in 300 steps. In other systems blocks and single
#: steps agree to two units in the last place for each stage; uncompensated sums would be ten units apart.
GROWING = {"gaussian_moments": 20, "henon_heiles": 20, "kowalevski_top": 20, "pendulum": 20}
GROWING |= {"nambu_pendulum": 20}
GROWING |= {"poisson_not_hamiltonian": 500}  # a start that differs by one unit in the last place ends 220 units apart
GROWING |= {"dzhanibekov": 150}  # a start that differs by one unit in the last place ends 67 units apart

#: Chaotic motions, and one that rotates for a long time before it flips: fitted recurrences do not predict them.
UNFORESEEN = {"henon_heiles", "kowalevski_top", "dzhanibekov"}

EXERCISE = Path(__file__).with_name("blocks.c")


WITHOUT_BLOCKS = ["ablowitz_ladik3", "charged_particle", "pendulum_euler", "quaternion_top", "toda3_quadratic"]
WITH_BLOCKS = [name for name in NAMES if name not in WITHOUT_BLOCKS]


def test_large_derivatives_of_paths_and_explicit_steps_have_no_blocks():
    assert not [name for name in WITHOUT_BLOCKS if isinstance(in_lanes(compiled(name).program), Blocks)]


@pytest.mark.thin(2)
@pytest.mark.corpus
@pytest.mark.parametrize("name", slow_but(QUICK, WITH_BLOCKS))
def test_blocks_and_groups_equal_single_steps(name, tmp_path):
    exercise(compiled(name), "-O0", tmp_path)


@pytest.mark.thin(1)
@pytest.mark.slow
@pytest.mark.parametrize("name", ["rigid_body", "toda3", "volterra5"])
def test_vectorised_blocks_and_groups_equal_single_steps(name, tmp_path):
    """The compiler does not vectorise the loops over lanes with -O0, and does with -O3."""
    exercise(compiled(name), "-O3", tmp_path)


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", slow_but(["rigid_body", "pendulum"], ["rigid_body", "pendulum", "volterra5"]))
def test_blocks_of_several_stages_equal_single_steps(name, tmp_path):
    """In the bi-realisation of the pendulum, y is the mean of the states at both ends of a stage."""
    composed = replace(compiled(name).spec, composition="suzuki")
    compilation = compile_spec(composed, order=4)
    assert len(compilation.program.fractions) == 5
    exercise(compilation, "-O0", tmp_path)


@pytest.mark.parametrize(
    ("composition", "optimisation"),
    slow_but([("suzuki", "-O0")], [("none", "-O0"), ("suzuki", "-O0"), ("suzuki", "-O3")]),
)
def test_blocks_with_sparse_factors_equal_single_steps(composition, optimisation, tmp_path):
    """A ring of nine species, whose Newton matrix has three entries in each row."""
    n = 9
    rows = [[(j - i) % n == 1 for j in range(n)] for i in range(n)]
    pi = [[int(rows[i][j]) - int(rows[j][i]) for j in range(n)] for i in range(n)]
    text = (
        f"coordinates: [{', '.join(f'v{i}' for i in range(n))}]\nhamiltonian: {' + '.join(f'v{i}' for i in range(n))}\n"
    )
    text += (
        f"poisson: {{log_canonical: {pi}}}\norder: {2 if composition == 'none' else 4}\ncomposition: {composition}\n"
    )
    start = [round(1 + 0.3 * (i % 4), 2) for i in range(n)]
    compilation = compile_text(f"{text}runs: {{r: {{initial: {start}, step: 0.2, steps: 10}}}}\n")
    assert compilation.program.step.factors
    assert compilation.program.step.eliminate
    exercise(compilation, optimisation, tmp_path, foreseen=False, units=200)  # 91 with the inverse matrix


def test_members_go_one_by_one_where_a_group_would_take_too_much_stack():
    """With seventeen stages, a block fits the stack limit, and a group with the history of eight members does not."""
    composed = replace(compiled("rigid_body").spec, composition="kahan-li")
    compilation = compile_spec(composed, order=8)
    code = emit(compilation.program, "c", COMMAND, single_file=True)["rigid_body.c"]
    assert "rigid_body_block(" in code
    assert "rigid_body_group" not in code
    many = solver(compilation, "c").ensemble([[0.1, 1.0, 0.1], [1.0, 0.2, 0.3], [0.5, 0.5, 0.5]], 0.1, 50)
    alone = solver(compilation, "c").integrate([0.1, 1.0, 0.1], 0.1, 50, stride=50).x[-1]
    np.testing.assert_allclose(many[0], alone, rtol=0, atol=1e-15)


def exercise(compilation, optimisation, folder, *, foreseen=True, units=2):
    """Build and run blocks.c for a system."""
    name = compilation.program.name
    code = emit(compilation.program, "c", COMMAND, single_file=True)
    write(folder, code)
    at = setting(compilation)
    definitions = [f"-DNAME={name}", f'-DSOURCE="{name}.c"', f"-DSTEP={at.h!r}"]
    definitions.append(f"-DULPS={GROWING.get(name, units * len(compilation.program.fractions))}")
    definitions.append(f"-DSTAGES={len(compilation.program.fractions)}")
    definitions.append(f"-DGROUPS={int(f'{name}_group;' in code[f'{name}.c'])}")
    definitions.append(f"-DMARCHES={int(f'{name}_march(' in code[f'{name}.c'])}")
    definitions += [f"-DTIMED={int(bool(compilation.program.time))}", f"-DGAUGED={int(bool(compilation.program.held))}"]
    definitions.append(f"-DFORESEEN={int(foreseen and name not in UNFORESEEN)}")
    definitions.append("-DSTATE=" + ", ".join(map(repr, at.x)))
    flags = ["-std=c99", optimisation, "-Wall", "-Wextra", "-Werror", "-Wno-unused-function"]
    run([tool("gcc"), *flags, *definitions, "-I.", EXERCISE, "-o", "blocks", "-lm"], folder)
    run([folder / "blocks"], folder)


def test_code_without_lanes_is_shorter_and_does_the_same():
    """`lanes: false` gives a loop over single steps, which agrees with blocks."""
    body = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 + q**4/4\norder: 4\n"
    with_lanes, without = compile_text(body), compile_text(f"{body}solver: {{lanes: false}}\n")
    lengths = [len(emit(c.program, "c", COMMAND)["t.c"].splitlines()) for c in (with_lanes, without)]
    assert lengths[1] < 0.6 * lengths[0]
    ends = [solver(c, "c").integrate([1.0, 0.0], 0.1, 400, stride=400).x[-1] for c in (with_lanes, without)]
    np.testing.assert_allclose(ends[1], ends[0], rtol=0, atol=1e-14)
    many = solver(without, "c").ensemble([[1.0, 0.0], [0.5, 0.1], [2.0, 0.0]], 0.1, 400)
    np.testing.assert_allclose(many[0], ends[0], rtol=0, atol=1e-14)
