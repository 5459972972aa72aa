"""Poisson structures that are given in other coordinates: maps and their inverses, nesting, and proofs in these
coordinates.
"""

from dataclasses import replace

import pytest
from geometry.building import system

from phigen.errors import SpecError
from phigen.geometry.checks import check as check_structure
from phigen.geometry.pullback import change_of_coordinates
from phigen.realisations import axioms
from phigen.realisations.catalogue import realise
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import substitute, symbol
from phigen.symbolic.verdict import PROVED, REFUTED, decide_zero

PULLBACK = BirealisationChoice("pullback")
SO3 = "{lie_algebra: {name: so(3)}}"


def pulled(of, mapping, inverse="", coordinates="x y z"):
    rest = f", inverse: {inverse}" if inverse else ""
    return system(coordinates, f"{{pullback: {{of: {of}, map: {mapping}{rest}}}}}")


@pytest.mark.parametrize(
    ("of", "mapping"),
    [
        (SO3, "{u: x, v: y + x**2, w: z - x*y}"),  # a shear
        (SO3, "{u: x + y, v: y - x, w: 3*z + 1}"),  # affine
        ("{log_canonical: [[0, 1, 1], [-1, 0, 1], [-1, -1, 0]]}", "{u: x, v: y + x**2, w: z}"),
        ("{canonical: {q: [u], p: [v]}}", "{u: x, v: y*exp(x), w: z}"),
        ("{product: [{coordinates: [u, v], log_canonical: [[0, 1], [-1, 0]]}, {coordinates: [w], matrix: [[0]]}]}",
         "{u: x, v: y + z**2, w: z}"),
        ("{pullback: {of: {matrix: [[0, c, 0], [-c, 0, 0], [0, 0, 0]]}, map: {a: u, b: v - u**2, c: w}}}",
         "{u: x, v: y, w: z + x}"),
    ],
)  # fmt: skip
def test_axioms_are_proved(of, mapping):
    s = pulled(of, mapping)
    assert {statement.verdict for statement in check_structure(s)[:-1]} == {PROVED}
    realisation = realise(s, PULLBACK)
    assert realisation.kind == "pullback"
    assert realisation.symmetric
    assert [statement.verdict for statement in axioms.check(s, realisation)] == [PROVED] * 5


def test_proofs_in_the_other_coordinates_agree_with_direct_ones():
    s = pulled("{matrix: [[0, w, 0], [-w, 0, 0], [0, 0, 0]]}", "{u: x, v: y + x**2, w: z - x}")
    realisation = realise(s, PULLBACK)
    statements = axioms.check(s, realisation)
    assert all("in the coordinates u, v, w" in statement.detail for statement in statements[1:4])
    direct = axioms.check(s, replace(realisation, inner=None))
    assert [statement.verdict for statement in direct] == [PROVED] * 5
    assert not any("coordinates u" in statement.detail for statement in direct)


def test_maps_that_are_not_the_pull_back_are_refuted():
    s = pulled(SO3, "{u: x, v: y + x, w: z}")
    realisation = realise(s, PULLBACK)
    wrong = replace(realisation, alpha=realisation.beta, beta=realisation.alpha)
    assert REFUTED in [statement.verdict for statement in axioms.check(s, wrong)]
    other = replace(s, poisson=tuple(tuple(2 * e for e in row) for row in s.poisson))
    assert REFUTED in [statement.verdict for statement in axioms.check(other, realisation)]


@pytest.mark.parametrize(
    "mapping",
    [
        "{u: exp(x), v: y*exp(x), w: sinh(z) + y}",
        "{u: 1/(x + y), v: y, w: -z/2}",
        "{u: log(x), v: y + sin(x), w: z*x}",
        "{u: x + y + z, v: y - z, w: z + 2*x}",
    ],
)
def test_the_inverse_is_found(mapping):
    s = pulled(SO3, mapping)
    change = change_of_coordinates(s.form, s.coordinates)
    forward = dict(zip(s.form.coordinates, change.forward, strict=True))
    residuals = [(c, e - symbol(c)) for c, e in zip(s.coordinates, substitute(change.backward, forward), strict=True)]
    assert decide_zero("ψ⁻¹∘ψ = id", residuals).holds


def test_without_a_formula_the_inverse_is_asked_for():
    mapping = "{u: x + y**3, v: y + x**3/10, w: z}"
    with pytest.raises(SpecError, match="could not be inverted symbolically for x, y") as caught:
        pulled(SO3, mapping)
    assert "inverse: {" in caught.value.diagnostics[0].hint


def test_a_given_inverse_is_checked():
    mapping = "{u: (x + y)**2, v: y, w: z}"
    with pytest.raises(SpecError, match=r"`inverse` are not the inverse of those under `map` \(x"):
        pulled(SO3, mapping, "{x: u - v, y: v, z: w}")


def test_a_singular_map_is_refused():
    with pytest.raises(SpecError, match="not invertible, its Jacobian matrix is singular"):
        pulled(SO3, "{u: x + y, v: 2*x + 2*y, w: z}")


def test_the_inner_kind_can_be_chosen():
    realisation = realise(pulled(SO3, "{u: x, v: y + x**2, w: z}"), BirealisationChoice("pullback", of="cayley"))
    assert "Cayley" in realisation.explanation


def test_auto_recognises_what_the_pull_back_is():
    # The bracket of so(3) stays linear after a permutation of the coordinates, so no pull-back is needed.
    assert realise(pulled(SO3, "{u: y, v: z, w: x}")).kind == "exponential"
    realisation = realise(pulled(SO3, "{u: x, v: y + x**2, w: z}"))
    assert realisation.explanation.startswith("auto picked pullback, since π is given in the coordinates u, v, w")


def test_casimirs_are_pulled_back():
    s = pulled(SO3, "{u: x, v: y + exp(x), w: z}")
    assert len(s.casimirs) == 1
    assert {statement.verdict for statement in check_structure(s)[:-1]} == {PROVED}


def test_without_closed_form_inside_the_path_is_followed_outside():
    s = pulled("{matrix: [[0, 1 + u*v, 0], [-1 - u*v, 0, 0], [0, 0, 0]]}", "{u: x, v: y + x**2, w: z}")
    assert realise(s).path
    with pytest.raises(SpecError, match="no closed form is known in the coordinates of the map"):
        realise(s, PULLBACK)


def test_other_forms_are_refused():
    with pytest.raises(SpecError, match=r"needs poisson: \{pullback"):
        realise(system("x y z", SO3), PULLBACK)
