"""Flows of a Poisson bracket with a JAX function as H: the steps are Poisson maps, have the requested order, and can be
differentiated.
"""

import numpy as np
import pytest
from support import slow_but

import phigen
from phigen.errors import CheckError, SpecError

jax = pytest.importorskip("jax")
jnp = jax.numpy

BODY = "poisson: {brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}}"
#: Brackets with their dimensions: so(3), so(4), se(3), a Toda chain on a solvable algebra, constant brackets, and
#: linear brackets with constant terms.
BRACKETS = {
    "so3": (3, BODY),
    "so4": (6, "poisson: {lie_algebra: {name: so(4), sign: minus}}"),
    "se3": (6, "poisson: {lie_algebra: {name: se(3), sign: minus}}"),
    "toda": (5, "poisson: {brackets: {x1: {x3: -x1, x4: x1}, x2: {x4: -x2, x5: x2}}}"),
    "constant": (3, "poisson: {brackets: {x1: {x2: 1, x3: a}, x2: {x3: 2}}}"),
    "affine": (5, "poisson: {brackets: {x1: {x2: x3 + 2, x3: -x2}, x2: {x3: x1 - a}, x4: {x5: a}}}"),
}


@pytest.fixture(autouse=True)
def in_double_precision():
    with jax.enable_x64(True):
        yield


def spec_of(name, more=""):
    size, bracket = BRACKETS[name]
    names = ", ".join(f"x{k + 1}" for k in range(size))
    text = f"phigen: 1\nname: {name}\ncoordinates: [{names}]\nparameters: {{a: 0.5}}\n{bracket}\nhamiltonian: 0\n{more}"
    return phigen.spec.loads(text)


def flow(name, h, steps, **options):
    from phigen.jax import flow as flow_of

    return flow_of(spec_of(name), network, h, steps, **options)


def network(x, weights):
    """Return the value at x of a neural network with one layer of seven units, which serves as H."""
    return jnp.tanh(x @ weights["rows"] + weights["shift"]) @ weights["last"]


def weights_of(size, dtype=float):
    draw = np.random.default_rng(size).normal
    return {"rows": draw(size=(size, 7)).astype(dtype), "shift": draw(size=7).astype(dtype),
            "last": (0.4 * draw(size=7)).astype(dtype)}  # fmt: skip


def start_of(size):
    return 0.8 * np.sin(1.0 + 2.0 * np.arange(size))


def bracket_of(name):
    """Return the function x ↦ π(x) of a bracket by name."""
    import sympy

    system = phigen.geometry.system.system_from_spec(spec_of(name)).to_sympy()
    entries = sympy.lambdify([list(system.coordinates)], system.poisson.subs(system.parameters), "numpy")
    return lambda x: np.array(entries(np.asarray(x, float)), float)


def defect(name, run, x):
    """Return the largest entry of |DΦ(x) π(x) DΦ(x)ᵀ − π(Φ(x))| for the map Φ = ``run``, relative to that of
    |π(Φ(x))|.
    """
    tangent, following = jax.jit(jax.jacfwd(lambda x: (run(x),) * 2, has_aux=True))(x)
    pi, tangent = bracket_of(name), np.asarray(tangent, float)
    after = pi(following)
    return np.abs(tangent @ pi(x) @ tangent.T - after).max() / np.abs(after).max()


@pytest.mark.parametrize("name", slow_but(("so3",), BRACKETS))
def test_steps_with_a_network_are_poisson_maps(name):
    """The method has order 2 and steps of 0.3, so that its truncation errors are large, but its Poisson defect is
    round-off.
    """
    size, _ = BRACKETS[name]
    x, weights = start_of(size), weights_of(size)
    run = flow(name, 0.3, 3, order=2)
    assert defect(name, lambda x: run(x, weights), x) <= 2e-14


@pytest.mark.slow
def test_steps_to_truncation_are_none():
    x, weights = start_of(3), weights_of(3)
    run = flow("so3", 0.3, 3, order=2, structure="to truncation")
    assert defect("so3", lambda x: run(x, weights), x) > 1e-6


@pytest.mark.slow
def test_order_is_that_of_the_method():
    """With half the step, the error of the method of order 4 is 2⁴ times smaller. Order 6 is compared with a solver by
    `test_rows_are_those_of_the_solver`.
    """
    x, weights = start_of(3), weights_of(3)
    exact = flow("so3", 0.02, 120, order=12)(x, weights)
    errors = [np.abs(flow("so3", 2.4 / n, n, order=4)(x, weights) - exact).max() for n in (64, 128)]
    assert errors[1] > 1e-14
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.3)


@pytest.mark.slow
def test_derivatives_are_those_of_differences():
    """Derivatives by the weights, the start, and a parameter of the bracket, in reverse and in forward mode."""
    x, weights, factors = start_of(5), weights_of(5), np.array([1.0, -2.0, 0.5, 1.5, -0.7])
    run = flow("affine", 0.2, 10, order=4)
    loss = jax.jit(lambda x, weights, a: jnp.sum(factors * run(x, weights, a=a) ** 3))
    at = (x, weights, 0.7)
    slopes, forwards = jax.jit(jax.grad(loss, argnums=(0, 1, 2)))(*at), jax.jit(lambda d: jax.jvp(loss, at, d)[1])
    draw = np.random.default_rng(0).normal
    for k in range(3):
        along = [jax.tree.map(lambda v, on=j == k: on * draw(size=np.shape(v)), part) for j, part in enumerate(at)]
        ends = [loss(*(jax.tree.map(lambda v, d, s=s: v + s * d, p, d) for p, d in zip(at, along, strict=True)))
                for s in (1e-5, -1e-5)]  # fmt: skip
        dot = sum(jnp.sum(a * b) for a, b in zip(jax.tree.leaves(slopes), jax.tree.leaves(along), strict=True))
        assert float(dot) == pytest.approx(float(ends[0] - ends[1]) / 2e-5, rel=1e-7)
        assert float(forwards(tuple(along))) == pytest.approx(float(dot), rel=1e-12)


@pytest.mark.slow
def test_second_derivatives_are_those_of_differences():
    x, weights = start_of(3), weights_of(3)
    run = flow("constant", 0.2, 4)
    slope = jax.jit(jax.grad(lambda x: jnp.sum(run(x, weights) ** 3)))
    steps = 1e-5 * np.eye(3)
    differences = np.array([(slope(x + d) - slope(x - d)) / 2e-5 for d in steps])
    assert np.allclose(jax.jit(jax.jacfwd(slope))(x), differences, rtol=1e-6, atol=1e-8)


@pytest.mark.slow
def test_vmap_is_a_loop():
    """vmap over starts and weights, or leading axes of x0, give the values of a loop, although the members need
    different numbers of iterations.
    """
    run, weights = flow("so3", 0.3, 5, order=4), weights_of(3)
    halved = jax.tree.map(lambda w: 0.5 * w, weights)
    starts = np.stack([start_of(3), 0.01 * start_of(3)[::-1]])
    loop = np.stack([run(starts[0], weights), run(starts[1], halved)])
    both = jax.tree.map(lambda *w: np.stack(w), weights, halved)
    assert np.allclose(jax.jit(jax.vmap(run))(starts, both), loop, rtol=0, atol=2e-15)
    assert np.allclose(run(starts[:, None], weights)[0, 0], loop[0], rtol=0, atol=2e-15)


@pytest.mark.slow
def test_single_precision_is_that_of_the_start():
    """A start in single precision gives a run in single precision. Its Casimir, the square of the norm of x, is
    constant to round-off.
    """
    x, weights, single = start_of(3), weights_of(3), weights_of(3, np.float32)
    run = flow("so3", 0.3, 2000, order=4, stride=20)
    rows = run(x.astype(np.float32), single)
    assert rows.dtype == np.float32
    assert np.abs(rows[1] - run(x, weights)[1]).max() < 1e-6
    # The rounding errors of 2000 steps add up like a random walk.
    assert np.ptp(np.sum(np.asarray(rows, float) ** 2, axis=1)) < 1e-7 * np.sqrt(2000)


@pytest.mark.slow
def test_rows_are_those_of_the_solver():
    """With the H of a spec, the steps equal those of a solver with scheme: gauss, and the Casimir does not drift."""
    spec = phigen.spec.loads(f"phigen: 1\nname: t\ncoordinates: [x1, x2, x3]\n{BODY}\n"
                             "hamiltonian: x1**2/2 + x2**2/4 + x3**2/6 + x1*x2*x3/5\n"
                             "casimirs: {C: x1**2 + x2**2 + x3**2}\n")  # fmt: skip
    solver = phigen.compile(spec, target="numpy", order=6, scheme="gauss")
    x, energy = start_of(3), lambda x: x[0] ** 2 / 2 + x[1] ** 2 / 4 + x[2] ** 2 / 6 + x[0] * x[1] * x[2] / 5
    from phigen.jax import flow as flow_of

    rows = flow_of(spec, energy, 0.4, 25, order=6, stride=10)(x)
    assert rows.shape == (4, 3)
    assert np.allclose(rows, solver.integrate(x, 0.4, 25, 10).x, rtol=0, atol=3e-15)
    assert np.array_equal(flow_of(spec, energy, 0.4, 0)(x), x)
    end = flow_of(spec, energy, 0.4, 20_000, order=6)(x)
    assert abs(np.sum(end**2) - np.sum(x**2)) < 3e-14


@pytest.mark.slow
def test_step_that_fails_is_not_a_number():
    run = flow("so3", 40.0, 2, order=4)
    assert np.isnan(run(10 * start_of(3), weights_of(3))).all()


REFUSED = {
    "bracket": ("poisson: {brackets: {x1: {x2: x1*x2 + x3**2}}}", "", "no exact Poisson map", "to truncation"),
    "time": (BODY, "time: t", "depends on the time, but H is a function of x without", "remove time"),
    "forces": (BODY, "forces: {covector: {x1: -x1}}", "forces are not offered", "remove"),
    "noise": (BODY, "noise: {w: {hamiltonian: x1}}", "noise is not offered", "remove"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_offered_is_refused_with_its_place_and_a_hint(case):
    from phigen.jax import flow as flow_of

    bracket, more, message, hint = REFUSED[case]
    text = f"phigen: 1\nname: t\ncoordinates: [x1, x2, x3]\n{bracket}\nhamiltonian: x1\n{more}\n"
    with pytest.raises(SpecError) as refused:
        flow_of(phigen.spec.loads(text), network, 0.1, 3)
    (diagnostic,) = refused.value.diagnostics
    assert message in diagnostic.message
    assert hint in diagnostic.hint
    assert diagnostic.location is not None


def test_lattices_are_refused(tmp_path):
    from phigen.jax import flow as flow_of

    text = "phigen: 1\nname: t\ncoordinates: [q, p]\nlattice: {axes: [i]}\npoisson: {canonical: {q: [q], p: [p]}}\n"
    text += "hamiltonian: p**2/2 + (q[i+1] - q)**2/2\n"
    (tmp_path / "t.yaml").write_text(text, encoding="utf-8")
    assert phigen.load(tmp_path / "t.yaml").spec.lattice
    for source in (phigen.spec.loads(text), tmp_path / "t.yaml", phigen.load(tmp_path / "t.yaml")):
        with pytest.raises(SpecError, match="lattice"):
            flow_of(source, network, 0.1, 3)


def test_brackets_that_are_not_poisson_are_refused():
    from phigen.jax import flow as flow_of

    text = "phigen: 1\nname: t\ncoordinates: [x1, x2, x3]\nhamiltonian: x1\n"
    text += "poisson: {brackets: {x1: {x2: x3, x3: x1**2}, x2: {x3: x2}}}\n"
    with pytest.raises(CheckError, match="Jacobi"):
        flow_of(phigen.spec.loads(text), network, 0.1, 3, structure="to truncation")


def test_arguments_of_no_run_are_refused():
    run, x = flow("so3", 0.1, 3), start_of(3)
    with pytest.raises(TypeError, match="unknown parameter 'b'"):
        run(x, weights_of(3), b=2.0)
    with pytest.raises(ValueError, match=r"x0 must have shape \(…, 3\)"):
        run(x[:2], weights_of(3))
    with pytest.raises(TypeError, match="x0 must be real"):
        run(1j * x, weights_of(3))
    for options in ({"order": 3}, {"order": 18}, {"structure": "none"}, {"stride": 0}):
        with pytest.raises(ValueError, match=next(iter(options))):
            flow("so3", 0.1, 3, **options)
    with pytest.raises(ValueError, match="step size"):
        flow("so3", 0.0, 3)
