"""docs/gallery.md is up to date: docs/make_gallery.py makes the same page of the present specs. `make figures` updates
the page.
"""

import importlib.util
import json
import re
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

DOCS = Path(__file__).resolve().parent.parent / "docs"
_location = importlib.util.spec_from_file_location("make_gallery", DOCS / "make_gallery.py")
gallery = importlib.util.module_from_spec(_location)
_location.loader.exec_module(gallery)

KNOWN = json.loads(gallery.FACTS.read_text(encoding="utf-8"))
MENDED_BY = "docs/gallery.md is out of date; `make figures` updates it"
#: Systems that compile and run quickly.
QUICK = ["lotka_volterra", "harmonic_oscillator"]


def test_facts_are_about_the_specs_of_today():
    every = [*gallery.names(), *gallery.lattices()]
    assert list(KNOWN) == every, MENDED_BY
    assert {name: fact["sha256"] for name, fact in KNOWN.items()} == {
        name: gallery.source(name).source_sha256 for name in every
    }, MENDED_BY


def test_page_is_made_of_specs_and_facts():
    assert gallery.PAGE.read_text(encoding="utf-8") == gallery.page(KNOWN), MENDED_BY


def test_page_shows_all_figures_and_they_are_small():
    shown = re.findall(r"\]\((figures/.*?)\)", gallery.PAGE.read_text(encoding="utf-8"))
    assert {DOCS / path for path in shown} == set(gallery.FIGURES.glob("*.svg"))
    assert len(shown) >= len(KNOWN)
    assert [path for path in shown if (DOCS / path).stat().st_size >= 150_000] == []


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", QUICK)
def test_numbers_are_current(name):
    today, before = gallery.facts(name), KNOWN[name]
    assert {k: v for k, v in today.items() if k != "errors"} == {k: v for k, v in before.items() if k != "errors"}
    for method, errors in today["errors"].items():
        assert errors == pytest.approx(before["errors"][method], rel=0.02, abs=1e-12)
