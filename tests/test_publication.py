"""Published files state the same version, and the dependencies of the package."""

import json
import re
import tomllib
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from phigen._version import __version__

ROOT = Path(__file__).parents[1]


def text(file):
    return (ROOT / file).read_text(encoding="utf-8")


def recipe():
    """Return the conda recipe as a mapping."""
    return YAML(typ="safe").load(text("packaging/conda/recipe.yaml"))


def test_all_files_state_the_same_version():
    assert YAML(typ="safe").load(text("CITATION.cff"))["version"] == __version__
    assert json.loads(text(".zenodo.json"))["version"] == __version__
    assert recipe()["context"]["version"] == __version__


def test_conda_recipe_has_the_dependencies_of_the_package():
    project = tomllib.loads(text("pyproject.toml"))
    needs = {d.replace(">=", " >=") for d in project["project"]["dependencies"]}
    assert set(recipe()["requirements"]["run"]) == needs | {"python " + project["project"]["requires-python"]}


def test_conda_recipe_agrees_with_the_package():
    project, about = tomllib.loads(text("pyproject.toml")), recipe()
    (command,) = project["project"]["scripts"].items()
    assert about["build"]["python"]["entry_points"] == [" = ".join(command)]
    assert about["about"]["license"] == project["project"]["license"]
    host = [d.replace(" ", "") for d in about["requirements"]["host"]]
    assert set(project["build-system"]["requires"]) <= set(host)
    assert (ROOT / "packaging/conda" / about["source"]["path"] / about["about"]["license_file"]).samefile(
        ROOT / "LICENSE"
    )


def test_conda_recipe_is_rendered():
    """rattler-build renders the recipe; it reports unknown keys, invalid requirements and undefined variables as
    errors.
    """
    rattler_build = pytest.importorskip("rattler_build", reason="the recipe needs py-rattler-build of PyPI")
    recipe = text("packaging/conda/recipe.yaml")
    (variant,) = rattler_build.Stage0Recipe.from_yaml(recipe).render()
    rendered = variant.recipe.to_dict()
    assert rendered["package"] == {"name": "phigen", "version": __version__}
    assert rendered["build"]["noarch"] == "python"
    assert len(rendered["tests"]) == 2
    mistakes = [
        ("requirements:", "requirement:"),
        ("click >=8.1", "click >=8.1 &"),
        ("${{ version }}", "${{ versio }}"),
    ]
    for mistake in mistakes:
        with pytest.raises(rattler_build.RattlerBuildError):
            rattler_build.Stage0Recipe.from_yaml(recipe.replace(*mistake)).render()


def test_paper_cites_what_its_bibliography_has():
    cited = set(re.findall(r"@(\w+)", text("paper.md").split("---", 2)[2]))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", text("paper.bib"), re.MULTILINE))
