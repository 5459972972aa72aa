"""``phigen build --stack``: the header states the stack that gcc reports; stacks without a bound are refused."""

import re
import subprocess
from pathlib import Path

import pytest
from tools import tool

BODY = """phigen: 1
name: body
coordinates: [x1, x2, x3]
poisson: {lie_algebra: {name: so(3), sign: minus}}
hamiltonian: x1**2/2 + x2**2/4 + x3**2/6
order: 4
"""
WORDS = ("build", "body.yaml", "-t", "c", "--profile", "certified")


@pytest.fixture(autouse=True)
def _gcc(monkeypatch, write):
    monkeypatch.setenv("CC", tool("gcc"))
    write("body.yaml", BODY)


def stated():
    header = Path("generated/body/body.h").read_text(encoding="utf-8")
    return {name: int(value) for name, value in re.findall(r"body_(STACK\w*) = (\d+)", header)}


@pytest.mark.parametrize("flags", ["-O2", "-Os -fno-inline"])
def test_header_states_the_stack_of_the_chain_of_calls(phigen, flags):
    """Each function of the chain has the size that gcc prints for it; without inlining the chain has several."""
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


def test_stack_used_by_a_running_step_is_within_the_bound(phigen, write):
    """A program paints the memory below its frame, makes a step, and looks how far the paint is gone."""
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
    assert stated()["STACK_OF_STEP"] / 2 < used < stated()["STACK_OF_STEP"] + 512  # the frames of main and of libm


def test_stacks_without_a_bound_and_other_compilers_are_refused(phigen, monkeypatch):
    for flags, why in [
        ("-O2 -fopenmp", "depends on its arguments|calls functions"),
        ("-mno-such-flag", "failed:"),
    ]:
        done = phigen("build", "body.yaml", "-t", "c", f"--stack={flags}")
        assert done.exit_code != 0
        assert re.search(why, done.output)
    monkeypatch.setenv("CC", "no-such-gcc")
    done = phigen(*WORDS, "--stack=-O2")
    assert done.exit_code != 0
    assert "no-such-gcc did not run" in done.output
    assert not Path("generated").exists()


def test_stack_needs_c_of_an_ordinary_system(phigen):
    done = phigen("build", "body.yaml", "-t", "numpy", "--stack=-O2")
    assert done.exit_code == 1
    assert "--stack of body: there is no target c" in done.output
    done = phigen("build", "toda", "-t", "c", "--stack=-O2")
    assert done.exit_code == 1
    assert "--stack of toda: not for lattices" in done.output
