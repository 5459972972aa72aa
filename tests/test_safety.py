"""The statements of docs/safety.md on generated C are true: bounded stacks, no calls except of libm, numbers of
operations.
"""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support import tool

from phigen.compiler import emit
from phigen.errors import ToolchainError

DOCS = Path(__file__).resolve().parent.parent / "docs"
_location = importlib.util.spec_from_file_location("make_safety", DOCS / "make_safety.py")
safety = importlib.util.module_from_spec(_location)
sys.modules[safety.__name__] = safety  # dataclasses look up their module here
_location.loader.exec_module(safety)

#: The page docs/safety.md. The tables in it are compared except for numbers that depend on the compiler.
PAGE = safety.PAGE.read_text(encoding="utf-8")
#: Factor by which the stack of another version of gcc may exceed that in the page.
OTHER_COMPILERS = 1.5


def written(folder, compilation):
    for file, text in emit(compilation.program, "c", "").items():
        (folder / file).write_text(text, encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("name", safety.SYSTEMS)
def test_stack_is_bounded_and_nothing_but_libm_is_called(name):
    compilation = safety.small(name)
    graph = safety.stacks(compilation)
    assert set(graph.kinds.values()) == {"static"}, "no function has a stack that depends on its arguments"
    assert {f for f in graph.external if not f.startswith(name)} <= safety.LIBRARY
    (row,) = re.findall(rf"^\| {name} \| (.*) \|$", PAGE, re.M)
    order, *stacks, additions, products, quotients, functions = map(int, row.split(" | "))
    measured = [graph.deepest(f"{name}_{function}") for function in ("init", "step")]
    assert all(m <= OTHER_COMPILERS * shown for m, shown in zip(measured, stacks, strict=True)), measured
    program = compilation.program
    counted = [program.about.operations[kind] for kind in ("additions", "multiplications", "divisions", "functions")]
    assert [program.order, *counted] == [order, additions, products, quotients, functions]


def test_recursion_is_seen():
    graph = safety.CallGraph({"a": 8, "b": 16}, {"a": {"b"}, "b": {"a"}}, {"a": "static", "b": "static"})
    with pytest.raises(ToolchainError, match="a can call itself: a → b → a"):
        graph.deepest("a")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pendulum_euler", "rigid_body", "dzhanibekov", "predator_prey"])
def test_rules_that_are_not_kept_are_listed_with_a_reason(name):
    tool("cppcheck")
    places = safety.misra(safety.small(name))
    assert places.keys() <= safety.REASONS.keys()
    if name == "rigid_body":
        shown = dict(re.findall(r"^\| ([\d.]+) \| (?:advisory|required) \| (\d+) \|", PAGE, re.M))
        assert all(places[rule] <= int(count) for rule, count in shown.items()), places


FAILING = """
#include <stdio.h>
#include "rigid_body.h"
int main(void)
{
    const double x0[3] = {1.0, 2.0, 3.0};
    rigid_body_solver s;
    size_t most = 0;
    int failed = 0;
    for (double h = 0.05; h < 1e4; h *= 1.05) {
        if (rigid_body_init(&s, NULL, x0) != rigid_body_OK) return 1;
        (void)rigid_body_integrate(&s, 0.01, 20); /* a history that misleads the predictor */
        for (int step = 0; step < 3; ++step) {
            const size_t before = s.evaluations;
            failed += rigid_body_step(&s, h) != rigid_body_OK;
            if (s.evaluations - before > most) most = s.evaluations - before;
        }
    }
    printf("%zu %d %d\\n", most, failed, rigid_body_MOST_EVALUATIONS);
    return 0;
}
"""


def test_a_step_evaluates_its_kernel_no_more_often_than_the_page_says(tmp_path):
    written(tmp_path, safety.small("rigid_body"))
    (tmp_path / "main.c").write_text('#include "rigid_body.c"\n' + FAILING, encoding="utf-8")
    subprocess.run(["cc", "-std=c99", "-O1", "main.c", "-lm", "-o", "main"], cwd=tmp_path, check=True)
    most, failed, bound = map(int, subprocess.run([tmp_path / "main"], capture_output=True, check=True).stdout.split())
    assert failed > 10
    assert 10 < most <= bound == 40


def test_code_has_no_jumps_pointers_to_functions_or_unions():
    for name in ("rigid_body", "pendulum_euler", "dzhanibekov"):
        (text,) = (t for f, t in emit(safety.small(name).program, "c", "").items() if f.endswith(".c"))
        assert not re.search(r"\b(goto|union|setjmp|errno|malloc|free|printf)\b|\(\*\w+\)\(", text)
