"""Passes over the loop IR, the intermediate representation of generated code. Tests compare the text of a function
before and after a pass.
"""

from textwrap import dedent

from ir.ir_text import text
from lattice.lattices import LATTICES

from phigen.compiler import compile_spec
from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.passes.by_tables import by_tables
from phigen.ir.passes.forms import FULL_RANGE, IN_LANES, calling, forms_of
from phigen.ir.passes.function_parameters import discard_unread
from phigen.ir.passes.loop_invariant import loop_invariant
from phigen.ir.passes.open_ends import divided_at_ends
from phigen.ir.passes.simultaneous import simultaneous
from phigen.ir.passes.temporaries import temporaries
from phigen.ir.passes.whole_arrays import WholeArrays, identical
from phigen.scheme.kernel import Role
from phigen.scheme.steps import Sweeps
from phigen.spec import loads
from phigen.symbolic.expression import call, symbol
from phigen.symbolic.symbols import Symbol, coefficient

Q, P = ir.Array(ir.Storage.STATE, 0, "q"), ir.Array(ir.Storage.STATE, 1, "p")


def sweep(*body: ir.Statement, role: Role = Role.SWEEP) -> ir.Function:
    return ir.Function("sweep", "a sweep", role, ("coef",), (ir.Loop("sites", body),))


def lattice(name: str) -> LatticeLoops:
    program = compile_spec(loads(LATTICES[name])).program
    assert isinstance(program.step, Sweeps)
    return LatticeLoops(program, program.step)


def expect(function: ir.Function, expected: str) -> None:
    assert text(function) == dedent(expected).strip()


def test_temporaries_name_what_is_shared_and_leave_out_what_is_not_read() -> None:
    q, sine = symbol("q"), call("sin", symbol("q"))
    before = sweep(ir.real("q", ir.Load(Q)), ir.real("p", ir.Load(P)), ir.Store(P, sine * q**2 + sine))
    expect(before, """
        sweep(coef)
          sites:
            real q = x[q]
            real p = x[p]
            x[p] += sin(q) + sin(q)*q**2
        """)  # fmt: skip
    expect(temporaries(before), """
        sweep(coef)
          sites:
            real q = x[q]
            real t:1 = sin(q)
            x[p] += t:1 + t:1*q**2
        """)  # fmt: skip


def test_simultaneous_changes_are_computed_before_any_is_made() -> None:
    before = sweep(ir.Store(Q, symbol("p")), ir.Store(P, -symbol("q")))
    expect(simultaneous(before), """
        sweep(coef)
          sites:
            real change0 = p
            real change1 = -q
            x[q] += change0
            x[p] += change1
        """)  # fmt: skip
    one, other_role = sweep(ir.Store(Q, symbol("p"))), sweep(*before.body[0].body, role=Role.ADVANCE)
    assert simultaneous(one) == one
    assert simultaneous(other_role) == other_role


def test_tables_of_neighbours_are_read_once() -> None:
    loops = lattice("fput")
    kick = next(s for s in loops.step.sweeps if s.moved == (1,))
    expect(by_tables(loops.sweep(kick), loops), """
        sweep1(coef, x, sites)
          count of sites
          real c:0 = coef[0]
          real c:1 = coef[1]
          real c:2 = coef[2]
          indices near:1 = sites.near[1]
          indices near:0 = sites.near[0]
          plain i in 0..count:
            real q = x[i]
            index beside:1 = near:1[i]
            real q[i+1] = x[beside:1]
            index beside:0 = near:0[i]
            real q[i-1] = x[beside:0]
            x[(i + count)] += KICK
        """.replace("KICK", str(kick.kernel.roots[0])))  # fmt: skip


def test_bonds_are_two_lists_of_sites() -> None:
    loops = lattice("food_web")
    ends = next(s.gather.ends[0] for s in loops.step.sweeps if s.gather)
    gathered = temporaries(loops.sums(ends))
    expect(gathered, """
        gather1_a(coef, state, sites, colour)
          bonds:
            real r[b] = x[r]b
            real x[b] = x[x]b
            real A = bond A
            gathered[0] += A*x[b]*(1 - r[b]/x[b])
        """)  # fmt: skip
    expect(by_tables(gathered, loops), """
        gather1_a(coef, x, sites, colour)
          array at:r = sites.params.r
          array at:A = sites.params.A
          sums of sites
          here, there, bond of sites.bonds('a', 'there', colour)
          plain k in 0..here.length:
            index i = here[k]
            index j = there[k]
            real r[b] = at:r[j]
            real x[b] = x[j]
            real A = at:A[bond[k]]
            sums[i] += A*x[b]*(1 - r[b]/x[b])
        """)  # fmt: skip


def test_a_sweep_of_whole_arrays_returns_the_next_state() -> None:
    loops = lattice("fput")
    kick = next(s for s in loops.step.sweeps if s.moved == (1,))
    expect(WholeArrays(loops).sweep(loops.sweep(kick)), """
        sweep1(coef, x, sites)
          real c:0 := coef[0]
          real c:1 := coef[1]
          real c:2 := coef[2]
          real q = x[0]
          real q[i+1] = sites.shifted(x[0], 1)
          real q[i-1] = sites.shifted(x[0], -1)
          real moved = x.copy()
          moved[1] <- (x[1] + (KICK))
          return moved
        """.replace("KICK", str(kick.kernel.roots[0])))  # fmt: skip


def test_sums_over_all_bonds_are_one_function_of_whole_arrays() -> None:
    loops = lattice("food_web")
    gather = next(s.gather for s in loops.step.sweeps if s.gather)
    both = WholeArrays(loops).sums([loops.sums(ends) for ends in gather.ends])
    *_, summed, end = text(both).splitlines()
    assert summed == "    sums <- (sums + np.array([sites.summed(A*x[b]*(-1 + r[b]/x[b]), here)]))"
    assert end == "  return sums"


def test_sweeps_that_differ_in_their_colour_share_a_function() -> None:
    one = ir.Function("one", "", Role.SWEEP, ("x", "colour=0"), (ir.Return(ir.fixed("x")),))
    other = ir.Function("other", "", Role.SWEEP, ("x", "colour=1"), one.body)
    first, second = identical([one, other])
    assert first == one
    expect(second, """
        other(x)
          return _one(x, colour=1)
        """)  # fmt: skip


def test_invariant_values_are_read_before_the_loop() -> None:
    read = (ir.real("q", ir.Load(Q)), ir.real(coefficient(2), ir.Coefficient(2)), ir.real("t", ir.Time()))
    before = sweep(*read, ir.Store(P, symbol("q") * symbol(coefficient(2)) + symbol("t")))
    expect(loop_invariant(before), """
        sweep(coef)
          real c:2 = Coefficient(number=2)
          real t = Time()
          sites:
            real q = x[q]
            x[p] += t + c:2*q
        """)  # fmt: skip


WEIGHT = Symbol("present", 0, 1)


def test_all_terms_are_present_away_from_open_ends() -> None:
    weight = ir.real(WEIGHT, ir.Inside(0, ((0, 1),)))
    before = sweep(weight, ir.Store(P, symbol(WEIGHT) * symbol("r") + symbol("q")),
                   ir.Store(Q, symbol(WEIGHT) - 1))  # fmt: skip
    away, near = divided_at_ends(before)
    expect(away, """
        sweep(coef)
          sites:
            x[p] += q + r
        """)  # fmt: skip
    assert (near.name, near.body) == ("sweep_end", before.body)
    assert divided_at_ends(away) == [away]


def test_functions_have_a_small_argument_and_a_full_range_form() -> None:
    before = sweep(ir.Store(P, call("sin", symbol("q")) + call("exp", symbol("q")) + call("atan", symbol("q"))))
    forms = forms_of([before], ["sin"], {"sin"}, IN_LANES)
    assert [text(calling(before, versions)).splitlines()[-1].split(" += ")[1] for versions in forms.values()] == [
        "atan(q) + (sin_near(q) + exp_lane(q))",
        "atan(q) + (sin_lane(q) + exp(q))",
    ]
    assert [*forms] == ["_near", "_full_range"]
    assert forms_of([before], ["sin"], {"expm1"}, FULL_RANGE) == {"": FULL_RANGE}


def test_parameters_that_are_not_read_are_discarded() -> None:
    before = ir.Function("f", "", Role.OTHER, ("coef", "row", "sums"), (ir.Call("g", (ir.fixed("row"),)),))
    expect(discard_unread(before), """
        f(coef, row, sums)
          discard coef
          discard sums
          g(row)
        """)  # fmt: skip
