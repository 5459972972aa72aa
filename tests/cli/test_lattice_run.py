"""Runs of lattices on the command line: output, sizes, figures, pages, verification, and the continuation of runs."""

from __future__ import annotations

import json

import numpy as np
import pytest
from html_check import Page

CHAIN = """phigen: 1
name: chain
lattice: {axes: [i], boundary: open}
coordinates: [q, p]
parameters: {a: 0.25, m: {value: 1, at: sites, positive: true}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: "p**2/(2*m) + (q[i+1] - q)**2/2 + a*(q[i+1] - q)**4/4"
invariants: {P: p}
runs:
  wave: {sizes: [12], initial: {q: sin(pi*i/N_i), p: 0}, step: 0.05, steps: 40, stride: 10}
"""


@pytest.fixture
def chain(tmp_path):
    path = tmp_path / "chain.yaml"
    path.write_text(CHAIN, encoding="utf-8")
    return path


def test_a_run_keeps_what_it_should(phigen, chain, tmp_path):
    out = tmp_path / "wave.npz"
    document = json.loads(phigen("run", chain, "-t", "numpy", "--json", "-o", out, "--set", "a=0.5").stdout)
    assert document["sizes"] == [12]
    assert 0 < document["errors"]["energy"] < 1e-6
    assert document["errors"]["P"] < 1e-14
    with np.load(out) as stored:
        assert stored["x"].shape == (5, 2, 12)
        assert stored["parameter_a"] == 0.5
    assert [p.name for p in tmp_path.iterdir() if "chain" not in p.name] == ["wave.npz"]


def ring(offsets, size):
    """Return the text of a spec: a ring of ``size`` sites whose bracket couples sites at the distances ``offsets``."""
    brackets = ", ".join(f'"a[i+{k}]": "a*a[i+{k}]"' for k in offsets)
    return (
        f"phigen: 1\nname: ring\nlattice: {{axes: [i]}}\ncoordinates: [a]\nhamiltonian: a\n"
        f"poisson: {{brackets: {{a: {{{brackets}}}}}}}\n"
        f"runs: {{r: {{sizes: [{size}], initial: {{a: 1}}, step: 0.1, steps: 1}}}}\n"
    )


@pytest.mark.slow
def test_what_names_the_series_says_which_sizes_would_split(phigen, tmp_path):
    spec = tmp_path / "ring.yaml"
    spec.write_text(ring([1, 2, 4], 5), encoding="utf-8")
    # The message does not propose 3 sites, a smaller multiple of 3, because the stencil reaches 4 sites.
    said = ": the series, since 5 along i is not a multiple of 3, as a splitting with 3 colours needs; 6 would do\n"
    assert f"Bi-realisation (constant in logarithms){said}" in phigen("check", spec).stdout
    assert f"order 4, profile fast, target numpy, 1 thread{said}" in phigen("run", spec, "-t", "numpy").stdout
    assert "since" not in phigen("run", spec, "-t", "numpy", "--sizes", "6").stdout
    why = {"scheme": "series", "colours": 1, "since": said.removeprefix(": the series, since ").strip()}
    (checked,) = json.loads(phigen("check", spec, "--json").stdout)
    assert why.items() <= checked.items()
    assert why.items() <= json.loads(phigen("run", spec, "-t", "numpy", "--json").stdout).items()
    split = json.loads(phigen("run", spec, "-t", "numpy", "--sizes", "6", "--json").stdout)
    assert {"scheme": "splitting", "colours": 3, "since": None}.items() <= split.items()


def test_what_names_a_splitting_says_which_sizes_would_take_fewer_colours_or_no_seam(phigen, tmp_path):
    spec = tmp_path / "ring.yaml"
    spec.write_text(ring([1], 9), encoding="utf-8")
    said = "Splitting: 2 colours and a seam, since 9 along i is not a multiple of 2; 8 would need no seam\n"
    assert said in phigen("check", spec).stdout
    periodic = ring([1], 9).replace("axes: [i]", "axes: [i, j], boundary: [periodic, open]").replace("[9]", "[9, 2]")
    spec.write_text(periodic, encoding="utf-8")
    said = (
        "Splitting: 3 colours, since 9 along i is not a multiple of 2, as a splitting with 2 colours needs; 8 would do"
    )
    assert said in phigen("check", spec).stdout


@pytest.mark.slow
def test_a_run_is_drawn_over_space_and_time(phigen, chain, tmp_path):
    pytest.importorskip("matplotlib")
    result = phigen("run", chain, "-t", "numpy", "--lyapunov", "--plot", tmp_path / "wave.svg")
    assert result.exit_code == 0
    assert "largest error" in result.stdout
    assert "largest Lyapunov exponent after t = 2: 0." in result.stdout
    assert "<svg" in (tmp_path / "wave.svg").read_text(encoding="utf-8")


def test_what_a_lattice_promises_is_measured(phigen, chain):
    chain.write_text(CHAIN.replace("runs:", "targets: [numpy]\nruns:"), encoding="utf-8")
    (record,) = json.loads(phigen("verify", chain, "--json", "--quick").stdout)
    checks = {check["name"]: check["value"] for check in record["checks"]}
    assert record["passed"]
    assert checks["observed order"] == pytest.approx(4, abs=0.1)
    assert checks["Poisson identity on 3 sites"] < 1e-14
    assert checks["tangent map against differences on 3 sites"] < 1e-10
    assert checks["reversibility"] < 1e-14


@pytest.mark.slow
def test_a_page_shows_the_cell_and_a_run_over_space_and_time(phigen, chain, tmp_path):
    pytest.importorskip("matplotlib")
    text = CHAIN.replace("runs:", "targets: [numpy]\ncasimirs: {}\nruns:").replace(
        "name: chain", "name: chain\ntitle: <b>"
    )
    chain.write_text(text, encoding="utf-8")
    assert phigen("report", chain, "--quick", "-o", tmp_path / "chain.html").exit_code == 0
    page = Page((tmp_path / "chain.html").read_text(encoding="utf-8"))
    assert page.errors == []
    assert [attributes["id"] for attributes in page.all("section")] == [
        "live", "brief", "system", "choices", "proofs", "measured", "run", "provenance",
    ]  # fmt: skip
    assert {attributes["id"] for attributes in page.all("figure")} == {"figure-fields", "figure-sites"}
    assert {attributes["id"] for attributes in page.all("canvas")} == {"live-ours", "live-theirs", "live-errors"}
    images = [attributes["href"] for attributes in page.all("image")]
    assert len(images) >= 3
    assert all(image.startswith("data:image/png;base64,") for image in images)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda x, h: x * (1 + 1e-6 * h), "tangent map against differences on 3 sites"),
        pytest.param(lambda x, h: x + 1e-3 * h**2 * x[::-1], "observed order", marks=pytest.mark.slow),
        pytest.param(lambda x, h: x + 1e-12, "reversibility", marks=pytest.mark.slow),
    ],
)
def test_verify_reports_lattices_with_wrong_steps(phigen, chain, monkeypatch, wrong, said):
    from phigen.runtime.numpy_lattice import NumpyLatticeSession

    chain.write_text(CHAIN.replace("runs:", "targets: [numpy]\nruns:"), encoding="utf-8")
    good = NumpyLatticeSession.advance

    def advance(session, h, steps):
        for _ in range(steps):
            good(session, h, 1)
            session._x = wrong(session._x, h)

    monkeypatch.setattr(NumpyLatticeSession, "advance", advance)
    result = phigen("verify", chain, "--quick")
    assert result.exit_code == 5
    assert said in result.stderr


def test_what_lattices_do_not_have_is_refused(phigen, chain):
    result = phigen("verify", "--plot", "a.svg", chain)
    assert result.exit_code in (1, 2)
    assert "lattice" in result.stderr


def test_a_run_starts_at_the_end_of_another_and_ends_at_a_time(phigen, chain, tmp_path):
    first, second, whole = (tmp_path / f"{name}.npz" for name in ("first", "second", "whole"))
    for more in (["-o", first, "--until", "1"], ["--from", first, "-o", second, "--until", "1"], ["-o", whole]):
        result = phigen("run", chain, "-t", "numpy", *more)
        assert result.exit_code == 0, result.stderr
    np.testing.assert_array_equal(np.load(second)["x"][-1], np.load(whole)["x"][-1])
    result = phigen("run", chain, "--from", first, "--sizes", "13", "-t", "numpy")
    assert (result.exit_code, "ends with a state of shape (2, 12), the run has (2, 13)" in result.stderr) == (2, True)
    (tmp_path / "no.npz").write_text("no")
    result = phigen("run", chain, "--from", tmp_path / "no.npz", "-t", "numpy")
    assert (result.exit_code, "is no .npz of a run of a lattice" in result.stderr) == (2, True)


@pytest.mark.parametrize(
    ("option", "said"), [("--step=0", "not 0"), ("--set=a=nan", "with a number"), ("--set=m=-1", "m must be positive")]
)
def test_numbers_that_no_run_can_have_are_errors_of_the_command_line(phigen, chain, option, said):
    result = phigen("run", chain, option, "-t", "numpy")
    assert (result.exit_code, said in result.stderr) == (2, True)


def test_a_film_of_a_lattice_is_drawn_and_refused_elsewhere(phigen, chain, tmp_path, monkeypatch):
    from matplotlib.animation import FFMpegWriter
    from PIL import Image

    film = tmp_path / "chain.gif"
    result = phigen("run", chain, "--target", "numpy", "--steps", "3", "--plot", film)
    assert result.exit_code == 0, result.stderr
    with Image.open(film) as pictures:
        assert pictures.n_frames > 1
    assert sorted(p.suffix for p in tmp_path.iterdir() if p.stem.startswith(".")) == []
    monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: False)
    refused = phigen("run", chain, "--plot", tmp_path / "chain.mp4")
    assert (refused.exit_code, "needs ffmpeg" in refused.stderr) == (2, True)
    assert "films are for lattices" in phigen("run", "pendulum", "--plot", tmp_path / "p.gif").stderr


def test_a_run_has_other_sizes_on_request(phigen, chain, tmp_path):
    out = tmp_path / "wave.npz"
    document = json.loads(phigen("run", chain, "-t", "numpy", "--json", "-o", out, "--sizes", "30").stdout)
    assert document["sizes"] == [30]
    with np.load(out) as stored:
        np.testing.assert_allclose(stored["x"][0, 0], np.sin(np.pi * np.arange(30) / 30))


@pytest.mark.parametrize(
    ("sizes", "said"),
    [
        ("3x3", "3x3 has 2 sizes; chain has one axis"),
        ("1", "1 is too small for the stencil; sizes are at least 2"),
        ("3,3", "'3,3' does not state sizes, such as 64x64"),
        ("0", "'0' does not state sizes"),
    ],
)
@pytest.mark.parametrize("command", ["run", "verify"])
def test_sizes_that_do_not_fit_are_errors_of_the_command_line(phigen, chain, command, sizes, said):
    result = phigen(command, chain, "--sizes", sizes)
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.split())


def test_systems_without_sizes_say_so(phigen):
    for name, said in (("kepler", "is not a lattice"), ("chiral_magnet", "whose size follows from its bonds")):
        assert said in " ".join(phigen("run", name, "--sizes", "4").stderr.split())


def test_a_run_of_other_sizes_is_not_gone_on_with(phigen, chain, tmp_path):
    from phigen import compile

    def stop(steps_done):
        if steps_done > 10:
            raise KeyboardInterrupt

    checkpoint = tmp_path / "wave.npz.checkpoint"
    with pytest.raises(KeyboardInterrupt):
        compile(chain, target="numpy").integrate(np.zeros((2, 12)), 0.05, 40, 10, checkpoints=checkpoint, progress=stop)
    asked = ("run", chain, "-t", "numpy", "-o", tmp_path / "wave.npz", "--resume", "--sizes", "14")
    result = phigen(*asked)
    assert result.exit_code == 2
    assert "belongs to another run" in result.stderr


@pytest.fixture
def killed(phigen, chain, tmp_path, monkeypatch):
    """Return the command of a run that was killed after its second checkpoint, and the files that the run left."""
    from phigen.runtime.checkpoint import Checkpoint

    save, saved = Checkpoint.save, []

    def last(checkpoint, path):
        save(checkpoint, path)
        saved.append(path)
        if len(saved) == 2:
            raise KeyboardInterrupt

    command = ("run", chain, "-t", "numpy", "-o", tmp_path / "wave.npz")
    with monkeypatch.context() as patched:
        patched.setattr(Checkpoint, "save", last)
        assert phigen(*command).exit_code == 130
    return command, files_beside(chain)


def files_beside(chain):
    """Return the contents of all files in the folder of a spec except the spec, by file name."""
    return {path.name: path.read_bytes() for path in chain.parent.iterdir() if path != chain}


def test_what_a_killed_run_left_is_not_overwritten(phigen, chain, killed):
    command, left = killed
    assert sorted(left) == ["wave.npz.checkpoint", "wave.npz.part.npy"]
    result = phigen(*command)
    assert result.exit_code == 2
    assert "belongs to an interrupted run: continue it with --resume, or remove the file" in " ".join(
        result.stderr.split()
    )
    assert files_beside(chain) == left


def test_a_killed_run_goes_on_to_the_same_frames(phigen, chain, killed, tmp_path):
    command, _ = killed
    assert phigen(*command, "--resume").exit_code == 0
    resumed = files_beside(chain)
    assert list(resumed) == ["wave.npz"]
    with np.load(tmp_path / "wave.npz") as stored:
        frames = stored["x"]
    assert phigen(*command).exit_code == 0  # a complete run may be repeated with the same output file
    with np.load(tmp_path / "wave.npz") as stored:
        assert stored["x"].tobytes() == frames.tobytes()


def test_a_complete_run_is_not_gone_on_with(phigen, chain, tmp_path):
    command = ("run", chain, "-t", "numpy", "-o", tmp_path / "wave.npz", "--resume")
    assert phigen(*command).exit_code == 0  # without a checkpoint the run starts at its initial state
    before = files_beside(chain)
    result = phigen(*command)
    assert result.exit_code == 2
    assert "its run is complete, and there is nothing to resume" in " ".join(result.stderr.split())
    assert files_beside(chain) == before
    assert "name them by --output" in phigen("run", chain, "--resume").stderr


@pytest.mark.parametrize("harm", [lambda path: path.unlink(), lambda path: np.save(path, np.zeros((5, 2, 12)))])
def test_frames_of_another_run_are_not_gone_on_with(phigen, chain, killed, tmp_path, harm):
    harm(tmp_path / "wave.npz.part.npy")
    result = phigen(*killed[0], "--resume")
    assert result.exit_code == 2
    assert "frames" in result.stderr
    assert (tmp_path / "wave.npz.checkpoint").exists()


def test_another_seed_is_that_of_a_spec_with_it(phigen, chain, tmp_path):
    noisy = CHAIN.replace("runs:", "noise: {kick: {hamiltonian: q, amplitude: 0.1}}\norder: 2\nruns:")
    last = []
    for text, more in ((noisy, ["--seed", 7]), (noisy.replace("stride: 10", "stride: 10, seed: 7"), []), (noisy, [])):
        chain.write_text(text, encoding="utf-8")
        result = phigen("run", chain, "-t", "numpy", "-o", tmp_path / "a.npz", *more)
        assert result.exit_code == 0, result.stderr
        with np.load(tmp_path / "a.npz") as stored:
            last.append(stored["x"][-1])
    assert (last[0] == last[1]).all()
    assert (last[0] != last[2]).any()


def test_a_lattice_without_noise_has_no_seed(phigen, chain):
    assert "chain has no noise" in phigen("run", chain, "--seed", 7).stderr


def test_an_energy_that_is_no_number_is_reported(phigen, tmp_path):
    path = tmp_path / "eaters.yaml"
    path.write_text(
        "phigen: 1\nname: eaters\nlattice: {pairs: all}\ncoordinates: [x, y]\npoisson: {brackets: {x: {y: x*y}}}\n"
        "hamiltonian: {sites: x - log(x) + y}\nruns: {r: {initial: {x: [1, -1], y: 1}, step: 0.1, steps: 4}}\n",
        encoding="utf-8",
    )
    result = phigen("run", path, "-t", "numpy")
    assert "warning: H is not a finite number at some states of this run: do not trust the run" in result.stderr
