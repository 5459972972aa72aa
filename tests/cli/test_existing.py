"""Existing files at the place of an output: without --force, a command replaces only its own earlier results."""

import zipfile

import pytest

LATTICE = """phigen: 1
name: chain
lattice: {axes: [i]}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**2/2 + (q[i+1] - q)**2/2
observables: {M: {mean: q}}
runs:
  r: {sizes: [8], initial: {q: sin(i), p: 0}, step: 0.1, steps: 5}
  s: {sizes: [8], initial: {q: 1, p: 0}, step: 0.1, steps: 5, record: [M], stop: M - 2}
"""
MINE = b"my thesis, chapter 1\n"
FILES = ("a.csv", "a.npz", "a.zarr", "a.svg", "a.pdf", "a.gif")


OSCILLATOR = """phigen: 1
name: swing
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**2/2
runs:
  r: {initial: [1, 0], step: 0.1, steps: 5, section: p}
  s: {initial: [1, 0], step: 0.1, steps: 5, section: q}
"""


@pytest.fixture(params=["swing", "chain"])
def spec(request, write):
    return write("spec.yaml", {"swing": OSCILLATOR, "chain": LATTICE}[request.param])


@pytest.mark.thin(4, of_all=1)
@pytest.mark.few("a.csv", "a.svg", of=FILES)
@pytest.mark.parametrize(
    ("option", "file"), [("-o", "a.csv"), ("-o", "a.npz"), ("--plot", "a.svg"), ("--plot", "a.pdf")]
)
def test_a_file_of_others_is_replaced_by_force_only(phigen, in_tmp, spec, option, file):
    path = in_tmp / file
    path.write_bytes(MINE)
    refused = phigen("run", spec, option, file)
    assert refused.exit_code == 2
    assert "--force" in refused.stderr
    assert path.read_bytes() == MINE
    assert f"replaced {file}" in phigen("run", spec, option, file, "--force").stderr
    assert path.read_bytes() != MINE
    assert f"replaced {file}" in phigen("run", spec, option, file).stderr  # the file is now a result of the same run


def test_an_archive_of_others_is_no_table(phigen, in_tmp):
    with zipfile.ZipFile(in_tmp / "a.npz", "w") as archive:
        archive.writestr("weights.npy", "mine")
    assert phigen("run", "harmonic_oscillator", "-o", "a.npz").exit_code == 2


@pytest.mark.slow
def test_a_continued_file_is_not_replaced(phigen, in_tmp):
    assert "wrote a.csv" in phigen("run", "harmonic_oscillator", "-o", "a.csv").stderr
    assert "wrote a.csv" in phigen("run", "harmonic_oscillator", "-o", "a.csv", "--extend", "--steps", 10).stderr


def test_pages_of_others_are_replaced_by_force_only(phigen, in_tmp):
    (in_tmp / "page.html").write_bytes(MINE)
    assert phigen("report", "pendulum", "--panel", "-o", "page.html").exit_code == 2
    assert "replaced page.html" in phigen("report", "pendulum", "--panel", "-o", "page.html", "--force").stderr
    assert "replaced page.html" in phigen("report", "pendulum", "--panel", "-o", "page.html").stderr
    refused = phigen("report", "harmonic_oscillator", "--panel", "-o", "page.html")
    assert refused.exit_code == 2
    assert "'page.html' holds the run libration of pendulum, not the run swing" in refused.stderr
    assert "a result of phigen panel, not of phigen report" in phigen("report", "pendulum", "-o", "page.html").stderr


@pytest.mark.parametrize("command", ["compare", "tune", "verify", "sweep"])
def test_figures_of_other_commands_are_replaced_by_force_only(phigen, write, in_tmp, command):
    spec = write("spec.yaml", f"{OSCILLATOR}sweeps: {{r: {{over: {{q: [1, 2]}}}}}}\n")
    drawn = f"<svg><!-- phigen origin: swing r {16 * '0'} --></svg>".encode()
    (in_tmp / "a.svg").write_bytes(drawn)
    refused = phigen(command, spec, "--plot", "a.svg")
    assert refused.exit_code == 2
    assert f"'a.svg' holds a result of phigen run, not of phigen {command}; --force replaces it" in refused.stderr
    assert (in_tmp / "a.svg").read_bytes() == drawn


@pytest.mark.thin(3, of_all=1)
@pytest.mark.few("a.csv", "a.npz", "a.pdf", "a.zarr", of=FILES)
@pytest.mark.parametrize(
    ("text", "option", "file"),
    [(OSCILLATOR, "-o", "a.csv"), (OSCILLATOR, "--section", "a.npz"), (OSCILLATOR, "--plot", "a.pdf"),
     (LATTICE, "-o", "a.csv"), (LATTICE, "-o", "a.npz"), (LATTICE, "-o", "a.zarr"), (LATTICE, "--plot", "a.gif"),
     (LATTICE, "--plot", "a.svg")],
)  # fmt: skip
def test_files_of_another_run_or_spec_are_replaced_by_force_only(phigen, write, text, option, file):
    spec = write("spec.yaml", text)
    other = write("other.yaml", text.replace("q**2/2", "q**2"))
    assert phigen("run", spec, option, file).exit_code == 0
    assert phigen("run", spec, option, file, "--steps", 7).exit_code == 0
    for arguments, words in (((spec, "--run", "s"), "not the run s"), ((other,), "another spec")):
        refused = phigen("run", *arguments, option, file)
        assert refused.exit_code == 2
        assert "holds the run r of" in refused.stderr
        assert words in refused.stderr
        assert "--force" in refused.stderr
    assert phigen("run", other, option, file, "--force").exit_code == 0
    assert phigen("run", other, option, file).exit_code == 0


def test_a_table_without_its_companion_or_of_other_columns_is_not_known(phigen, write, in_tmp):
    spec = write("spec.yaml", OSCILLATOR)
    phigen("run", spec, "-o", "a.csv")
    table = (in_tmp / "a.csv").read_text()
    # Programs that read the table expect the names of the columns in its first line.
    assert table.startswith("t,q,p,energy\n")
    (in_tmp / "a.csv").write_text("t,temperature\n0,21.5\n")
    assert phigen("run", spec, "-o", "a.csv").exit_code == 2
    (in_tmp / "a.csv").write_text(table)
    assert phigen("run", spec, "-o", "a.csv").exit_code == 0
    (in_tmp / "a.csv-metadata.json").unlink()
    assert "does not say which run" in phigen("run", spec, "-o", "a.csv").stderr


def test_the_file_of_another_run_is_not_continued(phigen, write, in_tmp):
    spec = write("spec.yaml", OSCILLATOR)
    phigen("run", spec, "-o", "a.csv")
    before = (in_tmp / "a.csv").read_text()
    assert phigen("run", spec, "--run", "s", "-o", "a.csv", "--extend", "--steps", 5, "--force").exit_code == 2
    assert (in_tmp / "a.csv").read_text() == before


def test_rows_and_crossings_do_not_go_to_the_same_file(phigen, write, in_tmp):
    refused = phigen("run", write("spec.yaml", OSCILLATOR), "-o", "a.csv", "--section", "a.csv")
    assert refused.exit_code == 2
    assert "the same file" in refused.stderr
    assert not (in_tmp / "a.csv").exists()
