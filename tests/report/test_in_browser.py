"""The page in a browser: formulas are drawn, the viewer rotates, the page works in both themes and in print, and the
browser reports no errors.
"""

import json

import numpy as np
import pytest
from chromium import Browser
from lattice.lattices import LATTICES
from support import compiled, tool

import phigen
from phigen import spec
from phigen.compiler import compile_spec
from phigen.lattice.states import start_of
from phigen.report.panel import panel_page
from phigen.study.classical import rk4
from phigen.study.lattice_errors import summed

#: A browser takes seconds to start. The contents of the page have faster tests in test_page.py.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser(page_path, tmp_path_factory):
    chromium = Browser(tool("chromium"), tmp_path_factory.mktemp("profile"))
    try:
        chromium.size(1100, 900)
        chromium.load(page_path)
        yield chromium
    finally:
        chromium.close()


def test_nothing_complains_and_nothing_is_loaded(browser, page_path):
    browser.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert browser.complaints == []
    assert browser.requests == [page_path.as_uri()]
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
    assert browser.value(tall) > 40  # pixels, at least the height of three rows


def view(browser):
    return [float(v) for v in browser.value("document.getElementById('viewer-canvas').dataset.view").split()]


def inked(browser):
    """Return the number of pixels of the viewer that are not transparent."""
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


# -- the live panel

SET = "#live&h=0.3&order=2&p.I1=1.5&x.x1=0.25&compare=step"


def settled(browser, page_path, fragment=""):
    """Load the page as for a user who prefers reduced motion, so that nothing moves by itself."""
    browser.media(prefers_reduced_motion="reduce")
    browser.load(page_path, fragment)


def click(browser, name, times=1):
    browser.value(f"for (let k = 0; k < {times}; k++) document.getElementById('live-{name}').click()")


def told(browser, what):
    return json.loads(browser.value(f"document.getElementById('live-panel').dataset.{what}"))


def test_panel_makes_the_steps_of_the_solver_and_of_rk4(browser, page_path):
    settled(browser, page_path, SET)
    click(browser, "step", 5)
    solver = phigen.compile(page_path.parent / "attack.yaml", target="numpy", order=2)
    start = np.array([0.25, 1, 0.2])
    ours, theirs, x = told(browser, "ours"), told(browser, "theirs"), start
    for _ in range(5):
        x = rk4(lambda y: solver.vector_field(y, I1=1.5), x, 0.3)
    assert (ours["steps"], theirs["steps"]) == (5, 5)
    assert ours["x"] == pytest.approx(solver.integrate(start, 0.3, 5, I1=1.5).x[-1], rel=1e-13)
    assert theirs["x"] == pytest.approx(x, rel=1e-13)
    assert [ours["t"], theirs["t"]] == pytest.approx([1.5, 1.5])
    assert browser.complaints == []
    error = abs(solver.hamiltonian(x, I1=1.5) / solver.hamiltonian(start, I1=1.5) - 1)
    mantissa, power = f"{error:.0e}".split("e-")
    shown = browser.value("document.querySelector('#live-theirs-scores strong').textContent")
    assert shown == f"{mantissa}·10⁻{'⁰¹²³⁴⁵⁶⁷⁸⁹'[int(power)]}"


def test_link_of_the_panel_holds_its_settings(browser, page_path):
    settled(browser, page_path)
    sliders = "document.querySelectorAll('#live-panel input[type=range]')"
    browser.value(f"{sliders}.forEach(s => {{ s.value = Number(s.min) + 1; s.dispatchEvent(new Event('input')); }})")
    chosen, link = told(browser, "settings"), browser.value("document.getElementById('live-link').hash")
    assert chosen["order"] == 4
    assert chosen["params"]["I1"] < 0.2
    assert len(set(chosen["start"])) == 3
    settled(browser, page_path, link)
    assert told(browser, "settings") == chosen


def test_parts_of_a_link_that_are_not_used_are_shown_as_text(browser, page_path):
    wrong = ("order=3", "h=", "p.I1=-1", "speed=fast", "x.y=1", "%3Cimg src=x onerror=broken=1%3E=1", "rk4=0")
    settled(browser, page_path, "#live&x.x1=0.25&" + "&".join(wrong))
    unused = browser.value("document.getElementById('live-unused').textContent")
    assert set(unused.partition(": ")[2].split(", ")) == {w.replace("%3C", "<").replace("%3E", ">") for w in wrong}
    assert browser.value("document.querySelector('#live-unused').children.length") == 0
    assert told(browser, "settings")["start"][0] == 0.25
    assert told(browser, "settings")["params"]["I1"] == 1
    settled(browser, page_path, SET)
    assert browser.value("document.getElementById('live-unused').hidden")


def test_a_failing_step_is_reported_with_its_status(browser, page_path):
    settled(browser, page_path, "#live&h=1e9&order=2&compare=step")
    assert browser.value("document.getElementById('live-ours-told').textContent") == ""
    click(browser, "step")
    message = browser.value("document.getElementById('live-ours-told').textContent")
    assert message in ("Failed after 0 steps: NO_CONVERGENCE.", "Failed after 0 steps: NOT_FINITE.")
    settled(browser, page_path, SET)
    click(browser, "step")
    assert browser.value("document.getElementById('live-steps').textContent") == "1 step"


def test_equal_work_gives_rk4_as_many_steps_as_the_link_says(browser, page_path):
    settled(browser, page_path, SET.replace("compare=step", "rk4=3"))
    click(browser, "step", 5)
    solver = phigen.compile(page_path.parent / "attack.yaml", target="numpy", order=2)
    x = np.array([0.25, 1, 0.2])
    for _ in range(15):
        x = rk4(lambda y: solver.vector_field(y, I1=1.5), x, 0.1)
    assert told(browser, "theirs")["x"] == pytest.approx(x, rel=1e-13)
    assert told(browser, "theirs")["t"] == pytest.approx(1.5)
    about = browser.value("document.getElementById('live-cost').textContent")
    assert about == "3 steps for each step of phigen: equal work in this browser"
    settled(browser, page_path, "#live&order=4")
    assert 1 <= told(browser, "settings")["parts"] <= 64


def test_address_bar_follows_the_settings(browser, page_path):
    settled(browser, page_path)
    assert browser.value("location.hash") == ""
    browser.value(
        "{const s = document.querySelector('[data-kind=h]'); s.value = 3; s.dispatchEvent(new Event('input'))}"
    )
    assert browser.value("location.hash") == browser.value("document.getElementById('live-link').hash")


GROWN = [1e-6 * k for k in range(40)]
#: Errors of phigen at each step, those of RK4, and the caption of the panel about them.
CLOSER = [
    ([1e-3] * 40, GROWN, "energy: RK4 is closer so far, but its error grows while that of phigen does not."),
    ([1e-3] * 40, [1e-6] * 40, "energy: RK4 is closer with these settings."),
    ([1e3 * e for e in GROWN], GROWN, "energy: RK4 is closer with these settings."),
    ([1e-6] * 40, [1e-3] * 40, ""),
    ([1e-14] * 40, [1e-15] * 40, ""),
]


@pytest.mark.parametrize(("ours", "theirs", "said"), CLOSER)
def test_where_rk4_is_closer_the_panel_says_so(browser, page_path, ours, theirs, said):
    histories = ", ".join(
        f"{side}: {{histories: [{{values: {v}}}]}}" for side, v in (("ours", ours), ("theirs", theirs))
    )
    assert browser.value(f"whereRk4IsCloser({{groups: [{{name: 'energy'}}], {histories}}})") == said


@pytest.mark.thin(1)
@pytest.mark.slow
@pytest.mark.parametrize("name", ["lotka_volterra", "nambu_pendulum", "pendulum", "rigid_body"])
def test_panels_of_the_corpus_begin_with_half_of_a_step_that_works(browser, tmp_path, name):
    compilation = compiled(name)
    run = next(iter(compilation.spec.runs.values()))
    path = tmp_path / "panel.html"
    text = panel_page(compilation, run)
    path.write_text(text, encoding="utf-8")
    settled(browser, path)
    chosen = told(browser, "settings")
    parameters = dict(chosen["params"]) | ({"t0": float(run.start)} if compilation.spec.time else {})
    solver = phigen.compile(compilation.spec, target="numpy", order=chosen["order"])
    start = solver.integrate(chosen["start"], chosen["h"], 50, **parameters)
    wide = solver.integrate(chosen["start"], 2 * chosen["h"], 50, **parameters)
    assert np.isfinite(start.x).all()
    assert np.isfinite(wide.x).all(), "a step of twice the size works, too"
    click(browser, "play")
    assert told(browser, "ours")["steps"] == 100
    nothing = "Nothing is conserved" in path.read_text(encoding="utf-8")
    assert nothing == (not told(browser, "theirs")["errors"])
    assert browser.complaints == []


def test_panel_moves_by_itself_unless_less_motion_is_asked_for(browser, page_path):
    waited = "new Promise(done => setTimeout(() => done(document.getElementById('live-steps').textContent), 400))"
    settled(browser, page_path)
    assert browser.value(waited) == "0 steps"
    click(browser, "play")
    assert browser.value(waited) == "100 steps"
    browser.media()
    browser.load(page_path)
    browser.value("document.getElementById('live-ours').scrollIntoView()")  # the panel only moves while it is visible
    moving = "document.getElementById('live-steps').textContent !== '0 steps'"
    assert browser.value(f"new Promise(d => {{ const wait = () => {moving} ? d(1) : setTimeout(wait, 20); wait(); }})")
    click(browser, "play")
    resting = browser.value(waited)
    assert browser.value(waited) == resting
    assert "After" in browser.value("document.getElementById('live-told').textContent")


def test_panel_is_used_by_keys(browser, page_path):
    settled(browser, page_path)
    before = told(browser, "settings")["h"]
    browser.value("document.querySelector('[data-kind=h]').focus()")
    browser.key("ArrowRight")
    assert told(browser, "settings")["h"] > before
    browser.key("Tab")
    assert browser.value("document.activeElement.dataset.kind") == "order"
    turned = "document.getElementById('live-ours').toDataURL()"
    picture = browser.value(turned)
    browser.value("document.getElementById('live-theirs').focus()")
    browser.key("ArrowLeft")
    assert browser.value(turned) != picture


def test_panel_fits_a_telephone(browser, page_path):
    browser.size(375, 800)
    settled(browser, page_path)
    assert browser.value("document.documentElement.scrollWidth <= innerWidth")
    assert browser.value("[...document.querySelectorAll('#live-panel canvas')].every(c => c.clientWidth > 140)")
    browser.size(1100, 900)
    browser.media()
    browser.load(page_path)


# -- the live panel of lattices

#: A chain of spins in a rotating field.
DRIVEN = """\
phigen: 1
name: driven
time: t
lattice: {axes: [i], boundary: open}
coordinates: [x, y, z]
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: "-(x*x[i+1] + y*y[i+1] + z*z[i+1]) - x*cos(2*t) - y*sin(2*t)"
casimirs: {C: x**2 + y**2 + z**2}
runs: {r: {sizes: [6], initial: {x: cos(i), y: sin(i), z: 0}, step: 0.1, steps: 10, start: 0.5}}
"""
#: A ring of sites with names, with an invariant, and with observables of bonds and of sites.
NAMED = """\
phigen: 1
name: named
lattice: {graph: bonds}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: {sites: p**2/2, bonds: "(q[a] - q[b])**2/2 + (q[a] - q[b])**4/4"}
invariants: {P: p}
observables: {T: {mean: p**2/2}, e: p**2/2, far: {max: "abs(q[a] - q[b])", over: bonds}}
runs:
  r:
    initial: {q: [0.1, 0.8, -0.3, 0.5], p: [0.3, 0, 0, 0]}
    bonds: [[0, 1], [1, 2], [2, 3], [3, 0]]
    names: [north, east, south, "<b>west"]
    step: 0.1
    steps: 20
"""
#: A chain with a formula as start, a plane with open ends, a cube, a graph with lists of values, vortices of both
#: signs, and the two lattices above.
LATTICE_PANELS = {n: LATTICES[n] for n in ("fput", "spins_2", "spins_3", "food_web", "vortices")} | {"driven": DRIVEN}
LATTICE_PANELS["named"] = NAMED
COLOURS = (
    "{const c = document.getElementById('live-ours'), pen = c.getContext('2d');"
    "new Set(new Uint32Array(pen.getImageData(0, 0, c.width, c.height).data.buffer)).size}"
)


@pytest.fixture(scope="module")
def panels(tmp_path_factory):
    """Return the paths of pages with a panel alone, by the name of the lattice."""
    folder, pages = tmp_path_factory.mktemp("panels"), {}
    for name in LATTICE_PANELS:
        compilation = compile_spec(spec.loads(LATTICE_PANELS[name]))
        pages[name] = folder / f"{name}.html"
        text = panel_page(compilation, next(iter(compilation.spec.runs.values())))
        pages[name].write_text(text, encoding="utf-8")
    return pages


@pytest.mark.parametrize("name", LATTICE_PANELS)
def test_fields_move_by_the_steps_of_the_solver_and_of_rk4(browser, panels, name):
    settled(browser, panels[name], "#live&h=0.05&compare=step")
    specification = spec.loads(LATTICE_PANELS[name])
    start = start_of(specification, next(iter(specification.runs.values())))
    t0 = 0.5 if specification.time else None
    solver = phigen.compile(specification, target="numpy")
    begin = np.reshape(told(browser, "ours")["x"], start.state.shape)
    if "spins" in name:  # the panel draws the initial spins at random
        assert np.linalg.norm(begin, axis=0) == pytest.approx(np.ones(start.sizes))
    else:
        assert begin[0] == pytest.approx(start.state[0], rel=1e-14, abs=1e-15)
    click(browser, "step", 4)

    def field(at):  # ``at`` holds the state and, as last number, the time
        time = float(at[-1]) if specification.time else None
        slope = solver.vector_field(at[:-1].reshape(begin.shape), time, parameters=start.arguments)
        return np.append(slope, 1)

    at = np.append(begin, t0 or 0)
    for _ in range(4):
        at = rk4(field, at, 0.05)
    x = at[:-1].reshape(begin.shape)
    run = solver.integrate(begin, 0.05, 4, t0=t0, parameters=start.arguments)
    assert told(browser, "ours")["x"] == pytest.approx(run.x[-1].ravel(), rel=1e-12, abs=1e-14)
    assert told(browser, "theirs")["x"] == pytest.approx(x.ravel(), rel=1e-12, abs=1e-14)
    errors = []
    if not specification.time:
        errors = [abs(solver.hamiltonian(x, parameters=start.arguments) - run.energy[0]) / run.energy_scale]
    if specification.casimirs:
        first, last = ((s**2).sum(axis=0) for s in (begin, x))
        errors.append(np.abs(last - first).max() / first.mean())
    cell, changes = compile_spec(specification).by_sweeps().cell, []
    for density in cell.invariants.values():
        (first, terms), (last, _) = (summed(cell, density, state, start.parameters) for state in (begin, x))
        changes.append(abs(last - first) / (abs(first) if abs(first) > 1e-3 * terms else terms))
    for side, state in (("ours", run.x[-1]), ("theirs", x)):
        times = {"t": float(at[-1])} if specification.time else {}
        observed = solver.observables(state, parameters=start.arguments, **times)
        expected = [observed[n] for n in specification.recorded]
        assert told(browser, side)["observed"] == pytest.approx(expected, rel=1e-10, abs=1e-12)
    shown = told(browser, "theirs")["errors"]
    assert shown[: len(errors)] == pytest.approx(errors, rel=1e-6, abs=1e-15)
    # The invariants are sums over sites whose terms cancel. Another order of summation changes their rounding errors.
    assert shown[len(errors) :] == pytest.approx([max(changes)] if changes else [], rel=1e-6, abs=1e-13)
    assert browser.value(COLOURS) > 8
    assert browser.complaints == []


def test_settings_of_a_lattice_are_in_its_link_and_make_it_larger(browser, panels):
    settled(browser, panels["fput"])
    assert len(told(browser, "ours")["x"]) == 10
    settled(browser, panels["spins_3"])
    browser.value(
        "document.querySelectorAll('#live-panel input[type=range]').forEach("
        "s => { s.value = s.max; s.dispatchEvent(new Event('input')); })"
    )
    browser.value(
        "{const g = document.getElementById('live-group'); g.value = 4; g.dispatchEvent(new Event('change'))}"
    )
    chosen, link = told(browser, "settings"), browser.value("document.getElementById('live-link').hash")
    click(browser, "step", 2)
    assert (chosen["group"], len(told(browser, "ours")["x"])) == (4, 3 * 16**3)
    settled(browser, panels["spins_3"], link)
    assert told(browser, "settings") == chosen
    assert browser.complaints == []


def test_lattices_fit_a_telephone(browser, page_path, panels):
    browser.size(375, 800)
    settled(browser, panels["spins_2"])
    assert browser.value("document.documentElement.scrollWidth <= innerWidth")
    assert browser.value("[...document.querySelectorAll('.race canvas')].every(c => c.clientWidth > 140)")
    browser.size(1100, 900)
    browser.media()
    browser.load(page_path)


# -- the page as a whole


def test_automatic_rotation_respects_reduced_motion(browser):
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
    """Return the colours of the page, of a curve in a figure, and of the text in a figure."""
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
