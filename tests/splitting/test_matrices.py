"""Linear parts by matrix exponentials that are computed before the steps: values, proofs, tangents, gradients."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from support import TARGETS, compile_text, javascript, solver

from phigen.errors import SpecError
from phigen.geometry.system import hamiltonian_vector_field
from phigen.notation import flows, latex
from phigen.splitting import enclosures
from phigen.splitting.enclosures import exponential_less_one
from phigen.splitting.matrices import MatrixExponential
from phigen.splitting.statements import check
from phigen.study import measures
from phigen.study.methods import of_solver
from phigen.symbolic.expression import derivatives, gradient, number
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.verdict import CHECKED, PROVED, REFUTED

PAIRS = "coordinates: [q1, q2, p1, p2]\npoisson: {canonical: {q: [q1, q2], p: [p1, p2]}}\n"

#: Hamiltonians whose flow is exp(tA), for instance an unstable one, one with a Jordan block of four rows, one with a
#: constant.
LINEAR = {
    "oscillators": PAIRS
    + "parameters: {k: 2, c: 0.3}\nhamiltonian: p1**2/2 + p2**2/3 + k*q1**2/2 - q2**2 + c*q1*q2 + p1*q2/5",
    "a saddle and a field": PAIRS
    + "parameters: {k: 0.7, c: 1.3}\nhamiltonian: p1**2/2 + p2**2/2 - k*q1**2/2 - q2**2 + c*q1*q2 + q1/3 - p2/2",
    "a Jordan block": PAIRS
    + "parameters: {k: 0.7, c: 1.3}\nhamiltonian: p1*q1 + p2*q2 + k*p1*q2 + c*q1*p2/100 + p1**2/9",
    "a charge in crossed fields": (
        "coordinates: [x, y, z, u, v, w]\nparameters: {k: 1.7, c: 0.4}\n"
        "poisson: {brackets: {x: {u: 1}, y: {v: 1}, z: {w: 1}, u: {v: k, w: 0.2}, v: {w: 0.1}}}\n"
        "hamiltonian: (u**2 + v**2 + w**2)/2 + c*x + y**2/2 - z**2/5"
    ),
}


def compilation(text):
    """Compile a text as a splitting, with tangents and gradients."""
    return compile_text(text + "\n", order=4, scheme="splitting", tangent=True, adjoint=True)


def without_adjoint(text):
    """Compile a text as a splitting without gradients, which JavaScript lacks."""
    return compile_text(text + "\n", order=4, scheme="splitting")


def field_matrix(system, parameters):
    """Return A and the constant part of π∇H, an affine field."""
    names = system.coordinates
    field = hamiltonian_vector_field(system.poisson, gradient(system.hamiltonian, names))
    columns = [evaluate(derivatives(field, c), {**parameters, **dict.fromkeys(names, 0)}) for c in names]
    constant = evaluate(field, {**parameters, **dict.fromkeys(names, 0)})
    n = len(names)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = np.array(columns).T, constant
    return whole


@pytest.mark.parametrize("name", LINEAR)
def test_the_flow_is_one_part_and_proved_to_round_off(name):
    compiled = compilation(LINEAR[name])
    (flow,) = compiled.splitting.flows
    assert len(flow.exponentials) == 1
    assert [s.verdict for s in check(compiled.system, compiled.splitting)] == [PROVED, PROVED, CHECKED]


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", LINEAR)
def test_steps_of_any_size_are_the_exponential(name, target):
    compiled = compilation(LINEAR[name])
    a = field_matrix(compiled.system, {p.name: float(p.value) for p in compiled.system.parameters})
    x = np.linspace(-0.7, 0.9, len(a) - 1)
    for h in (1e-12, 0.3, -0.3, 4.0, 100.0):
        if h == 100.0 and np.linalg.eigvals(a).real.max() > 1e-9:
            continue
        exact = (expm(h * a) @ [*x, 1.0])[:-1]
        moved = solver(compiled, target).step(x, h)
        assert np.abs(moved - exact).max() <= 2e-14 * (1 + np.abs(h * a).sum(axis=1).max()) * np.abs(exact).max()
    slow = solver(compiled, target).step(x, 1e-12) - x
    assert slow == pytest.approx(1e-12 * (a @ [*x, 1.0])[:-1], abs=3e-16)


@pytest.mark.parametrize("name", ["oscillators", "a charge in crossed fields"])
def test_steps_are_poisson_maps_with_the_gradients_of_differences(name):
    compiled = compilation(LINEAR[name])
    at, bar = np.linspace(-0.7, 0.9, compiled.program.dimension), np.linspace(0.4, -1, compiled.program.dimension)
    for target in TARGETS:
        solve = solver(compiled, target)
        parameters = {p.name: float(p.value) for p in compiled.system.parameters}
        method = of_solver(solve, parameters, None)
        assert measures.poisson_defect(compiled.system, parameters, method, at, 0.7) < 1e-14
        assert measures.tangent_error(method, at, 0.7) < 1e-8
        pulled = solve.pullback(at, 0.7, 3, bar)
        for key, value in parameters.items():
            ends = [solve.integrate(at, 0.7, 3, parameters={key: value + d}).x[-1] @ bar for d in (1e-5, -1e-5)]
            assert pulled.parameters_bar[key] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-7, abs=1e-8)


#: Linear parts of systems with a nonlinear term: a screw motion, and a coupling to coordinates that are constant along
#: the flow of the part.
NONLINEAR = {
    "an algebra of a matrix": (
        "coordinates: [s, x, y, z, a, b]\nparameters: {k: 0.3}\n"
        "poisson: {brackets: {s: {x: x/3 + y, y: z - y/2, z: k*z - x/5}, a: {b: 1}}}\n"
        "hamiltonian: s + x*y + z**2/2 + a*b/5 - cos(a)*x + a",
        "x, y, z",
    ),
    "a drive that stands still": (
        "coordinates: [q1, q2, s, p1, p2, r]\npoisson: {canonical: {q: [q1, q2, s], p: [p1, p2, r]}}\n"
        "parameters: {a: 0.3}\nforces: {vector: {q1: p1 - a*q2, p1: -q1 + a*p2 + s, q2: p2 - a*q1, p2: -2*q2 - a*p1}}\n"
        "hamiltonian: r**2/2 - cos(s)",
        "q1, q2, p1, p2",
    ),
}


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", NONLINEAR)
def test_composed_with_other_parts_they_have_the_order_of_the_method(name):
    text, moved = NONLINEAR[name]
    compiled = compilation(text)
    (by_matrix,) = [f for f in compiled.splitting.flows if f.exponentials]
    assert f"{moved} moved by exp(tA), computed before the steps" in by_matrix.manner
    assert {s.verdict for s in check(compiled.system, compiled.splitting)} == {PROVED, CHECKED}
    x = np.array([0.4, -0.3, 0.8, 0.5, 0.2, -0.6])
    solve = solver(compiled, "c")
    ends = [solve.integrate(x, 1.6 / n, n).x[-1] for n in (8, 16, 128)]
    errors = [np.abs(e - ends[-1]).max() for e in ends[:2]]
    assert 12 < errors[0] / errors[1] < 22


#: Systems with a constant matrix A, for whose exponential the reverse pass has no transpose: without parameters, and
#: with a parameter elsewhere.
CONSTANT = {
    "none": LINEAR["oscillators"].replace("parameters: {k: 2, c: 0.3}\n", "").replace("k*", "").replace("c*", ""),
    "beside A": NONLINEAR["a drive that stands still"][0]
    .replace("a: 0.3", "k: 0.3")
    .replace("a*", "")
    .replace("cos(s)", "k*cos(s)"),
}


@pytest.mark.thin(2)
@pytest.mark.parametrize("parameters", CONSTANT)
def test_exponentials_that_no_parameter_enters_are_not_transposed(parameters):
    compiled = compilation(CONSTANT[parameters])
    assert [len(f.exponentials) for f in compiled.splitting.flows if f.exponentials] == [1]
    at, bar = np.linspace(-0.7, 0.9, compiled.program.dimension), np.linspace(0.4, -1, compiled.program.dimension)
    for target in TARGETS:
        solve = solver(compiled, target)
        pulled = solve.pullback(at, 0.7, 3, bar)
        for key, value in pulled.parameters_bar.items():
            ends = [solve.integrate(at, 0.7, 3, parameters={key: 0.3 + d}).x[-1] @ bar for d in (1e-5, -1e-5)]
            assert value == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-7)


def test_javascript_computes_the_same_numbers():
    compiled_system = without_adjoint(LINEAR["oscillators"])
    x = [0.4, -0.3, 0.8, 0.5]
    there = javascript(compiled_system, f"x0: {x}", "s.integrate(3.5, 2)", "Array.from(s.x)")
    assert there == pytest.approx(solver(compiled_system, "c").integrate(x, 3.5, 2).x[-1], rel=1e-14)


def test_printed_formulas_are_the_flow():
    """The exponential of the printed matrix A agrees with the flow of the coordinates."""
    compiled_system = without_adjoint(LINEAR["a saddle and a field"])
    listed = dict(flows.formulas(compiled_system, None))
    values = {"k": 0.7, "c": 1.3, "q1": 0.3, "q2": -0.2, "p1": 0.5, "p2": 0.1}
    entries = {name: eval(text, {}, dict(values)) for name, text in listed.items() if name.startswith("A_")}
    size = max(int(name[-1]) for name in entries)
    a = np.array([[entries.get(f"A_{i}{j}", 0.0) for j in range(1, size + 1)] for i in range(1, size + 1)])
    e = expm(0.4 * a) - np.eye(size)
    known = values | {f"E_{i + 1}{j + 1}": e[i, j] for i in range(size) for j in range(size)}
    end = (
        solver(compiled_system, "numpy")
        .integrate([values[c] for c in compiled_system.system.coordinates], 0.4, 1)
        .x[-1]
    )
    assert [eval(listed[f"Φ_1: {c}"], {}, known) for c in compiled_system.system.coordinates] == pytest.approx(
        end, abs=1e-14
    )
    assert listed["E"] == "exp(h*A) - 1"
    assert "E_{12}" in latex.document(compiled_system)
    assert "A_{41}" in latex.document(compiled_system)


def test_a_wrong_row_and_wrong_numbers_are_refuted(monkeypatch):
    compiled = compilation(LINEAR["oscillators"])
    (flow,) = compiled.splitting.flows
    first, second, *others = flow.increment
    planted = replace(compiled.splitting, flows=(replace(flow, increment=(second, first, *others)),))
    assert [s.verdict for s in check(compiled.system, planted)] == [PROVED, REFUTED, CHECKED]
    monkeypatch.setattr(enclosures, "exponential_less_one", lambda a: exponential_less_one(a) * (1 + 1e-12))
    assert [s.verdict for s in check(compiled.system, compiled.splitting)] == [PROVED, PROVED, REFUTED]


@pytest.mark.parametrize("rows", [1, 7, 64])
def test_matrices_of_any_size_are_exact_to_round_off(rows):
    draws = np.random.default_rng(rows).integers(-9, 9, rows * rows)
    jordan = [int(j == i + 1) for i in range(rows) for j in range(rows)]
    for entries in (draws, jordan, [0] * rows**2):
        exponential = MatrixExponential(tuple(number(int(e)) for e in entries))
        assert enclosures.enclosed("", exponential, {}).verdict == CHECKED


#: A linear part that is driven: a coefficient of the linear equations depends on the time.
DRIVEN = (
    PAIRS
    + "time: t\nparameters: {k: 2, w: 1.3}\n"
    + "hamiltonian: p1**2/2 + p2**2/3 + k*q1**2/2 - q2**2 + q1*q2/3 + p1*q2/5 - k*q1*cos(w*t)"
)


@pytest.mark.parametrize("target", TARGETS)
def test_a_coefficient_that_depends_on_the_time_is_an_unknown(target):
    compiled = compilation(DRIVEN)
    (flow,) = compiled.splitting.flows
    assert [e.size for e in flow.exponentials] == [5]
    assert {s.verdict for s in check(compiled.system, compiled.splitting)} == {PROVED, CHECKED}
    solve, x = solver(compiled, target), np.array([0.4, -0.3, 0.8, 0.5])

    def rate(t, y):
        return solve.vector_field(y, t=t)

    exact = solve_ivp(rate, (0.3, 1.1), x, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    errors = [np.abs(solve.integrate(x, 0.8 / n, n, t0=0.3).x[-1] - exact).max() for n in (4, 8)]
    assert 12 < errors[0] / errors[1] < 22
    bar = np.linspace(0.4, -1, 4)
    pulled = solve.pullback(x, 0.2, 3, bar, t0=0.3)
    for key, value in {"k": 2, "w": 1.3}.items():
        ends = [solve.integrate(x, 0.2, 3, t0=0.3, parameters={key: value + d}).x[-1] @ bar for d in (1e-5, -1e-5)]
        assert pulled.parameters_bar[key] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-7)


def test_products_of_coordinates_among_the_unknowns_are_proved():
    compiled = compilation(
        "coordinates: [x, y, z]\nparameters: {a: 2}\n"
        "poisson: {brackets: {x: {y: z - 4*y, z: 4*z - 17*y}}}\nhamiltonian: a*x + a*z - y**2"
    )
    (flow,) = compiled.splitting.flows
    assert [e.size for e in flow.exponentials] == [6]
    assert [s.verdict for s in check(compiled.system, compiled.splitting)] == [PROVED, PROVED, CHECKED]
    first, *others = flow.increment
    planted = replace(compiled.splitting, flows=(replace(flow, increment=(first + first**2, *others)),))
    assert [s.verdict for s in check(compiled.system, planted)] == [PROVED, REFUTED, CHECKED]


def test_noise_along_a_flow_of_random_duration_is_refused():
    text = PAIRS + "noise: {w: {hamiltonian: p1**2/2 + p2**2/3 + 3*q1**2 + q1*q2/2 + q2**2 + p1*q2 - q1}}\n"
    with pytest.raises(SpecError, match="needs the flow of the noise w in closed form"):
        compile_text(text + "hamiltonian: p1**2/2\n", scheme="splitting")


def test_a_state_dependent_time_is_refused():
    text = PAIRS + "hamiltonian: p1**2/2 + p2**2/3 + 3*q1**2 + q1*q2/2 + q2**2 + p1*q2 - 1\nmonitor: log"
    with pytest.raises(SpecError):
        compile_text(text + "\n", scheme="splitting")
