"""The examples of docs/recipes.md work, and their output is what the page shows."""

from pathlib import Path

import pytest
from walkthrough import follow

from phigen.runtime.toolchain import available


@pytest.mark.skipif(not available(), reason="no C compiler")
@pytest.mark.slow
def test_the_page_can_be_followed(tmp_path):
    assert follow(Path(__file__).resolve().parent.parent / "docs" / "recipes.md", tmp_path) == 17
