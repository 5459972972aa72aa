"""The site of the documentation: it builds without a warning, holds every page, and needs nothing from elsewhere."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from chromium import Browser
from tools import tool

import phigen

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    if importlib.util.find_spec("mkdocs") is None:
        if os.environ.get("PHIGEN_ALL_TOOLS"):
            pytest.fail("mkdocs is not installed")
        pytest.skip("mkdocs is not installed")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def test_every_page_is_reached_from_the_navigation(site):
    home = (site / "index.html").read_text(encoding="utf-8")
    linked = set(re.findall(r'href="([\w]+)\.html"', home))
    assert {p.stem for p in (ROOT / "docs").glob("*.md")} <= linked


def test_every_public_name_is_documented(site):
    text = (site / "api.html").read_text(encoding="utf-8")
    assert [name for name in phigen.__all__ if f'id="phigen.{name}"' not in text] == ["__version__"]


def test_nothing_is_loaded_from_elsewhere(site):
    for page in site.glob("*.html"):
        text = page.read_text(encoding="utf-8")
        loaded = re.findall(r'<(?:script|img|iframe)[^>]*src="?(https?:[^"\s>]*)', text)
        loaded += re.findall(r'<link[^>]*rel="?(?:stylesheet|preload|icon)"?[^>]*href="?(https?:[^"\s>]*)', text)
        assert loaded == [], page.name


def test_the_search_works_where_the_site_is_opened_from_a_file(site, tmp_path):
    browser = Browser(tool("chromium"), tmp_path)
    try:
        browser.load(site / "index.html")
        browser.value("document.querySelector('[data-md-component=search-query]').focus()")
        browser.value(
            "const box = document.querySelector('[data-md-component=search-query]'); box.value = 'Casimir';"
            "box.dispatchEvent(new Event('keyup', {bubbles: true})); box.dispatchEvent(new Event('input'))"
        )
        found = browser.value(
            "new Promise(done => { const begun = Date.now(); const look = () => {"
            "const links = document.querySelectorAll('.md-search-result__link');"
            "if (links.length || Date.now() - begun > 20000) done(links.length); else setTimeout(look, 50) }; look() })"
        )
        assert found > 3
        assert browser.complaints == []
    finally:
        browser.close()
