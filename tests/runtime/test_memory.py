"""Arrays over sites that do not fit into memory are refused before they are allocated."""

from contextlib import nullcontext

import numpy as np
import pytest
from click.testing import CliRunner

from phigen import compile, memory, sweep
from phigen.cli import group
from phigen.errors import LimitError
from phigen.study.lyapunov import lattice_spectrum
from phigen.sweeping import cluster

#: Bytes of a state (q, p) of 12 sites.
STATE = 8 * 2 * 12
CHAIN = """phigen: 1
name: chain
lattice: {axes: [i]}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + (q[i+1] - q)**2/2
order: 2
runs:
  wave: {sizes: [12], initial: {q: sin(pi*i/N_i), p: 0}, step: 0.05, steps: 40}
"""


@pytest.fixture
def chain(tmp_path):
    path = tmp_path / "chain.yaml"
    path.write_text(CHAIN, encoding="utf-8")
    return path


def test_what_is_available_is_less_than_there_is_and_not_nothing():
    free = memory.available()
    assert free is not None
    assert 2**20 < free < 2**50


def test_groups_count_what_they_use_but_for_pages_of_files(tmp_path):
    for name, text in (("memory.max", "1000"), ("memory.current", "800"), ("memory.stat", "anon 500\nfile 300\n")):
        (tmp_path / name).write_text(text)
    assert list(memory._of_groups(tmp_path)) == [500]
    (tmp_path / "memory.max").write_text("max\n")
    assert list(memory._of_groups(tmp_path)) == []


def test_a_run_that_cannot_fit_ends_with_what_to_do(chain):
    asked = ["run", str(chain), "--sizes", "9999999999", "-t", "numpy"]
    result = CliRunner().invoke(group, asked, prog_name="phigen")
    assert result.exit_code == 3
    assert "9999999999 sites take 224 GiB of memory at least" in result.stderr
    assert "phigen.mpi on several machines" in result.stderr


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_solvers_and_frames_are_refused_where_they_do_not_fit_and_only_there(chain, target, monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "UNCHECKED_BYTES", 0)
    solver, x = compile(chain, target=target), np.zeros((2, 12))
    monkeypatch.setattr(memory, "available", lambda: 101 * STATE)
    assert len(solver.integrate(x, 0.05, 100)) == 101
    with pytest.raises(LimitError, match=r"102 frames take .* of memory at least"):
        solver.integrate(x, 0.05, 101)
    assert len(solver.integrate(x, 0.05, 101, output=tmp_path / "a.npy")) == 102
    monkeypatch.setattr(memory, "available", lambda: 2 * STATE - 1)
    with pytest.raises(LimitError, match="of memory at least"):
        solver.integrate(x, 0.05, 0)
    monkeypatch.setattr(memory, "available", lambda: None)
    solver.integrate(x, 0.05, 101)


def carry(solver, x):
    next(solver.tangents(x, 0.05, 1, np.ones((500, *x.shape))))


def back(solver, x):
    solver.pullback(x, 0.05, 500, np.ones((501, *x.shape)), 1)


def alike(solver, x):
    solver.ensemble(np.tile(x, (9, 1, 1)), 0.05, 1)


#: Calls that allocate arrays. Each entry has words of the error, the target, the free memory with which the call is
#: refused and the free memory with which it succeeds (both in units of one state of the chain), and the call.
TAKING = [
    ("tangent vectors", "numpy", 499, 500, carry),
    ("the arrays of 500 tangent vectors", "c", 1338, 1340, carry),
    ("the arrays of 24 tangent vectors", "c", 71, 72, lambda solver, x: lattice_spectrum(solver, x, 0.05, 1, 24)),
    ("the states of 9 members", "c", 8, 18, alike),
    ("the states of 9 members", "c", 8, 18, lambda solver, x: solver.ensemble(x, np.full(9, 0.05), 1)),
    ("2 frames of 9 members", "c", 17, 18, alike),
    ("501 frames", "numpy", 500, 1046, back),
    ("the stored states of the reverse pass", "numpy", 1045, 1046, back),
]


@pytest.mark.thin(2)
@pytest.mark.parametrize(("words", "target", "refused", "allowed", "call"), TAKING)
def test_tangent_vectors_members_and_reverse_passes_that_do_not_fit_are_refused(
    chain, words, target, refused, allowed, call, monkeypatch
):
    solver, x = compile(chain, target=target, tangent=True, adjoint=True), np.zeros((2, 12))
    monkeypatch.setattr(memory, "UNCHECKED_BYTES", 0)
    monkeypatch.setattr(memory, "available", lambda: allowed * STATE)
    call(solver, x)
    monkeypatch.setattr(memory, "available", lambda: refused * STATE)
    with pytest.raises(LimitError, match=words):
        call(solver, x)


@pytest.mark.parametrize("steps", [0, 1])
def test_a_reverse_pass_without_memory_for_one_step_is_refused(chain, steps, monkeypatch):
    solver, x = compile(chain, target="c", adjoint=True), np.zeros((2, 12))
    session = solver.backend.start(x, {})
    least = session._c.trail_size(session._address, 1)
    monkeypatch.setattr(memory, "UNCHECKED_BYTES", 0)
    monkeypatch.setattr(memory, "available", lambda: least)
    solver.pullback(x, 0.05, steps, x)
    monkeypatch.setattr(memory, "available", lambda: least - 1)
    with pytest.raises(LimitError, match="the stored data of the reverse pass"):
        solver.pullback(x, 0.05, steps, x)


def test_chunks_of_a_sweep_that_are_made_at_a_time_fit_together(chain, monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "UNCHECKED_BYTES", 0)
    monkeypatch.setattr(memory, "available", lambda: 2 * 45 * STATE - 1)
    monkeypatch.setattr(cluster, "connected", lambda scheduler, workers: nullcontext((None, workers)))
    with pytest.raises(LimitError, match="2 chunks of a sweep at a time"):
        sweep(chain, over={"step": [0.05, 0.06]}, frames=1, workers=2, target="numpy", output=tmp_path / "made.zarr")
