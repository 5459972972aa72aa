"""Pages on Python followed to the letter."""

from pathlib import Path

import pytest
from systems import slow_but
from walkthrough import follow

pytest.importorskip("pandas")
pytest.importorskip("xarray")


@pytest.mark.slow
@pytest.mark.parametrize("page", slow_but(["ensembles"], ["python", "ensembles", "gradients"]))
def test_the_page_can_be_followed(page, tmp_path):
    assert follow(Path(__file__).resolve().parent.parent / "docs" / f"{page}.md", tmp_path) == 1
