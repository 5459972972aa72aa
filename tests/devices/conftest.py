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
        patch.setenv("CC", "gcc -g0")  # another name than gcc: accepted flags are cached by command
        yield
