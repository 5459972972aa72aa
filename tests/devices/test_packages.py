"""The packages of devices are optional, and imported for their targets only."""

import subprocess
import sys

import pytest

PROGRAM = """
import sys
sys.modules["pyopencl"] = sys.modules["cupy"] = None  # imports of them fail
import phigen, phigen.cli, phigen.runtime.devices.opening, phigen.sweeping.api, phigen.sweeping.devices
phigen.compile("pendulum_euler", "numpy").integrate([1, 0], 0.1, 3)
phigen.compile("toda", "numpy").integrate([[0.1] * 8, [0.2] * 8], 0.1, 3)
"""


@pytest.mark.slow
def test_other_targets_import_no_package_of_devices():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
