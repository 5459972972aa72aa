"""Messages of pytest about skipped tests."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_selection_without_quick_tests_mentions_all():
    file = Path(__file__).with_name("test_tutorial.py")
    command = [sys.executable, "-m", "pytest", "-p", "no:xdist", "-p", "no:cacheprovider", file]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    assert process.returncode == pytest.ExitCode.NO_TESTS_COLLECTED
    assert "--all runs the slow tests too" in process.stdout
