"""Runs of solvers as functions of JAX: values, derivatives in forward and reverse mode, jit and vmap."""

import numpy as np
import pytest

import phigen

jax = pytest.importorskip("jax")
jnp = jax.numpy

SYSTEM = """phigen: 1
name: t
coordinates: [x1, x2, x3]
parameters: {I1: 1, I2: 2, I3: 3}
poisson: {brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}}
hamiltonian: (x1**2/I1 + x2**2/I2 + x3**2/I3)/2
gauge: none
profile: small
order: 2
"""
H, STEPS = 0.1, 7
X = np.array([[1.0, 0.5, 0.3], [0.9, -0.2, 0.4]])


@pytest.fixture(scope="module")
def solver():
    return phigen.compile(phigen.spec.loads(SYSTEM), target="numpy", adjoint=True)


@pytest.fixture(autouse=True)
def in_double_precision():
    with jax.enable_x64(True):
        yield


def propagator(solver, **options):
    from phigen.jax import propagator as make

    return make(solver, h=H, steps=STEPS, **options)


def close(actual, expected):
    return np.allclose(np.asarray(actual), np.asarray(expected), rtol=1e-13, atol=0)


def cubes(f):
    """Return the function (x, I2) ↦ Σ f(x, I2)³, a number that depends on the result of a run ``f``."""
    return lambda x, i2: jnp.sum(f(x, {"I2": i2}) ** 3)


def test_values_are_those_of_the_solver(solver):
    propagate, rows = propagator(solver), propagator(solver, stride=3)
    assert np.array_equal(propagate(X[0]), solver.integrate(X[0], H, STEPS).x[-1])
    assert np.array_equal(propagate(X), solver.ensemble(X, H, STEPS))
    assert np.array_equal(rows(X, {"I2": 1.5})[1], solver.integrate(X[1], H, STEPS, 3, I2=1.5).x)
    assert propagate(X[0].astype(np.float32)).dtype == np.float32


def test_gradient_is_that_of_the_pull_back(solver):
    function = cubes(propagator(solver))
    gradient = jax.jit(jax.value_and_grad(function, argnums=(0, 1)))
    value, (by_x, by_i2) = gradient(X[0], 2.2)
    x1 = solver.integrate(X[0], H, STEPS, I2=2.2).x[-1]
    _, x0_bar, parameters_bar = solver.pullback(X[0], H, STEPS, 3 * x1**2, I2=2.2)
    assert close(value, np.sum(x1**3))
    assert close(by_x, x0_bar)
    assert close(by_i2, parameters_bar["I2"])


@pytest.mark.thin(2)
@pytest.mark.parametrize("axes", [(0, None), (None, 0)])
def test_vmap_is_a_loop(solver, axes):
    function = cubes(propagator(solver))
    arguments = (X if axes[0] == 0 else X[0], np.array([1.8, 2.3]) if axes[1] == 0 else 2.2)
    values, slopes = jax.vmap(jax.value_and_grad(function, argnums=(0, 1)), in_axes=axes)(*arguments)
    for m in range(2):
        member_arguments = [a[m] if axis == 0 else a for a, axis in zip(arguments, axes, strict=True)]
        value, (by_x, by_i2) = jax.value_and_grad(function, argnums=(0, 1))(*member_arguments)
        assert close(values[m], value)
        assert close(slopes[0][m], by_x)
        assert close(slopes[1][m], by_i2)


@pytest.mark.slow
def test_derivatives_by_a_shared_parameter_are_sums_over_members(solver):
    """The derivative by a shared parameter I2 is the sum over the members, whether these are the leading axis of x, or
    vmap runs over x inside the derivative, or over I2 outside of it.
    """
    propagate = propagator(solver)
    expected = sum(jax.grad(cubes(propagate), argnums=1)(x, 2.2) for x in X)
    assert close(jax.grad(cubes(propagate), argnums=1)(X, 2.2), expected)
    inside = lambda i2: jnp.sum(jax.vmap(propagate, in_axes=(0, None))(X, {"I2": i2}) ** 3)  # noqa: E731
    assert close(jax.grad(inside)(2.2), expected)
    both = jax.vmap(jax.grad(cubes(propagate), argnums=1), in_axes=(None, 0))(X, jnp.array([2.2, 1.5]))
    assert close(both[0], expected)


@pytest.mark.slow
@pytest.mark.parametrize("forward", [False, True])
def test_derivatives_both_ways_agree(solver, forward):
    back, forth = (propagator(solver, stride=3, forward=towards) for towards in (False, forward))
    at, along = (X, 2.2), (jnp.array(0.1 * X[::-1]), 0.7)
    by_x, by_i2 = jax.grad(cubes(back), argnums=(0, 1))(*at)
    _, slope = jax.jvp(cubes(forth), at, along)
    assert close(slope, np.sum(by_x * along[0]) + by_i2 * along[1])
    assert close(jax.jit(jax.grad(cubes(forth)))(*at), by_x)


def test_a_gradient_takes_one_run_back_and_a_jvp_the_tangent_map(solver, monkeypatch):
    from phigen.runtime.propagation import Propagation

    propagate, along = propagator(solver), jnp.array([0.3, -0.2, 0.5])
    _, slope = jax.jvp(lambda x: propagate(x, {"I2": 2.2}), (X[0],), (along,))
    assert close(slope, solver.jacobian(X[0], H, STEPS, I2=2.2).by_x0 @ along)
    monkeypatch.delattr(Propagation, "jacobian")
    x1 = solver.integrate(X[0], H, STEPS, I2=2.2).x[-1]
    gradient = solver.pullback(X[0], H, STEPS, 3 * x1**2, I2=2.2)
    by = jax.grad(lambda p: jnp.sum(propagate(X[0], p) ** 3))({"I2": 2.2, "I3": 3.0})
    assert all(close(by[name], gradient.parameters_bar[name]) for name in by)
    rows = jax.vmap(jax.vmap(jax.grad(cubes(propagate)), (None, 0)), (0, None))(X, jnp.array([1.8, 2.2]))
    assert close(rows[0, 1], gradient.x0_bar)


@pytest.mark.thin(2)
@pytest.mark.parametrize("forward", [False, True])
def test_second_derivatives_are_refused(solver, forward):
    with pytest.raises(TypeError, match="second derivatives of runs are not offered"):
        jax.hessian(cubes(propagator(solver, forward=forward)))(X[0], 2.2)


@pytest.mark.parametrize("stride", [None, 3])
def test_members_of_a_solver_without_ensembles_are_integrated_one_by_one(solver, stride):
    certified = phigen.compile(phigen.spec.loads(SYSTEM), adjoint=True, profile="certified")
    x = np.array([[0.1, 0.8, 0.3], [0.2, -0.5, 0.4]])
    actual, expected = (
        jax.vmap(propagator(each, stride=stride))(jnp.asarray(x), {"I2": jnp.array([1.7, 2.2])})
        for each in (certified, solver)
    )
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-13)


def test_failing_steps_raise(solver):
    with pytest.raises(Exception, match=r"NO_CONVERGENCE|NOT_FINITE"):
        propagator(solver)(1e6 * X[0])
    with pytest.raises(ValueError, match="stride"):
        propagator(solver, stride=0)


def test_wrong_arguments_are_errors_of_the_call_itself(solver):
    run = propagator(solver)
    with pytest.raises(TypeError, match="unknown parameter 'I7'"):
        run(X[0], {"I7": 2.0})
    with pytest.raises(ValueError, match=r"x0 must have shape \(…, 3\)"):
        run(X[0][:2])
    for x, initial in ((X, 3), (X[0], 1)):
        with pytest.raises(ValueError, match="'I2' must have a shape that broadcasts"):
            run(x, {"I2": np.ones(initial)})
    with pytest.raises(TypeError, match="x0 must be real"):
        run(1j * X[0])
    with pytest.raises(TypeError, match="'I2' must be real"):
        run(X[0], {"I2": 1j})
    with pytest.raises(TypeError, match="unknown parameter 'I7'"):
        propagator(solver, I7=2.0)
    with pytest.raises(TypeError, match="does not depend on the time"):
        propagator(solver, t0=1.0)
    with pytest.raises(TypeError, match="compiled solver"):
        propagator("rigid_body")


def test_derivatives_of_a_solver_without_pullback_are_refused_while_traced():
    x, run = X[0], propagator(phigen.compile(phigen.spec.loads(SYSTEM), target="numpy"))
    assert run(x).shape == (3,)
    for derived in (jax.grad(cubes(run)), jax.jit(jax.grad(cubes(run))), jax.jacfwd(cubes(run))):
        with pytest.raises(TypeError, match="compiled without pullback; compile it with adjoint=True"):
            derived(x, 2.2)


def test_forward_mode_of_lattices_is_refused_without_a_run():
    lattice = phigen.compile("xxz_disorder", target="numpy", adjoint=True)
    run, x = propagator(lattice), np.ones((3, 4))
    loss = lambda x: jnp.sum(run(x, {"B": 1.0}))  # noqa: E731
    for derived in (jax.jacfwd(loss), jax.jit(jax.jacfwd(loss))):
        with pytest.raises(TypeError, match="lattices have no derivatives in forward mode"):
            derived(x)
    with pytest.raises(TypeError, match="lattices have no derivatives in forward mode"):
        propagator(lattice, forward=True)
    with pytest.raises(TypeError, match="xxz_disorder is a lattice, and lattices have no full Jacobian; use pullback"):
        lattice.jacobian(x, H)
    with pytest.raises(TypeError, match="unknown parameter 'bonds'"):
        propagator(lattice, bonds=[[0, 1]])
    with pytest.raises(ValueError, match="x0 must have shape"):
        run(x[:2])


def test_a_propagator_of_a_graph_needs_bonds():
    graph = phigen.compile("food_web", target="numpy")
    with pytest.raises(TypeError, match="bonds= is missing"):
        propagator(graph)
    with pytest.raises(ValueError, match="bond 0 runs from 0 to 7"):
        propagator(graph, bonds=[[0, 7]])(np.ones((1, 3)))


def test_members_may_be_none_and_states_lists(solver):
    propagate = propagator(solver)
    assert np.array_equal(propagate([1, 0.5, 0.3]), propagate(X[0] * 0 + np.array([1, 0.5, 0.3])))
    by_x, by_i2 = jax.grad(cubes(propagate), argnums=(0, 1))(np.empty((0, 3)), 2.2)
    assert (by_x.shape, float(by_i2)) == ((0, 3), 0)


@pytest.mark.thin(2)
@pytest.mark.parametrize("stride", [None, 3])
def test_lattices_have_gradients_along_disorder(stride):
    """`vmap` runs over members, each with its own field B at the sites. The parameter J is shared."""
    chain, rng = phigen.compile("xxz_disorder", target="numpy", adjoint=True), np.random.default_rng(1)
    many, fields = rng.normal(size=(2, 3, 5)), rng.normal(size=(2, 5))
    propagate = propagator(chain, stride=stride)

    def loss(x, field, j):
        return jnp.sum(propagate(x, {"B": field, "J": j}) ** 3)

    gradient = jax.jit(jax.vmap(jax.grad(loss, argnums=(0, 1, 2)), in_axes=(0, 0, None)))
    x_bar, field_bar, j_bar = gradient(many, fields, 0.9)
    for m in range(2):
        frames = chain.integrate(many[m], H, STEPS, stride or STEPS, B=fields[m], J=0.9).x
        bar = 3 * (frames if stride else frames[-1]) ** 2
        pulled_back = chain.pullback(many[m], H, STEPS, bar, stride, B=fields[m], J=0.9)
        assert close(x_bar[m], pulled_back.x0_bar)
        assert close(field_bar[m], pulled_back.parameters_bar["B"])
        assert close(j_bar[m], pulled_back.parameters_bar["J"])
    one = chain.pullback(
        many, H, STEPS, np.ones(propagate(many, {"B": 0.5}).swapaxes(0, 1 if stride else 0).shape), stride, B=0.5
    )
    assert close(jax.grad(lambda b: jnp.sum(propagate(many, {"B": b})))(0.5), one.parameters_bar["B"])
