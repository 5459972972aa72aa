"""Predictors of the stages of a Gauss step: steps take few fixed-point sweeps in C, JavaScript and NumPy, also after
kicks and changes of the step size.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from support import RawC, compiled, first_run, javascript, small, solver

from phigen.compilation import Compilation

#: Number of steps of a run. The first step has no predictor.
STEPS = 200


@dataclass(frozen=True)
class Case:
    """A system of the corpus with a Gauss method, a start and a step size."""

    name: str
    order: int
    step_factor: float

    @property
    def compilation(self) -> Compilation:
        """Compilation with the profile fast."""
        return compiled(self.name, self.order, "gauss")

    @property
    def x0(self) -> list[float]:
        """Initial state of the first run of the spec."""
        return [float(v) for v in first_run(self.compilation).initial]

    @property
    def h(self) -> float:
        """Step size: a multiple of that of the first run."""
        return self.step_factor * float(first_run(self.compilation).step)


#: Systems on so(4) and se(3) with regular motion.
SO4, SE3 = Case("so4_manakov", 12, 4), Case("kowalevski_top", 8, 2)


def sweeps_in_c(case: Case, sizes: Sequence[float], kick: float, compilation: Compilation) -> list[int]:
    """Return the number of fixed-point sweeps in each step, for steps of the given sizes. Before each step but the
    first, ``kick`` is added to all coordinates.
    """
    raw, counts = RawC(compilation), [0]
    change = np.full(raw.n, kick)
    assert raw.init(case.x0) == 0
    for k, h in enumerate(sizes):
        if k and kick:
            assert raw.kick(change) == 0
        assert raw.step(h) == 0
        counts.append(int(raw.counters[1]))
    return np.diff(counts).tolist()


def sweeps_in_short_c(case: Case, sizes: Sequence[float], kick: float = 0.0) -> list[int]:
    return sweeps_in_c(case, sizes, kick, small(case.compilation))


def sweeps_in_fast_c(case: Case, sizes: Sequence[float], kick: float = 0.0) -> list[int]:
    return sweeps_in_c(case, sizes, kick, case.compilation)


def sweeps_in_javascript(case: Case, sizes: Sequence[float], kick: float = 0.0) -> list[int]:
    change = f"s.kick(new Array({len(case.x0)}).fill({kick}));" if kick else ""
    body = f"const counts = []; for (const h of {list(sizes)}) {{ if (s.steps) {{ {change} }} s.step(h); "
    counts = javascript(case.compilation, f"x0: {case.x0}", body + "counts.push(s.evaluations); }", "counts")
    return (1 + np.diff([0, *counts])).tolist()  # the counter leaves out the first sweep of a step


def sweeps_in_numpy(case: Case, sizes: Sequence[float], kick: float = 0.0) -> list[int]:
    session = solver(case.compilation, "numpy").backend.start(np.array(case.x0), {})
    module, calls, counts = session._module, [], [0]
    slopes = module._slopes

    def counted(*arguments):
        calls.append(1)
        return slopes(*arguments)

    module._slopes = counted
    try:
        for k, h in enumerate(sizes):
            if k and kick:
                session.kick(np.full(len(case.x0), kick))
            session.advance(h, 1)
            counts.append(len(calls))
    finally:
        module._slopes = slopes
    return np.diff(counts).tolist()


TARGETS: list[Callable[..., list[int]]] = [sweeps_in_short_c, sweeps_in_fast_c, sweeps_in_javascript, sweeps_in_numpy]


@pytest.mark.parametrize("count", TARGETS)
def test_steps_of_regular_motion_take_few_sweeps(count):
    """With a predictor, steps on so(4) and se(3) take about three and eight fixed-point sweeps; without one they would
    take eight and ten.
    """
    for case, limit in [(SO4, 3.1), (SE3, 8.0)]:
        assert np.mean(count(case, [case.h] * STEPS)) <= limit


@pytest.mark.parametrize("count", TARGETS)
def test_steps_after_kicks_are_predicted_by_the_last_step(count):
    for case in SO4, SE3:
        first, *kicked = count(case, [case.h] * 20, 1e-6)
        assert max(kicked[9:]) < first


@pytest.mark.parametrize("count", TARGETS)
def test_steps_of_a_new_size_are_predicted_by_the_last_step_of_the_old_one(count):
    """The first step of a new size is predicted by the last step of the old size, and the second step by the first step
    of the new size only.
    """
    for case in SO4, SE3:
        shorter = 0.3 * case.h
        *_, first, second = count(case, [case.h] * 8 + [shorter] * 2)
        first_unpredicted, second_by_one_step = count(case, [shorter] * 2)
        assert first < first_unpredicted
        assert second <= second_by_one_step + 1  # one more, since the states differ


def targets_and_compilations(case):
    """Return the compilations to test, by the name of their target: NumPy, fast C, and C of profile small."""
    return {"numpy": case.compilation, "c": case.compilation, "short c": small(case.compilation)}


@pytest.mark.parametrize("target", ["numpy", "c", "short c"])
@pytest.mark.parametrize("case", [SO4, SE3])
def test_stored_sessions_continue_with_the_increments_of_the_last_steps(case, target):
    compilation = targets_and_compilations(case)[target]
    backend = solver(compilation, target.removeprefix("short ")).backend
    whole, part = (backend.start(np.array(case.x0), {}) for _ in range(2))
    whole.advance(case.h, 9)
    part.advance(case.h, 4)
    restored = backend.restored(part.saved(), {})
    restored.advance(case.h, 5)
    assert restored.state().tolist() == whole.state().tolist()


@pytest.mark.parametrize("case", [SO4, SE3])
def test_copies_in_javascript_continue_as_the_solver_and_share_nothing_with_it(case):
    code = f"s.integrate({case.h}, 4); const twin = s.copy(), other = s.copy(); "
    code += f"other.kick(s.x).integrate({case.h}, 3); "
    code += f"for (const each of [s, twin]) each.integrate({case.h}, 5);"
    value = "[s, twin].map((each) => [...each.x, each.evaluations])"
    copied, twin = javascript(case.compilation, f"x0: {case.x0}", code, value)
    alone = javascript(case.compilation, f"x0: {case.x0}", f"s.integrate({case.h}, 9)", "[...s.x, s.evaluations]")
    assert copied == twin == alone
