"""Functions of paths in the loop IR, the intermediate representation of generated code: recurrences of Taylor
coefficients, and the sums over orders in SIMD lanes.
"""

from __future__ import annotations

from textwrap import dedent

from ir.ir_text import text
from support import as_given

from phigen.ir.path_functions import functions, lane_functions
from phigen.scheme.path import PathSlopes, path_of
from phigen.symbolic.expression import symbol
from phigen.targets.c.loops import commented

PROGRAM = as_given("nambu_pendulum").program
COORDINATES, NAME = PROGRAM.coordinates, PROGRAM.name


def path():
    """Return the path with the equations ṁ₁ = m₁ m₂, ṁ₂ = −3 m₁, ṁ₃ = m₁."""
    first, second, _ = map(symbol, COORDINATES)
    return path_of(COORDINATES, [first * second, -3 * first, first])


def test_orders_of_a_path_follow_each_other():
    begin, order, _ = (text(f) for f in functions(PROGRAM, path(), "path"))
    assert (
        begin
        == dedent("""
        path_begin(coef, p, s, f)
          discard coef
          discard p
          discard f
          real s:0 := s[0][0]
          real s:1 := s[1][0]
          s[3][0] <- s:1*s:0
          s[4][0] <- (-3)*s:0
        """).strip()
    )
    assert "    s[3][k] <- taylor_product(s[1], s[0], k)\n    s[4][k] <- (" in order
    assert "  s[0][(k + 1)] <- (s[3][k] / (k + 1))\n" in order


def test_sums_over_orders_are_loops_over_lanes():
    slopes = PathSlopes((), (), (), ())
    follow, further, *_ = lane_functions(PROGRAM, path(), slopes, ())
    printed = commented(follow, PROGRAM)
    assert f"static void {NAME}_follow({NAME}_lanes coef[restrict], {NAME}_expansion *e, int k)" in printed
    assert "            sum[0][lane] += e->s[1][j][lane] * e->s[0][k - j][lane];" in printed
    value = "e->s[1][0][lane] * e->s[0][k][lane] + e->s[1][k][lane] * e->s[0][0][lane];"
    assert f"e->s[3][k][lane] = sum[0][lane] + {value}" in printed
    assert text(further).splitlines()[1:3] == ["  discard coef", "  discard e"]
