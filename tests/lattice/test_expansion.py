"""The expansion of a lattice into an ordinary spec, compared with sums over sites by plain loops and array shifts."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner
from lattice.lattices import LATTICES, on_grid

import phigen
from phigen.cli import group
from phigen.geometry.checks import check
from phigen.geometry.system import System, hamiltonian_vector_field, system_from_spec
from phigen.lattice.cell import Cell, bond_forces, contributions, vector_field
from phigen.lattice.cell_building import cell_from_spec
from phigen.lattice.expansion import Expansion, expand, run_of
from phigen.lattice.recognition import recognised
from phigen.lattice.states import Start, start_of
from phigen.spec import loads
from phigen.spec.model import Spec
from phigen.spec.yaml_text import spec_text
from phigen.study.lattice_errors import summed
from phigen.symbolic.arrays import evaluate
from phigen.symbolic.expression import gradient
from phigen.symbolic.verdict import REFUTED

GRIDS = [n for n, text in LATTICES.items() if "axes" in text]


@cache
def prepared(name: str) -> tuple[Spec, Cell, Start, Expansion, System]:
    """Return a lattice, its first run, and both expanded into an ordinary system."""
    spec = loads(LATTICES[name])
    cell, start = cell_from_spec(spec), start_of(spec, next(iter(spec.runs.values())))
    expansion = expand(cell, start.sizes, start.bonds)
    return spec, cell, start, expansion, system_from_spec(expansion.spec())


def values(name: str) -> dict[str, float]:
    """Return the coordinates and parameters of the ordinary system at the start of the run."""
    _, _, start, expansion, system = prepared(name)
    return expansion.numbers(start.parameters) | dict(zip(system.coordinates, start.state.reshape(-1), strict=True))


@pytest.mark.parametrize("name", [n for n in GRIDS if "open" not in LATTICES[n]])
def test_the_field_at_a_site_is_that_of_the_expansion(name: str) -> None:
    _, cell, start, _, system = prepared(name)
    expanded = np.array(evaluate(system.vector_field(), values(name))).reshape(start.state.shape)
    rates = vector_field(cell)
    for k, f in enumerate(cell.fields):
        np.testing.assert_allclose(on_grid(cell, start, rates[f]), expanded[k], rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", GRIDS)
def test_forces_are_the_gradient_of_h_at_open_ends_too(name: str) -> None:
    _, cell, start, expansion, system = prepared(name)
    slopes = evaluate(gradient(system.hamiltonian, system.coordinates), values(name))
    slope_of = dict(zip(system.coordinates, slopes, strict=True))
    for f, listed in contributions(cell).items():
        for site in expansion.sites:
            force = 0.0
            for c in listed:
                inside = all(
                    b == "periodic" or (s + low >= 0 and s + high < n)
                    for b, s, low, high, n in zip(cell.boundary, site, c.low, c.high, start.sizes, strict=True)
                )
                term = expansion.at(c.expression, site) if inside else None
                force += float(evaluate([term], values(name))[0]) if term is not None else 0.0
            np.testing.assert_allclose(force, slope_of[expansion.names[f, site]], rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", [n for n in GRIDS if "open" not in LATTICES[n]])
def test_h_is_the_sum_of_the_density(name: str) -> None:
    _, cell, start, _, system = prepared(name)
    expected = evaluate([system.hamiltonian], values(name))[0]
    np.testing.assert_allclose(on_grid(cell, start, cell.hamiltonian).sum(), expected, rtol=1e-13)


def test_open_ends_leave_out_the_terms_that_reach_beyond() -> None:
    _, _, start, _, system = prepared("fput_open")
    q, p = start.state
    r = q[1:] - q[:-1]
    energy = (p**2 / 2).sum() + (r**2 / 2 + 0.25 * r**3 / 3 + 0.5 * r**4 / 4).sum()
    np.testing.assert_allclose(evaluate([system.hamiltonian], values("fput_open"))[0], energy, rtol=1e-14)


def test_bonds_are_summed_with_their_own_parameters() -> None:
    _, cell, start, _, system = prepared("spin_graph")
    x, y, z = start.state
    J, D = start.parameters["J"], start.parameters["D"]
    energy = -(start.parameters["B"] * z).sum()
    force = np.zeros_like(x)
    for k, (a, b) in enumerate(start.bonds):
        energy -= J[k] * (x[a] * x[b] + y[a] * y[b] + z[a] * z[b]) + D * (x[a] * y[b] - y[a] * x[b])
        ends = {f"{f}[{e}]": v[s] for f, v in zip("xyz", start.state, strict=True) for e, s in (("a", a), ("b", b))}
        slopes = bond_forces(cell)
        force[a] += evaluate([slopes["x[a]"]], ends | {"J": J[k], "D": D})[0]
        force[b] += evaluate([slopes["x[b]"]], ends | {"J": J[k], "D": D})[0]
    slopes = evaluate(gradient(system.hamiltonian, system.coordinates[:4]), values("spin_graph"))
    np.testing.assert_allclose(evaluate([system.hamiltonian], values("spin_graph"))[0], energy, rtol=1e-14)
    np.testing.assert_allclose(slopes, force, rtol=1e-13)


def test_brackets_along_bonds_add_up() -> None:
    _, _, start, expansion, system = prepared("food_web")
    x, A = start.state[0], start.parameters["A"]
    expected = np.zeros((4, 4))
    for k, (a, b) in enumerate(start.bonds):
        expected[a, b] += A[k] * x[a] * x[b]
        expected[b, a] -= A[k] * x[a] * x[b]
    matrix = [evaluate(row, values("food_web")) for row in system.poisson]
    np.testing.assert_allclose(np.array(matrix, dtype=float), expected, rtol=1e-14)
    assert expansion.coordinates == ("x_0", "x_1", "x_2", "x_3")


def test_every_pair_is_counted_once() -> None:
    _, _, start, _, system = prepared("vortices")
    x, y = start.state
    G = start.parameters["G"]
    energy = 0.0
    for a in range(4):
        for b in range(a):
            energy -= G[a] * G[b] * np.log((x[a] - x[b]) ** 2 + (y[a] - y[b]) ** 2) / (4 * np.pi)
    np.testing.assert_allclose(evaluate([system.hamiltonian], values("vortices"))[0], energy, rtol=1e-14)


@pytest.mark.parametrize("name", LATTICES)
def test_the_expansion_is_a_poisson_system_with_what_the_spec_claims(name: str) -> None:
    system = prepared(name)[-1]
    assert [str(s) for s in check(system) if s.verdict == REFUTED] == []
    assert len(system.casimirs) >= len(prepared(name)[1].casimirs)


@pytest.mark.parametrize("name", LATTICES)
def test_the_text_of_an_expansion_reads_as_the_same_spec(name: str) -> None:
    spec, _, start, expansion, _ = prepared(name)
    (run,) = spec.runs.values()
    numbers = expansion.numbers(start.parameters)
    expanded_spec = replace(expansion.spec(), runs={run.name: run_of(expansion, run, start.state, numbers)})
    read = loads(spec_text(expanded_spec))
    here = values(name)
    assert (read.coordinates, [p.name for p in read.parameters]) == (
        expanded_spec.coordinates,
        [p.name for p in expanded_spec.parameters],
    )
    pairs = [(read.hamiltonian, expanded_spec.hamiltonian)]
    rows = zip(read.poisson.entries, expanded_spec.poisson.entries, strict=True)
    pairs += [pair for r, s in rows for pair in zip(r, s, strict=True)]
    pairs += [(read.casimirs[n], e) for n, e in expanded_spec.casimirs.items()]
    pairs += [(read.invariants[n], e) for n, e in expanded_spec.invariants.items()]
    for left, right in pairs:
        np.testing.assert_allclose(*evaluate([left, right], here), rtol=1e-13, atol=1e-15)
    assert read.runs[run.name].initial == expanded_spec.runs[run.name].initial
    assert read.runs[run.name].parameters == expanded_spec.runs[run.name].parameters


def test_the_text_of_a_large_expansion_keeps_the_limits_of_expressions() -> None:
    expanded_spec = expand(prepared("fput")[1], (100,)).spec()
    text = spec_text(expanded_spec)
    assert "H_part1" in text
    assert recognised(loads(text), expanded_spec.poisson.entries).lattice.boundary == ("periodic",)


def test_sizes_that_do_not_fit_are_refused() -> None:
    cell = prepared("spins_2")[1]
    with pytest.raises(ValueError, match="sizes must be 2 positive integers, for the axes i, j; got 3"):
        expand(cell, (3,))
    with pytest.raises(ValueError, match="between 0 and 2"):
        expand(prepared("spin_graph")[1], (3,), [(0, 3)])


def test_names_of_sites_do_not_clash_with_others() -> None:
    text = LATTICES["toda"].replace("{B: {value: b, at: sum}, A:", "{b_1: {value: b, at: sum}, A:")
    cell = cell_from_spec(loads(text))
    assert expand(cell, (3,)).names["b", (1,)] == "b_1_"


def random_lattice(seed: int) -> str:
    """Return the spec of a lattice with a random stencil for H, on a periodic or an open grid."""
    draw = random.Random(seed)
    axes = ["i", "j", "k"][: draw.choice([1, 1, 2, 3])]

    def at(field: str) -> str:
        steps = [f"{a}{draw.choice([-1, 1]):+d}" for a in axes if draw.random() < 0.5]
        return f"{field}[{', '.join(steps)}]" if steps else field

    terms = [
        draw.choice([
            f"{at('q')}*{at('p')}*{at('q')}", f"w*cos({at('q')} - {at('p')})", f"c*({at('q')} - {at('q')})**2*w",
            f"exp({at('p')}/4)*{at('w')}", f"{at('p')}**2/(2 + {at('q')}**2)",
        ])
        for _ in range(4)
    ]  # fmt: skip
    bracket = draw.choice(["1", "1 + q**2 + p**2", "exp(q)", "w*q*p"])
    boundary = ", ".join(draw.choice(["periodic", "open"]) for _ in axes)
    return (
        f"phigen: 1\nname: drawn\nlattice: {{axes: [{', '.join(axes)}], boundary: [{boundary}]}}\ncoordinates: [q, p]\n"
        f"parameters: {{c: 0.7, w: {{value: 1 + i/10, at: sites}}}}\npoisson: {{brackets: {{q: {{p: {bracket}}}}}}}\n"
        f"hamiltonian: {' + '.join(terms)}\n"
        f"runs: {{r: {{sizes: {[3] * len(axes)}, initial: {{random: normal, seed: {seed}}}, step: 1, steps: 1}}}}\n"
    )


@pytest.mark.parametrize("seed", range(50))
def test_random_lattices_move_as_their_expansions(seed: int) -> None:
    spec = loads(random_lattice(seed))
    cell, start = cell_from_spec(spec), start_of(spec, spec.runs["r"])
    expansion = expand(cell, start.sizes)
    expanded_spec = expansion.spec()
    here = expansion.numbers(start.parameters)
    here |= dict(zip(expanded_spec.coordinates, start.state.reshape(-1), strict=True))
    slopes = gradient(expanded_spec.hamiltonian, expanded_spec.coordinates)
    rates = evaluate(hamiltonian_vector_field(expanded_spec.poisson.entries, slopes), here)
    force = {f: np.zeros(start.sizes) for f in cell.fields}
    for f, listed in contributions(cell).items():
        for site, c in itertools.product(expansion.sites, listed):
            box = zip(cell.boundary, site, c.low, c.high, start.sizes, strict=True)
            if all(b == "periodic" or (s + low >= 0 and s + high < n) for b, s, low, high, n in box):
                force[f][site] += evaluate([expansion.at(c.expression, site)], here)[0]
    pi = on_grid(cell, start, cell.bracket["q", "p"])
    np.testing.assert_allclose(
        [pi * force["p"], -pi * force["q"]], np.reshape(rates, start.state.shape), rtol=1e-11, atol=1e-12
    )
    energy, _ = summed(cell, cell.hamiltonian, start.state, start.parameters)
    np.testing.assert_allclose(energy, evaluate([expanded_spec.hamiltonian], here)[0], rtol=1e-12)


def test_bodies_that_meet_take_the_logarithmic_monitor_as_an_ordinary_system(tmp_path):
    text = """\
phigen: 1
name: bodies
lattice: {pairs: all}
coordinates: [x, y, px, py]
parameters: {m: {value: [1, 0.01, 0.002], at: sites, positive: true}}
poisson: {canonical: {q: [x, y], p: [px, py]}}
hamiltonian:
  sites: (px**2 + py**2)/(2*m)
  pairs: -m[a]*m[b]/sqrt((x[a] - x[b])**2 + (y[a] - y[b])**2)
runs: {close: {initial: {x: [0, 1, 1.3], y: 0, px: 0, py: [0, 0.003, 0.0018]}, step: 0.02, until: 3}}
"""
    plain = phigen.compile(loads(text), target="numpy", order=4)
    (tmp_path / "bodies.yaml").write_text(text)
    command = ["show", str(tmp_path / "bodies.yaml"), "--expand", "3"]
    listed = CliRunner().invoke(group, command, prog_name="phigen").stdout
    monitored = phigen.compile(loads(f"{listed}scheme: splitting\nmonitor: log\n"), target="numpy", order=4)
    runs = plain.run(), monitored.run(step=0.0005)
    errors = [np.abs(run.energy - run.energy[0]).max() / abs(run.energy[0]) for run in runs]
    assert runs[1].steps < runs[0].steps
    assert errors[1] < 1e-6 < 0.05 < errors[0]
