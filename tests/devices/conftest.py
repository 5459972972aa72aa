import os

import pytest

from phigen.runtime import toolchain

#: Tests compile kernels of OpenCL without optimisation, in a fifth of the time.
os.environ["PYOPENCL_BUILD_OPTIONS"] = "-cl-opt-disable"


@pytest.fixture(autouse=True, scope="module")
def c_without_contraction(compiled_solvers):
    """Compile C without fused multiply-add, so that each product and sum is rounded as on devices."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "TUNING_FLAGS", ("-ffp-contract=off",))
        # phigen remembers which flags a compiler command accepts; a command other than `gcc` has its own entry.
        patch.setenv("CC", "gcc -g0")
        yield
