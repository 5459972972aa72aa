"""Captions of the live panel, executed in Node for the systems of the corpus: they agree with the errors of
each step.
"""

from __future__ import annotations

import re

import pytest
from node import asked
from systems import LATTICES, compiled, first_run, slow_but, spec_of

from phigen.compiler import compile_spec
from phigen.lattice.states import start_of
from phigen.report.live import gathered, live_section, script
from phigen.report.live_lattice import gathered_lattice, lattice_live_section, lattice_script
from phigen.report.page import CURVES, FIELDS
from phigen.resources import bundled_specs, file_of, templates
from phigen.spec import load

#: Systems with every kind of step whose JavaScript is made in less than a second. The other systems are slow.
QUICK = ("kepler", "lotka_volterra", "rigid_body", "duffing", "landau_lifshitz", "kepler_eccentric", "vortices3")
QUICK_LATTICES = ("fput", "outer_planets", "point_vortices", "food_web", "heisenberg_plane")
#: Errors below this are rounding, which the panel does not compare.
ROUNDING = 1e-13

#: JavaScript that makes steps of phigen and of RK4 without a browser. It returns the errors of each step, and the
#: caption about them.
RACE = """
const inSpace = () => ({}), freshView = () => ({});
const data = DATA, params = {}, made = {};
for (const { name, value } of data.parameters) params[name] = value;
const sites = data.sizes ? 0 : undefined;
const standard = { h: data.step, order: data.order, parts: 1, params, start: data.start, sites, group: 0 };
const shortened = (v) => Number(v.toPrecision(4));
const begin = (given) => view.begin(made[given.order] ??= liveSolvers[given.order](), given);
const view = makeView({
  at: () => ({}), data, sides: ["ours", "theirs"], ink: () => "", colour: () => "", draw: () => {},
  tried: (...given) => start.tried(...given), shortened,
});
let start = makeStart({ data, begin, view, shortened, milliseconds: { ours: 60, all: 400 } });
// The settings with which the panel begins in a browser that has no time for trials.
const hurry = { ours: 0, all: 0 };
export const hurried = () => makeStart({ data, begin, view, shortened, milliseconds: hurry }).showing(standard);
export const lacking = () => Object.keys(data).filter((name) => data[name] === null).sort();
// Make steps with the step size h and `parts` steps of RK4 for each. Without h, begin as the panel does, without limits
// of time and, unless `parts` is 0, with this number of steps of RK4.
export const raced = (h, parts, steps) => {
  if (!h && parts) {
    start = makeStart({ data, begin, view, shortened, milliseconds: { ours: 1e4, all: 1e5 }, costOf: () => parts });
  }
  const given = { ...standard, ...(h ? { h, parts } : start.showing(standard)) };
  if (!h) given.parts = start.partsOf(given);
  const race = begin(given), errors = { ours: [], theirs: [] };
  const late = performance.now() + 4000;
  for (const side of ["ours", "theirs"]) {
    for (let k = 0; k < steps && !race[side].failed && performance.now() < late; k++) {
      race[side].step();
      if (!race[side].failed) errors[side].push(race[side].histories.map(({ last }) => last));
    }
  }
  const observed = [...view.observed(race.ours)].length, names = race.groups.map(({ name }) => name);
  const { order, parts: of } = given, begins = { order, parts: of, share: given.h / data.step };
  return { ...errors, failed: race.theirs.failed, said: whereRk4IsCloser(race), names, observed, begins };
};
"""


@pytest.fixture(scope="module")
def raced(tmp_path_factory):
    """Return a function that makes the steps of phigen and of RK4 in the panel of a run. It returns the errors of each
    step with the captions, and the text above the panel.
    """
    folder = tmp_path_factory.mktemp("captions")

    def race(compilation, run, share, parts, steps=120):
        specification = compilation.spec
        if specification.lattice:
            live = gathered_lattice(compilation.by_sweeps(), None, run, start_of(specification, run), ())
            code, names = lattice_script(live), FIELDS[:-1]
            section = lattice_live_section(compilation.by_sweeps(), live)
        else:
            live = gathered(compilation, None, run, specification.parameters_of(run), ())
            code, names, section = script(live), CURVES[:-1], live_section(compilation, live)
        if not live.solvers:
            pytest.skip(f"the system has no panel: {live.why_not}")
        data = re.search(r'id="live-data"[^>]*>(.*?)</script>', section, re.DOTALL)[1]
        sources = [(templates() / "report" / name).read_text(encoding="utf-8") for name in names]
        path = folder / f"{specification.name}.mjs"
        path.write_text("\n".join([*sources, code, RACE.replace("DATA", data)]))
        race.path = path
        race_result = asked(path, f"return module.raced({float(run.step) * share}, {parts}, {steps})")
        return race_result, re.search(r'<p class="say">(.*?)</p>', section)[1]

    return race


def halves(errors, k):
    values = [row[k] for row in errors]
    return max(values[: len(values) // 2], default=0.0), max(values[len(values) // 2 :], default=0.0)


def expect_true(race_result, say):
    """Assert that the captions and the text ``say`` above the panel agree with the errors."""
    sentences = race_result["said"].rstrip(".").split("; ") if race_result["said"] else []
    for k, name in enumerate(race_result["names"]):
        (begin, ours), (rk4_begin, theirs) = halves(race_result["ours"], k), halves(race_result["theirs"], k)
        closer = not race_result["failed"] and theirs < ours and ours >= ROUNDING
        said = [s for s in sentences if s.startswith(f"{name}: ")]
        assert len(said) == closer, (name, ours, theirs)
        for sentence in said:
            grows = ours <= 1.2 * begin and theirs > 1.5 * rk4_begin
            assert ("its error grows while that of phigen does not" in sentence) == grows
        if "Casimir" in name:
            assert ("surface" in say) or ("Casimirs" in say)
            assert ours < 1e-9
    assert len(race_result["ours"]) > 10
    if race_result["names"]:
        assert race_result["ours"][-1][0] < 1  # phigen must be able to follow the motion
    else:
        assert "Nothing is conserved" in say


@pytest.mark.parametrize("name", slow_but(QUICK))
@pytest.mark.parametrize(("share", "parts"), [(0, 0), (0.25, 3)])  # 0: the settings with which the panel begins
def test_captions_of_systems_are_not_refuted_by_their_numbers(raced, name, share, parts):
    compilation = compiled(name)
    race_result, say = raced(compilation, first_run(compilation), share, parts)
    expect_true(race_result, say)
    assert race_result["observed"] == len(spec_of(name).observables)


@pytest.mark.parametrize("name", slow_but(QUICK_LATTICES, LATTICES))
def test_captions_of_lattices_are_not_refuted_by_their_numbers(raced, name):
    specification = load(bundled_specs() / "lattices" / f"{name}.yaml")
    race_result, say = raced(compile_spec(specification), next(iter(specification.runs.values())), 0, 0, 60)
    expect_true(race_result, say)


def test_panel_begins_where_rk4_is_farther_off(raced):
    """With the order and the step of the run the errors of both methods are small. The panel begins with a larger step,
    for which the errors of RK4 are large.
    """
    compilation = compiled("henon_heiles")
    run = first_run(compilation)
    race_result, _ = raced(compilation, run, 1, 3)
    assert max(row[0] for row in race_result["theirs"]) < 1e-5
    race_result, _ = raced(compilation, run, 0, 2, 300)
    assert race_result["begins"]["share"] >= 4
    assert max(row[0] for row in race_result["ours"]) < 0.03
    assert race_result["failed"] or race_result["theirs"][-1][0] > 2 * race_result["ours"][-1][0]
    assert race_result["said"] == ""


def test_panel_begins_with_the_step_of_the_run_where_there_is_no_time_for_trials(raced):
    compilation = compiled("kepler")
    run = first_run(compilation)
    raced(compilation, run, 1, 1, 1)
    setting = asked(raced.path, "return module.hurried()")
    assert (setting["h"], setting["order"]) == (float(run.step), compilation.order.order)
    assert setting["speed"] > 0


@pytest.mark.parametrize(
    ("name", "lacking"),
    [("kepler", ["site", "sizes", "t0"]), ("fput", ["bonds", "places", "t0"]), ("food_web", ["t0"])],
)
def test_data_of_the_panel_have_null_for_what_a_system_lacks(raced, name, lacking):
    specification = load(file_of(name))
    raced(
        compile_spec(specification) if specification.lattice else compiled(name),
        next(iter(specification.runs.values())),
        1,
        1,
        1,
    )
    assert asked(raced.path, "return module.lacking()") == lacking
