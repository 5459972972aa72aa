"""The Hamiltonian of a top learned from noisy orbits: python docs/gradients/learned_network.py [ITERATIONS]

The bracket is that of se(3)*, for the angular momentum m and the direction g of gravity in the body. Three models are
fitted to the same records: a network for H with the bracket (`phigen.jax.flow`), a network of the same size for the
vector field, with Runge and Kutta's method (a neural ODE), and the formula of H with five unknown parameters
(`phigen.jax.propagator`).
"""

import sys
import time
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

import phigen
from phigen.jax import flow, propagator

SPEC = """phigen: 1
name: top
coordinates: [m1, m2, m3, g1, g2, g3]
parameters: {a: 1, b: 1, c: 1, d: 0, e: 0.5}
poisson: {lie_algebra: {name: se(3), sign: minus}}
hamiltonian: (a*m1**2 + b*m2**2 + c*m3**2)/2 + d*g1 + e*g3
casimirs: {C1: m1*g1 + m2*g2 + m3*g3, C2: g1**2 + g2**2 + g3**2}
order: 4
"""
NAMES = ("a", "b", "c", "d", "e")
#: A top with I = (1, 1, 0.6), whose centre of mass is on its axis.
TRUE = np.array([1.0, 1.0, 1 / 0.6, 0.0, 1.0])
STEP, STRIDE, ROWS, RECORDS, NOISE = 0.1, 2, 20, 100, 0.01
#: Rows of the windows that are fitted, each from its own noisy first row.
WINDOW = 5
HIDDEN, RATE, BATCH = 32, 5e-3, 128
#: Times of the comparison: records that were not seen, ten times as long, and a long run.
HELD_OUT, LONG = 40.0, 1000.0


def starts_of(rng, count):
    """States of tops that turn about their axes, with directions of all kinds."""
    m = rng.normal(size=(count, 3)) * 0.5 + np.array([0, 0, 1.0])
    g = rng.normal(size=(count, 3))
    return np.hstack([m, g / np.linalg.norm(g, axis=1, keepdims=True)])


def true_energy(x):
    """H of the top that made the records."""
    return x[..., :3] ** 2 @ TRUE[:3] / 2 + TRUE[3] * x[..., 3] + TRUE[4] * x[..., 5]


def layers(key, outputs):
    """Weights of a network with two hidden layers."""
    sizes, rng = (6, HIDDEN, HIDDEN, outputs), np.random.default_rng(key)
    return [(rng.normal(size=(m, n)) / np.sqrt(m), np.zeros(n)) for m, n in pairwise(sizes)]


def network(x, weights):
    """The values of the network."""
    for w, b in weights[:-1]:
        x = jnp.tanh(x @ w + b)
    return x @ weights[-1][0] + weights[-1][1]


def energy(x, weights):
    """The network as a Hamiltonian."""
    return network(x, weights)[0]


def neural_ode(h, steps, stride):
    """Rows of ẋ = network(x), by Runge and Kutta's method of order 4."""

    def step(x, weights):
        k1 = network(x, weights)
        k2 = network(x + h / 2 * k1, weights)
        k3 = network(x + h / 2 * k2, weights)
        k4 = network(x + h * k3, weights)
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def rows(x0, weights):
        def row(x, _):
            x = jax.lax.fori_loop(0, stride, lambda _, x: step(x, weights), x)
            return x, x

        following = jax.lax.scan(row, x0, None, steps // stride)[1]
        return jnp.moveaxis(jnp.concatenate([x0[None], following]), 0, -2)

    return rows


def trained(run, weights, records, iterations):
    """Weights fitted to windows of the records by Adam, with a rate that falls to zero."""
    windows = np.stack([records[:, i : i + WINDOW] for i in range(ROWS + 1 - WINDOW)], axis=1).reshape(-1, WINDOW, 6)

    def loss(weights, rows):
        return jnp.mean((run(rows[:, 0], weights) - rows)[:, 1:] ** 2)

    @jax.jit
    def update(weights, first, second, rows, k):
        value, slopes = jax.value_and_grad(loss)(weights, rows)
        first = jax.tree.map(lambda m, s: 0.9 * m + 0.1 * s, first, slopes)
        second = jax.tree.map(lambda v, s: 0.999 * v + 0.001 * s**2, second, slopes)
        rate = RATE * (1 - k / iterations)
        weights = jax.tree.map(
            lambda w, m, v: w - rate * (m / (1 - 0.9 ** (k + 1))) / (jnp.sqrt(v / (1 - 0.999 ** (k + 1))) + 1e-8),
            weights, first, second,
        )  # fmt: skip
        return weights, first, second, value

    weights = jax.tree.map(lambda w: jnp.asarray(w, jnp.float32), weights)
    first = second = jax.tree.map(jnp.zeros_like, weights)
    rng, losses = np.random.default_rng(1), []
    for k in range(iterations):
        rows = windows[rng.choice(len(windows), BATCH, replace=False)].astype(np.float32)
        weights, first, second, value = update(weights, first, second, rows, k)
        losses.append(float(value))
    return jax.tree.map(lambda w: np.asarray(w, float), weights), losses


def fitted(records):
    """The five parameters of the formula, from the same windows, by BFGS."""
    solver = phigen.compile(phigen.spec.loads(SPEC), adjoint=True, target="numpy")
    windows = records[:, : ROWS - ROWS % (WINDOW - 1) + 1]
    starts = windows[:, : -1 : WINDOW - 1].reshape(-1, 6)
    targets = np.stack([windows[:, i :: WINDOW - 1][:, : len(starts) // RECORDS] for i in range(1, WINDOW)], axis=2)
    targets = targets.reshape(-1, WINDOW - 1, 6)
    f = propagator(solver, h=STEP, steps=STRIDE * (WINDOW - 1), stride=STRIDE)

    def loss(values):
        return jnp.mean((f(starts, dict(zip(NAMES, values, strict=True)))[:, 1:] - targets) ** 2)

    slope = jax.value_and_grad(loss)
    result = minimize(lambda v: [np.asarray(r, float) for r in slope(v)], [1, 1, 1, 0, 0.5], jac=True, method="BFGS",
                      options={"gtol": 1e-8})  # fmt: skip
    return result.x


def measured(rows_of, starts, truth):
    """Errors: of orbits that were not seen (root of the mean square), then of energy and Casimirs over a long time."""
    held_out = np.asarray(rows_of(starts, HELD_OUT, 2))
    orbit = np.sqrt(np.mean((held_out - truth) ** 2))
    long = np.asarray(rows_of(starts[:8], LONG, 100))
    energies, (m, g) = true_energy(long), (long[..., :3], long[..., 3:])
    casimirs = [np.sum(m * g, axis=-1), np.sum(g * g, axis=-1)]
    drift = [np.abs(v - v[:, :1]).max() for v in (energies, *casimirs)]
    return orbit, drift[0], max(drift[1:])


def main(iterations=6000):
    """Fit the three models, and compare them."""
    rng, spec = np.random.default_rng(3), phigen.spec.loads(SPEC)
    solver = phigen.compile(spec)
    parameters = dict(zip(NAMES, TRUE, strict=True))
    starts, unseen = starts_of(rng, RECORDS), starts_of(rng, 16)
    clean = solver.ensemble(starts, STEP, STRIDE * ROWS, STRIDE, parameters=parameters)
    records = np.moveaxis(clean, 0, 1) + NOISE * rng.normal(size=(RECORDS, ROWS + 1, 6))
    truth = np.moveaxis(solver.ensemble(unseen, STEP, round(HELD_OUT / STEP), 2, parameters=parameters), 0, 1)

    def structured(steps, stride):
        return flow(spec, energy, STEP, steps, order=4, stride=stride)

    models, results, seconds = {}, {}, {}
    for name, run, outputs in (("network for H, with the bracket", structured, 1),
                               ("neural ODE", lambda n, stride: neural_ode(STEP, n, stride), 6)):  # fmt: skip
        begin = time.process_time()
        weights, losses = trained(run(STRIDE * (WINDOW - 1), STRIDE), layers(0, outputs), records, iterations)
        seconds[name] = time.process_time() - begin
        print(f"{name}: loss {np.mean(losses[-50:]):.2e}, {seconds[name]:.0f} s", flush=True)
        models[name] = lambda x, span, stride, run=run, w=weights: jax.jit(run(round(span / STEP), stride))(x, w)
    values = fitted(records)
    print("parameters", np.round(values, 4))
    models["formula with five parameters"] = lambda x, span, stride: np.moveaxis(
        solver.ensemble(x, STEP, round(span / STEP), stride, parameters=dict(zip(NAMES, values, strict=True))), 0, 1
    )
    for name, rows_of in models.items():
        results[name] = measured(rows_of, unseen, truth)
        print("{:32} orbit {:.3f}, energy {:.1e}, Casimirs {:.1e}".format(name, *results[name]))
    return results, values


if __name__ == "__main__":
    with jax.enable_x64(True):
        main(*map(int, sys.argv[1:]))
