"""The pass that lowers loops over a lattice to loops over its rows. Tests compare the text of a function before and
after the pass.
"""

from dataclasses import replace
from textwrap import dedent

from ir.ir_text import text
from ir.test_passes import P, Q, lattice

from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.passes import row_loops, row_transposes
from phigen.ir.passes.by_rows import RowLayout
from phigen.scheme.kernel import Role
from phigen.symbolic.expression import symbol
from phigen.symbolic.symbols import Symbol, coefficient

BAR = ir.Array(ir.Storage.COTANGENT, 0, "q")
SEED = Symbol("change_bar", 0)
Q_READ, NEXT = ir.real("q", ir.Load(Q, (0,))), ir.real("q[i+1]", ir.Load(Q, (1,)))


def built(role: Role, *body: ir.Statement, once: tuple[ir.Statement, ...] = ()) -> ir.Function:
    return ir.Function("f", "", role, ("coef",), (*once, ir.Loop("sites", body)))


def rows(loops: LatticeLoops) -> RowLayout:
    lines = dict.fromkeys(offset[:-1] for _, offset in loops.step.sites.places.values()) or {(): None}
    return RowLayout(loops, tuple(lines), {p.name: p.name for p in loops.program.parameters})


def expect(result: ir.Function | ir.Block, expected: str) -> None:
    function = result if isinstance(result, ir.Function) else ir.Function("f", "", Role.SWEEP, (), result)
    assert text(function).splitlines()[1:] == [f"  {line}" for line in dedent(expected).strip().splitlines()]


def test_a_sweep_reads_neighbours_in_place_and_adds_to_what_it_has_read() -> None:
    once = (ir.real(coefficient(0), ir.Coefficient(0)),)
    change = ir.Store(Q, symbol(coefficient(0)) * symbol("q[i+1]"))
    function = built(Role.SWEEP, Q_READ, NEXT, change, once=once)
    expect(row_loops.sweep(function, rows(lattice("fput"))), """
        real c:0 := c0
        real q[i+1] := q_row[(i + 1)]
        real c0 = coef[0]
        pointer q_row = row.x[0]
        row i in row.from..row.to:
          real q = q_row[i]
          q_row[i] <- (q + ... c:0*q[i+1])
        """)  # fmt: skip


def test_compensated_sweep_stores_compensation_terms() -> None:
    function = built(Role.SWEEP, ir.Store(P, symbol("h")))
    expect(row_loops.sweep(function, rows(lattice("fput")), compensated=True), """
        discard coef
        pointer carry:p = row.s.carry[1]
        pointer p_row = row.x[1]
        row i in row.from..row.to:
          real add0 = (carry:p[i] + ... h), sum0 = (p_row[i] + add0)
          carry:p[i] <- (add0 - (sum0 - p_row[i]))
          p_row[i] <- sum0
        """)  # fmt: skip


def test_a_sweep_of_one_colour_steps_from_one_of_its_sites_to_the_next() -> None:
    store = ir.Store(ir.Array(ir.Storage.STATE, 0, "a"), symbol("h"))
    loop = ir.Loop("sites", (store,), selection=ir.Selection(1))
    layout = rows(lattice("volterra"))
    function = row_loops.sweep(ir.Function("f", "", Role.SWEEP, ("coef",), (loop,)), layout)
    assert text(function).splitlines()[-2] == "  row i in first(row, 1, row.from)..row.to by 2:"
    function = row_loops.sweep(ir.Function("f", "", Role.SWEEP, ("coef",), (loop,)), layout, passed=True)
    assert text(function).splitlines()[-2] == "  row i in first(row, row.swept, row.from)..row.to by 2:"


def test_sums_over_bonds_pass_over_those_without_a_site_of_the_colour() -> None:
    loops = lattice("food_web")
    ends = next(s.gather.ends[0] for s in loops.step.sweeps if s.gather)
    before = loops.sums(ends)
    loop = replace(before.body[-1], body=(ir.real("x[b]", ir.Load(ir.Array(ir.Storage.STATE, 0, "x"), end="b")),
                                          ir.Store(ir.Array(ir.Storage.SUM, 0), symbol("x[b]"))))  # fmt: skip
    expect(row_loops.over_bonds(row_loops.BondLoop(replace(before, body=(loop,))), rows(loops), first=True), """
        discard coef
        pointer x_row = row.x[0]
        row i in row.from..row.to:
          real sum0 = 0.0
          plain k in row.s.bonds[i]..row.s.middle[i]:
            if (row.s.colours[row.s.other[k]] != row.chosen):
              Continue
            index j = row.s.other[k]
            real x[b] = x_row[j]
            sum0 += x[b]
          row.s.gathered[0][i] <- sum0
        """)  # fmt: skip


def transpose(*body: ir.Statement) -> row_transposes.Transpose:
    seed = ir.real(SEED, ir.Load(ir.Array(ir.Storage.SEED, 0, "change_bar")))
    handed = (row_transposes.Handed(0, 0, (1,)),)
    return row_transposes.Transpose(built(Role.TRANSPOSED_SWEEP, seed, *body), "change_bar", (1,), handed)


def test_cotangents_of_neighbours_are_handed_over() -> None:
    own_store, beside = ir.Store(BAR, symbol(SEED)), ir.Store(BAR, -symbol(SEED), offset=(1,))
    layout = rows(lattice("fput"))
    both = transpose(own_store, beside)
    expect(row_transposes.transposed(both, layout, vectors=False), """
        discard coef
        discard sums
        pointer bar_0 = row.bar[0]
        pointer bar_1 = row.bar[1]
        pointer handed_0 = row.handed[0]
        row i in row.from..row.to:
          real change_bar:0 = bar_1[i]
          bar_0[i] += change_bar:0
          handed_0[i] <- -change_bar:0
        """)  # fmt: skip
    expect(row_transposes.handing("hand", "", both.handed, layout), """
        pointer handed_0 = row.handed[0]
        pointer bar_0 = row.bar[0]
        row i in row.from..row.to:
          bar_0[i] += handed_0[(i - 1)]
        """)  # fmt: skip


SHARE = ir.Reduce("coef", 3, coefficient(3), symbol("q"))


def test_sums_over_sites_are_kept_in_vectors() -> None:
    body = (*row_transposes.in_vectors((Q_READ,), [SHARE]),)
    expect(body, """
        vector share0 = [0.0]
        index to = row.to, whole = (to - ((to - row.from) % 8))
        index lanes = LANES((whole - row.from))
        plain j in row.from..whole by lanes:
          plain l in 0..lanes:
            index i = (j + l)
            real q = x[q]
            ADD(share0, l, q)
        plain i in whole..to:
          real q = x[q]
          share0[0] += q
        sums[3] += total(share0)
        """)  # fmt: skip


def test_sums_over_sites_are_kept_apart_in_batches() -> None:
    expect((*row_transposes.in_batches((Q_READ,), [SHARE], rows(lattice("fput")), None),), """
        index apart = ((row.to - row.from) if ((row.to - row.from) < ADDED) else ADDED)
        vector share0 = None
        clear apart of share0
        plain begin in row.from..row.to by ADDED:
          index end = (row.to if ((row.to - begin) < ADDED) else (begin + ADDED))
          row i in begin..end:
            real q = x[q]
            share0[(i - begin)] += q
        sums[3] += added(share0, apart)
        """)  # fmt: skip
