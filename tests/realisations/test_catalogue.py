"""Choice of the kind of a bi-realisation: by name, by the shape of π, and the error if no kind applies."""

import os
import subprocess
import sys

import pytest
from geometry.building import system

from phigen.errors import SpecError
from phigen.realisations.catalogue import BUILDERS, realise
from phigen.spec.model import BirealisationChoice
from phigen.spec.names import BIREALISATIONS
from phigen.symbolic.expression import ONE, symbol
from phigen.symbolic.symbols import momentum


@pytest.mark.parametrize(
    ("coordinates", "poisson", "kind"),
    [
        ("q p", "{canonical: {q: [q], p: [p]}}", "constant"),
        ("x y", "{brackets: {x: {y: 2}}}", "constant"),
        ("x y", "{brackets: {x: {y: 3*x*y}}}", "log-canonical"),
        ("x y z", "{brackets: {x: {y: z}}}", "exponential"),
        ("x y z", "{brackets: {x: {y: z + 1, z: y}}}", "exponential"),
        ("x y", "{lie_algebra: {name: aff(1)}}", "exponential"),
    ],
)
def test_auto_picks_by_shape_and_explains(coordinates, poisson, kind):
    realisation = realise(system(coordinates, poisson))
    assert realisation.kind == kind
    assert realisation.explanation.startswith(f"auto picked {kind}, since π is ")
    assert realisation.exact
    assert realisation.symmetric
    assert realisation.reference


def test_refusals_carry_the_place_in_the_spec():
    with pytest.raises(SpecError) as caught:
        realise(system("x y z", "{lie_algebra: {name: so(3)}}"), BirealisationChoice("constant"))
    assert caught.value.diagnostics[0].location.line == 4  # the line of poisson, because the spec has no birealisation


def test_every_kind_of_the_spec_format_has_a_builder():
    assert set(BUILDERS) == set(BIREALISATIONS)


def test_unknown_kind_lists_the_available_ones():
    with pytest.raises(SpecError) as caught:
        realise(system("x y", "{brackets: {x: {y: 1}}}"), BirealisationChoice("magic"))
    assert all(kind in caught.value.diagnostics[0].hint for kind in BUILDERS)


@pytest.mark.parametrize(
    ("kind", "poisson"),
    [
        ("constant", "{brackets: {x: {y: x}}}"),
        ("log-canonical", "{brackets: {x: {y: x}}}"),
        ("canonical-euler", "{brackets: {x: {y: 2}}}"),
        ("cayley", "{brackets: {x: {y: 2}}}"),
    ],
)
def test_a_kind_that_does_not_fit_is_refused_with_the_shape_of_the_tensor(kind, poisson):
    with pytest.raises(SpecError, match=f"birealisation {kind} needs"):
        realise(system("x y", poisson), BirealisationChoice(kind))


def test_custom_maps_of_the_wrong_size_or_with_unknown_symbols_are_refused():
    s = system("x y", "{brackets: {x: {y: 2}}}")
    x = symbol("x")
    with pytest.raises(SpecError, match="alpha has 1 components"):
        realise(s, BirealisationChoice("custom", (x,), (x, x)))
    with pytest.raises(SpecError, match="beta uses p_z"):
        realise(s, BirealisationChoice("custom", (x, x), (x, symbol(momentum("z")))))


def test_custom_differences_do_not_cancel():
    x, y, p, r = (symbol(n) for n in ("x", "y", momentum("x"), momentum("y")))
    s = system("x y", "{brackets: {x: {y: 1}}}")
    realisation = realise(s, BirealisationChoice("custom", (x + r, ONE * y), (x, y - p)))
    assert [str(d) for d in realisation.displacement] == ["p:y", "0"]
    assert [str(d) for d in realisation.increment] == ["-p:y", "-p:x"]
    assert not realisation.symmetric


def test_constant_displacement_and_increment():
    realisation = realise(system("q p", "{canonical: {q: [q], p: [p]}}"))
    assert [str(d) for d in realisation.displacement] == ["(-1/2)*p:p", "1/2*p:q"]
    assert [str(d) for d in realisation.increment] == ["p:p", "-p:q"]
    assert realisation.covector == (momentum("q"), momentum("p"))


@pytest.mark.slow
def test_nothing_depends_on_the_hash_seed():
    code = (
        "from phigen.spec import load\nfrom phigen.resources import bundled_specs\n"
        "from phigen.geometry.system import system_from_spec\nfrom phigen.geometry.checks import check\n"
        "from phigen.realisations.catalogue import realise\nimport dataclasses\n"
        "for name in ('toda3', 'rigid_body_dual', 'so4_manakov', 'lotka_volterra', 'gaussian_moments'):\n"
        "    spec = dataclasses.replace(load(bundled_specs() / (name + '.yaml')), casimirs={})\n"
        "    s = system_from_spec(spec)\n    r = realise(s)\n"
        "    print([str(e) for e in (*r.alpha, *r.beta, *r.displacement, *r.increment, *s.casimirs.values())])\n"
        "    print(*check(s), r.explanation)\n"
    )
    outputs = []
    for seed in ("0", "1", "2"):
        environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)}
        run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        outputs.append(run.stdout)
    assert outputs[0] == outputs[1] == outputs[2]
    assert len(outputs[0]) > 1000
