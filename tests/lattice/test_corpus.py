"""Bundled lattices: they are documented, proved, and equal to their expansions into ordinary specs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lattice.lattices import LATTICES, on_grid
from support import WARNINGS, run, tool, write

from phigen import resources
from phigen.api import lattice_solver_of
from phigen.compiler import compile_spec, emit, examine
from phigen.geometry.system import system_from_spec
from phigen.lattice.cell import vector_field
from phigen.lattice.cell_building import cell_from_spec, least_sizes
from phigen.lattice.expansion import expand
from phigen.lattice.states import start_of
from phigen.spec import load, loads
from phigen.study.lattice_errors import summed
from phigen.symbolic.arrays import evaluate
from phigen.symbolic.expression import total
from phigen.symbolic.verdict import PROVED

FILES = sorted((resources.bundled_specs() / "lattices").glob("*.yaml"))
#: Limits on the lines of C in profile small, including the header; code with a monitor also saves and resumes its
#: clock.
MOST_LINES, MOST_LINES_WITH_MONITOR = 800, 900
PERIODIC = [f for f in FILES if "axes" in f.read_text(encoding="utf-8") and "open" not in f.read_text(encoding="utf-8")]


def test_the_corpus_has_every_relation_of_sites() -> None:
    assert len(FILES) >= 14
    cells = [cell_from_spec(load(f)) for f in FILES]
    assert {c.relation for c in cells} == {"grid", "graph", "pairs"}
    assert {len(c.axes) for c in cells} == {0, 1, 2, 3}
    assert any(not c.is_local and c.relation == "grid" for c in cells)


@pytest.mark.thin(2)
@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_lattice_is_documented_proved_and_starts(path: Path) -> None:
    spec = load(path)
    assert spec.name == path.stem
    assert spec.title
    assert spec.references
    assert {s.name: s.verdict for s in examine(spec).statements if s.verdict != PROVED} == {}
    for experiment in spec.runs.values():
        start = start_of(spec, experiment)
        assert start.state.shape == (len(spec.coordinates), *start.sizes)
        assert np.all(np.isfinite(start.state))


@pytest.mark.slow
def test_short_code_is_short_for_any_number_of_sites() -> None:
    for path in FILES:
        spec = load(path)
        files = emit(compile_spec(spec, profile="small").program, "c", "phigen")
        most = MOST_LINES_WITH_MONITOR if spec.monitor else MOST_LINES
        assert sum(len(text.splitlines()) for text in files.values()) <= most, path.stem


@pytest.mark.thin(1)
@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_short_code_with_transposes_has_no_function_that_nothing_calls(path: Path, tmp_path: Path) -> None:
    """tests/generated/test_compilers.py checks fast code."""
    spec = load(path)
    program = compile_spec(spec, profile="small", adjoint=not (spec.noise or spec.monitor)).program
    write(tmp_path, emit(program, "c", "phigen"))
    # Only clang warns of unused inline functions.
    run([tool("clang"), "-std=c99", *WARNINGS, "-fsyntax-only", f"{path.stem}.c"], tmp_path)


def test_bonds_that_differ_in_direction_and_parameters_are_added_up_by_one_loop() -> None:
    compilation = compile_spec(load(resources.bundled_specs() / "lattices/chiral_magnet.yaml"), profile="small")
    code = emit(compilation.program, "c", "phigen")["chiral_magnet.c"]
    assert "/* For each site a, the forces of H_1, H_5 on a, summed over its neighbours b. */" in code
    assert "only for bonds that" not in code
    random = np.random.default_rng(2)
    bonds = {"bonds": np.stack([np.arange(20), (np.arange(20) * 7 + 3) % 20], axis=1)[random.permutation(19)]}
    bonds |= {"Dx": random.normal(size=19), "Dy": random.normal(size=19)}
    x = random.normal(size=(3, 20))
    mine, other = (lattice_solver_of(compilation, t).integrate(x, 0.1, 3, 3, **bonds).x[-1] for t in ("c", "numpy"))
    np.testing.assert_allclose(mine, other, rtol=0, atol=3e-13)


def test_sums_over_open_and_periodic_grids_are_those_of_expansions() -> None:
    for name, text in LATTICES.items():
        spec = loads(text)
        cell, start = cell_from_spec(spec), start_of(spec, next(iter(spec.runs.values())))
        if cell.axes:
            expansion = expand(cell, start.sizes)
            values = expansion.numbers(start.parameters)
            values |= dict(zip(expansion.coordinates, start.state.reshape(-1), strict=True))
            (expected,) = evaluate([total(expansion.summed(cell.hamiltonian))], values)
            mine, _ = summed(cell, cell.hamiltonian, start.state, start.parameters)
            np.testing.assert_allclose(mine, expected, rtol=1e-13, atol=1e-13, err_msg=name)


@pytest.mark.parametrize("path", PERIODIC, ids=lambda p: p.stem)
def test_a_small_one_moves_as_its_expansion(path: Path) -> None:
    spec = load(path)
    cell = cell_from_spec(spec)
    run = next(iter(spec.runs.values()))
    sizes = tuple(n + 1 for n in least_sizes(cell))
    start = start_of(spec, replace(run, lattice=replace(run.lattice, sizes=sizes)))
    state = start.state + np.random.default_rng(1).uniform(0.1, 0.3, size=start.state.shape)
    start = replace(start, state=state)
    expansion = expand(cell, sizes)
    system = system_from_spec(expansion.spec())
    values = expansion.numbers(start.parameters) | dict(zip(system.coordinates, state.reshape(-1), strict=True))
    energy, *rates = evaluate([system.hamiltonian, *system.vector_field()], values)
    np.testing.assert_allclose(on_grid(cell, start, cell.hamiltonian).sum(), energy, rtol=1e-12)
    for mine, theirs in zip(vector_field(cell).values(), np.reshape(rates, state.shape), strict=True):
        np.testing.assert_allclose(on_grid(cell, start, mine), theirs, rtol=1e-11, atol=1e-11)
