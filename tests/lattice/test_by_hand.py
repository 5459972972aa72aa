"""Single sweeps over segments of lattices, as processes that share a lattice make them."""

from __future__ import annotations

import numpy as np
import pytest
from lattice.test_sweeps import compiled, disorder, solver, start
from systems import slow_but

from phigen.compiler import compile_spec, emit
from phigen.runtime.arguments import Beginning

#: Chains with open and periodic ends, with colours and with elementary functions; planes with both kinds of ends, and a
#: box.
NAMES = ["xxz", "xxz_open", "fput", "volterra", "sheet", "cube"]
SIZES = {"sheet": (9, 5), "cube": (7, 3, 3), "volterra": (30,)}


def by_hand(name: str, x: np.ndarray, h: float, steps: int, seed: int) -> np.ndarray:
    """Return the state after steps made stage by stage, each in segments of random sizes and in random order."""
    integrator = solver(name, 4, "c")
    stages = integrator.backend.stages()
    session = integrator.started(Beginning(x, h, integrator.values(disorder(name, x), {}, x.shape[1:])))
    session.begin(h)
    random = np.random.default_rng(seed)
    flows = [0, *range(1, len(stages) - 2)]
    for step in range(steps):
        for stage in [len(stages) - 1 if step else 0, *flows[1:], *([len(stages) - 2] if step == steps - 1 else [])]:
            cuts = np.unique([0, *random.integers(0, x.shape[1], 3), x.shape[1]])
            for k in random.permutation(len(cuts) - 1):
                session.sweep(stage, 0, int(cuts[k]), int(cuts[k + 1]))
    return session.state()


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("name", slow_but({*NAMES} - {"xxz"}, NAMES))  # the chain with open ends has all of its code
def test_sweeps_by_hand_in_pieces_have_the_bits_of_steps(name: str) -> None:
    x = start(name, SIZES.get(name, (40,)))
    whole = solver(name, 4, "c").integrate(x, 0.03, 3, 3, **disorder(name, x)).x[-1]
    assert whole.tobytes() == by_hand(name, x, 0.03, 3, seed=2).tobytes()


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("name", [*NAMES, "charges", "magnet"])
def test_bits_do_not_depend_on_the_frames(name: str) -> None:
    """The steps are so large that some need full-range functions."""
    x = start(name, SIZES.get(name))
    runs = [solver(name, 4, "c").integrate(x, 0.15, 120, n, **disorder(name, x)).x[-1].tobytes() for n in (1, 7, 60)]
    assert runs[0] == runs[1] == runs[2]


@pytest.mark.parametrize("name", NAMES)
def test_a_stage_reads_no_further_than_it_says(name: str) -> None:
    """Values beyond the halo of a stage, and fields that it does not read there, may be arbitrary."""
    x = start(name, SIZES.get(name, (40,)))
    integrator = solver(name, 4, "c")
    first, end = 3, 5
    for number, stage in enumerate(integrator.backend.stages()):
        seen = []
        for wrong in (False, True):
            session = integrator.started(Beginning(x, 0.03, integrator.values(disorder(name, x), {}, x.shape[1:])))
            session.begin(0.03)
            for field in range(len(x) if wrong else 0):
                beside = stage.read >> field & 1
                values = session.planes(field, 0, x.shape[1])
                values[: first - stage.behind * beside] = 1e3
                values[end + stage.ahead * beside :] = 1e3
                session.put_planes(field, 0, x.shape[1], values)
            before = session.state()
            session.sweep(number, 1, first, end)
            after = session.state()
            seen.append(after[:, first:end].tobytes())
            changed = {f for f in range(len(x)) if after[f].tobytes() != before[f].tobytes()}
            assert all(stage.changed >> f & 1 for f in changed)
        assert seen[0] == seen[1]


@pytest.mark.parametrize("name", ["xxz", "cube"])
def test_planes_that_are_put_are_where_sweeps_begin(name: str) -> None:
    """The copies in halos are set too: the first sweep has the same bits as after a start with these planes."""
    x = start(name, SIZES.get(name, (40,)))
    integrator, swept = solver(name, 4, "c"), []
    for begun in (x, 0.5 * x):
        session = integrator.started(Beginning(begun, 0.03, integrator.values(disorder(name, x), {}, x.shape[1:])))
        session.begin(0.03)
        for field in range(len(x)):
            session.put_planes(field, 0, x.shape[1], x[field])
        for stage in (0, 1):
            session.sweep(stage, 1, 0, x.shape[1])
        swept.append(session.state().tobytes())
    assert swept[0] == swept[1]


def test_planes_and_stages_that_there_are_not_are_refused() -> None:
    x = start("sheet", (9, 5))
    integrator = solver("sheet", 4, "c")
    session = integrator.started(Beginning(x, 0.1, integrator.values(disorder("sheet", x), {}, x.shape[1:])))
    with pytest.raises(ValueError, match="BAD_ARGUMENT"):
        session.sweep(0, 1, 0, 9)  # before the step size is known
    session.begin(0.1)
    for stage, first, end in ((99, 0, 9), (0, 4, 3), (0, 0, 10)):
        with pytest.raises(ValueError, match="BAD_ARGUMENT"):
            session.sweep(stage, 1, first, end)
    with pytest.raises(ValueError, match="no caller-driven stepping"):
        solver("charges", 4, "c").backend.stages()


@pytest.mark.parametrize(("profile", "without"), [("small", ()), ("fast", ("by-hand",))])
def test_steps_by_hand_can_be_left_out(profile: str, without: tuple[str, ...]) -> None:
    program = compile_spec(compiled("fput").spec, profile=profile, without=without).program
    assert not any("put_planes" in text for text in emit(program, "c", "phigen").values())
