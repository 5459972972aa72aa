import pytest
from tools import WARNINGS

from phigen.runtime import toolchain


@pytest.fixture(autouse=True)
def flags_of_benchmarks(monkeypatch):
    """Compile without treating warnings as errors, as ``python -m benchmarks`` does: the classical methods to compare
    with (peers) are C written by hand.
    """
    monkeypatch.setattr(toolchain, "BASE_FLAGS", tuple(f for f in toolchain.BASE_FLAGS if f not in WARNINGS))
