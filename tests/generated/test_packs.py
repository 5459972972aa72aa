"""Ensembles of splittings and explicit steps: members in SIMD batches agree with single trajectories."""

import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from support import COMMAND, SPECIES, TARGETS, compile_text, compiled, run, setting, slow_but, solver, tool, write

from phigen.compiler import emit
from phigen.errors import StepError
from phigen.scheme.steps import Explicit, Splitting
from phigen.targets.c import kernels

EXERCISE = Path(__file__).with_name("packs.c")

#: Splittings, each with a factor of the step size beyond which arguments leave the range of the small-argument
#: polynomials.
FAR = {
    "ablowitz_ladik3": 1,
    "henon_heiles": 1,
    "kepler": 1,
    "lagrange_top": 500,
    "lotka_volterra": 1,
    "spin_chain5": 250,
    "toda3_quadratic": 500,
    "volterra5": 50,
    "vortices3": 1,
}

PAIR = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
EULER = PAIR + "birealisation: canonical-euler\norder: 1\n"
RUN = "runs: {one: {initial: [1, 0.5], step: 0.1, steps: 1}}\n"

#: Explicit steps, with the allowed difference in units in the last place: sin has its own version for SIMD lanes.
EXPLICIT = {
    "a quartic": (EULER + "hamiltonian: p**2/2 + q**4/4\n", 0),
    "a pendulum": (EULER + "hamiltonian: p**2/2 - cos(q)\n", 40),
    "five stages": (PAIR + "order: 4\ncomposition: suzuki\nhamiltonian: p**4/4 + q\n", 0),
}


def exercise(compilation, folder, optimisation, ulps, far):
    """Compile and run packs.c for a system."""
    name, at = compilation.program.name, setting(compilation)
    write(folder, emit(compilation.program, "c", COMMAND, single_file=True))
    definitions = [f"-DNAME={name}", f'-DSOURCE="{name}.c"', f"-DSTEP={at.h!r}", f"-DULPS={ulps}", f"-DFAR={far}"]
    definitions.append("-DSTATE=" + ", ".join(map(repr, at.x)))
    flags = ["-std=c99", *optimisation.split(), "-Wall", "-Wextra", "-Werror", "-Wno-unused-function"]
    run([tool("gcc"), *flags, *definitions, "-I.", EXERCISE, "-o", "packs", "-lm"], folder)
    run([folder / "packs"], folder)


SAME = {*FAR} - {"kepler"}  # in batches the eccentric anomaly is computed by another iteration


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", slow_but(SAME - {"ablowitz_ladik3", "spin_chain5", "volterra5"}, sorted(SAME)))
def test_members_of_splittings_equal_single_trajectories_bit_for_bit(name, tmp_path):
    """The bits are equal if arguments are small and multiplications and additions are not fused; otherwise members
    agree to round-off.
    """
    exercise(compiled(name, 4, "splitting"), tmp_path, "-O0", 0, FAR[name])


def test_flows_that_are_printed_in_parts_do_the_same(tmp_path, monkeypatch):
    """Large flows are divided into several functions, which read the coefficients of every lane."""
    monkeypatch.setattr(kernels, "LONGEST_FUNCTION", 2)
    compilation = compiled("henon_heiles", 4, "splitting")
    (text,) = emit(compilation.program, "c", COMMAND, single_file=True).values()
    assert "_change2_lanes_part2(coef, state, change, work);" in text
    exercise(compilation, tmp_path, "-O0", 0, 1)


@pytest.mark.parametrize("name", slow_but(["kepler"], ["spin_chain5", "kepler"]))
def test_vectorised_packs_equal_single_trajectories(name, tmp_path):
    exercise(compiled(name, 4, "splitting"), tmp_path, "-O3 -march=native -ffp-contract=fast", 40, FAR[name])


@pytest.mark.parametrize("kind", EXPLICIT)
def test_members_of_explicit_steps_equal_single_trajectories(kind, tmp_path):
    text, ulps = EXPLICIT[kind]
    compilation = compile_text(text + RUN)
    assert isinstance(compilation.program.step, Explicit)
    exercise(compilation, tmp_path, "-O0", ulps, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but(["toda3_quadratic"], ["kepler", "toda3_quadratic"]))
@pytest.mark.parametrize("compiler", slow_but(["clang"], ["gcc", "clang"]))
def test_packs_compile_without_a_warning_where_loops_cannot_be_vectorised(name, compiler, tmp_path):
    """This includes -Wpass-failed of clang, which loses the place of a loop when OpenMP moves it into another
    function.
    """
    write(tmp_path, emit(compiled(name, 4, "splitting").program, "c", COMMAND, single_file=True))
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror"]
    for flags in (["-O2", "-fopenmp"], ["-O3", "-march=native"]):
        run([tool(compiler), *strict, *flags, "-c", f"{name}.c", "-o", "packs.o"], tmp_path)


#: Program that prints the status and the bits of all members, one of which has no state.
THREADS = """
#include <stdio.h>
#include "{name}.c"
int main(void)
{{
    static double x[{name}_DIM][100];
    const double start[] = {{ {state} }};
    for (int i = 0; i < {name}_DIM; ++i)
        for (int m = 0; m < 100; ++m) x[i][m] = start[i] * (1.0 + 0.01 * m);
    x[0][40] = (double)NAN;
    printf("%d\\n", (int){name}_ensemble(NULL, &x[0][0], 100, {h!r}, 100, NULL));
    for (int i = 0; i < {name}_DIM; ++i)
        for (int m = 0; m < 100; ++m) printf("%a\\n", x[i][m]);
    return 0;
}}
"""

#: Starts of members of which the second and the last become infinite, one after the other.
BLOW_UP = np.array([[0.3, 0.9, 0.6], [-3.0, 5.0, 0.001], [0.5, 0.2, 0.1], [-2.5, 5.0, 0.001]])


@pytest.mark.parametrize("target", TARGETS)
def test_members_that_blow_up_keep_their_last_states_and_disturb_nobody(target):
    """They fail between two checks for finite values."""
    solve = solver(compile_text(SPECIES + "order: 4\n", scheme="splitting"), target)
    with pytest.raises(StepError) as many:
        solve.ensemble(BLOW_UP, 1e-3, 400)
    assert (many.value.members, many.value.status) == ((1, 3), "NOT_FINITE")
    failed = set()
    for k in many.value.members:
        with pytest.raises(StepError) as single:
            solve.integrate(BLOW_UP[k], 1e-3, 400)
        last = single.value.trajectory.x[-1]
        np.testing.assert_allclose(many.value.trajectory[k], last, rtol=1e-9)  # near the singularity round-off grows
        failed.add(single.value.step)
    assert len(failed) == 2
    assert all(200 < step < 399 for step in failed)
    for k in (0, 2):
        alone = solve.integrate(BLOW_UP[k], 1e-3, 400, stride=400).x[-1]
        np.testing.assert_allclose(many.value.trajectory[k], alone, rtol=1e-13)


def test_code_without_lanes_is_shorter_and_does_the_same():
    body = PAIR + "hamiltonian: p**2/2 - cos(q)\norder: 4\nscheme: splitting\n"
    with_lanes, without = compile_text(body), compile_text(f"{body}solver: {{lanes: false}}\n")
    texts = [emit(c.program, "c", COMMAND)["t.c"] for c in (with_lanes, without)]
    assert ["t_pack" in text for text in texts] == [True, False]
    start = np.array([[0.1 * k, 1.0] for k in range(11)])
    ends = [solver(c, "c").ensemble(start, 0.1, 100) for c in (with_lanes, without)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-14)


def test_functions_without_a_version_for_lanes_leave_members_by_themselves():
    compilation = compile_text(PAIR + "hamiltonian: p**2/2 + q*atan(q)\norder: 4\nscheme: splitting\n")
    assert "t_pack" not in emit(compilation.program, "c", COMMAND)["t.c"]


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", ["kepler", "lagrange_top", "pendulum_euler"])
def test_threads_change_no_bit(name, tmp_path):
    """100 members make four groups, the last of which is not full."""
    scheme = None if name == "pendulum_euler" else "splitting"
    compilation = compiled(name, None, scheme)
    at = setting(compilation)
    write(tmp_path, emit(compilation.program, "c", COMMAND, single_file=True))
    state = ", ".join(map(repr, at.x))
    write(tmp_path, {"main.c": THREADS.format(name=name, state=state, h=at.h)})
    printed = []
    for flags in ([], ["-fopenmp"]):
        run([tool("gcc"), "-std=c99", "-O0", *flags, "main.c", "-o", "main", "-lm"], tmp_path)
        printed.append(run([tmp_path / "main"], tmp_path, OMP_NUM_THREADS="3"))
    assert printed[0] == printed[1]
    assert printed[0].splitlines()[0] == "4"
    assert len(set(printed[0].splitlines())) > 90


@pytest.mark.parametrize("scheme", ["series", "splitting"])
def test_what_lanes_cannot_compute_is_not_taken_for_infinite(scheme):
    """exp(−800) is 0, but outside of the range of the lane version of exp. If it were taken for infinite, the force
    would be 0, and the step would not fail.
    """
    text = "coordinates: [q, p, c]\npoisson: {brackets: {q: {p: 1}}}\nhamiltonian: p**2/2 + q/(1 + exp(c))\norder: 2\n"
    compilation = compile_text(text, scheme=scheme)
    assert isinstance(compilation.program.step, Explicit | Splitting)
    ends = solver(compilation, "c").ensemble([[0.0, 0.0, -800.0], [0.0, 0.0, 0.0]], 0.125, 64)
    np.testing.assert_allclose(ends, [[-32, -8, -800], [-16, -4, 0]], rtol=1e-14)


VECTORS = list(product(["gcc", "clang"], ["henon_heiles", "spin_chain5", "volterra5"]))


@pytest.mark.thin(2)
@pytest.mark.parametrize(("compiler", "name"), slow_but([v for v in VECTORS if v[1] == "henon_heiles"], VECTORS))
def test_steps_of_packs_become_vector_instructions(name, compiler, tmp_path):
    """Both compilers vectorise all arithmetic with -O2 and instructions of the year 2013. Coefficients that members
    share are loaded as one number for all lanes.
    """
    write(tmp_path, emit(compiled(name, 4, "splitting").program, "c", COMMAND, single_file=True))
    flags = ["-std=c99", "-O2", "-march=haswell", "-fno-math-errno", "-S"]
    run([tool(compiler), *flags, f"{name}.c", "-o", "packs.s"], tmp_path)
    vector, scalar, spread, function = 0, 0, 0, ""
    steps = re.compile(r".*_(?:lanes|group_(?:run|steps|advance))")
    beside = (
        "_group_run",
        "_full_range_lanes",
    )  # the first may contain single steps; the second calls libm for each lane
    for line in (tmp_path / "packs.s").read_text().splitlines():
        label = re.match(r"(\w[\w.]*):", line)
        function = label[1] if label else function
        arithmetic = re.match(r"\s+v(?:add|sub|mul|fn?m(?:add|sub)\d+)([ps]d)\s", line)
        if not steps.fullmatch(function):
            continue
        spread += bool(re.match(r"\s+vbroadcastsd\s+\S*\(%(?!rip)", line))
        if arithmetic:
            vector += arithmetic[1] == "pd"
            scalar += arithmetic[1] == "sd" and not function.endswith(beside)
    assert vector > 40
    assert scalar == 0
    assert spread > 4  # clang broadcasts two more for a member that joins
