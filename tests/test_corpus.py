import json
from pathlib import Path

import pytest
from golden import calls
from support import NAMES, QUICK, described

from phigen import resources, spec

SPECS = sorted(resources.bundled_specs().glob("*.yaml"))
REFERENCES = json.loads(Path(__file__).with_name("references.json").read_text(encoding="utf-8"))["references"]


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_spec_is_documented_and_has_an_experiment(path):
    system = spec.load(path)
    assert system.name == path.stem
    assert system.title
    assert system.description
    assert system.references
    assert system.runs


@pytest.mark.parametrize("name", REFERENCES)
def test_reference_state_belongs_to_the_run_of_the_spec(name):
    system, expected = spec.load(resources.bundled_specs() / f"{name}.yaml"), REFERENCES[name]
    run = system.runs["reference"]
    assert run.step * run.steps == expected["time"]
    assert system.order == expected["order"]
    assert len(expected["state"]) == system.dimension


def traits(name):
    """Return the kind of the bi-realisation and the names of all functions that the generated C defines or calls."""
    return {described(name)[2].kind, *calls()[name]}


#: Functions that no system in `QUICK` calls. In the corpus only `guiding_centre` has powers along paths, and it takes
#: long; tests/paths/test_functions.py and tests/generated/test_compilers.py have smaller systems with powers.
ELSEWHERE = {"taylor_power"}


def test_quick_systems_have_every_trait_of_the_corpus():
    # The profile fast and attitudes add further functions, so only systems with the profile small and no attitude are
    # compared. tests/attitude has systems of every kind with an attitude.
    short = [name for name in NAMES if described(name)[0].profile == "small" and not described(name)[0].reconstruct]
    assert set().union(*map(traits, short)) - set().union(*map(traits, QUICK)) == ELSEWHERE
    assert {described(name)[2].kind for name in NAMES} == {described(name)[2].kind for name in QUICK}
