"""Statements about lattices of all sizes, compared with the expansion at some sizes; planted errors are refuted."""

from __future__ import annotations

import random

import pytest
from lattice.lattices import FOOD_WEB, FPUT, LATTICES, SPIN_GRAPH, TODA, VOLTERRA, VORTICES, spins

from phigen import resources
from phigen.compiler import examine
from phigen.geometry.jacobi import jacobi_identity
from phigen.geometry.system import system_from_spec
from phigen.lattice.cell import Cell
from phigen.lattice.cell_building import cell_from_spec
from phigen.lattice.expansion import expand
from phigen.lattice.proofs import euler, tensor
from phigen.spec import loads
from phigen.symbolic.expression import Expression, symbol
from phigen.symbolic.verdict import PROVED, REFUTED, decide_zero

PERIODIC = spins("i", "periodic", "4")


def verdicts(text: str) -> dict[str, str]:
    """Return the verdicts on a lattice, by statement."""
    return {s.name: s.verdict for s in examine(loads(text)).statements}


def stated(text: str, name: str) -> str:
    """Return the only statement with this name, as text."""
    (statement,) = (s for s in examine(loads(text)).statements if s.name == name)
    return str(statement)


@pytest.mark.parametrize("name", LATTICES)
def test_everything_true_of_a_lattice_is_proved_for_all_sizes(name: str) -> None:
    assert {n: v for n, v in verdicts(LATTICES[name]).items() if v != PROVED} == {}


def test_the_example_of_the_reference_is_proved() -> None:
    page = (resources.bundled_specs().parent / "docs" / "lattices.md").read_text(encoding="utf-8")
    example = page.split("```yaml\n")[1].split("```")[0]
    assert set(verdicts(example).values()) == {PROVED}
    assert len(verdicts(example)) == 8


@pytest.mark.parametrize("c", ["0.1", "{value: 0.1, positive: true}"])
def test_drag_proportional_to_the_square_of_the_speed_is_proved(c: str) -> None:
    text = (
        "phigen: 1\nname: dragged\nlattice: {axes: [i]}\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
        f"parameters: {{c: {c}}}\nhamiltonian: p**2/2 + (q[i+1] - q)**2/2\nforces: {{vector: {{p: -c*p*abs(p)}}}}\n"
    )
    assert set(verdicts(text).values()) == {PROVED}


# --- planted errors


def test_a_bracket_of_neighbours_without_jacobi_identity_is_refuted_with_the_triple() -> None:
    wrong = VOLTERRA.replace("BOUNDARY", "periodic").replace('"a*a[i+1]"}}}', '"a**2*a[i+1]"}}}')
    assert stated(wrong, "Jacobi identity").startswith("Jacobi identity: refuted ((a, a[i+1], a[i+2])")


def test_nothing_rests_on_a_bracket_that_is_refuted() -> None:
    wrong = TODA.replace("BOUNDARY", "periodic").replace("{a: {b: a/2,", "{a: {b: a*b,")
    examination = examine(loads(wrong))
    assert examination.unexamined
    assert [s.name for s in examination.refuted] == ["Jacobi identity"]


def test_a_matrix_that_is_not_skew_is_refuted() -> None:
    wrong = PERIODIC.replace("{lie_algebra: {name: so(3)}}", "{matrix: [[0, z, -y], [z, 0, x], [y, -x, 0]]}")
    assert verdicts(wrong) == {"π is skew": REFUTED}


@pytest.mark.parametrize(
    ("casimir", "where"),
    [
        ("x**2 + y**2 - z**2", "{C, y}"),
        ('{value: "x**2 + z[i+1]**2", at: sum}', "{x, C}"),
        ("{value: x, at: product}", "{y, C}"),
    ],
)
def test_a_casimir_that_is_none_is_refuted(casimir: str, where: str) -> None:
    text = PERIODIC.replace("x**2 + y**2 + z**2", casimir)
    assert stated(text, "C is a Casimir").startswith(f"C is a Casimir: refuted ({where}")


def test_a_sum_that_is_a_casimir_is_none_at_single_sites() -> None:
    text = TODA.replace("BOUNDARY", "periodic").replace("{value: b, at: sum}", "b")
    assert verdicts(text)["B is a Casimir"] == REFUTED


def test_an_invariant_with_a_wrong_sign_is_refuted() -> None:
    wrong = TODA.replace("BOUNDARY", "periodic").replace("b**3/3 + 2", "b**3/3 - 2")
    assert verdicts(wrong)["K is invariant"] == REFUTED


def test_a_density_whose_rate_is_constant_is_no_invariant() -> None:
    text = FPUT.replace("BOUNDARY", "periodic").replace("p**2/2 + r**2/2 + alpha*r**3/3 + beta*r**4/4", "q")
    assert verdicts(text)["P is invariant"] == REFUTED


def test_magnetisation_is_invariant_in_a_field_along_it_only() -> None:
    text = PERIODIC.replace("{M: z}", "{M: z, X: x}")
    assert (verdicts(text)["M is invariant"], verdicts(text)["X is invariant"]) == (PROVED, REFUTED)


def test_open_ends_are_looked_at_apart() -> None:
    verdict_of = verdicts(TODA.replace("BOUNDARY", "open"))
    assert verdict_of["Jacobi identity"] == PROVED
    assert [n for n, v in verdict_of.items() if v == REFUTED] == ["B is a Casimir", "A is a Casimir", "K is invariant"]
    text = TODA.replace("BOUNDARY", "open")
    assert "at open ends, 2 sites" in stated(text, "K is invariant")


def test_momentum_is_conserved_by_free_ends() -> None:
    assert verdicts(LATTICES["fput_open"])["P is invariant"] == PROVED


def test_brackets_along_bonds_need_the_jacobi_identity_of_every_graph() -> None:
    wrong = FOOD_WEB.replace('"A*x[a]*x[b]"', '"A*x[a]*x[b]**2"')
    assert "the graph 0–1, 1–2" in stated(wrong, "Jacobi identity")
    local = SPIN_GRAPH.replace(
        "{lie_algebra: {name: so(3)}}", '{lie_algebra: {name: so(3)}, bonds: {"x[a]": {"x[b]": 1}}}'
    )
    assert "the graph 0–1:" in stated(local, "Jacobi identity")


def test_an_interaction_that_breaks_the_symmetry_is_found_on_a_graph() -> None:
    wrong = SPIN_GRAPH.replace("y[a]*y[b] +", "2*y[a]*y[b] +")
    assert verdicts(wrong)["M is invariant"] == REFUTED


def test_a_pair_has_no_first_and_second() -> None:
    wrong = VORTICES.replace("(x[a] - x[b])**2", "(x[a] - 2*x[b])**2")
    assert verdicts(wrong)["the density of a pair is symmetric"] == REFUTED


# --- the calculus


def test_the_euler_operator_vanishes_on_differences_of_neighbours_and_constants() -> None:
    cell = cell_from_spec(loads(LATTICES["far"]))
    density = symbol("q") ** 2 * symbol("p[i+1,j-1]") + symbol("w") * symbol("q[j+1]")
    telescoping = cell.shifted(density, (2, -1)) - density + 3
    assert decide_zero("", [(n, e) for n, e in euler(cell, telescoping).items()]).verdict == PROVED
    assert decide_zero("", [(n, e) for n, e in euler(cell, density).items()]).verdict == REFUTED


def random_bracket(seed: int) -> Cell:
    """Return a cell with a random quadratic bracket of two fields with neighbours, Poisson or not."""
    draw = random.Random(seed)
    a, b = symbol("a"), symbol("b")
    right = {"a[i+1]": symbol("a[i+1]"), "b[i+1]": symbol("b[i+1]"), "b": b}
    bracket: dict[tuple[str, str], Expression] = {}
    frame = Cell("frame", ("a", "b"), a, {}, axes=("i",), boundary=("periodic",))

    def state(f: str, g: str, value: Expression) -> None:
        base, offset = frame.place(g)
        bracket[f, g] = value
        bracket[base, frame.at(f, tuple(-o for o in offset))] = frame.shifted(-value, tuple(-o for o in offset))

    for f, same_site in (("a", a), ("b", b)):
        for g, other in right.items():
            if (f, g) == ("b", "b") or draw.random() < 0.3:
                continue
            choices = [same_site * other, same_site * other, same_site, other, same_site * other + 1]
            state(f, g, draw.choice([1, -1, 2]) * draw.choice(choices[: 2 + 3 * (draw.random() < 0.4)]))
    return Cell("random", ("a", "b"), a, bracket, axes=("i",), boundary=("periodic",))


def test_verdicts_on_random_brackets_are_those_on_their_expansions() -> None:
    seen = set()
    for seed in range(24):
        cell = random_bracket(seed)
        mine = tensor(cell)[-1]
        theirs = jacobi_identity(system_from_spec(expand(cell, (6,)).spec()))
        assert (mine.name, mine.verdict) == (theirs.name, theirs.verdict), seed
        seen.add(mine.verdict)
    assert seen == {PROVED, REFUTED}
