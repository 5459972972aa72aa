import pytest
from tools import WARNINGS

from phigen.runtime import toolchain


@pytest.fixture(autouse=True)
def flags_of_benchmarks(monkeypatch):
    """Peers are written by hand, and compiled as ``python -m benchmarks`` does: warnings are no errors."""
    monkeypatch.setattr(toolchain, "BASE_FLAGS", tuple(f for f in toolchain.BASE_FLAGS if f not in WARNINGS))
