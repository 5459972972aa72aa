"""Predictors of the stages by two steps: few sweeps in code with loops over stages, in C, JavaScript and NumPy."""

import numpy as np
import pytest
from support import RawC, compiled, files, first_run, javascript, small, solver

STEPS = 200


def sweeps_in_c(compilation, x0, h):
    raw = RawC(small(compilation))
    assert raw.init(x0) == 0
    assert raw.integrate(h, STEPS) == 0
    return int(raw.counters[1])


def sweeps_in_javascript(compilation, x0, h):
    """Those after the first of each step, which are the ones that are counted."""
    return STEPS + javascript(compilation, f"x0: {x0}", f"s.integrate({h}, {STEPS});", "s.evaluations")


def sweeps_in_numpy(compilation, x0, h):
    module = {}
    exec(files(compilation, "numpy")[f"{compilation.program.name}.py"], module)
    slopes, calls = module["_slopes"], []

    def counted(*arguments):
        calls.append(1)
        return slopes(*arguments)

    module["_slopes"] = counted
    module["integrate"](np.array(x0), h, STEPS)
    return len(calls)


@pytest.mark.parametrize("count", [sweeps_in_c, sweeps_in_javascript, sweeps_in_numpy])
def test_steps_of_regular_motion_take_four_sweeps(count):
    """By one step alone they take six."""
    compilation = compiled("so4_manakov", 12, "gauss")
    run = first_run(compilation)
    x0 = [float(v) for v in run.initial]
    assert count(compilation, x0, 4 * float(run.step)) <= 4.1 * STEPS


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_stored_sessions_continue_with_the_increments_of_two_steps(target):
    compilation = compiled("so4_manakov", 12, "gauss")
    run = first_run(compilation)
    h, backend = 4 * float(run.step), solver(compilation, target).backend
    whole, part = (backend.start(np.array([float(v) for v in run.initial]), {}) for _ in range(2))
    whole.advance(h, 9)
    part.advance(h, 4)
    restored = backend.restored(part.saved(), {})
    restored.advance(h, 5)
    assert restored.state().tolist() == whole.state().tolist()
