"""Oscillator of oscillator.c as a module with the API of generated NumPy solvers, written by hand."""

import numpy as np

DIM = 3
ORDER = 2
CASIMIRS = ("c", "c2")
DEFAULT_PARAMETERS = {"omega": 1.0, "limit": 1e300}


class StepError(Exception):
    def __init__(self, step, status, members, states):
        super().__init__(f"step {step}: {status}")
        self.step, self.status, self.members, self.states = step, status, members, states


FRACTIONS = (1.0,)
GAUGE = ()


def _values(parameters):
    return {**DEFAULT_PARAMETERS, **parameters}


def _admissible(values):
    return True


def _coefficients(parameters, x, h, gauge):
    omega = parameters["omega"]
    return [np.array([np.cos(omega * h), np.sin(omega * h), omega, parameters["limit"]])]


def _stage_at(stage, members):
    return stage


def _advance(coef, x, carry, memory):
    c, d, omega, limit = coef
    q, p = c * x[..., 0] + d / omega * x[..., 1], c * x[..., 1] - d * omega * x[..., 0]
    status = np.where(np.abs(q) > limit, "NO_CONVERGENCE", "")
    return np.stack([q, p, x[..., 2]], axis=-1), carry, memory, status


def integrate(x0, h, steps, stride=1, **parameters):
    x = np.array(x0, dtype=float)
    shape, x = x.shape, x.reshape(-1, DIM)
    coef = _coefficients(_values(parameters), x, h, None)[0]
    rows = [x]
    for step_number in range(1, steps + 1):
        following, _, _, status = _advance(coef, x, 0 * x, None)
        if (failed := np.flatnonzero(status != "")).size:
            raise StepError(
                step_number - 1, "NO_CONVERGENCE", tuple(failed), np.array([*rows, x]).reshape((-1, *shape))
            )
        x = following
        if step_number % stride == 0 or step_number == steps:
            rows.append(x)
    return np.array(rows).reshape((-1, *shape))


def hamiltonian(x, **parameters):
    values = _values(parameters)
    return (x[..., 1] ** 2 + values["omega"] ** 2 * x[..., 0] ** 2) / 2


def casimirs(x, **parameters):
    return np.stack([x[..., 2], x[..., 2] ** 2], axis=-1)


def vector_field(x, **parameters):
    omega = _values(parameters)["omega"]
    return np.stack([x[..., 1], -(omega**2) * x[..., 0], 0 * x[..., 2]], axis=-1)
