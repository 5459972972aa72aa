"""docs/python.md followed to the letter."""

from pathlib import Path

import pytest
from walkthrough import follow

pytest.importorskip("pandas")
pytest.importorskip("xarray")


def test_the_page_can_be_followed(tmp_path):
    assert follow(Path(__file__).resolve().parent.parent / "docs" / "python.md", tmp_path) == 1
