"""Files that exist where a command writes."""

import zipfile

import pytest

LATTICE = """phigen: 1
name: chain
lattice: {axes: [i]}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**2/2 + (q[i+1] - q)**2/2
runs: {r: {sizes: [8], initial: {q: sin(i), p: 0}, step: 0.1, steps: 5}}
"""
MINE = b"my thesis, chapter 1\n"


@pytest.fixture(params=["harmonic_oscillator", "chain"])
def spec(request, in_tmp):
    if request.param == "chain":
        (in_tmp / "chain.yaml").write_text(LATTICE)
        return "chain.yaml"
    return request.param


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
    assert f"replaced {file}" in phigen("run", spec, option, file).stderr  # now it is phigen's


def test_an_archive_of_others_is_no_table(phigen, in_tmp):
    with zipfile.ZipFile(in_tmp / "a.npz", "w") as archive:
        archive.writestr("weights.npy", "mine")
    assert phigen("run", "harmonic_oscillator", "-o", "a.npz").exit_code == 2


def test_a_continued_file_is_not_replaced(phigen, in_tmp):
    assert "wrote a.csv" in phigen("run", "harmonic_oscillator", "-o", "a.csv").stderr
    assert "wrote a.csv" in phigen("run", "harmonic_oscillator", "-o", "a.csv", "--extend", "--steps", 10).stderr


def test_pages_of_others_are_replaced_by_force_only(phigen, in_tmp):
    (in_tmp / "page.html").write_bytes(MINE)
    assert phigen("report", "pendulum", "--panel", "-o", "page.html").exit_code == 2
    assert "replaced page.html" in phigen("report", "pendulum", "--panel", "-o", "page.html", "--force").stderr
