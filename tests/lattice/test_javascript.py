"""Lattices in JavaScript, run by Node, agree with NumPy to round-off on the whole corpus; and refusals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lattice import test_forcing, test_tangents, test_time
from lattice.lattices import LATTICES
from node import answers as answers_of

from phigen import resources
from phigen import spec as specs
from phigen.api import lattice_solver_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec, emit
from phigen.lattice.states import Start, start_of
from phigen.runtime.modules import load_module
from phigen.spec.model import Spec

CORPUS = {f.stem: f for f in sorted((resources.bundled_specs() / "lattices").glob("*.yaml"))}

STIFF = """\
phigen: 1
name: stiff
lattice: {axes: [i, j], boundary: [open, periodic]}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
scheme: series
order: 4
hamiltonian: p**2/2 + 200*((q[i+1]-q)**2 + (q[j+1]-q)**2) + q**4/4
runs: {r: {sizes: [3, 4], initial: {random: normal, seed: 3, scale: 0.1}, step: 0.2, steps: 8}}
"""
STIFF_GRAPH = """\
phigen: 1
name: stiff_graph
lattice: {graph: bonds}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
scheme: series
hamiltonian: {sites: p**2/2 + q**4/4, bonds: "200*(q[a] - q[b])**2 + q[a]*p[b]**2/9"}
runs: {r: {bonds: [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]], initial: {random: normal, scale: 0.1}, step: 0.2, steps: 8}}
"""
#: A spec with names that are reserved in JavaScript, or are local variables of printed loops.
NAMES = """\
phigen: 1
name: names
lattice: {axes: [i, j], boundary: periodic}
coordinates: [near_0, count]
parameters: {delete: 1.5, sites: {value: i - j, at: sites}, sweep1: 0.3, coef: 1}
poisson: {canonical: {q: [near_0], p: [count]}}
hamiltonian: delete*count**2/2 + sites*cos(near_0[i+1] - near_0[j-1]) + sweep1*near_0**4 + coef*near_0
runs: {r: {sizes: [3, 3], initial: {random: normal, seed: 3}, step: 0.1, steps: 8}}
"""
#: Springs on a graph without bonds, and a ring without brackets.
NO_BONDS = """\
phigen: 1
name: apart
lattice: {graph: bonds}
coordinates: [q, p]
parameters: {k: {value: 1, at: bonds}, l: {value: 2, at: bonds}, m: {value: [1, 2, 3], at: sites}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: {sites: p**2/(2*m) + q**4, bonds: "k*(q[a] - q[b] - l)**2/2"}
runs: {r: {sizes: [3], bonds: [], initial: {q: [1, 0, 2], p: 1}, step: 0.1, steps: 4}}
"""
NO_BRACKETS = """\
phigen: 1
name: nothing
lattice: {axes: [i]}
coordinates: [a]
poisson: {brackets: {a: {}}}
hamiltonian: a**2/2 + a*a[i+1]
runs: {r: {sizes: [3], initial: {a: 1 + i}, step: 0.1, steps: 4}}
"""
#: Specs with features that the corpus lacks: open ends, other schemes and orders, kicks with a modified potential,
#: stiff steps.
VARIANTS: dict[str, Callable[[], Spec]] = {
    **{name: lambda text=text: specs.loads(text) for name, text in LATTICES.items()},  # type: ignore[misc]
    "stiff": lambda: specs.loads(STIFF),
    "stiff graph": lambda: specs.loads(STIFF_GRAPH),
    "names": lambda: specs.loads(NAMES),
    # Pairs without energy in H: there is nothing to sum at a site.
    "apart": lambda: specs.loads(
        "phigen: 1\nname: apart\nlattice: {pairs: all}\ncoordinates: [q, p]\n"
        "poisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: {sites: p**2/2 + q**4/4}\n"
        "runs: {r: {sizes: [4], initial: {random: normal, seed: 3}, step: 0.1, steps: 8}}\n"
    ),
    "no bonds": lambda: specs.loads(NO_BONDS),
    "no brackets": lambda: specs.loads(NO_BRACKETS),
    "spins by the series": lambda: replace(specs.loads(LATTICES["spins_2"]), scheme="series"),
    "a graph by the series": lambda: replace(specs.loads(LATTICES["spin_graph"]), scheme="series"),
    "kicks": lambda: replace(specs.loads(LATTICES["fput_open"]), composition="force-gradient"),
    "colours": lambda: replace(specs.loads(LATTICES["volterra"].replace("[5]", "[6]")), order=6),
}
#: Lattices with time dependence, and with forces.
DRIVEN = {f"{name}, in time": (test_time, name) for name in test_time.TEXTS}
DRIVEN |= {f"{name}, forced": (test_forcing, name) for name in test_forcing.FORCED}
DRIVEN |= {f"{name}, noisy": (test_forcing, name) for name in test_forcing.NOISY}
#: Arguments that select random numbers: numbers of 64, 32 and 48 bits.
DRAWS: dict[str, Any] = {"seed": 2**61 + 5, "member": 2**31 + 3, "step0": 2**45 + 2}
CASES = [*CORPUS, *VARIANTS, *DRIVEN]
STEPS, T0 = 8, 0.7
#: Quick tests make the lattices of the corpus, and one of each further kind.
pytestmark = pytest.mark.few(
    *CORPUS, "stiff", "stiff graph", "names", "apart", "no bonds", "no brackets",
    "kicks", "colours", "spins by the series", "a graph by the series",
    "melting, in time", "coloured, in time", "damped, forced", "friction, forced", of=CASES,
)  # fmt: skip


@cache
def compiled(case: str) -> Compilation:
    if case in DRIVEN:
        module, name = DRIVEN[case]
        return module.compiled(name, 2)
    return compile_spec(specs.load(CORPUS[case]) if case in CORPUS else VARIANTS[case]())


@cache
def begun(case: str) -> tuple[Start, float]:
    """Return the start and the step size of a case."""
    if case in DRIVEN:
        module, name = DRIVEN[case]
        x, values = module.given(name)
        graph = "bonds" in values
        return Start(x.shape[1:], x, values, values.pop("bonds", np.zeros((0, 2), dtype=int)), graph), 0.05
    spec = compiled(case).spec
    run = next(iter(spec.runs.values()))
    return start_of(spec, run), float(run.step)


def job(folder: Path, case: str, **more: Any) -> dict[str, Any]:
    """Return the request for the first run of a case in JavaScript."""
    compilation = compiled(case)
    start, h = begun(case)
    (text,) = emit(compilation.program, "js", "phigen").values()
    path = folder / f"{case.replace(' ', '_')}.mjs"
    path.write_text(text, encoding="utf-8")
    params = {name: np.ravel(v).tolist() if np.ndim(v) else float(v) for name, v in start.parameters.items()}
    options = {"x0": start.state.ravel().tolist(), "sizes": start.sizes, "params": params}
    options |= {"bonds": start.bonds.ravel().tolist()} if start.graph else {}
    options |= {"t0": T0} if compilation.program.time else {}
    options |= {**DRAWS, "seed": str(DRAWS["seed"])} if compilation.program.noise else {}  # beyond 2^53
    return {"module": path.as_uri(), "options": {**options, **more}, "h": h, "steps": STEPS}


def node(jobs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return Node's answers to some requests."""
    return answers_of(Path(__file__).with_name("javascript.mjs"), jobs)


class Answers(dict[str, dict[str, Any]]):
    """Answers of the solver of a case, computed when a test first needs them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __missing__(self, case: str) -> dict[str, Any]:
        (self[case],) = node([job(self.folder, case)])
        return self[case]


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    return Answers(tmp_path_factory.mktemp("javascript"))


@pytest.mark.thin(3)
@pytest.mark.parametrize("case", CASES)
def test_steps_and_what_is_seen_are_those_of_numpy_to_roundoff(case: str, answers: dict[str, dict[str, Any]]) -> None:
    compilation, answer = compiled(case), answers[case]
    name = compilation.program.name
    (start, h), dated = begun(case), bool(compilation.program.time)
    module = load_module(emit(compilation.program, "numpy", "phigen")[f"{name}.py"], name)
    since = ({"t0": T0} if dated else {}) | (DRAWS if compilation.program.noise else {})
    x = module.integrate(start.state, h, STEPS, stride=STEPS, **since, **start.arguments)[-1]
    size, end = np.abs(x).max(), T0 * dated + STEPS * h
    then = {**start.arguments, **({"t": end} if dated else {})}

    def agrees(mine: list[float], theirs: np.ndarray, part: float = 1e-13) -> None:
        np.testing.assert_allclose(np.reshape(mine, theirs.shape), theirs, rtol=part, atol=part * np.abs(theirs).max())

    assert answer["done"] == {"value": STEPS}
    if not compilation.program.is_monitored:  # tests/lattice/test_monitor.py compares the times of steps with a monitor
        assert answer["t"] == pytest.approx(end, rel=1e-14)
    np.testing.assert_allclose(np.reshape(answer["x"], x.shape), x, rtol=0, atol=1e-13 * size)
    assert answer["energy"] == pytest.approx(module.hamiltonian(x, **then), rel=1e-12)
    agrees(answer["density"], module.density(x, **then), 1e-11)
    agrees(answer["field"], module.vector_field(x, **then), 1e-11)
    if compilation.program.casimirs:
        agrees(answer["casimirs"], module.casimirs(x, **start.arguments))
    assert answer["first"] == answer["x"][: len(answer["first"])]


@pytest.mark.slow
def test_sweeps_of_every_kind_are_among_them(answers: dict[str, dict[str, Any]]) -> None:
    steps = [compiled(case).program.step for case in CASES]
    assert {s.equation is not None for s in steps} == {True, False}  # type: ignore[union-attr]
    assert {s.sites.colours for s in steps} == {1, 2}  # type: ignore[union-attr]
    assert any(s.by_colour for s in steps)  # type: ignore[union-attr]
    assert any(s.schedule.multiples for s in steps)  # type: ignore[union-attr]
    assert {"stiff": True, "point_vortices": False}.items() <= {c: answers[c]["stiff"] for c in CASES}.items()


@pytest.mark.parametrize("case", ["toda", "kdv", "stiff", "food_web"])
def test_a_step_that_cannot_be_made_leaves_the_state(case: str, answers: dict[str, dict[str, Any]]) -> None:
    failure = answers[case]["failure"]
    assert failure["name"] == "StepError"
    assert failure["status"] in ("NOT_FINITE", "NO_CONVERGENCE")
    assert failure["steps"] == STEPS
    assert answers[case]["kept"]


def test_one_number_is_the_value_at_all_bonds_of_none(tmp_path: Path, answers: dict[str, dict[str, Any]]) -> None:
    request = job(tmp_path, "no bonds")
    request["options"]["params"] = {"k": 1.0, "l": [], "m": [1, 2, 3]}
    assert node([request])[0]["x"] == answers["no bonds"]["x"]


#: Cases of tangent vectors: open ends, colours, a graph with colours, pairs, noise, the series with sweeps and Newton's
#: method.
CARRYING = {
    **dict.fromkeys(("sheet", "volterra", "magnet", "tangle", "vortices"), test_tangents.with_tangents),
    **{name: lambda name: carrying(test_forcing.compiled(name)) for name in ("free", "bath")},
    "stiff graph": lambda name: carrying(compiled(name)),
}


def carrying(compilation: Compilation) -> Compilation:
    return compile_spec(compilation.spec, tangent=True)


@pytest.fixture(scope="module")
def carried(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[dict[str, Any], np.ndarray, np.ndarray]]:
    """Return the answer for each case, with the state and the tangent vectors of NumPy."""
    folder, jobs, expected = tmp_path_factory.mktemp("carried"), [], []
    for case, compiled_lattice in CARRYING.items():
        compilation = compiled_lattice(case)
        if case in test_tangents.IN_C:
            x = test_tangents.start(case, test_tangents.FEW.get(case))
            values, h = test_tangents.disorder(case, x), test_tangents.H
        elif case in test_forcing.TEXTS:
            (x, values), h = test_forcing.given(case), 0.05
        else:
            begin, h = begun(case)
            x, values = begin.state, begin.arguments
        draws = {"seed": 5, "step0": 3} if compilation.program.noise else {}
        vectors = np.random.default_rng(2).normal(size=(2, *x.shape))
        solver = lattice_solver_of(compilation, "numpy")
        expected.append(solver.step_tangent(x, h, vectors, parameters=values, **draws))
        about = {n: np.ravel(v).tolist() if np.ndim(v) else float(v) for n, v in values.items()}
        options = {"x0": x.ravel().tolist(), "sizes": x.shape[1:], "bonds": about.pop("bonds", None), "params": about}
        path = folder / f"{case.replace(' ', '_')}.mjs"
        path.write_text(*emit(compilation.program, "js", "phigen").values(), encoding="utf-8")
        request = {"module": path.as_uri(), "options": options | draws, "h": h, "steps": 0}
        jobs.append({**request, "vectors": vectors.reshape(2, -1).tolist()})
    answers = node(jobs)
    return {case: (a, *e) for case, a, e in zip(CARRYING, answers, expected, strict=True)}


@pytest.mark.slow
@pytest.mark.parametrize("case", CARRYING)
def test_tangent_vectors_are_those_of_numpy_to_roundoff(case: str, carried: dict[str, Any]) -> None:
    answer, after, vectors = carried[case]
    size = np.abs(vectors).max()
    np.testing.assert_allclose(np.reshape(answer["carried"], vectors.shape), vectors, rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(
        np.reshape(answer["after"], after.shape), after, rtol=0, atol=1e-13 * np.abs(after).max()
    )
    assert answer["unlike"]["status"] == "BAD_ARGUMENT"


REFUSED = {
    "sizes": ("volterra", {"sizes": [5]}, "i of 2 or more, a multiple of 2"),
    "small": ("heisenberg", {"sizes": [1, 2, 2]}, "i of 2 or more"),
    "dimension": ("heisenberg", {"sizes": [4]}, "sizes are [4]"),
    "state": ("toda", {"x0": [1, 2, 3]}, "x0 must be 128 finite numbers"),
    "not finite": ("toda", {"sizes": [2], "x0": ["NaN", 1, 1, 1]}, "x0 must be 4 finite numbers"),
    "unknown": ("dnls", {"params": {"gamma": 1}}, "there is no parameter gamma"),
    "no noise": ("toda", {"seed": 1}, "there is no option seed; options are x0, sizes, params"),
    "no time": ("food_web", {"t0": 1}, "there is no option t0; options are x0, sizes, params, bonds"),
    "array": ("xxz_disorder", {"params": {}}, "the parameter B must be given: its default is an array"),
    "positive": ("kdv", {"params": {"d": 0}}, "the parameter d is 0"),
    "one site": ("food_web", {"params": {"k": [1, 1, 1, 0, 1, 1, 1, 1, 1, 1]}}, "the parameter k is"),
    "bonds": ("food_web", {"bonds": [0, 10]}, "bonds are pairs of different sites"),
    "itself": ("food_web", {"bonds": [1, 1]}, "bonds are pairs of different sites"),
    "strengths": ("food_web", {"bonds": [0, 1, 1, 2]}, "A must be 2 finite numbers"),
}


@pytest.fixture(scope="module")
def refusals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("refused")
    listed = [job(folder, case, **more) for case, more, _ in REFUSED.values()]
    return dict(zip(REFUSED, node(listed), strict=True))


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_not_allowed_is_told(what: str, refusals: dict[str, dict[str, Any]]) -> None:
    assert refusals[what]["status"] == "BAD_ARGUMENT"
    assert REFUSED[what][2] in refusals[what]["message"]


@pytest.mark.parametrize(("name", "required"), [("xxz_disorder", True), ("toda", False), ("point_vortices", True)])
def test_headers_of_c_say_whether_parameters_may_be_null(name: str, required: bool) -> None:
    text = " ".join(emit(compiled(name).program, "c", "phigen")[f"{name}.h"].split())
    assert ("params must not be NULL, nor those of its arrays that have no default" in text) == required
    assert ("params may be NULL for the defaults" in text) != required


def test_modules_of_numpy_have_no_default_for_an_array() -> None:
    start, h = begun("xxz_disorder")
    (text,) = emit(compiled("xxz_disorder").program, "numpy", "phigen").values()
    module: dict[str, Any] = {}
    exec(text, module)
    with pytest.raises(TypeError, match="the parameter B must be given"):
        module["integrate"](start.state, h, 1)
    module["integrate"](start.state, h, 1, **start.parameters)
