"""The Cayley transform: the algebras and representations in which P E P belongs to the algebra for all elements P and
E.
"""

import pytest
from geometry.building import family, system, typed

from phigen.errors import SpecError
from phigen.geometry.representations import candidates, indecomposable_parts
from phigen.geometry.system import system_from_spec
from phigen.realisations.axioms import check
from phigen.realisations.catalogue import realise
from phigen.realisations.cayley import closed_product
from phigen.resources import bundled_specs
from phigen.spec import load
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.verdict import PROVED

CAYLEY = BirealisationChoice("cayley")


def proved(s):
    return {statement.verdict for statement in check(s, realise(s, CAYLEY))} == {PROVED}


def refusal(s) -> str:
    with pytest.raises(SpecError) as caught:
        realise(s, CAYLEY)
    return str(caught.value)


def test_sl3_is_refused_naming_the_element_that_leaves():
    message = refusal(family("sl", 3))
    # E1 and E2 are diagonal, and their product E1·E1·E2 has a trace, so it is not in sl(3).
    assert "in the 3×3 matrices of sl(3), E1·E1·E2 + E2·E1·E1 leaves the algebra" in message
    assert "in the adjoint 8×8 matrices, E1·E1·E1 leaves the algebra" in message
    assert "exponential" in message


def test_su3_is_refused_and_su2_is_not():
    assert "leaves the algebra" in refusal(family("su", 3))
    assert proved(family("su", 2))


def test_sl3_typed_as_a_matrix_is_refused_with_the_coordinates_names():
    assert "x1·x1·x2 + x2·x1·x1 leaves" in refusal(typed(family("sl", 3)))


def test_gl3_contains_sl3_but_is_closed():
    assert proved(typed(family("gl", 3)))


def test_toda_lattice_needs_nilpotent_blocks_for_its_centre():
    s = system_from_spec(load(bundled_specs() / "toda3.yaml"))
    assert "nilpotent 2×2 block" in realise(s, CAYLEY).explanation
    assert proved(s)


@pytest.mark.parametrize("sites", [2, 4, 5])
def test_toda_lattices_of_any_length(sites):
    a = [f"a{i}" for i in range(1, sites)]
    b = [f"b{i}" for i in range(1, sites + 1)]
    rows = ", ".join(f"a{i}: {{b{i}: -a{i}, b{i + 1}: a{i}}}" for i in range(1, sites))
    assert proved(system(" ".join(a + b), f"{{brackets: {{{rows}}}}}"))


def test_lagrange_top_is_recognised_as_se3():
    s = system_from_spec(load(bundled_specs() / "lagrange_top.yaml"))
    assert "minus the 4×4 matrices of se(3)" in realise(s, CAYLEY).explanation
    # The last three coordinates, the force direction, only get terms that are linear in p.
    assert [str(d).count("p:") for d in realise(s, CAYLEY).displacement[3:]] == [2, 2, 2]


def test_spin_chain_is_taken_apart_into_its_spins():
    s = system_from_spec(load(bundled_specs() / "spin_chain5.yaml"))
    assert indecomposable_parts(s.lie_algebra) == [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(5)]
    assert "(x1, y1, z1), (x2, y2, z2)" in realise(s, CAYLEY).explanation


def test_parts_may_be_interleaved_and_of_different_kinds():
    # The algebra is so(3) on (a, c, e), the Heisenberg algebra on (b, d, f), and a Casimir g.
    s = system("a b c d e f g", "{brackets: {a: {c: e, e: -c}, c: {e: a}, b: {d: f}}}")
    assert indecomposable_parts(s.lie_algebra) == [[0, 2, 4], [1, 3, 5], [6]]
    assert proved(s)
    assert realise(s, CAYLEY).displacement[6].is_zero


@pytest.mark.parametrize(
    "brackets",
    [
        "{x: {y: -z/I3, z: y/I2}, y: {z: -x/I1}}",  # so(3) with moments of inertia
        "{x: {y: I1*y, z: I1*z}}",  # book algebra
        "{x: {y: I1*y, z: -I1*z}}",  # se(1, 1)
        "{x: {y: I1*z}}",  # Heisenberg, scaled
        "{x: {y: 2*I1*y, z: -2*I1*z}, y: {z: x/I2}}",  # sl(2), scaled
        "{x: {y: sqrt(I1)*z, z: -y}}",  # se(2) with a function of a parameter
    ],
)
def test_algebras_with_parameters_in_their_constants(brackets):
    assert proved(system("x y z", f"{{brackets: {brackets}}}", extra="parameters: {I1: 2, I2: 3, I3: 5}"))


def test_solvable_algebra_with_unequal_weights_is_refused():
    # In the adjoint matrices x has the eigenvalues 0, 1 and 2. Its cube is in the algebra only if all eigenvalues
    # except 0 have the same modulus. The exponential has no such condition.
    message = refusal(system("x y z", "{brackets: {x: {y: y, z: 2*z}}}"))
    assert "in the adjoint 3×3 matrices, x·x·x leaves the algebra" in message


def test_two_step_nilpotent_algebras_need_no_family():
    # The free nilpotent algebra of step two with three generators: its centre lies in [g, g].
    s = system("a b c u v w", "{brackets: {a: {b: u, c: v}, b: {c: w}}}")
    assert "two-step nilpotent" in realise(s, CAYLEY).explanation
    assert proved(s)


def test_three_step_nilpotent_without_representation_is_refused_saying_so():
    message = refusal(system("a b c d", "{brackets: {a: {b: c, c: d}}}"))
    assert "no faithful representation" in message


def test_given_matrices_come_first_and_are_used_as_they_are():
    # These 3×3 matrices of sl(2) are closed, so the search for other matrices is not needed.
    three = "[[[2,0,0],[0,0,0],[0,0,-2]], [[0,1,0],[0,0,2],[0,0,0]], [[0,0,0],[2,0,0],[0,1,0]]]"
    s = system("h e f", f"{{lie_algebra: {{matrices: {three}}}}}")
    assert "given algebra" in realise(s, CAYLEY).explanation or "sl(2)" in realise(s, CAYLEY).explanation
    assert proved(s)


def test_linear_tensor_without_jacobi_identity_is_called_that():
    message = refusal(system("x y z", "{brackets: {x: {y: z, z: x}, y: {z: y + x}}}"))
    assert "Jacobi identity fails for (x, y, z)" in message


def test_nonlinear_tensor_is_refused():
    assert "needs a linear or affine π" in refusal(system("x y", "{brackets: {x: {y: x*y}}}"))


@pytest.mark.parametrize(("name", "size"), [("so", 4), ("gl", 2), ("se", 3), ("heisenberg", 2), ("aff", 1)])
def test_all_candidates_are_faithful_representations(name, size):
    from phigen.geometry.field import Field
    from phigen.geometry.linear import Span, add_multiple
    from phigen.geometry.matrix_algebras import product

    algebra = typed(family(name, size)).lie_algebra
    for representation in candidates(algebra):
        field = Field(v for m in representation.matrices for v in m.values())
        matrices = [{at: field.convert(v) for at, v in m.items()} for m in representation.matrices]
        assert Span(field, matrices).dependent == []
        for i in range(algebra.dimension):
            for j in range(i):
                difference = product(matrices[i], matrices[j])
                add_multiple(difference, product(matrices[j], matrices[i]), -field.one)
                for k, c in algebra.bracket(i, j).items():
                    add_multiple(difference, matrices[k], -field.convert(c))
                assert difference == {}


def test_trilinear_form_of_so3_is_minus_the_scalar_product():
    terms, _ = closed_product(family("so", 3).lie_algebra)
    # For so(3), P E_i P = −p_i P with P = Σ p_j E_j.
    assert {key: str(c) for key, c in terms.items() if key[0] == 0} == {
        (0, 0, 0, 0): "-1",
        (0, 0, 1, 1): "-1",
        (0, 0, 2, 2): "-1",
    }
