"""Gradients of implicit steps with a sparse Newton matrix, whose transpose has its zeros elsewhere: random systems."""

import random

import numpy as np
import pytest
from support import files, interface, solver

from phigen import spec
from phigen.compiler import compile_spec
from phigen.runtime.c_solver import CSolver
from phigen.runtime.solver import Solver

H, STEPS, WIDTH = 0.1, 10, 1e-4


def drawn(seed, pairs):
    """Return a spec of canonical pairs with a quartic energy, in which few coordinates of different pairs occur
    together.
    """
    source = random.Random(seed)
    q, p = ([f"{c}{k}" for k in range(pairs)] for c in "qp")
    terms = [f"{a}**2/2" for a in p] + [f"{source.randint(1, 4)}*{a}**2/5" for a in q]
    for _ in range(pairs + 1):
        i, j = source.sample(range(pairs), 2)
        a, b = source.choice([q[i], p[i]]), source.choice([q[j], p[j]])
        terms.append(f"w*{a}**{source.choice([1, 2, 3])}*{b}/{source.choice([-7, -5, 4, 6])}")
    return (
        f"coordinates: [{', '.join(q + p)}]\nparameters: {{w: {source.uniform(0.5, 1.5):.3f}}}\n"
        f"poisson: {{canonical: {{q: [{', '.join(q)}], p: [{', '.join(p)}]}}}}\nhamiltonian: {' + '.join(terms)}\n"
        "scheme: series\ngauge: none\n"
    )


def compiled(text, lanes):
    head = f"phigen: 1\nname: t\nadjoint: true\nsolver: {{lanes: {str(lanes).lower()}}}\n"
    return compile_spec(spec.loads(head + text))


def pivoting(compilation):
    """Return a solver in C that treats no pivot as close to 1, so that it solves single steps and stages with
    pivoting.
    """
    changed = {
        name: text.replace("_LARGEST_RECIPROCAL 1e3", "_LARGEST_RECIPROCAL 0.0")
        for name, text in files(compilation, "c").items()
    }
    assert changed != files(compilation, "c")
    names = interface(compilation)
    return Solver(CSolver(changed, names), names)


def slopes(integrator, x, bar):
    """Return the derivatives of bar · x(end) along the state and the parameter, by central differences."""

    def end(state, w):
        return bar @ integrator.integrate(state, H, STEPS, STEPS, w=w).x[-1]

    (w,) = integrator.interface.parameters.values()
    units = [(WIDTH * e, 0) for e in np.eye(len(x))] + [(0, WIDTH)]
    return np.array([(end(x + e, w + d) - end(x - e, w - d)) / (2 * WIDTH) for e, d in units])


COMPOSED = "order: 4\ncomposition: suzuki\n"
#: Seed, canonical pairs, order.
DRAWN = [(2, 3, "order: 2\n"), (3, 3, COMPOSED), (4, 6, "order: 2\n")]


@pytest.mark.parametrize(
    ("seed", "pairs", "order"), [(1, 2, "order: 2\n"), *(pytest.param(*each, marks=pytest.mark.slow) for each in DRAWN)]
)
def test_gradients_of_sparse_implicit_steps_are_differences(seed, pairs, order):
    """Gradients in NumPy and in C: without lanes, in lanes, and with pivoting."""
    text = drawn(seed, pairs) + order
    plain, laned = compiled(text, lanes=False), compiled(text, lanes=True)
    rng = np.random.default_rng(seed)
    x, bar = rng.uniform(-0.5, 0.5, (2, 2 * pairs))
    expected = slopes(solver(plain, "numpy"), x, bar)
    step = plain.program.step
    jacobian = np.array([e.is_zero for e in step.linearise.outputs[2].values]).reshape(2 * pairs, -1)
    assert (jacobian != jacobian.T).any()
    several = [solver(plain, "numpy"), solver(plain, "c"), pivoting(laned)]
    for integrator in several if pairs == 2 else [*several, solver(laned, "c"), pivoting(plain)]:
        _, x0_bar, by = integrator.pullback(x, H, STEPS, bar)
        assert [*x0_bar, by["w"]] == pytest.approx(expected, abs=1e-6 * np.max(np.abs(expected)))
    cotangent = solver(plain, "c").pullback(x, H, 1, bar).x0_bar
    tangent = solver(plain, "numpy").jacobian(x, H)[1]
    assert cotangent == pytest.approx(bar @ tangent, rel=1e-12)
