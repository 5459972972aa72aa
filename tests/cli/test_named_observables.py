"""Observables in `stop`, `section` and `average: {of: …}` of ordinary systems, and the figure of an energy that
changes.
"""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner

import phigen
from phigen.cli import group
from phigen.errors import SpecError
from phigen.spec import loads

OSCILLATOR = """\
phigen: 1
name: oscillator
coordinates: [q, p]
parameters: {gamma: 0.1}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**2/2
damping: gamma
observables: {radius: sqrt(q**2 + p**2), side: q}
runs: {fall: {initial: [1, 0], step: 0.1, until: 40, stop: radius - 0.5, section: side, average: {of: [radius]}}}
"""


def test_runs_stop_and_cross_where_observables_say():
    run = phigen.compile(loads(OSCILLATOR), target="numpy").run("fall")
    assert run.observables["radius"][-1] == pytest.approx(0.5, abs=1e-12)
    # dH/dt = -gamma |pi grad H|^2 = -gamma radius^2, so that the radius falls as exp(-gamma t)
    assert run.t[-1] == pytest.approx(np.log(2) / 0.1, rel=1e-4)


def test_figures_and_means_show_what_was_asked_for(tmp_path):
    spec = tmp_path / "oscillator.yaml"
    spec.write_text(OSCILLATOR)
    command = ["run", str(spec), "--plot", str(tmp_path / "fall.svg")]
    result = CliRunner().invoke(group, command, prog_name="phigen")
    assert result.exit_code == 0, result.output
    means = result.output.partition("observables, means")[2]
    assert "radius" in means
    assert "side" not in means.partition("crossings")[0]
    assert "crossing of the section q = 0" in result.output
    drawn = (tmp_path / "fall.svg").read_text(encoding="utf-8")
    assert "change of the energy, H(t)" in drawn
    assert "energy balance" not in drawn


@pytest.mark.parametrize(
    ("old", "new", "message", "hint"),
    [
        ("of: [radius]", "of: [radiuss]", "is no observable that is one number", "radius"),
        ("of: [radius]", "of: radius", "expected a list", r"a list of one is \[radius\]"),
        ("section: side", "section: sidee", "not declared", "side"),
    ],
)
def test_other_names_are_refused_with_a_hint(old, new, message, hint):
    with pytest.raises(SpecError, match=message) as error:
        loads(OSCILLATOR.replace(old, new))
    assert any(hint.replace("\\", "") in d.hint for d in error.value.diagnostics)
