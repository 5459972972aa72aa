"""``phigen vendor``: what is copied, what the manifest says, and what --check notices."""

import json
import shlex
import sys
from pathlib import Path

import pytest
from tools import run, tool
from tools import write as write_files

from phigen import resources
from phigen.cli import manifest

EXT = Path("project/ext")


def tree(folder=EXT):
    return {p.name: p.read_bytes() for p in sorted(Path(folder).iterdir())}


def solvers(folder=EXT):
    return json.loads((folder / manifest.FILE).read_text())["solvers"]


def edit(file, before, after):
    path = EXT / file
    path.write_text(path.read_text().replace(before, after, 1))


@pytest.fixture
def vendored(phigen, write):
    """Vendor the solvers of two specs into one folder, and return a function that runs ``phigen vendor --check`` on the
    folder.
    """
    assert phigen("vendor", write("models/a.yaml"), write("models/b.yaml"), EXT, "-t", "c").exit_code == 0

    def check(*specs):
        before = tree()
        result = phigen("vendor", "--check", *specs, EXT)
        assert tree() == before
        assert result.stdout == ""
        return result

    return check


def test_files_are_those_of_build_and_one_manifest_lists_them(phigen, vendored):
    phigen("build", "models", "-t", "c")
    assert sorted(tree()) == ["a.c", "a.h", "b.c", "b.h", manifest.FILE]
    for name, file in (("a", "a.c"), ("b", "b.h")):
        content = tree()[file]
        assert content == (Path("generated") / name / file).read_bytes()
        assert solvers()[name]["files"][file] == manifest.sha256(content)
    assert "2 solvers, 4 files: unmodified and current" in vendored().stderr
    assert "1 solver, 2 files" in vendored("models/b.yaml").stderr


def test_manifest_depends_on_specs_and_options_alone(phigen, write, monkeypatch):
    write("one/models/a.yaml")
    write("elsewhere/two/models/a.yaml")
    for place in ("one", "elsewhere/two"):
        phigen("vendor", f"{place}/models/a.yaml", f"{place}/project/ext", "--order", "4")
    first, second = (tree(f"{place}/project/ext") for place in ("one", "elsewhere/two"))
    assert first == second
    assert str(Path.cwd()).encode() not in first[manifest.FILE]


@pytest.mark.parametrize(
    "options", ["", " -t c --order 4 --profile small --without ensemble --single-file --tangent --modified 1"]
)
def test_command_of_the_manifest_makes_the_same_bytes(phigen, write, options, monkeypatch):
    phigen("vendor", *options.split(), write("models/a.yaml"), EXT)
    before = tree()
    command = solvers()["a"]["command"]
    assert command == f"phigen vendor ../../models/a.yaml .{options}"
    monkeypatch.chdir(EXT)
    for file in before:
        Path(file).unlink()
    assert phigen(*shlex.split(command)[1:]).exit_code == 0
    assert tree(".") == before


def test_path_through_the_home_of_somebody_is_not_recorded(phigen, write, monkeypatch):
    monkeypatch.setenv("HOME", str(Path.cwd()))
    assert phigen("vendor", write("models/a.yaml"), EXT).exit_code == 0
    assert "file" not in solvers()["a"]["spec"]
    (EXT / "a.h").unlink()
    assert phigen("vendor", EXT).exit_code == 0
    assert phigen("vendor", "--check", EXT).exit_code == 0
    Path("models/a.yaml").write_text(Path("models/a.yaml").read_text() + "# more\n")
    assert "a.h: stale: its spec has changed" in phigen("vendor", "--check", "models/a.yaml", EXT).stderr


def damage_body():
    edit("a.c", "return", "return ")


def damage_header():
    edit("a.h", "0BSD", "MIT")


def damage_missing():
    (EXT / "b.c").unlink()


def damage_extra():
    (EXT / "gone.c").write_bytes((EXT / "a.c").read_bytes())


def damage_spec():
    write_order("b", 4)


def damage_targets():
    spec = Path("models/a.yaml")
    spec.write_text(spec.read_text() + "tangent: true\n")


def damage_line_endings():
    path = EXT / "a.c"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))


def write_order(name, order):
    spec = Path(f"models/{name}.yaml")
    spec.write_text(spec.read_text().replace("order: 2", f"order: {order}"))


DAMAGES = {
    damage_body: ("a.c: edited by hand", "project/ext --force"),
    damage_header: ("a.h: edited by hand", "project/ext --force"),
    damage_missing: ("b.c: missing", "project/ext"),
    damage_extra: ("gone.c: extra", "rm project/ext/gone.c"),
    damage_spec: ("b.h: stale: its spec has changed", "project/ext"),
    damage_targets: ("a.c: stale: its spec has changed", "project/ext"),
    damage_line_endings: ("a.c: its line endings were changed", "project/ext --force"),
}


@pytest.mark.thin(3)
@pytest.mark.parametrize("damage", DAMAGES)
def test_check_names_the_file_what_is_wrong_and_the_command_that_mends(phigen, vendored, damage):
    what, remedy = DAMAGES[damage]
    damage()
    result = vendored()
    assert result.exit_code == 5
    assert what in result.stderr
    commands = [line.strip() for line in result.stderr.split("to mend it:\n")[1].splitlines()]
    assert [c.endswith(remedy) for c in commands] == [True]
    words = shlex.split(commands[0])
    if words[0] == "rm":
        Path(words[1]).unlink()
    else:
        assert phigen(*words[1:]).exit_code == 0
    assert vendored().exit_code == 0


def test_check_of_a_spec_mends_with_its_options_and_leaves_others_alone(phigen, vendored):
    write_order("a", 4)
    damage_missing()
    assert vendored("models/b.yaml").stderr.splitlines()[1:2] == ["  project/ext/b.c: missing"]
    result = vendored("models/a.yaml")
    assert "phigen vendor models/a.yaml project/ext -t c\n" in result.stderr
    assert "b.c" not in result.stderr


def test_another_version_makes_files_stale(phigen, write, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("phigen.scheme.program.__version__", "0.0.9")
        patch.setattr("phigen.cli.vendor.__version__", "0.0.9")
        phigen("vendor", write("a.yaml"), EXT)
    assert solvers()["a"]["phigen"] == "0.0.9"
    from phigen import __version__

    result = phigen("vendor", "--check", EXT)
    assert result.exit_code == 5
    assert f"a.c: stale: it was generated by phigen 0.0.9, but the installed version is {__version__}" in result.stderr
    assert phigen("vendor", EXT).exit_code == 0
    assert phigen("vendor", "--check", EXT).exit_code == 0


def test_without_its_spec_a_solver_is_checked_against_the_copy_with_a_message(phigen, vendored):
    Path("models").rename("moved")
    result = vendored()
    assert result.exit_code == 0
    assert "a: its spec (models/a.yaml) was not found, so its changes cannot be checked" in result.stderr
    assert "unmodified and current" not in result.stderr
    damage_body()
    assert vendored().exit_code == 5
    assert "from the copy of the spec in the manifest" in phigen("vendor", EXT, "--force").stderr
    assert vendored().exit_code == 0
    assert solvers()["a"]["spec"]["file"] == "../../models/a.yaml"


def test_edited_and_foreign_files_are_not_overwritten(phigen, vendored):
    damage_header()
    write_order("a", 4)
    (EXT / "b.py").write_text("mine = 1\n")
    before = tree()
    result = phigen("vendor", "models", EXT)
    assert result.exit_code == 5
    assert "a.h was edited by hand" in result.stderr
    assert "b.py was not generated by phigen" in result.stderr
    assert tree() == before
    assert phigen("vendor", "models", EXT, "--force").exit_code == 0
    assert vendored().exit_code == 0


def test_files_of_a_target_that_is_dropped_go_and_those_of_the_user_stay(phigen, write):
    phigen("vendor", write("a.yaml"), EXT)
    (EXT / "notes.py").write_text("x = 1\n")
    result = phigen("vendor", "a.yaml", EXT, "-t", "c", "--single-file")
    assert "removed a.h, a.py" in result.stderr
    assert sorted(tree()) == ["a.c", "notes.py", manifest.FILE]
    assert phigen("vendor", "--check", EXT).exit_code == 0


def test_second_time_leaves_files_alone(phigen, vendored):
    before = [p.stat().st_mtime_ns for p in EXT.iterdir()]
    assert "a unchanged" in phigen("vendor", EXT).stderr
    assert "need a SPEC" in phigen("vendor", EXT, "--order", "4").stderr
    assert [p.stat().st_mtime_ns for p in EXT.iterdir()] == before


@pytest.mark.thin(1)
@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('"manifest": 1', '"manifest": 2', "format 1"),
        ('"manifest"', '"manifest', "not JSON"),
        ('"a.c"', '"../a.c"', "'../a.c' is not a file of that solver"),
        ('"order: 2"', '"order: 4"', "the text of its spec was changed"),
        ('"options"', '"choices"', "'options' is missing"),
        ('"targets"', '"directory"', "'directory' is not an option"),
        ('"targets"', '"order": 99, "targets"', "the option 'order' cannot be 99"),
    ],
)
def test_damaged_manifest_is_refused(phigen, vendored, before, after, message):
    edit(manifest.FILE, before, after)
    for result in (phigen("vendor", EXT), phigen("vendor", "--check", EXT)):
        assert result.exit_code == 5
        assert message in result.stderr
        assert "hint: restore phigen-vendor.json from version control" in result.stderr


def test_bundled_spec_is_vendored_by_its_name_and_followed_by_it(phigen, in_tmp, monkeypatch):
    assert phigen("vendor", "cyclotron", EXT, "-t", "c").exit_code == 0
    assert solvers()["cyclotron"]["command"] == "phigen vendor cyclotron . -t c"
    assert solvers()["cyclotron"]["spec"]["file"] == "cyclotron"
    changed = Path("cyclotron.yaml")
    changed.write_text(resources.bundled()["cyclotron"].read_text().replace("step: 0.05", "step: 0.06"))
    monkeypatch.setattr(resources, "bundled", lambda: {"cyclotron": changed.absolute()})
    result = phigen("vendor", "--check", EXT)
    assert result.exit_code == 5
    assert "stale: its spec has changed" in result.stderr


def test_spec_file_that_became_another_system_is_noticed(phigen, vendored):
    Path("models/b.yaml").replace("models/a.yaml")
    result = vendored()
    assert result.exit_code == 5
    assert "models/a.yaml now defines b, but a in project/ext was generated from this file" in result.stderr


def test_wrong_usage_is_explained(phigen, write):
    write("a.yaml")
    write("b.yaml")
    for words, message in (
        (["a.yaml"], "phigen vendor a.yaml DEST"),
        (["a.yaml", "b.yaml"], "phigen vendor a.yaml b.yaml DEST"),
        (["a.yaml", "new.yaml"], "new.yaml is not a folder"),
        (["nothing"], "to put one there: phigen vendor SPEC nothing"),
    ):
        result = phigen("vendor", *words)
        assert result.exit_code == 2
        assert message in result.stderr
    assert phigen("vendor", "--check", "nothing").exit_code == 5
    assert phigen("vendor", "a.yaml", "c.yaml", "ext").exit_code == 1
    assert not Path("ext").exists()


@pytest.mark.slow
def test_build_files_are_kept_up_with_the_solvers(phigen, vendored, write):
    phigen("vendor", EXT, "--cmake", "--meson")
    assert solvers().keys() == {"a", "b"}
    assert "unmodified and current" in vendored().stderr
    phigen("vendor", write("models/c.yaml"), EXT, "-t", "c")
    assert "add_library(phigen_c STATIC c.c)" in (EXT / "CMakeLists.txt").read_text()
    assert "c_dep = declare_dependency" in (EXT / "meson.build").read_text()
    edit("CMakeLists.txt", "STATIC", "SHARED")
    result = vendored()
    assert result.exit_code == 5
    assert f"{EXT / 'CMakeLists.txt'}: edited by hand" in result.stderr
    assert phigen("vendor", EXT).exit_code == 5
    assert phigen("vendor", EXT, "--force").exit_code == 0
    assert "unmodified and current" in vendored().stderr
    (EXT / "meson.build").unlink()
    assert f"{EXT / 'meson.build'}: missing" in vendored().stderr


def test_a_package_needs_modules(phigen, vendored):
    result = phigen("vendor", EXT, "--python")
    assert result.exit_code == 2
    assert "-t numpy" in result.stderr


MAIN = """#include "a.h"
#include "b.h"
int main(void)
{
    a_solver s;
    const double x[a_DIM] = {1.0, 0.5};
    return a_init(&s, NULL, x) != a_OK || a_integrate(&s, 0.1, 100) != a_OK || b_solver_size() == 0;
}
"""

PROJECTS = {
    "cmake": {
        "CMakeLists.txt": "cmake_minimum_required(VERSION 3.13)\nproject(mine C)\nadd_subdirectory(ext)\n"
        "add_executable(main main.c)\ntarget_link_libraries(main phigen::a phigen::b)\n",
    },
    "meson": {
        "meson.build": "project('mine', 'c')\nsubdir('ext')\n"
        "executable('main', 'main.c', dependencies: [a_dep, b_dep])\n",
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("system", PROJECTS)
def test_foreign_projects_build(system, phigen, vendored):
    phigen("vendor", EXT, f"--{system}")
    project = EXT.parent.resolve()
    write_files(project, {"main.c": MAIN, **PROJECTS[system]})
    if system == "cmake":
        run([tool("cmake"), "-S", ".", "-B", "build"], project)
        run([tool("cmake"), "--build", "build"], project)
    else:
        pytest.importorskip("mesonbuild")
        tool("ninja")
        run([sys.executable, "-m", "mesonbuild.mesonmain", "setup", "build"], project)
        run([sys.executable, "-m", "mesonbuild.mesonmain", "compile", "-C", "build"], project)
    run([project / "build" / "main"], project)


def test_a_package_is_imported(phigen, write):
    phigen("vendor", write("a.yaml"), write("b.yaml"), "solvers", "-t", "numpy", "--python")
    script = "import solvers; print(solvers.a.integrate([1.0, 0.5], 0.1, 10).shape, solvers.__all__)"
    assert run([sys.executable, "-c", script], Path.cwd()).startswith("(")
    assert phigen("vendor", "--check", "solvers").exit_code == 0
