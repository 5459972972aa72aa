"""Certificates of ``phigen build --certify``: they name the checksums of the verified files, and ``--check`` reports a
certificate of another spec or other files.
"""

import json

import pytest
from click.testing import CliRunner
from support import BODY

from phigen.cli import group
from phigen.study import verification

TEXT = f"phigen: 1\nname: t\n{BODY}order: 4\nruns: {{a: {{initial: [0.4, 1, 0.3], step: 0.1, steps: 200}}}}\n"


def run(*words):
    return CliRunner().invoke(group, [str(w) for w in words])


@pytest.fixture
def place(tmp_path):
    (tmp_path / "t.yaml").write_text(TEXT, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_certificate_is_tied_to_spec_and_files(place):
    result = run("build", place / "t.yaml", "-o", place / "out", "--certify")
    assert result.exit_code == 0, result.output
    path = place / "out" / "t" / "t.certificate.json"
    text = path.read_text(encoding="utf-8")
    data = json.loads(text)
    assert data["verification"]["passed"] is True
    for file, checksum in data["files"].items():
        assert checksum in (place / "out" / "t" / file).read_text(encoding="utf-8")
    assert str(place) not in text
    assert run("build", place / "t.yaml", "-o", place / "out", "--check").exit_code == 0
    changed = TEXT.replace("x3**2/6", "x3**2/7")
    (place / "t.yaml").write_text(changed, encoding="utf-8")
    assert run("build", place / "t.yaml", "-o", place / "out").exit_code == 0
    stale = run("build", place / "t.yaml", "-o", place / "out", "--check")
    assert stale.exit_code == 5
    assert "certifies other files" in stale.stderr
    assert run("build", place / "t.yaml", "-o", place / "out", "--certify").exit_code == 0
    assert run("build", place / "t.yaml", "-o", place / "out", "--check").exit_code == 0


CHAIN = """phigen: 1
name: chain
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: "p**2/2 + (q[i+1] - q)**2/2 + q**4/4"
targets: [numpy]
runs: {a: {sizes: [8], initial: {q: i/8, p: 0}, step: 0.1, steps: 100}}
"""


def test_lattices_are_certified_with_their_poisson_identity(tmp_path):
    (tmp_path / "chain.yaml").write_text(CHAIN, encoding="utf-8")
    result = run("build", tmp_path / "chain.yaml", "-o", tmp_path, "--certify")
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "chain" / "chain.certificate.json").read_text(encoding="utf-8"))
    checks = {c["name"]: c for c in data["verification"]["checks"]}
    assert checks["Poisson identity on 3 sites"]["passed"]


@pytest.mark.slow
def test_what_falls_short_gets_none(place, monkeypatch):
    assert run("build", place / "t.yaml", "-o", place / "out", "--certify").exit_code == 0
    monkeypatch.setattr(verification, "DIFFERENCES", 0.0)
    result = run("build", place / "t.yaml", "-o", place / "out", "--certify")
    assert result.exit_code == 5
    assert "verification failed" in result.stderr
    assert not (place / "out" / "t" / "t.certificate.json").exists()


def test_show_lists_corrections(place):
    result = run("show", place / "t.yaml", "--modified", "2")
    assert result.exit_code == 0, result.output
    assert "H̃" in result.output
    assert "H_6" in result.output
