"""Functions of splittings in the loop IR, the intermediate representation of generated code: the flows, their order in
a step, and the reverse pass.
"""

from __future__ import annotations

from textwrap import dedent

from ir.ir_text import text
from support import as_given

from phigen.ir import nodes as ir
from phigen.ir.flow_functions import FlowFunctions, FlowTransposes, Transposed, group_schedule
from phigen.scheme.alternation import Schedule
from phigen.targets.c.loops import commented

PROGRAM = as_given("duffing").program
NAME = PROGRAM.name

#: A schedule of flows: a kick, then three times a drift and a kick, each with its row of coefficients.
SCHEDULE = Schedule((0.1, *[0.3, 0.3] * 3), 3, ((1, 0), (0, 1)))


def expect(function: ir.Function, expected: str) -> None:
    assert text(function) == dedent(expected).strip()


def test_flows_of_a_step_follow_each_other_and_a_tape_receives_the_states_before_them():
    expect(FlowFunctions(2, 2, stores=True).schedule(SCHEDULE), """
        flows(coef, x, displacement, start, tape)
          append x to tape
          flow1(coef, x, displacement, start)
          coef += ROW
          stages k in 0..3:
            append x to tape
            flow2(coef, x, displacement, start)
            append x to tape
            flow1((coef + ROW), x, displacement, start)
            coef += (2 * ROW)
        """)  # fmt: skip


def test_batches_count_rows_of_coefficients():
    assert "    flow1_full_range_lanes((row + 1), distinct_coef, group)\n    row += 2" in text(
        group_schedule(SCHEDULE, "_full_range")
    )


def test_values_that_a_flow_does_not_update_are_left_out():
    expect(FlowFunctions(2, 2).flow(1, [1]), """
        flow1(coef, x, displacement, start)
          vector change = None
          change1(coef, x, change)
          add(x, displacement, start, 1, change[0])
        """)  # fmt: skip
    assert text(FlowFunctions(2, 2).flow(1, [])).splitlines()[1:3] == ["  discard displacement", "  discard start"]


def test_cotangents_are_added_where_a_flow_has_read():
    flow = Transposed(state=[1], row=[0], before=[], reads=[(0, 1)], full_range=True, full_range_back=False)
    transposes = FlowTransposes([flow, flow], 2, 3, recomputes=False)
    assert "      bar[1] += back[0]\n      coef_bar[0] += slopes[0]" in text(transposes.back())
    stored = commented(transposes.group_flows(), PROGRAM)
    assert f"{NAME}_lanes tape[{NAME}_BACK_PACKS][2])" in stored
    assert "memcpy(tape[k][0], group->pack[k].x[0], 1 * sizeof tape[k][0]);" in stored
    assert f"if (group->full_range) {NAME}_flow2_full_range_lanes(row, 1, group);" in stored


def test_an_inverse_flow_needs_no_tape():
    flow = Transposed(state=[], row=[], before=[1], reads=[], full_range=False, full_range_back=False)
    back = text(FlowTransposes([flow], 2, 1, recomputes=True).group_back())
    assert back.startswith("follow_back_lanes(part, row, group, bar)")
    assert "copy before[0] to x[1]" in back
