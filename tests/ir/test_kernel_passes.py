"""Functions of kernels in the loop IR, the intermediate representation of generated code, and the passes over them.
Tests compare the text of a function before and after a pass.
"""

from textwrap import dedent

from ir.ir_text import text

from phigen.ir import nodes as ir
from phigen.ir.kernel_functions import kernel_function
from phigen.ir.passes.cutting import cut, workspace
from phigen.ir.passes.output_order import in_output_order
from phigen.ir.passes.simd_lanes import in_lanes
from phigen.ir.passes.zeros import without_zeros, zeros_first
from phigen.scheme.kernel import Kernel, Output
from phigen.symbolic.expression import ZERO, call, symbol
from phigen.symbolic.symbols import coefficient

x, y, c = symbol("x"), symbol("y"), symbol(coefficient(0))
INPUTS = {"coef": (coefficient(0),), "at": ("x", "y"), "params": ("k",)}


def kernel(*outputs: Output, named: tuple[tuple[str, object], ...] = ()) -> ir.Function:
    return kernel_function(Kernel("k", "a kernel", INPUTS, outputs, named), {"k": "k"})  # type: ignore[arg-type]


def expect(function: ir.Function, expected: str) -> None:
    assert text(function) == dedent(expected).strip()


def test_a_kernel_reads_entries_then_computes_and_stores() -> None:
    expect(kernel(Output("out", (x * symbol("k"), c * call("sin", x)))), """
        k(coef, at, params, out)
          real c:0 := coef[0]
          real x = at[0]
          real k := params.k
          out[0] <- k*x
          out[1] <- c:0*sin(x)
        """)  # fmt: skip


def test_arrays_with_many_zeros_are_cleared_and_sparse_code_stores_none() -> None:
    before = kernel(Output("few", (ZERO,)), Output("many", (*[ZERO] * 6, x)))
    expect(zeros_first(before), """
        k(coef, at, params, few, many)
          real x = at[0]
          few[0] <- 0
          clear 7 of many
          many[6] <- x
        """)  # fmt: skip
    assert [str(s.target.index.value) for s in without_zeros(before).body if isinstance(s, ir.Assign)] == ["6"]


def test_values_of_an_output_are_right_before_its_stores() -> None:
    first, second = call("sin", x), call("cos", y)
    outputs = (Output("one", (first, first)), Output("other_one", (second * second, second)))
    before = kernel(*outputs)
    expect(in_output_order(before, [], by_output=True), """
        k(coef, at, params, one, other_one)
          real x = at[0]
          real y = at[1]
          real t:1 = sin(x)
          one[0] <- t:1
          one[1] <- t:1
          real t:2 = cos(y)
          other_one[0] <- t:2**2
          other_one[1] <- t:2
        """)  # fmt: skip
    plain = in_output_order(before, [], by_output=False)
    assert [type(s).__name__ for s in plain.body] == ["Declare"] * 4 + ["Assign"] * 4


def test_values_that_parts_of_a_long_function_share_are_in_a_workspace() -> None:
    sine = call("sin", x)
    parts = cut(kernel(Output("out", (sine, sine * y, sine * x))), 2)
    assert len(parts) == 2
    assert workspace(parts) == 1
    expect(parts[0], """
        k(coef, at, params, out)
          real x = at[0]
          real w:0 := work[0]
          work[0] <- sin(x)
          out[0] <- w:0
        """)  # fmt: skip
    assert text(parts[1]).splitlines()[-2:] == ["  out[1] <- y*w:0", "  out[2] <- x*w:0"]


def test_lanes_are_an_inner_index_of_all_arrays_that_they_do_not_share() -> None:
    before = kernel(Output("out", (c * x,)))
    expect(in_lanes(before, frozenset(), frozenset({"coef"})), """
        k(coef, at, params, out)
          lanes lane in 0..LANES:
            real c:0 := coef[0][(distinct_coef * lane)]
            real x = at[0][lane]
            out[0][lane] <- c:0*x
        """)  # fmt: skip
    expect(in_lanes(before, frozenset({"coef", "out"}), single=True), """
        k(coef, at, params, out)
          real c:0 := coef[0]
          real x = at[0][lane]
          out[0] <- c:0*x
        """)  # fmt: skip
