"""``phigen build``: what is written, what is refused, and what --check notices."""

import ctypes
import shlex
from itertools import product
from pathlib import Path

import pytest
from cli_specs import NOT_POISSON
from support import slow_but

FILES = ["a.c", "a.h", "a.py"]


def tree(folder="generated"):
    return {str(p): p.read_bytes() for p in sorted(Path(folder).rglob("*")) if p.is_file()}


def mending_commands(message):
    return [line.strip() for line in message.split("to mend it:\n")[1].splitlines()]


def run_line(phigen, line):
    words = shlex.split(line)
    if words[0] == "rm":
        for path in words[1:]:
            Path(path).unlink()
        return
    assert phigen(*words[1:]).exit_code == 0


def test_build_writes_each_solver_to_its_own_folder(phigen, write):
    write("specs/a.yaml")
    write("specs/deeper/b.yml")
    write("specs/.hidden/c.yaml")
    write("specs/notes.txt", "no spec")
    assert phigen("build", "specs").exit_code == 0
    assert sorted(p.name for p in Path("generated/a").iterdir()) == FILES
    assert sorted(p.name for p in Path("generated").iterdir()) == ["a", "b"]


def test_second_build_leaves_files_alone(phigen, write):
    write("a.yaml")
    phigen("build", "a.yaml")
    before = [p.stat().st_mtime_ns for p in Path("generated/a").iterdir()]
    assert "unchanged" in phigen("build", "a.yaml").stderr
    assert [p.stat().st_mtime_ns for p in Path("generated/a").iterdir()] == before


@pytest.mark.thin(2)
@pytest.mark.parametrize("options", [[], ["--order", "4"], ["-t", "c"], ["--single-file"], ["-o", "out put"]])
def test_check_accepts_what_build_wrote(phigen, write, options):
    write("specs/a.yaml")
    assert phigen("build", "specs", *options).exit_code == 0
    before = tree(".")
    assert phigen("build", "specs", *options, "--check").exit_code == 0
    assert tree(".") == before


def test_listed_specs_are_left_out_of_folders(phigen, write):
    write("specs/a.yaml")
    write("specs/b.yaml")
    write("generated/left_out.txt", "# not committed\n\nb  # too long\n")
    result = phigen("build", "specs")
    assert "1 spec left out by generated/left_out.txt" in result.stderr
    assert sorted(p.name for p in Path("generated").iterdir()) == ["a", "left_out.txt"]
    assert phigen("build", "specs", "--check").exit_code == 0
    assert phigen("build", "specs/b.yaml").exit_code == 0, "a spec that the command names is built"
    assert Path("generated/b/b.c").exists()
    forgotten = phigen("build", "specs", "--check")
    assert forgotten.exit_code == 5
    assert "generated/b/b.c: no spec of this build produces it" in forgotten.stderr


def test_the_list_of_left_out_specs_is_read_strictly(phigen, write):
    write("specs/a.yaml")
    write("generated/left_out.txt", "a\n  b c\na\n")
    result = phigen("build", "specs")
    assert result.exit_code == 1
    assert "generated/left_out.txt:2:3: error: 'b c' is not the name of a spec" in result.stderr
    assert "generated/left_out.txt:3:1: error: a is in line 1 already" in result.stderr
    write("generated/left_out.txt", "gone\n")
    assert phigen("build", "specs").exit_code == 0
    gone = phigen("build", "specs", "--check")
    assert gone.exit_code == 5
    assert "generated/left_out.txt:1:1: no spec has the name gone" in gone.stderr


def edited(text):
    return text.replace("{", "{ ", 1)


def damage_edit():
    path = Path("generated/a/a.c")
    path.write_text(path.read_text().replace("return", "return ", 1))


def damage_header():
    path = Path("generated/a/a.h")
    path.write_text(path.read_text().replace("0BSD", "MIT", 1))


def damage_missing():
    Path("generated/a/a.py").unlink()


def damage_orphan():
    other = Path("generated/gone")
    other.mkdir()
    (other / "gone.py").write_text(Path("generated/a/a.py").read_text())


def damage_stale():
    spec = Path("specs/a.yaml")
    spec.write_text(spec.read_text() + "targets: [c]\n")


def damage_spec():
    spec = Path("specs/a.yaml")
    spec.write_text(spec.read_text().replace("order: 2", "order: 4"))


DAMAGES = [damage_edit, damage_header, damage_missing, damage_orphan, damage_stale, damage_spec]
QUICK = [*product(["generated"], DAMAGES), ("else where", damage_edit), ("else where", damage_orphan)]


@pytest.mark.thin(2)
@pytest.mark.parametrize(("folder", "damage"), slow_but(QUICK, product(["generated", "else where"], DAMAGES)))
def test_check_notices_and_names_the_command_that_mends(phigen, write, damage, folder, monkeypatch):
    write("specs/a.yaml")
    options = [] if folder == "generated" else ["-o", folder]
    phigen("build", "specs", *options)
    if options:
        Path("generated").symlink_to(folder)
    damage()
    before = tree(".")
    result = phigen("build", "specs", *options, "--check")
    assert result.exit_code == 5
    assert result.stdout == ""
    assert tree(".") == before
    for line in mending_commands(result.stderr):
        run_line(phigen, line)
    assert phigen("build", "specs", *options, "--check").exit_code == 0


def test_diff_prints_and_writes_nothing(phigen, write):
    write("a.yaml")
    phigen("build", "a.yaml")
    damage_edit()
    before = tree(".")
    result = phigen("build", "a.yaml", "--diff")
    assert result.exit_code == 5
    assert result.stdout.startswith("--- generated/a/a.c\n+++ generated/a/a.c\n@@")
    assert tree(".") == before


def test_hand_edited_file_is_not_overwritten(phigen, write):
    write("a.yaml")
    write("b.yaml")
    phigen("build", "a.yaml")
    damage_edit()
    before = tree()
    result = phigen("build", "b.yaml", "a.yaml")
    assert result.exit_code == 5
    assert "generated/a/a.c was edited by hand" in result.stderr
    assert tree() == before
    assert phigen("build", "a.yaml", "--force").exit_code == 0
    assert phigen("build", "a.yaml", "--check").exit_code == 0


def test_foreign_file_is_not_overwritten(phigen, write):
    write("a.yaml")
    write("generated/a/a.c", "int mine;\n")
    result = phigen("build", "a.yaml")
    assert result.exit_code == 5
    assert "was not generated by phigen" in result.stderr
    assert Path("generated/a/a.c").read_text() == "int mine;\n"


def test_other_files_of_the_user_stay(phigen, write):
    write("a.yaml")
    write("generated/a/main.c", "int main(void) { return 0; }\n")
    write("generated/a/notes.py", "x = 1\n")
    phigen("build", "a.yaml", "--force")
    assert phigen("build", ".", "--check").exit_code == 0
    assert Path("generated/a/main.c").exists()
    assert Path("generated/a/notes.py").exists()


def test_nothing_is_written_if_any_spec_is_wrong(phigen, write):
    write("a.yaml")
    write("b.yaml", NOT_POISSON)
    write("c.yaml", "phigen: 1\n")
    result = phigen("build", "a.yaml", "b.yaml", "c.yaml")
    assert result.exit_code == 1
    assert "Jacobi identity: refuted" in result.stderr
    assert "c.yaml" in result.stderr
    assert not Path("generated").exists()


def test_what_is_refuted_is_not_built(phigen, write):
    path = write("a.yaml")
    path.write_text(path.read_text() + "invariants: {F: q}\n")
    result = phigen("build", path)
    assert result.exit_code == 5
    assert "a.yaml:15:17: error: F is invariant: refuted" in result.stderr


def test_refuted_birealisation_is_located_at_itself(phigen, write):
    path = write("a.yaml")
    half = "  alpha: [q - p_p/3, p + p_q/3]\n  beta: [q + p_p/3, p - p_q/3]\n"
    path.write_text(path.read_text() + f"birealisation:\n  kind: custom\n{half}")
    result = phigen("build", path)
    assert result.exit_code == 5
    assert "a.yaml:15:1: error: {α_i, α_j} = π_ij∘α: refuted" in result.stderr


def test_two_specs_of_one_name_are_an_error(phigen, write):
    write("specs/a.yaml")
    write("specs/b.yaml", name="a")
    result = phigen("build", "specs")
    assert result.exit_code == 1
    assert "specs/b.yaml:2:7: error: the name 'a' is taken by specs/a.yaml" in result.stderr


def test_same_spec_twice_is_one_spec(phigen, write):
    write("specs/a.yaml")
    assert phigen("build", "specs", "specs/a.yaml").exit_code == 0


def test_folder_without_specs_is_an_error(phigen, in_tmp):
    Path("empty").mkdir()
    assert phigen("build", "empty").exit_code == 1


def test_build_does_not_follow_a_link_out_of_its_folder(phigen, write):
    write("a.yaml")
    Path("elsewhere").mkdir()
    Path("generated").mkdir()
    Path("generated/a").symlink_to("../elsewhere")
    assert phigen("build", "a.yaml").exit_code == 5
    assert not list(Path("elsewhere").iterdir())


def test_single_file_replaces_the_header(phigen, write):
    write("a.yaml")
    phigen("build", "a.yaml")
    result = phigen("build", "a.yaml", "--single-file")
    assert "removed a.h" in result.stderr
    assert not Path("generated/a/a.h").exists()
    assert '#include "a.h"' not in Path("generated/a/a.c").read_text()


def regenerate_line(path):
    (line,) = [line for line in Path(path).read_text().splitlines() if "to regenerate:" in line]
    return line.split("to regenerate: ")[1]


@pytest.mark.parametrize(
    ("options", "file", "line"),
    [
        ([], "a.c", "phigen build a.yaml"),
        (["--order", "4", "-o", "x/y"], "a.c", "phigen build a.yaml --order 4"),
        (["--order", "2"], "a.py", "phigen build a.yaml"),  # 2 is the order of the spec, so the line omits it
        (["--profile", "small"], "a.c", "phigen build a.yaml --profile small"),
        (["--profile", "fast"], "a.c", "phigen build a.yaml"),
        (["--profile", "small"], "a.py", "phigen build a.yaml --profile small"),
        (["--without", "ensemble"], "a.c", "phigen build a.yaml --without ensemble"),
        (["--single-file"], "a.c", "phigen build a.yaml --single-file"),
        (["--single-file"], "a.py", "phigen build a.yaml"),
        (["-t", "c"], "a.c", "phigen build a.yaml"),
    ],
)
def test_header_names_the_command_without_places(phigen, write, options, file, line):
    phigen("build", write("deep/down/a.yaml"), *options)
    (path,) = Path().rglob(file)
    assert regenerate_line(path) == line


def test_target_that_the_spec_does_not_name_is_in_the_command(phigen, write):
    path = write("a.yaml")
    path.write_text(path.read_text() + "targets: [c]\n")
    phigen("build", path, "-t", "numpy")
    assert [p.name for p in Path("generated/a").iterdir()] == ["a.py"]
    assert regenerate_line("generated/a/a.py") == "phigen build a.yaml -t numpy"


def test_compile_makes_a_library_that_loads(phigen, write):
    result = phigen("build", write("a.yaml"), "--compile")
    assert result.exit_code == 0, result.stderr
    library = Path("generated/a/liba.so")
    assert str(library) in result.stderr
    assert ctypes.CDLL(str(library.resolve())).a_solver_size() > 0
    assert phigen("build", "a.yaml", "--check").exit_code == 0
    assert "older than its sources" in phigen("build", "a.yaml", "--order", "4").stderr


def test_quiet_says_nothing_and_verbose_times_the_stages(phigen, write):
    assert phigen("build", write("a.yaml"), "-q").stderr == ""
    said = phigen("build", "a.yaml", "-v").stderr
    for stage in ("system", "bi-realisation", "program", "proofs", "emitting"):
        assert stage in said


def test_no_temporary_files_are_left(phigen, write, monkeypatch):
    write("a.yaml")
    phigen("build", "a.yaml")
    assert sorted(p.name for p in Path("generated/a").iterdir()) == FILES
    monkeypatch.setattr(Path, "replace", lambda *args: (_ for _ in ()).throw(OSError(28, "No space left", "a.c")))
    before = tree()
    assert phigen("build", "a.yaml", "--order", "4").exit_code == 2
    assert tree() == before
