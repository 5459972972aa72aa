"""Fixtures: the page of a spec whose texts try to inject HTML and scripts, made once per test session."""

import json

import pytest
from click.testing import CliRunner

from phigen.cli import group

ATTACK = "</title></style></script></p>--><script>window.broken = 1</script><img src=x onerror='broken=1'>&amp;\"]]>"
QUOTED = json.dumps(ATTACK)

SPEC = f"""\
phigen: 1
name: attack
title: {QUOTED}
description: |
  Two lines: {ATTACK}
  {{{{ 7*7 }}}} {{% raw %}} </math><mtext><a href="javascript:broken=1">x</a>
references: [{QUOTED}, "https://example.org/?a=1&b=<2>"]
coordinates: [x1, x2, alert]
parameters:
  I1: {{value: 1, positive: true, description: {QUOTED}}}
poisson:
  brackets: {{x1: {{x2: -alert, alert: x2}}, x2: {{alert: -x1}}}}
hamiltonian: x1**2/I1/2 + x2**2/4 + alert**2/6
order: 4
runs:
  constructor:
    description: {QUOTED}
    initial: [0.3, 1, 0.2]
    step: 0.1
    steps: 40
    compare: [rk4]
    section: x1
"""


@pytest.fixture(scope="session")
def page_path(tmp_path_factory, compiled_solvers):
    """Write the page of `SPEC` once, and return its path."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "attack.yaml").write_text(SPEC, encoding="utf-8")
    arguments = ["report", str(folder / "attack.yaml"), "--lyapunov", "--quick", "-o", str(folder / "attack.html")]
    result = CliRunner().invoke(group, arguments, prog_name="phigen")
    assert result.exit_code == 0, result.output
    return folder / "attack.html"


@pytest.fixture(scope="session")
def html(page_path):
    return page_path.read_text(encoding="utf-8")
