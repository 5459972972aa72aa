"""Runs and sweeps use the profile fast unless --profile names another one. The key ``profile`` of a spec only applies
to ``phigen build``.
"""

import json

import pytest

from phigen.runtime.interface import LatticeInterface
from phigen.sweeping import sweep as sweeps

SPEC = """phigen: 1
name: a
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**2/2
order: 2
profile: small
runs: {r: {initial: [1, 0], step: 0.1, steps: 10}}
sweeps: {s: {run: r, over: {q: {from: 1, to: 2, count: 3}}}}
"""
CHAIN = (
    SPEC.partition("runs")[0].replace("q**2/2", "(q[i+1] - q)**2/2")
    + "lattice: {axes: [i], boundary: periodic}\n"
    + "runs: {r: {sizes: [8], initial: {q: cos(i), p: 0}, step: 0.1, steps: 4}}\n"
)


@pytest.mark.parametrize("text", [SPEC, CHAIN], ids=["ordinary", "lattice"])
@pytest.mark.parametrize(("options", "profile"), [([], "fast"), (["--profile", "small"], "small")])
def test_runs_name_their_scheme_and_profile(phigen, write, text, options, profile):
    write("a.yaml", text)
    printed = phigen("run", "a.yaml", "-t", "numpy", *options).stdout.splitlines()[1]
    assert "scheme s" in printed
    assert f", order 2, profile {profile}, target numpy" in printed
    assert json.loads(phigen("run", "a.yaml", "-t", "numpy", "--json", *options).stdout)["profile"] == profile


@pytest.mark.parametrize(("options", "profile"), [([], "fast"), (["--profile", "small"], "small")])
def test_sweeps_are_made_in_the_profile_that_is_asked_for(phigen, write, monkeypatch, options, profile):
    write("a.yaml", SPEC)
    compiled, compilation_of = [], sweeps.compilation_of

    def noted(*source, **asked):
        compiled.append(compilation_of(*source, **asked))
        raise KeyboardInterrupt

    monkeypatch.setattr(sweeps, "compilation_of", noted)
    phigen("sweep", "a.yaml", "-t", "numpy", "-o", "a.zarr", *options)
    assert [c.program.profile for c in compiled] == [profile]


def test_large_lattices_are_shared_between_threads():
    """Lattices with more than 4096 sites use several threads, and lattices with pairs those with more than 512 sites.
    The C runtime has the same limits.
    """
    about = {"name": "t", "coordinates": ("q",), "order": 2, "parameters": {}, "positive": frozenset(), "casimirs": ()}
    chain = LatticeInterface(**about, axes=("i",))
    pairs = LatticeInterface(**about, axes=("i",), pairs=True)
    assert [chain.is_shared(n) for n in (4096, 4097)] == [False, True]
    assert [pairs.is_shared(n) for n in (512, 513)] == [False, True]
