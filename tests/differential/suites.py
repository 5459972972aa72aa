"""Test suites for random systems, by the kind of system."""

from __future__ import annotations

from collections.abc import Mapping

from differential import lattice_checks, ordinary_checks
from differential.trial import Suite

SUITES: Mapping[str, Suite] = {"ordinary": ordinary_checks.SUITE, "lattice": lattice_checks.SUITE}
