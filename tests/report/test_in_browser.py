"""The page in a browser: formulas are drawn, the viewer turns, both themes and paper work, and nothing complains."""

import pytest
from chromium import Browser
from support import tool


@pytest.fixture(scope="module")
def browser(made, tmp_path_factory):
    found = Browser(tool("chromium"), tmp_path_factory.mktemp("profile"))
    try:
        found.size(1100, 900)
        found.load(made)
        yield found
    finally:
        found.close()


def test_nothing_complains_and_nothing_is_loaded(browser, made):
    browser.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert browser.complaints == []
    assert browser.requests == [made.as_uri()]
    assert browser.value("window.broken") is None


def test_policy_stops_what_should_get_past_the_escaping(browser):
    script = "const s = document.createElement('script'); s.textContent = 'window.broken = 1'; document.body.append(s)"
    browser.value(f"{{{script}}}")
    assert browser.value("window.broken") is None
    browser.value("{const d = document.createElement('div'); d.innerHTML = '<img src=x onerror=\"broken = 1\">';"
                  "document.body.append(d)}")  # fmt: skip
    assert browser.value("new Promise(done => setTimeout(() => done(window.broken), 50))") is None


def test_formulas_are_drawn(browser):
    sizes = browser.value(
        "[...document.querySelectorAll('math')].filter(m => !m.closest('details:not([open])'))"
        ".map(m => m.getBoundingClientRect()).map(r => [r.width, r.height])"
    )
    assert len(sizes) > 20
    assert all(w > 2 and h > 5 for w, h in sizes)
    tall = "document.querySelector('mtable').getBoundingClientRect().height"
    assert browser.value(tall) > 40  # three rows below one another


def view(browser):
    return [float(v) for v in browser.value("document.getElementById('viewer-canvas').dataset.view").split()]


def inked(browser):
    """How many points of the canvas are drawn upon."""
    return browser.value(
        "{const c = document.getElementById('viewer-canvas');"
        "c.getContext('2d').getImageData(0, 0, c.width, c.height).data.filter((v, i) => i % 4 === 3 && v > 0).length}"
    )


def test_viewer_turns_by_mouse_and_keys(browser):
    assert inked(browser) > 500
    canvas = "document.getElementById('viewer-canvas')"
    browser.value(f"{canvas}.scrollIntoView({{block: 'center'}})")
    box = browser.value(f"(r => [r.x + r.width / 2, r.y + r.height / 2])({canvas}.getBoundingClientRect())")
    yaw, pitch, zoom = view(browser)
    browser.drag(*box, 80, 40)
    assert view(browser)[0] == pytest.approx(yaw - 0.8, abs=0.05)
    assert view(browser)[1] == pytest.approx(pitch + 0.4, abs=0.05)
    browser.value(f"{canvas}.focus()")
    browser.key("ArrowLeft")
    browser.key("+")
    assert view(browser)[0] == pytest.approx(yaw - 0.7, abs=0.05)
    assert view(browser)[2] == pytest.approx(1.2 * zoom)
    browser.key("0")
    assert view(browser) == [yaw, pitch, zoom]


def test_slider_moves_along_the_trajectory(browser):
    state = "document.getElementById('viewer-state').textContent"
    assert "x1 = 0.3000, x2 = 1.0000" in browser.value(state)
    browser.value(
        "{const s = document.getElementById('viewer-time'); s.value = s.max; s.dispatchEvent(new Event('input'))}"
    )
    assert "t = 4.00" in browser.value(state)


def test_turning_by_itself_respects_reduced_motion(browser):
    def yaw_after_a_click():
        browser.key("0")
        browser.value("document.getElementById('viewer-turn').click()")
        first = view(browser)[0]
        browser.value("new Promise(done => setTimeout(done, 120))")
        return first, view(browser)[0]

    browser.media(prefers_reduced_motion="reduce")
    first, later = yaw_after_a_click()
    assert first == later
    browser.media()
    first, later = yaw_after_a_click()
    assert first != later
    browser.value("document.getElementById('viewer-turn').click()")


def colours(browser):
    """Of the page, of a curve in a figure, of the text in a figure."""
    return browser.value(
        "[getComputedStyle(document.body).backgroundColor,"
        "getComputedStyle(document.querySelector('svg [stroke=\"var(--series-1)\"]')).stroke,"
        "getComputedStyle(document.querySelector('svg [fill=\"var(--ink)\"], svg text')).fill]"
    )


def test_dark_and_light(browser):
    browser.media(prefers_color_scheme="light")
    light = colours(browser)
    browser.media(prefers_color_scheme="dark")
    dark = colours(browser)
    assert light[0] == "rgb(255, 255, 255)"
    assert light[1] == "rgb(11, 99, 165)"
    assert all(a != b for a, b in zip(light, dark, strict=True))
    browser.value("document.getElementById('theme').click()")
    assert colours(browser) == light
    browser.value("document.getElementById('theme').click()")
    assert colours(browser) == dark
    browser.media()


def test_prints_on_paper(browser):
    browser.media("print", prefers_color_scheme="dark")
    assert colours(browser)[0] == "rgb(255, 255, 255)"
    assert browser.value("getComputedStyle(document.getElementById('viewer')).display") == "none"
    browser.media()
    assert browser.pdf().startswith(b"%PDF")


def test_paper_shows_what_is_folded(browser):
    folded = "document.querySelectorAll('details:not([open])').length"
    before = browser.value(folded)
    assert before > 2
    browser.value("dispatchEvent(new Event('beforeprint'))")
    assert browser.value(folded) == 0
    browser.value("dispatchEvent(new Event('afterprint'))")
    assert browser.value(folded) == before


@pytest.mark.parametrize("width", [360, 1100])
def test_nothing_sticks_out_sideways(browser, width):
    browser.size(width, 800)
    assert browser.value("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
