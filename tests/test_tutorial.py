"""The examples of docs/tutorial.md work, and the figure in the page is the one that the command of the page draws."""

from pathlib import Path

import pytest
from walkthrough import follow, labels_of

pytest.importorskip("matplotlib")

DOCS = Path(__file__).resolve().parent.parent / "docs"


@pytest.mark.slow
def test_tutorial_can_be_followed(tmp_path):
    assert follow(DOCS / "tutorial.md", tmp_path) == 15
    committed, drawn = DOCS / "figures" / "tutorial.svg", tmp_path / "rattleback.svg"
    assert labels_of(committed.read_text(encoding="utf-8")) == labels_of(drawn.read_text(encoding="utf-8"))
