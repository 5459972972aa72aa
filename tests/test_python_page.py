"""The examples in the pages on Python work, and their output is what the pages show."""

from pathlib import Path

import pytest
from systems import slow_but
from walkthrough import follow

pytest.importorskip("pandas")
pytest.importorskip("xarray")


#: Pages by name, with the number of commands whose output is compared.
PAGES = {"python": 1, "ensembles": 1, "gradients": 4}


@pytest.mark.slow
@pytest.mark.parametrize("page", slow_but(["ensembles"], PAGES))
def test_the_page_can_be_followed(page, tmp_path):
    if page == "gradients":
        pytest.importorskip("jax")
    assert follow(Path(__file__).resolve().parent.parent / "docs" / f"{page}.md", tmp_path) == PAGES[page]
