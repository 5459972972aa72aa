"""Row drivers: functions of generated code that call the loops of a lattice row by row. Tests compare their text."""

from dataclasses import replace
from textwrap import dedent

from ir.ir_text import text
from ir.test_passes import lattice
from ir.test_row_passes import rows
from support import as_given

from phigen.ir import nodes as ir
from phigen.ir.row_drivers import (
    AWAY,
    COEF,
    FIRST_SITES,
    LAST_SITES,
    SEGMENT,
    RowDrivers,
    RowSegment,
    at,
    in_forms,
    member,
)
from phigen.targets.c.loops import statements

KICK, DRIFT = ir.Call("kick", (COEF, SEGMENT)), ir.Call("drift", (COEF, SEGMENT))
PARAMETERS = ("part", "coef", "full_range")


def expect(function: ir.Function, expected: str) -> None:
    assert text(function).splitlines()[1:] == [f"  {line}" for line in dedent(expected).strip().splitlines()]


def test_each_part_has_a_loop_over_segments_and_copies_the_ends_of_the_rows_that_it_updates() -> None:
    drivers = RowDrivers(rows(lattice("fput")), halo=1)
    cases = [RowSegment((KICK,), updated=[1]), RowSegment((DRIFT,), updated=[0])]
    expect(drivers.driver("sweep", "", PARAMETERS, cases), """
        discard full_range
        switch part:
          case 1:
            segments unit in first..end:
              recordtype row = piece_of(s, unit)
              kick(coef, &row)
              ends(s.x[1], s.length, row.from, row.to)
          case 2:
            segments unit in first..end:
              recordtype row = piece_of(s, unit)
              drift(coef, &row)
              ends(s.x[0], s.length, row.from, row.to)
        """)  # fmt: skip


def test_short_code_distinguishes_the_parts_inside_one_loop_that_threads_share() -> None:
    drivers = RowDrivers(rows(lattice("fput")), halo=0, may_be_empty=True, one_loop=True)
    driver = drivers.driver("sweep", "", PARAMETERS, [RowSegment((KICK,)), RowSegment((DRIFT,))], [1, 4], threads=4096)
    expect(driver, """
        discard full_range
        size units = units(s)
        segments unit in 0..units by threads above 4096 sites:
          recordtype row = piece_of(s, unit)
          if (row.from >= row.to):
            Continue
          switch part:
            case 1:
              kick(coef, &row)
            case 4:
              drift(coef, &row)
        """)  # fmt: skip


def test_sites_near_open_ends_have_loops_of_their_own() -> None:
    drivers = RowDrivers(rows(lattice("spins_1_open")), halo=1)
    calls = [(end, sites) for end, sites in (("_end", FIRST_SITES), ("", AWAY), ("_end", LAST_SITES))]
    case = RowSegment(tuple(ir.Call(f"sweep{end}", (COEF, at(sites))) for end, sites in calls))
    expect(drivers.driver("sweep", "", ("coef",), [case]), """
        segments unit in first..end:
          recordtype row = piece_of(s, unit)
          -- the sites i with second <= i < third are away from all open ends
          index begin = row.from, stop = row.to, low = 1, high = (s.length - 1)
          index second = (begin if (begin > low) else (stop if (stop < low) else low))
          index third = (stop if (stop < high) else (second if (high < second) else high))
          sweep_end(coef, between(&row, begin, second))
          sweep(coef, between(&row, second, third))
          sweep_end(coef, between(&row, third, stop))
        """)  # fmt: skip


def test_the_flag_far_selects_the_full_range_form() -> None:
    drivers = RowDrivers(rows(lattice("fput")), halo=0)
    calls = in_forms({"_full_range": (DRIFT,), "_near": (KICK,)})
    case = RowSegment(calls, (member("x", ir.fixed("coef")),))
    expect(drivers.driver("sweep", "", PARAMETERS, [case], alone=True), """
        discard part
        recordtype row = piece_of(s, unit)
        row.x <- coef
        if full_range:
          drift(coef, &row)
        else:
          kick(coef, &row)
        """)  # fmt: skip


def test_c_calls_the_function_that_a_flag_selects() -> None:
    """The C branches and calls one of two functions. A conditional expression that selects a function pointer is not
    inlined by gcc, and is 4 % slower on chains of 1,024 spins.
    """
    (choice,) = in_forms({"_full_range": (DRIFT,), "_near": (replace(DRIFT, name="drift_near"),)})
    printed = ir.Function("sweep", "", ir.Role.OTHER, PARAMETERS, (choice,))
    lines = ["    if (full_range) toda_drift(coef, &row);", "    else toda_drift_near(coef, &row);"]
    assert statements(printed, as_given("toda").program) == lines
