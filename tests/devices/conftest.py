import os

import pytest

from phigen.runtime import toolchain

#: Kernels compile in a fifth of the time without optimisation, as C does in tests.
os.environ["PYOPENCL_BUILD_OPTIONS"] = "-cl-opt-disable"


@pytest.fixture(autouse=True, scope="module")
def c_without_contraction(compiled_solvers):
    """C in which products and sums are rounded one by one, as on devices."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "TUNING_FLAGS", ("-ffp-contract=off",))
        patch.setenv("CC", "gcc -g0")  # a command of its own: the flags that a command accepts are remembered
        yield
