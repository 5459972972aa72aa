"""The page of a spec: it is complete, safe for any texts of the spec, and accessible."""

import base64
import hashlib
import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from html_check import Page
from support import compiled, slow_but

from phigen import resources, spec
from phigen.compiler import compile_spec
from phigen.drawing.palette import PALETTE
from phigen.geometry.conservation import RELATIVE, Unit
from phigen.proofs.examination import Examination
from phigen.report import document as pages
from phigen.report import live, page, pictures
from phigen.report.material import Material
from phigen.report.panel import NoPanelError, panel_page
from phigen.report.svg import inlined
from phigen.report.viewer import MOST_NUMBERS, viewer
from phigen.runtime.trajectory import Trajectory
from phigen.study.summary import Drift, Summary
from phigen.symbolic.verdict import CHECKED, PROVED, Statement

NO_DRIFT = Drift(0.0, Unit(kind=RELATIVE), 1.0)
SUMMARY = Summary("phigen", NO_DRIFT, {"C": NO_DRIFT}, {}, None, (0.0,), 3, 3)
ASSETS = resources.templates() / "report"
CSS = (ASSETS / "report.css").read_text(encoding="utf-8")


def trajectory(x, names=("x", "y", "z")):
    t = np.arange(len(x), dtype=float)
    return Trajectory(t=t, x=x, energy=t, casimirs={}, steps=len(x), h=1.0, parameters={}, coordinates=names)


def bare(compilation, **more):
    """Return the page of a system for which nothing was measured."""
    return pages.document(
        Material(Examination(compilation.spec, {}, compilation), compilation, "phigen report", **more)
    )


# -- the page with all sections, of a spec whose texts try to inject scripts


def test_page_is_sound_html_that_loads_nothing(html):
    assert Page(html).errors == []


def test_page_has_all_its_sections(html):
    section_names = [attributes["id"] for attributes in Page(html).all("section")]
    assert section_names == ["live", "brief", "system", "choices", "method", "proofs", "measured", "modified", "run",
                     "precision", "provenance"]  # fmt: skip
    figures = {attributes["id"] for attributes in Page(html).all("figure")}
    assert figures == {
        f"figure-{n}" for n in ("constancy", "trajectory", "errors", "section", "lyapunov", "convergence", "work")
    }


def test_texts_of_the_spec_stay_texts(html):
    page = Page(html)
    assert [attributes for attributes in page.all("script") if attributes.get("type") != "application/json"] == [{}]
    assert "<script>window" not in html
    assert "javascript:broken" not in str([attributes for _, attributes in page.elements])
    assert any("</title></style></script>" in text for text in page.texts["h1"])
    assert any("{{ 7*7 }}" in text for text in page.texts["p"])


def test_policy_allows_the_own_style_and_scripts_and_nothing_else(html):
    policy = next(g["content"] for g in Page(html).all("meta") if g.get("http-equiv") == "Content-Security-Policy")
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    for tag, rule in (("style", "style-src"), ("script", "script-src")):
        (content,) = re.findall(rf"<{tag}>(.*?)</{tag}>", html, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        assert rules[rule] == f"'sha256-{digest}'"


def test_page_says_how_to_make_it_again(html, page_path):
    assert hashlib.sha256((page_path.parent / "attack.yaml").read_bytes()).hexdigest() in html
    assert "phigen report attack.yaml --lyapunov --quick -o attack.html" in html
    assert str(page_path.parent) not in html


def test_figures_are_named_and_take_their_colours_from_the_page(html):
    for text in re.findall(r"<svg.*?</svg>", html, re.DOTALL):
        assert "<title" in text
        assert "<desc" in text
        assert not re.search(r"#[0-9a-fA-F]{6}", text)
        assert "var(--ink)" in text


def test_measured_times_are_marked(html):
    page = Page(html)
    assert sum("measured" in attributes.get("class", "") for attributes in page.all("td")) > 10
    assert any("measured" in text for text in page.texts["caption"])


# -- systems of every kind, without measurements


BARE = ["pendulum_euler", "poisson_not_hamiltonian", "sir_epidemic"]


@pytest.mark.parametrize("name", slow_but(BARE, [*BARE, "spin_chain5"]))
def test_page_without_measurements_is_sound(name):
    text = bare(compiled(name))
    assert Page(text).errors == []
    assert "<math" in text
    assert len(text.encode()) < 1_000_000


def test_page_of_a_splitting_shows_its_flows():
    compilation = compile_spec(compiled("henon_heiles").spec, scheme="splitting")
    text = bare(compilation)
    assert Page(text).errors == []
    assert "The 29 flows of one step" in text
    assert "Bi-realisation" not in text


def test_without_matplotlib_the_page_says_so_always_in_the_same_way(monkeypatch):
    monkeypatch.setattr(pages, "drawable", lambda: False)
    curve = trajectory(np.eye(3), compiled("rigid_body").system.coordinates)
    run = SimpleNamespace(name="r", every=None, at=(), stride=1, description="")
    text = bare(compiled("rigid_body"), run=run, methods={"phigen": curve}, summaries=(SUMMARY,))
    assert Page(text).errors == []
    assert text == bare(compiled("rigid_body"), run=run, methods={"phigen": curve}, summaries=(SUMMARY,))
    assert "matplotlib was not installed" in text
    assert "viewer-data" in text
    assert "<svg" not in text


def test_a_wrong_statement_stands_out():
    compilation = compiled("rigid_body")
    groups = {"Poisson tensor": (Statement("A <b>", PROVED), Statement("C_1 = 1e-16", CHECKED, "8 points"))}
    text = pages.document(Material(Examination(compilation.spec, groups, compilation), compilation, ""))
    assert "1 of 2" in text
    assert "C<sub>1</sub> = 1·10⁻¹⁶" in text
    assert "A &lt;b&gt;" in text


def test_a_long_spec_is_cut():
    compilation = compiled("rigid_body")
    spec = replace(compilation.spec, source="# <&>" * 100_000)
    text = bare(replace(compilation, spec=spec))
    assert len(text.encode()) < 1_000_000
    assert f"the first {pages.SOURCE} of 500000 characters" in text


# -- parts of the page


@pytest.mark.parametrize(
    ("value", "shown"),
    [(3.14e-8, "3.1·10⁻⁸"), (0, "0"), (5.976, "5.98"), (-2.5e-3, "−2.5·10⁻³"), (1234567.0, "1.2·10⁶"), (0.0123, "0.01"),
     (float("inf"), "∞"), (float("-inf"), "−∞"), (float("nan"), "–"), (-1.5, "−1.50"), (1e-300, "1.0·10⁻³⁰⁰")],
)  # fmt: skip
def test_numbers_to_read(value, shown):
    assert page.scientific(value) == shown


def test_typeset_escapes_and_writes_formulas():
    assert page.typeset("<i> S_1 + t^5 S_5, p_x3**2, 1.6e-13, α_i & a_b") == (
        "&lt;i&gt; S<sub>1</sub> + t<sup>5</sup> S<sub>5</sub>, p<sub>x3</sub><sup>2</sup>, 1.6·10⁻¹³, "
        "α<sub>i</sub> &amp; a<sub>b</sub>"
    )


def test_figure_keeps_no_style_and_has_ids_of_its_own():
    svg = (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" width="9pt" height="9pt">'
        '<metadata>x</metadata><defs><style type="text/css">*{fill:red}</style></defs>'
        '<path id="m" style="stroke: #0072b2"/><g clip-path="url(#c)"><use xlink:href="#m" x="1.23456"/>'
        '<text style="font: italic 9px \'DejaVu\'">a &lt; b</text></g><clipPath id="c"/></svg>'
    )
    text = str(inlined(svg, "one", "A <title>", "what & why"))
    assert not re.search(r"<style| style=", text)
    assert "metadata" not in text
    assert 'stroke="var(--series-1)"' in text
    assert 'id="one-m"' in text
    assert 'href="#one-m"' in text
    assert 'clip-path="url(#one-c)"' in text
    assert 'font-size="9"' in text
    assert 'x="1.23"' in text
    assert "A &lt;title&gt;" in text


def viewer_data(methods, opening=None, casimirs=None):
    text = str(viewer(methods, opening or {}, casimirs or {}))
    return json.loads(re.search(r'id="viewer-data">(.*?)</script>', text)[1])


def test_viewer_holds_the_curve_to_what_a_screen_shows():
    angle = np.linspace(0, 6, 500)
    x = np.column_stack([np.cos(angle), 5 + np.sin(angle), angle])
    data = viewer_data({"a": trajectory(x)})
    low, high = np.array(data["low"]), np.array(data["high"])
    shown = low[:, None] + (high - low)[:, None] * np.array(data["curves"][0]) / data["steps"]
    assert np.max(np.abs(shown[:3].T - x)) < 1e-3
    assert data["axes"] == [0, 1, 2]
    assert data["joined"]


@pytest.mark.parametrize(("dimension", "axes"), [(1, [0, 1, 1]), (2, [0, 1, 2]), (4, [0, 1, 4]), (300, None)])
def test_viewer_is_bounded_and_has_axes_for_every_dimension(dimension, axes):
    names = ("q1", "q2", "p1", "p2") if dimension == 4 else tuple(f"x{i}" for i in range(dimension))
    x = np.random.default_rng(1).normal(size=(20_000 if dimension > 4 else 200, dimension))
    data = viewer_data({"a": trajectory(x, names), "b": trajectory(x, names), "c": trajectory(x, names)})
    assert len(data["curves"]) == 2
    assert sum(len(column) for curve in data["curves"] for column in curve) <= 1.1 * MOST_NUMBERS
    if axes and dimension != 4:
        assert data["axes"] == axes


def test_viewer_shows_the_opening_of_a_run_whose_rows_make_no_line():
    angles = np.linspace(0, 3000, 1000), np.linspace(0, 15, 500)
    far, near = (trajectory(np.column_stack([np.cos(a), np.sin(a), a / 9])) for a in angles)
    data = viewer_data({"a": far}, {"a": near})
    assert data["joined"]
    assert data["high"][2] == pytest.approx(15 / 9)
    assert "first part of the run" in viewer({"a": far}, {"a": near}, {})
    assert "first part of the run" not in viewer({"a": near}, {"a": near}, {})


def test_a_curve_of_the_whole_run_is_not_called_its_first_part():
    angles = np.linspace(0, 3000, 1000), np.linspace(0, 15, 1000)
    far, all_of_it = (trajectory(np.column_stack([np.cos(a), np.sin(a), a / 9])) for a in angles)
    assert viewer_data({"a": far}, {"a": all_of_it})["joined"]
    assert "first part of the run" not in viewer({"a": far}, {"a": all_of_it}, {})


def test_the_picture_is_omitted_if_the_viewer_has_the_same_curve():
    figures = {}
    for name in ("rigid_body", "kepler"):
        coordinates = compiled(name).system.coordinates
        figures[name] = pictures.trajectory_picture(compiled(name), trajectory(np.eye(len(coordinates)), coordinates))
    assert 'class="instead"' in figures["rigid_body"]
    assert "instead" not in figures["kepler"]


def test_viewer_has_the_leaf_around_the_curve():
    system, angle = compiled("rigid_body").system, np.linspace(0, 6, 200)
    x = 2 * np.column_stack([np.cos(angle), 0.6 * np.sin(angle), 0.8 * np.sin(angle)])
    curve = replace(trajectory(x, system.coordinates), parameters={"I1": 1.0, "I2": 2.0, "I3": 3.0})
    data = viewer_data({"a": curve}, casimirs=system.casimirs)
    low, high = np.array(data["low"])[:3], np.array(data["high"])[:3]
    points = np.array([p for p in zip(*data["leaf"], strict=True) if None not in p]) / data["steps"]
    assert len(points) > 500
    assert np.linalg.norm(low + (high - low) * points, axis=1) == pytest.approx(2, abs=2e-3)
    # The bounds contain the whole sphere, which is larger than the curve.
    assert np.max(np.abs([low + 2, high - 2])) < 0.1
    assert viewer_data({"a": curve})["leaf"] is None


def test_viewer_ends_where_a_method_broke_down():
    x = np.ones((10, 3)).cumsum(axis=0)
    broken = np.where(np.arange(10)[:, None] < 4, x, np.nan)
    data = viewer_data({"phigen": trajectory(x), "<rk4>": trajectory(broken)})
    assert [len(curve[0]) for curve in data["curves"]] == [10, 4]
    assert "&lt;rk4&gt;" in viewer({"phigen": trajectory(x), "<rk4>": trajectory(broken)}, {}, {})


def panel_of(name, **more):
    compilation = replace(compiled(name), **more)
    run = next(iter(compilation.spec.runs.values()))
    return compilation, live.gathered(compilation, None, run, compilation.spec.parameters_of(run))


def test_panel_has_the_order_of_the_page_and_lower_ones():
    compilation, panel = panel_of("rigid_body")
    assert list(panel.solvers) == [2, 4, 6]
    assert "/*" not in live.script(panel)
    assert "never leaves the surface drawn here" in live.live_section(compilation, panel)


def test_panel_runs_a_system_without_its_attitude():
    assert panel_of("dzhanibekov")[1].solvers


def test_panel_counts_errors_only_in_what_is_conserved():
    said = {name: str(live.live_section(*panel_of(name))) for name in ("thruster_body", "landau_lifshitz", "pendulum")}
    assert "Nothing is conserved" in said["thruster_body"]
    assert "energy error" not in said["landau_lifshitz"]
    assert "distance from the surface (Casimir length)" in said["landau_lifshitz"]
    assert "the curve drawn here" in said["pendulum"]


def test_page_says_why_it_has_no_panel(monkeypatch):
    monkeypatch.setattr(live, "MOST", 10)
    compilation, panel = panel_of("pendulum")
    assert "There is no live panel: its JavaScript would take more than" in live.live_section(compilation, panel)
    assert live.script(panel) not in bare(compilation, live=panel)


def test_every_lattice_of_the_corpus_without_noise_has_a_panel():
    folder = resources.bundled_specs() / "lattices"
    pages = {path.stem: compile_spec(spec.load(path)) for path in sorted(folder.glob("*.yaml"))}
    for compilation in pages.values():
        run = next(iter(compilation.spec.runs.values()))
        if compilation.spec.noise:
            with pytest.raises(NoPanelError, match="does not apply to systems with noise"):
                panel_page(compilation, run)
        else:
            assert len(panel_page(compilation, run)) < 120_000


def test_modules_become_functions_that_cannot_leave_their_element():
    text = live.enclosed('/**\n * @a\n */\n// b\nexport class Solver {\n  x = "</script><!--";\n}\n')
    assert text.splitlines()[1:4] == ["class Solver {", 'x = "<\\/script><\\!--";', "}"]


def test_no_name_ends_the_data_of_the_viewer():
    text = str(page.data("d", ["</script><script>", "\u2028", "<!--"]))
    assert text.count("<") == 2


# -- colours, templates


def colours():
    return {n: pair for n, *pair in re.findall(r"--([a-z0-9-]+): light-dark\((#\w{6}), (#\w{6})\)", CSS)}


def luminance(colour):
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
@pytest.mark.parametrize("ground", ["paper", "raised"])
def test_texts_and_curves_have_contrast(theme, ground):
    palette = colours()
    for name in set(palette) - {"paper", "raised", "grid", "leaf"}:
        a, b = sorted((luminance(palette[n][theme]) for n in (name, ground)), reverse=True)
        assert (a + 0.05) / (b + 0.05) >= 4.5, name


def test_page_has_a_variable_for_every_colour_of_the_figures():
    assert set(PALETTE) <= set(colours())


@pytest.mark.parametrize("name", sorted(p.name for p in ASSETS.iterdir() if p.suffix in (".css", ".js")))
def test_assets_cannot_leave_their_elements(name):
    text = (ASSETS / name).read_text(encoding="utf-8")
    assert "</" not in text
    assert "<!--" not in text
    assert "http" not in text
    assert "innerHTML" not in text


def test_templates_escape():
    assert page._environment().autoescape
    assert page.paragraph("<script>") == '<p class="">&lt;script&gt;</p>'
