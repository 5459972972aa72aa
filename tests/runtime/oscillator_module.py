"""The twin of oscillator.c: a module of the generated NumPy API, written by hand."""

import numpy as np

DIM = 3
ORDER = 2
CASIMIRS = ("c", "c2")
DEFAULT_PARAMETERS = {"omega": 1.0, "limit": 1e300}


class StepError(Exception):
    def __init__(self, step, status, members, states):
        super().__init__(f"step {step}: {status}")
        self.step, self.status, self.members, self.states = step, status, members, states


def _advance(x, h, omega):
    c, d = np.cos(omega * h), np.sin(omega * h)
    q, p = c * x[..., 0] + d / omega * x[..., 1], c * x[..., 1] - d * omega * x[..., 0]
    return np.stack([q, p, x[..., 2]], axis=-1)


def step(x, h, **parameters):
    return integrate(x, h, 1, **parameters)[-1]


def integrate(x0, h, steps, stride=1, **parameters):
    values = {**DEFAULT_PARAMETERS, **parameters}
    x = np.array(x0, dtype=float)
    rows = [x]
    for done in range(1, steps + 1):
        following = _advance(x, h, values["omega"])
        wrong = np.abs(following[..., 0]) > values["limit"]
        if wrong.any():
            states = rows if (done - 1) % stride == 0 else [*rows, x]
            raise StepError(
                done - 1, "NO_CONVERGENCE", tuple(np.flatnonzero(wrong)) if x.ndim > 1 else (), np.array(states)
            )
        x = following
        if done % stride == 0 or done == steps:
            rows.append(x)
    return np.array(rows)


def hamiltonian(x, **parameters):
    values = {**DEFAULT_PARAMETERS, **parameters}
    return (x[..., 1] ** 2 + values["omega"] ** 2 * x[..., 0] ** 2) / 2


def casimirs(x, **parameters):
    return np.stack([x[..., 2], x[..., 2] ** 2], axis=-1)


def vector_field(x, **parameters):
    omega = {**DEFAULT_PARAMETERS, **parameters}["omega"]
    return np.stack([x[..., 1], -(omega**2) * x[..., 0], 0 * x[..., 2]], axis=-1)
