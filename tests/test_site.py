"""The web site of the documentation builds without warnings, contains every page, and loads nothing from other
sites.
"""

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

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    if importlib.util.find_spec("mkdocs") is None:
        if os.environ.get("PHIGEN_ALL_TOOLS"):
            pytest.fail("mkdocs is not installed")
        pytest.skip("mkdocs is not installed; `make docs` installs it")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder]
    panels = {"PHIGEN_PANELS": "pendulum_euler toda thermal_spin"}
    process = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False, env={**os.environ, **panels}
    )
    assert process.returncode == 0, process.stderr
    return folder


def test_every_page_is_reached_from_the_navigation(site):
    home = (site / "index.html").read_text(encoding="utf-8")
    linked = set(re.findall(r'href="([\w]+)\.html"', home))
    assert {p.stem for p in (ROOT / "docs").glob("*.md")} <= linked


def test_every_public_name_is_documented(site):
    text = (site / "api.html").read_text(encoding="utf-8")
    assert [name for name in phigen.__all__ if f'id="phigen.{name}"' not in text] == ["__version__"]


def test_the_gallery_offers_a_panel_of_each_system_that_has_one(site):
    page = (site / "gallery.html").read_text(encoding="utf-8")
    offered = re.findall(r'<details data-live="?live/(\w+).html', page)
    assert offered == ["pendulum_euler", "toda"]  # systems with noise have no panel
    assert sorted(path.stem for path in site.glob("live/*.html")) == offered
    listed = re.findall(r'<a href="#(\w+)" class="md-nav__link"', page)
    assert {"vortices3", "lattices", "toda"} <= {*listed}


def test_nothing_is_loaded_from_elsewhere(site):
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        loaded = re.findall(r'<(?:script|img|iframe)[^>]*src="?(https?:[^"\s>]*)', text)
        loaded += re.findall(r'<link[^>]*rel="?(?:stylesheet|preload|icon)"?[^>]*href="?(https?:[^"\s>]*)', text)
        assert loaded == [], page.name


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    chromium = Browser(tool("chromium"), tmp_path_factory.mktemp("profile"))
    yield chromium
    chromium.close()


def test_a_system_of_the_gallery_runs_once_its_panel_is_opened(site, browser):
    browser.load(site / "gallery.html")
    panel = "document.querySelector('details[data-live=\"live/toda.html\"]')"
    frames = "document.querySelectorAll('details iframe').length"
    assert browser.value(frames) == 0
    browser.value(f"{panel}.open = true; {panel}.scrollIntoView()")  # a panel that is not visible does not run
    height = f"{panel}.querySelector('iframe')?.style.height"  # the panel sets its height when it starts
    wait = f"new Promise(done => {{ const look = () => {height} ? done({height}) : setTimeout(look, 50); look(); }})"
    assert float(browser.value(wait).removesuffix("px")) > 400
    browser.value(f"{panel}.open = false")
    assert (
        browser.value("new Promise(d => setTimeout(() => d(document.querySelectorAll('details iframe').length), 100))")
        == 0
    )
    assert browser.complaints == []


def test_the_search_works_where_the_site_is_opened_from_a_file(site, browser):
    browser.load(site / "index.html")
    browser.value("document.querySelector('[data-md-component=search-query]').focus()")
    browser.value(
        "const box = document.querySelector('[data-md-component=search-query]'); box.value = 'Casimir';"
        "box.dispatchEvent(new Event('keyup', {bubbles: true})); box.dispatchEvent(new Event('input'))"
    )
    results = browser.value(
        "new Promise(done => { const begun = Date.now(); const look = () => {"
        "const links = document.querySelectorAll('.md-search-result__link');"
        "if (links.length || Date.now() - begun > 20000) done(links.length); else setTimeout(look, 50) }; look() })"
    )
    assert results > 3
    assert browser.complaints == []
