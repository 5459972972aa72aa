"""Captions of the live panel, run in Node, compared with the errors of every step, over the corpus."""

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
from phigen.resources import bundled_specs, templates
from phigen.spec import load

#: Those whose JavaScript takes less than a second to make, of every kind of step; the others are slow.
QUICK = ("kepler", "lotka_volterra", "rigid_body", "duffing", "landau_lifshitz", "kepler_eccentric", "vortices3")
QUICK_LATTICES = ("fput", "outer_planets", "point_vortices", "food_web", "heisenberg_plane")
#: Errors below this are rounding, which the panel does not compare.
ROUNDING = 1e-13

#: A race of both methods without a browser: the errors of each step, and the sentence about them.
RACE = """
const inSpace = () => ({}), freshView = () => ({});
const data = DATA;
const panel = {
  at: () => ({}), data, sides: ["ours", "theirs"], ink: () => "", colour: () => "", draw: () => {},
  tried: () => { throw Error("not here"); }, shortened: (v) => Number(v.toPrecision(4)),
};
const view = makeView(panel), params = {};
for (const { name, value } of data.parameters) params[name] = value;
const sites = data.sizes ? 0 : undefined;
export const raced = (h, parts, steps) => {
  const given = { h, order: data.order, parts, params, start: data.start, sites, group: 0 };
  const race = view.begin(liveSolvers[data.order](), given), errors = { ours: [], theirs: [] };
  const late = performance.now() + 4000;
  for (const side of ["ours", "theirs"]) {
    for (let k = 0; k < steps && !race[side].failed && performance.now() < late; k++) {
      race[side].step();
      if (!race[side].failed) errors[side].push(race[side].histories.map(({ last }) => last));
    }
  }
  const observed = [...view.observed(race.ours)].length, names = race.groups.map(({ name }) => name);
  return { ...errors, failed: race.theirs.failed, said: whereRk4IsCloser(race), names, observed };
};
"""


@pytest.fixture(scope="module")
def raced(tmp_path_factory):
    """Race the methods of a panel: errors by method, and what is said."""
    folder = tmp_path_factory.mktemp("captions")

    def race(compilation, run, share, parts, steps=120):
        given = compilation.spec
        if given.lattice:
            live = gathered_lattice(compilation.by_sweeps(), None, run, start_of(given, run), ())
            code, names = lattice_script(live), FIELDS[:2]
            section = lattice_live_section(compilation.by_sweeps(), live)
        else:
            live = gathered(compilation, None, run, given.parameters_of(run), ())
            code, names, section = script(live), CURVES[:2], live_section(compilation, live)
        if not live.solvers:
            pytest.skip(f"it has no panel: {live.why_not}")
        data = re.search(r'id="live-data"[^>]*>(.*?)</script>', section, re.DOTALL)[1]
        sources = [(templates() / "report" / name).read_text(encoding="utf-8") for name in names]
        path = folder / f"{given.name}.mjs"
        path.write_text("\n".join([*sources, code, RACE.replace("DATA", data)]))
        told = asked(path, f"return module.raced({float(run.step) * share}, {parts}, {steps})")
        return told, re.search(r'<p class="say">(.*?)</p>', section)[1]

    return race


def halves(errors, k):
    values = [row[k] for row in errors]
    return max(values[: len(values) // 2], default=0.0), max(values[len(values) // 2 :], default=0.0)


def expect_true(told, say):
    """What is said is what the errors are."""
    sentences = told["said"].rstrip(".").split("; ") if told["said"] else []
    for k, name in enumerate(told["names"]):
        (begin, ours), (rk4_begin, theirs) = halves(told["ours"], k), halves(told["theirs"], k)
        closer = not told["failed"] and theirs < ours and ours >= ROUNDING
        said = [s for s in sentences if s.startswith(f"{name}: ")]
        assert len(said) == closer, (name, ours, theirs)
        for sentence in said:
            grows = ours <= 1.2 * begin and theirs > 1.5 * rk4_begin
            assert ("its error grows while that of phigen does not" in sentence) == grows
        if "Casimir" in name:
            assert ("surface" in say) or ("Casimirs" in say)
            assert ours < 1e-9
    assert len(told["ours"]) > 10
    if told["names"]:
        assert told["ours"][-1][0] < 1  # the panel is about a motion that phigen follows
    else:
        assert "Nothing is conserved" in say


@pytest.mark.parametrize("name", slow_but(QUICK))
@pytest.mark.parametrize(("share", "parts"), [(1, 1), (0.25, 3)])
def test_captions_of_systems_are_not_refuted_by_their_numbers(raced, name, share, parts):
    compilation = compiled(name)
    told, say = raced(compilation, first_run(compilation), share, parts)
    expect_true(told, say)
    assert told["observed"] == len(spec_of(name).observables)


@pytest.mark.parametrize("name", slow_but(QUICK_LATTICES, LATTICES))
def test_captions_of_lattices_are_not_refuted_by_their_numbers(raced, name):
    given = load(bundled_specs() / "lattices" / f"{name}.yaml")
    told, say = raced(compile_spec(given), next(iter(given.runs.values())), 1, 2, 60)
    expect_true(told, say)
