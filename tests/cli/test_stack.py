"""``phigen build --stack``: the header states the stack that gcc reports; stacks without a bound are refused."""

import re
import subprocess
from pathlib import Path

import pytest
from tools import tool

from phigen.compiler import compile_spec, emit
from phigen.errors import ToolchainError
from phigen.resources import bundled
from phigen.runtime.stack import call_graph, stack_bound
from phigen.spec import load

BODY = """phigen: 1
name: body
coordinates: [x1, x2, x3]
poisson: {lie_algebra: {name: so(3), sign: minus}}
hamiltonian: x1**2/2 + x2**2/4 + x3**2/6
order: 4
"""
STEP = "void a_step(void) {}\n"
WORDS = ("build", "body.yaml", "-t", "c", "--profile", "certified")


@pytest.fixture(autouse=True)
def _gcc(monkeypatch, write):
    monkeypatch.setenv("CC", tool("gcc"))
    write("body.yaml", BODY)


def stated():
    header = Path("generated/body/body.h").read_text(encoding="utf-8")
    return {name: int(value) for name, value in re.findall(r"body_(STACK\w*) = (\d+)", header)}


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("flags", ["-O2", "-Os -fno-inline"])
def test_header_states_the_stack_of_the_chain_of_calls(phigen, flags):
    """The stated stack is the sum of the frame sizes along the longest chain of calls. gcc prints the size of each
    frame, and without inlining a chain has several frames.
    """
    done = phigen(*WORDS, f"--stack={flags}")
    assert done.exit_code == 0, done.output
    stack = stated()
    command = [tool("gcc"), "-std=c99", *flags.split(), "-fstack-usage", "-c", "body.c"]
    subprocess.run(command, cwd="generated/body", check=True)
    lines = Path("generated/body/body.su").read_text(encoding="utf-8").splitlines()
    sizes = {line.split(":")[3].split()[0]: int(line.split()[1]) for line in lines}
    assert max(sizes.values()) <= stack["STACK"] <= sum(sizes.values())
    assert sizes["body_step"] < stack["STACK_OF_STEP"] <= stack["STACK"]
    assert sizes["body_init"] <= stack["STACK_OF_INIT"] <= stack["STACK"]
    header = Path("generated/body/body.h").read_text(encoding="utf-8")
    version = subprocess.run([tool("gcc"), "--version"], capture_output=True, text=True, check=True).stdout
    assert f"{version.splitlines()[0]} for" in " ".join(header.split())
    assert f"with {flags}. */" in " ".join(header.split())
    assert phigen(*WORDS, f"--stack={flags}", "--check").exit_code == 0
    assert phigen(*WORDS, "--stack=-O0", "--check").exit_code == 5


@pytest.mark.slow
def test_stack_used_by_a_running_step_is_within_the_bound(phigen, write):
    """A program fills the memory below its frame with a pattern, makes a step, and counts the bytes that have
    changed.
    """
    assert phigen(*WORDS, "--stack=-O2").exit_code == 0
    main = """#include <stdio.h>
#include <string.h>
#include "body.h"
enum { DEEP = 1 << 14 };
static __attribute__((noinline)) void paint(void) { volatile char a[DEEP]; for (int k = 0; k < DEEP; k++) a[k] = 77; }
static __attribute__((noinline)) int untouched(void)
{
    volatile char a[DEEP];
    int k = 0;
    while (k < DEEP && a[k] == 77) k++;
    return k;
}
int main(void)
{
    const double x0[3] = {0.1, 1.0, 0.1};
    static body_solver s;
    if (body_init(&s, NULL, x0) != body_OK) return 1;
    paint();
    if (body_step(&s, 0.1) != body_OK) return 1;
    printf("%d\\n", DEEP - untouched());
}
"""
    write("generated/body/main.c", main)
    command = [tool("gcc"), "-std=c99", "-O2", "-w", "main.c", "body.c", "-lm", "-o", "main"]
    subprocess.run(command, cwd="generated/body", check=True)
    used = int(subprocess.run(["generated/body/main"], capture_output=True, text=True, check=True).stdout)
    # 512 bytes for the frames of main and of libm.
    assert stated()["STACK_OF_STEP"] / 2 < used < stated()["STACK_OF_STEP"] + 512


def test_stacks_without_a_bound_and_other_compilers_are_refused(phigen, monkeypatch):
    for flags, why in [
        ("-O2 -fopenmp", "calls functions that the graph of calls does not show"),
        ("-mno-such-flag", "failed:"),
    ]:
        done = phigen("build", "body.yaml", "-t", "c", f"--stack={flags}")
        assert done.exit_code != 0
        assert why in done.output
    with pytest.raises(ToolchainError, match="the stack of a_init depends on arguments, without a bound"):
        stack_bound({"a.c": f"void use(char *);\nvoid a_init(int n) {{ char b[n]; use(b); }}\n{STEP}"}, "a", "-O1")
    text = "int use(int);\nint a_init(int n) { return n ? use(a_init(n - 1)) : 0; }\n"
    with pytest.raises(ToolchainError, match="a_init can call itself: a_init → a_init"):
        stack_bound({"a.c": text + STEP}, "a", "-O0")
    monkeypatch.setenv("CC", "no-such-gcc")
    done = phigen(*WORDS, "--stack=-O2")
    assert done.exit_code != 0
    assert "no-such-gcc did not run" in done.output
    assert not Path("generated").exists()


def test_functions_that_are_called_by_others_belong_to_the_chain(monkeypatch):
    """The bounds of init and of step are those of the chains that begin with these functions. The longest chain may
    begin with another function.
    """
    frames = {"init": 100, "step": 300, "run": 50}
    text = "void use(char *);\n" + "".join(
        f"void a_{name}(void) {{ char b[{size}]; use(b); {'a_step(); use(b);' * (name == 'run')} }}\n"
        for name, size in frames.items()
    )
    bound = stack_bound({"a.c": text}, "a", "-O0 -fno-stack-protector")
    sizes = call_graph({"a.c": text}, "a", ["-O0", "-fno-stack-protector"]).stack
    assert (bound.init, bound.step, bound.longest) == (
        sizes["a_init"], sizes["a_step"], sizes["a_run"] + sizes["a_step"],
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("rigid_body", {"profile": "fast"}), ("nambu_pendulum", {"profile": "certified"}),
        ("kowalevski_gauss", {"profile": "fast"}), ("henon_heiles", {"profile": "fast", "adjoint": True}),
        ("thermal_spin", {"profile": "small"}), ("kepler", {"profile": "small", "real": "float"}),
    ],
)  # fmt: skip
def test_solvers_of_all_kinds_have_a_bound(name, options):
    """Functions with vectors align their frames at run time. For these gcc prints an upper bound of the size of the
    frame, which suffices for a bound of the stack.
    """
    program = compile_spec(load(bundled()[name]), **options).program
    bound = stack_bound(emit(program, "c", ""), name, "-O2")
    assert 0 < bound.step <= bound.longest
    assert bound.init <= bound.longest


def test_stack_needs_c_of_an_ordinary_system(phigen):
    done = phigen("build", "body.yaml", "-t", "numpy", "--stack=-O2")
    assert done.exit_code == 1
    assert "--stack of body: there is no target c" in done.output
    assert "hint: add -t c, or leave out --stack" in done.output
    done = phigen("build", "toda", "-t", "c", "--stack=-O2")
    assert done.exit_code == 1
    assert "--stack of toda: not for lattices" in done.output
    assert "hint: build the lattice without --stack" in done.output
