"""The examples of docs/generated.md work as the page says: compiled as described, blocks of steps, single steps and
ensembles give the same results.
"""

from pathlib import Path

import pytest
from walkthrough import follow

DOCS = Path(__file__).resolve().parent.parent / "docs"


@pytest.mark.slow
def test_page_about_generated_code_can_be_followed(tmp_path):
    assert follow(DOCS / "generated.md", tmp_path) == 3
