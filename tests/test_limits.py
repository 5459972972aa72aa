"""Large specs, which could exhaust the compiler, are compiled or refused in a few seconds and with little memory."""

import json
import os
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from phigen import progress
from phigen.compiler import compile_proved, compile_spec
from phigen.errors import LimitError
from phigen.proofs import statements
from phigen.realisations import sampled
from phigen.scheme import discretisation
from phigen.scheme.estimate import OperationCount, TooManyError, path_operations
from phigen.scheme.generating import collected_form, graph_form
from phigen.scheme.kernels import newton_solvers
from phigen.scheme.lowering import cost
from phigen.series.hamilton_jacobi import PolynomialSeries, polynomial_series
from phigen.spec import limits, loads
from phigen.symbolic import budgets, expression
from phigen.symbolic.expression import ONE, symbol, total_at
from phigen.symbolic.symbols import STEP
from phigen.symbolic.tower import Tower

#: Processor seconds that a refusal may take, and the memory in bytes at which the child process is stopped.
SECONDS, CEILING = 5, 2**31


def names(count):
    return [f"x{i}" for i in range(1, count + 1)]


def spec(coordinates, poisson, hamiltonian, order=4):
    return f"""\
phigen: 1
name: large
coordinates: [{", ".join(coordinates)}]
poisson: {{{poisson}}}
hamiltonian: {hamiltonian}
order: {order}
"""


def algebra(name, dimension):
    return spec(names(dimension), f"lie_algebra: {{name: {name}}}", "x1**2")


def fput(masses):
    q, p = ([f"{c}{i}" for i in range(1, masses + 1)] for c in "qp")
    springs = [f"(q{i % masses + 1} - q{i})" for i in range(1, masses + 1)]
    terms = [*(f"{c}**2/2" for c in p), *(f"{s}**2/2 + {s}**3/12 + {s}**4/40" for s in springs)]
    return spec([*q, *p], f"canonical: {{q: [{', '.join(q)}], p: [{', '.join(p)}]}}", " + ".join(terms))


def log_canonical(n):
    rows = [[(j > i) - (j < i) for j in range(n)] for i in range(n)]
    return spec(
        names(n),
        f"log_canonical: {[[e * (i * j % 3 + 1) for j, e in enumerate(r)] for i, r in enumerate(rows)]}",
        "+".join(names(n)),
    )


def triangular(n):
    """Return a spec with canonical brackets after a change of coordinates whose inverse has very many terms."""
    x, u = names(n), [f"u{i}" for i in range(1, n + 1)]
    moved = ", ".join(
        f"{v}: {a} + ({'+'.join(x[i + 1 :] or ['0'])})**3" for i, (v, a) in enumerate(zip(u, x, strict=True))
    )
    of = f"canonical: {{q: [{', '.join(u[: n // 2])}], p: [{', '.join(u[n // 2 :])}]}}"
    return spec(x, f"pullback: {{map: {{{moved}}}, of: {{{of}}}}}", "x1**2")


def nambu(n):
    casimirs = ["+".join(f"{i * j % 7 + 1}*x{i}**2" for i in range(1, n + 1)) for j in range(1, n - 1)]
    return f"nambu: [{', '.join(casimirs)}]"


SPACE = (names(10), "canonical: {q: [x1, x2, x3, x4, x5], p: [x6, x7, x8, x9, x10]}")
PLANE = (["x", "y"], "canonical: {q: [x], p: [y]}")


#: Program that compiles a spec within limits on time and memory. It runs in a new interpreter, because a fork of a
#: process with threads can wait for ever for a lock.
CHILD = """
import json, resource, sys
from clock import slowness
from phigen.compiler import compile_proved
from phigen.errors import PhigenError
from phigen.spec import loads
seconds, ceiling = map(int, sys.argv[1:])
resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
resource.setrlimit(resource.RLIMIT_AS, (ceiling, ceiling))
began = resource.getrusage(resource.RUSAGE_SELF)
try:
    compile_proved(loads(sys.stdin.read()))
    said = "compiled"
except PhigenError as error:
    said = f"{error.exit_code}: {error}"
ended = resource.getrusage(resource.RUSAGE_SELF)
spent = ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime
print(json.dumps([said, spent / slowness(), (ended.ru_maxrss - began.ru_maxrss) / 1024]))
"""


def compiled_in_a_child(text):
    """Compile a spec in a child process. Return "compiled" or the error, the processor time in seconds of the reference
    machine of `clock`, and the memory in MiB.
    """
    command = [sys.executable, "-c", CHILD, str(4 * SECONDS), str(CEILING)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.run(command, input=text, capture_output=True, text=True, check=False, env=environment)
    assert process.returncode == 0, f"the child ended with {process.returncode}: {process.stderr[-2000:]}"
    return json.loads(process.stdout)


def test_the_memory_of_sums_counts_too(monkeypatch):
    many = names(30)
    h = loads(spec(many, "brackets: {x1: {x2: 1}}", "+".join(many))).hamiltonian  # H is a sum without products
    (first,) = polynomial_series(h, list(map(symbol, many)), many, (), 1, symmetric=True).terms
    assert len(first) == 30
    monkeypatch.setattr(budgets, "TAYLOR_BYTES", 10_000)
    with pytest.raises(OverflowError):
        polynomial_series(h, list(map(symbol, many)), many, (), 1, symmetric=True)


def nested(depth):
    definitions = ["d0: x + y", *(f"d{i}: sin(d{i - 1}) + x" for i in range(1, depth))]
    return spec(*PLANE, f"d{depth - 1}") + "definitions:\n" + "".join(f"  {d}\n" for d in definitions)


def test_derivatives_reserve_no_memory_for_missing_terms():
    """A derivative of a polynomial in flint reserves memory for as many terms as the polynomial has, here 550 MB
    instead of 5. phigen must not keep this memory.
    """
    many = names(255)
    tower = Tower(many)
    square = tower.integer_power(tower.combine(map(tower.variable, many)), 2)
    before = pages()
    slopes = tower.gradient(square, many[:64])
    assert sum(map(len, slopes)) == 64 * 255
    assert (pages() - before) * resource.getpagesize() < 50 * 2**20


def pages():
    """Return the number of memory pages that this process has requested, used or not."""
    return int(Path("/proc/self/statm").read_text().split()[0])


def test_nested_functions_are_visited_once(monkeypatch):
    seen = []
    visit = Tower.visit
    monkeypatch.setattr(Tower, "visit", lambda self, node, args: seen.append(node) or visit(self, node, args))
    work = []
    for depth in (20, 40):
        Tower(PLANE[0], [loads(nested(depth)).hamiltonian])
        work.append(len(seen))
        seen.clear()
    assert work[1] < 2.5 * work[0]


def test_rings_and_collected_polynomials_of_nested_functions_are_given_up_where_they_are_too_large(monkeypatch):
    text = loads(nested(12))
    with monkeypatch.context() as few:
        few.setattr(budgets, "PRODUCT_BYTES", 10_000)
        with pytest.raises(OverflowError, match="functions inside functions"):
            Tower(PLANE[0], [text.hamiltonian], PLANE[0])
    tower = Tower([*PLANE[0], STEP], [text.hamiltonian], PLANE[0])
    series = PolynomialSeries(tower, (tower.convert(text.hamiltonian),))
    term_counts = [len(collected_form(series, PLANE[0], [STEP], 10**6))]
    for most in (10_000, 2_000):  # too few for the Hessian, then for the polynomials too
        monkeypatch.setattr(limits, "CELLS", most)
        term_counts.append(len(collected_form(series, PLANE[0], [STEP], 10**6)))
    assert term_counts == [2, 1, 0]


def test_a_graph_whose_hessian_is_too_large_is_given_up_before_it_is_made(monkeypatch):
    monkeypatch.setattr(limits, "OPERATIONS", 100)
    names_ = names(30)
    h = loads(spec(names_, "brackets: {x1: {x2: 1}}", f"sin({'*'.join(names_)})")).hamiltonian
    with pytest.raises(OverflowError, match="a part of the Hessian"):
        graph_form([h], names_, [])


def test_long_stages_report_their_progress(monkeypatch):
    """Stages of the compiler that take long report progress, and their counts reach the announced totals."""
    monkeypatch.setattr(expression, "LARGE_GRAPH", 20)
    monkeypatch.setattr(sampled.limits, "PROOF_PRODUCTS", 0)
    stages = {}
    text = spec(names(4), "lie_algebra: {name: gl(2)}", "+".join(f"{i}*x{i}**2" for i in range(1, 5)))
    text += "birealisation: cayley\n"
    with progress.watched(lambda now: stages.update({id(now[-1]): now} if now else {})):
        compile_proved(loads(text))
        OperationCount(10**6, lambda name: False).matrix([{0: symbol("a")}], [{0: symbol("b")}])
    counted = {now[-1].name for now in stages.values() if now[-1].total and now[-1].done == now[-1].total}
    assert counted >= {
        *(f"S_{i}" for i in (1, 2, 3)),
        *(f"Hessian of the {form}" for form in ("graph", "polynomial")),
        *("Newton matrix", "operations of the Newton matrix", "derivatives of α and β", "expressions", "Casimirs"),
    }
    within = {outer.name for now in stages.values() for outer in now[:-1] if now[-1].total}
    assert within >= {"proofs", "bi-realisation", "generating function", "program"}


def test_products_of_matrices_are_counted_as_they_would_be_made():
    a, b, c, d, fixed = (symbol(name) for name in ("a", "b", "c", "d", "fixed"))
    left = [{0: a, 1: b, 2: c}, {1: ONE, 2: a}, {0: fixed}]
    right = [{0: c, 1: c, 2: fixed}, {0: d, 1: d}, {0: b, 1: b, 2: a}]
    rows = [{j: {k: e * right[k][j] for k, e in row.items() if j in right[k]} for j in range(3)} for row in left]
    sums = [total_at(terms) for row in rows for terms in row.values()]
    true = cost([e for e in sums if e is not fixed * fixed])
    assert OperationCount(true, lambda name: name == "fixed").matrix(left, right) == true
    with pytest.raises(TooManyError):
        OperationCount(true - 1, lambda name: name == "fixed").matrix(left, right)
    repeated = [{**row, **{j + 3: e for j, e in row.items()}} for row in right]  # equal columns count once
    assert OperationCount(true, lambda name: name == "fixed").matrix(left, repeated) == true


def test_equal_columns_of_matrices_are_counted_once(monkeypatch):
    work = []
    monkeypatch.setattr(OperationCount, "_total", lambda self, terms: work.append(terms))
    a, b = symbol("a"), symbol("b")
    count = OperationCount(10**6, lambda name: False)
    count.matrix([{0: a, 1: b}] * 8, [dict.fromkeys(range(100), a), dict.fromkeys(range(100), b)])
    assert len(work) == 8


def test_a_step_whose_matrices_are_too_large_is_composed_or_refused_before_they_are_made(monkeypatch):
    """The number of operations is estimated before matrices are computed; the estimate exceeds 0.6 of the true number.
    Above the limit a composition of steps of order 2 is used, or the spec is refused.
    """
    text = loads(log_canonical(10))
    direct = compile_spec(text).program
    true = cost(direct.step.linearise.roots)
    few = 4 * 10**3 - 1  # with a limit of 4n³ or more, operations are not counted
    assert few > 0.6 * true
    for most, stages in ((true, 1), (few, 5)):
        monkeypatch.setattr(discretisation, "MOST_OPERATIONS", most)
        assert len(compile_spec(text).program.fractions) == stages
    with pytest.raises(LimitError, match=f"the matrices of a step would take more than {most} operations"):
        compile_spec(replace(text, composition="none"))
    dense = "*".join(f"cos({x})" for x in names(10))
    monkeypatch.setattr(discretisation, "generating_function", None)  # no S_i is computed before the check
    with pytest.raises(LimitError, match="the matrices of a step"):
        compile_spec(loads(log_canonical(10).replace("hamiltonian: ", f"hamiltonian: {dense} + ")))


def test_the_equations_of_a_path_are_counted_too(monkeypatch):
    """Equations of a path that are too large are not constructed: a composition of steps of order 2 replaces them, or
    the spec is refused.
    """
    text = spec(names(4), "lie_algebra: {name: gl(2)}", "+".join(f"{i}*x{i}**2" for i in range(1, 5)))
    text, counted = loads(text + "birealisation: karasev\n"), []
    monkeypatch.setattr(
        discretisation, "path_operations", lambda *arguments: counted.append(path_operations(*arguments)) or counted[-1]
    )
    compilation = compile_spec(text)
    true, direct = cost(compilation.program.step.generate.roots), compilation.scheme.generating
    assert 0.3 * true < counted[-1] <= true
    monkeypatch.setattr(discretisation, "MOST_OPERATIONS", counted[-1] - 1)
    assert len(compile_spec(text).program.fractions) == 5
    monkeypatch.setattr(discretisation, "generating_function", lambda *_: direct)
    with pytest.raises(LimitError, match="the matrices of a step would take more"):
        compile_spec(replace(text, composition="none"))


def test_an_elimination_that_is_too_long_for_a_function_is_a_loop(monkeypatch):
    """An elimination with more operations than the limit is a loop, not unrolled code. A comparison with n³ alone would
    allow millions of operations for n = 200.
    """
    direct = compile_spec(loads(fput(8)), order=2).program.step
    assert direct.eliminate is not None
    monkeypatch.setattr(limits, "OPERATIONS", cost(direct.eliminate.roots) // 2)
    kernels = newton_solvers(direct.linearise, centred=False)
    assert (kernels.eliminate, kernels.factors) == (None, None)


def test_a_step_that_is_too_large_is_refused_before_anything_is_proved(monkeypatch):
    monkeypatch.setattr(discretisation, "MOST_OPERATIONS", 100)
    monkeypatch.setattr(statements, "tensor", None)
    with pytest.raises(LimitError, match="the matrices of a step would take more than 100 operations"):
        compile_proved(loads(log_canonical(10)))


@pytest.mark.thin(3)
@pytest.mark.parametrize(
    ("text", "said", "most"),
    [
        pytest.param(
            spec(*PLANE, "(x**2 + y**2 + 1)**0.37*sin(x*y)/(1 + x**4)", order=16), "3: ", 100, id="an order too high"
        ),
        pytest.param(
            spec(*PLANE, "exp(sin(x*y))*log(2 + cos(x)*y**2) + sqrt(1 + x**2)", order=8),
            "compiled",
            200,
            id="an order that only a composition reaches",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            spec(*SPACE, f"({'+'.join(names(10))})**60"),
            "compiled",
            200,
            id="a power that cannot be expanded",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            spec(names(15), "lie_algebra: {name: so(6)}", "x1**2")
            + f"casimirs: {{C: ({'+'.join(f'{x}**2' for x in names(15))})**12}}\n",
            "compiled",
            200,
            id="a Casimir that cannot be expanded",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            spec(names(9), nambu(9), "x1**2 + x2*x3"),
            "compiled",
            100,
            id="minors of large matrices",
            marks=pytest.mark.slow,
        ),
        pytest.param(algebra("so(8)", 28), "compiled", 200, id="an algebra whose adjoint traces mislead"),
        pytest.param(
            fput(32) + "scheme: splitting\n", "compiled", 50, id="a lattice, by splitting", marks=pytest.mark.slow
        ),
        pytest.param(algebra("so(7)", 21), "compiled", 50, id="Casimirs with very many terms"),
        pytest.param(triangular(10), "3: ", 100, id="an inverse with very many terms"),
    ],
)
def test_every_stage_estimates_before_it_works(text, said, most):
    outcome, seconds, megabytes = compiled_in_a_child(text)
    assert outcome.startswith(said)
    assert seconds < SECONDS
    assert megabytes < most
