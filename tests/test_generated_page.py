"""docs/generated.md followed to the letter: blocks, single steps and ensembles agree, compiled as the page says."""

from pathlib import Path

import pytest
from walkthrough import follow

DOCS = Path(__file__).resolve().parent.parent / "docs"


@pytest.mark.slow
def test_page_about_generated_code_can_be_followed(tmp_path):
    assert follow(DOCS / "generated.md", tmp_path) == 3
