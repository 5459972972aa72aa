"""Pullbacks of runs of lattices, compared with differences, with arithmetic in many digits and with one another."""

import os
import signal
import threading
from functools import cache

import mpmath
import numpy as np
import pytest
from lattice.lattices import LATTICES as SPECS
from lattice.lattices import with_threads
from support import precisely

import phigen
from phigen import SpecError, StepError
from phigen.compiler import compile_spec
from phigen.lanes.in_lanes import in_lanes
from phigen.resources import bundled
from phigen.runtime import c_lattice
from phigen.scheme.sweep_inverse import can_recompute_fields, transposes
from phigen.symbolic.expression import topological

H, STEPS, SITES = 0.05, 4, 6
RING = {"bonds": np.array([[i, (i + 1) % SITES] for i in range(SITES)] + [[0, 2]])}

#: Lattices by name: kicks, open ends with parameters at sites, several sweeps of one part, colours, graphs, pairs; then
#: the scheme series.
LATTICES = {
    "fput": {},
    "xxz_disorder": {"B": 0.5 + np.arange(SITES) / 7},
    "kdv": {"d": 1.3},
    "food_web": RING | {"A": 0.4 + np.arange(7) / 9, "k": 0.3 + np.arange(SITES) / 8},
    "chiral_magnet": RING | {"D": 0.6, "Dx": 0.3 - np.arange(7) / 9, "Dy": 0.4 + np.arange(7) / 8},
    "outer_planets": {"G": 1.0, "m": 0.1 + np.arange(SITES) / 20},
    "spin_graph series": RING | {"J": 0.4 + np.arange(7) / 9, "D": 0.6},
    "point_vortices": {"G": 0.9 - np.arange(SITES) / 4},
    "xxz_disorder series": {"B": 0.5 + np.arange(SITES) / 7},
}


#: A lattice with forces, phases at sites, and coefficients that depend on the time.
DRIVEN = """phigen: 1
name: driven
time: t
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
parameters: {w: 1.3, A: 0.3, damp: 0.4, phase: {value: 0.3, at: sites}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + (1 + A*cos(w*t + phase))*(q[i+1] - q)**2/2 + A*q**4
forces: {vector: {p: -damp*p}}
"""
#: A lattice without neighbours; only the derivatives along parameters call sin of large arguments.
SWUNG = DRIVEN.replace("driven", "swung").replace(
    "(1 + A*cos(w*t + phase))*(q[i+1] - q)**2/2", "cos(q)*cos(w*t + phase)"
)
LATTICES["swung"] = LATTICES["swung series"] = {"w": 1.2, "phase": 2.0 + np.arange(SITES) / 5}
LATTICES["driven"] = LATTICES["driven composed"] = {"w": 1.2, "A": 0.35, "phase": 0.2 + np.arange(SITES) / 5}
#: Damped spins; the damping flow is not proportional to the fields that it updates.
RELAXING = """phigen: 1
name: relaxing
lattice: {axes: [i], boundary: periodic}
coordinates: [x, y, z]
parameters: {a: 0.1}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: -x*x[i+1] - y*y[i+1] - z
damping: a
"""
#: Springs along two axes: the ends of a spring sum the cotangents of other springs, and there are terms other than
#: springs.
MEMBRANE = """phigen: 1
name: membrane
lattice: {axes: [i, j], boundary: periodic}
coordinates: [q, p]
parameters: {a: 0.7, b: 1.3}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + a*(q[i+1] - q)**4/4 + b*(q[i+1, j+1] - q)**2/2 - cos(q[j+1] - 2*q)
"""
#: Parameters with the names of local variables of generated loops.
NAMED = """phigen: 1
name: named
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
parameters:
  {l: {value: 1, at: sites}, whole: {value: 1, at: sites}, share0: {value: 1.1, at: sites}, apart: 0.7, j: 1}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: apart*p**2/2 + l*(q[i+1] - q)**2/2 + share0*whole*q**4 + j*cos(q)
"""
#: Pairs whose sums at the two sites differ by a sign, are equal, or are unrelated; parameters have the names of local
#: variables of loops.
PAIRED = """phigen: 1
name: paired
lattice: {pairs: all}
coordinates: [q, p, r, s]
parameters: {own0: 0.7, first: {value: 1, at: sites}}
order: 2
poisson: {canonical: {q: [q, r], p: [p, s]}}
hamiltonian:
  sites: (p**2 + s**2)/2 + cos(q)
  pairs: own0*(cos(q[a] - q[b]) + first[a]*first[b]*sin(r[a] + r[b]))/4
"""
#: Forces of bonds that the reverse pass recomputes, with parameters that depend on the direction of bonds.
SPRINGS = """phigen: 1
name: springs
lattice: {graph: bonds}
coordinates: [q, p]
parameters: {k: {value: 1, at: bonds}, d: {value: 0.1, at: bonds}, c: 0.3}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: {sites: p**2/2 + c*q**4, bonds: "c*k*(q[b] - q[a] - d)**2/2"}
"""
#: Rotations about axes that are sums over pairs: the cotangents read these sums, and the sums read the spins of the
#: other sites only.
MEAN_FIELD = """phigen: 1
name: mean_field
lattice: {pairs: all}
coordinates: [x, y, z]
parameters: {J: 0.3, B: {value: 1, at: sites}}
order: 2
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: {sites: B*z, pairs: "J*(x[a]*x[b] + y[a]*y[b] + z[a]*z[b]/2)"}
"""
LATTICES["springs fast"] = RING | {"k": 0.4 + np.arange(7) / 9, "d": np.arange(7) / 20, "c": 0.4}
LATTICES["named fast"] = {"l": 0.3 + np.arange(SITES) / 5, "whole": 1.2, "j": 0.4}
#: A graph with colours, disorder at bonds and sites, and coefficients of bonds that depend on the time.
DRIVEN_GRAPH = """phigen: 1
name: driven_graph
time: t
lattice: {graph: bonds}
coordinates: [x, y, z]
parameters: {J: {value: 1, at: bonds}, B: {value: 0.3, at: sites}, D: 0.4, w: 1.3}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian:
  sites: -(1 + D*sin(w*t))*B*z
  bonds: -J*cos(w*t)*(x[a]*x[b] + y[a]*y[b] + z[a]*z[b]) - D*(x[a]*y[b] - y[a]*x[b])
"""
LATTICES["driven_graph"] = RING | {"J": 0.4 + np.arange(7) / 9, "B": 0.5 + np.arange(SITES) / 7, "w": 1.2}
#: Forces of bonds that do not read the fields which they update, and forces at sites with small-argument functions.
ROTORS = """phigen: 1
name: rotors
lattice: {graph: bonds}
coordinates: [q, p]
parameters: {J: {value: 1, at: bonds}, m: {value: 1, at: sites}, g: 0.3}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: {sites: p**2/2/m - g*cos(q), bonds: "-J*cos(q[a] - q[b])"}
"""
LATTICES["rotors fast"] = RING | {"J": 0.4 + np.arange(7) / 9, "m": 0.5 + np.arange(SITES) / 7}
OWN = {
    "driven_graph": DRIVEN_GRAPH,
    "rotors": ROTORS,
    "driven": DRIVEN,
    "relaxing": RELAXING,
    "swung": SWUNG,
    "named": NAMED,
    "membrane": MEMBRANE,
    "paired": PAIRED,
    "springs": SPRINGS,
    "mean_field": MEAN_FIELD,
    "mixed": PAIRED.replace("paired", "mixed").replace("sin(r[a] + r[b])", "r[a]*r[b]"),
    "far_open": SPECS["far_open"],
    "spin_graph": SPECS["spin_graph"],
}


#: Lattices that are tested in C, with their sizes: time and forces, colours, open ends along two axes with parameters
#: of neighbours; a graph with colours and parameters at bonds, pairs; the series with several stages, of a graph and of
#: pairs.
IN_C = {"driven": SITES, "volterra": SITES, "far_open": (4, 3), "food_web": SITES, "outer_planets": SITES}
IN_C |= {"heisenberg_plane fast": (3, 19), "heisenberg fast": (2, 3, 11), "dnls fast": 11}
IN_C |= {"heisenberg_plane small": (4, 6), "chiral_magnet small": SITES, "driven_graph": SITES, "rotors fast": SITES}
IN_C["ablowitz_ladik fast"] = IN_C["relaxing"] = SITES
IN_C |= {
    "membrane fast": (5, 6),
    "named fast": SITES,
    "swung": SITES,
    "swung series": SITES,
    "driven composed": SITES,
    "far_open series": (4, 3),
    "chiral_magnet series": SITES,
    "point_vortices": SITES,
    "paired fast": 11,
    "mixed series": 11,
    "springs fast": SITES,
    "mean_field": 11,
}
SLOW = ("volterra", "far_open series", "relaxing")

HOW = {"series": {"scheme": "series", "order": 2}, "composed": {"scheme": "series", "order": 4}}
HOW |= {profile: {"profile": profile} for profile in ("small", "fast")}


@cache
def made(name, target="numpy"):
    lattice, *how = name.split()
    more = HOW.get(" ".join(how), {})
    more |= {"tangent": target == "c"}
    spec = phigen.spec.loads(OWN[lattice]) if lattice in OWN else lattice
    return phigen.compile(spec, target=target, adjoint=True, **more)


def beginning(solver, sizes=SITES):
    """Return a start in which all sites differ, with planets and vortices far from one another."""
    shape = np.empty((len(solver.interface.coordinates), *np.atleast_1d(sizes))).shape
    x = 0.3 + 0.5 * np.random.default_rng(3).random(shape)
    if solver.interface.name in ("outer_planets", "point_vortices"):
        x[0] += 3 * np.arange(SITES)
    return x


def arguments(solver, parameters):
    """Return the parameters and the start time of a run."""
    return {"parameters": parameters} | ({"t0": 0.7} if solver.interface.time else {})


def difference(f, width=1e-3):
    """Return the derivative of f at 0, by central differences of order 6."""
    return sum(w * (f(k * width) - f(-k * width)) for k, w in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))) / width


def numbers(solver, parameters):
    """Return all parameters except the bonds, as arrays of the given values or of defaults."""
    return {name: np.asarray(parameters.get(name, value)) for name, value in solver.interface.parameters.items()}


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", LATTICES)
def test_pullback_is_the_gradient_of_the_run(name):
    """Compare along random directions of the state and of each parameter, with a cotangent of every frame."""
    solver, parameters, random = made(name), LATTICES[name], np.random.default_rng(5)
    x = beginning(solver)
    bar = random.normal(size=(3, *x.shape))
    frames, x0_bar, parameters_bar = solver.pullback(x, H, STEPS, bar, 2, **arguments(solver, parameters))
    run = solver.integrate(x, H, STEPS, 2, **arguments(solver, parameters)).x
    assert frames == pytest.approx(run, abs=1e-14) if " " in name else np.array_equal(frames, run)

    def weighed(x, **changed):
        return np.sum(bar * solver.integrate(x, H, STEPS, 2, **arguments(solver, {**parameters, **changed})).x)

    along = random.normal(size=x.shape)
    slope = difference(lambda e: weighed(x + e * along))
    assert np.sum(x0_bar * along) == pytest.approx(slope, rel=1e-8)
    for parameter, value in numbers(solver, parameters).items():
        along = random.normal(size=value.shape)
        width = 1e-3 * min(1.0, float(np.min(np.abs(value))) or 1.0)
        slope = difference(lambda e, n=parameter, v=value, a=along: weighed(x, **{n: v + e * a}), width)
        assert parameters_bar[parameter].shape == value.shape
        assert np.sum(parameters_bar[parameter] * along) == pytest.approx(slope, rel=1e-7, abs=1e-9), parameter


@precisely
def precise_end(x, alpha, beta, bar, module):
    """Return the product of the last state of an FPUT ring with ``bar``, computed by drifts and kicks in many
    digits.
    """
    q, p = [list(row) for row in x]
    for _ in range(STEPS):
        for part, row in module.SCHEDULE:
            t = mpmath.mpf(module.TIMES[row]) * mpmath.mpf(H)
            if module.PARTS[part][0].__name__ == module.DRIFT:
                q = [a + t * b for a, b in zip(q, p, strict=True)]
                continue
            r = [q[(i + 1) % SITES] - q[i] for i in range(SITES)]
            force = [s + alpha * s**2 + beta * s**3 for s in r]
            p = [b + t * (force[i] - force[i - 1]) for i, b in enumerate(p)]
    return mpmath.fdot([*bar[0], *bar[1]], [*q, *p])


@precisely
def test_gradient_agrees_with_many_digits():
    solver = phigen.compile("fput", target="numpy", adjoint=True, order=2)
    module, x = solver.backend._module, beginning(solver)
    assert not hasattr(module, "MULTIPLES")
    ones = np.ones((2, SITES))
    moved = module.PARTS[0][0]([0.1] * 9, ones, module._Sites(ones.shape, {}))
    module.DRIFT = module.PARTS[int(moved[0, 0] == 1.0)][0].__name__
    bar = np.random.default_rng(7).normal(size=x.shape)
    _, x0_bar, parameters_bar = solver.pullback(x, H, STEPS, bar, alpha=0.3, beta=0.8)
    width = mpmath.mpf(10) ** -12

    def slope(f):
        return (f(width) - f(-width)) / (2 * width)

    start = [[mpmath.mpf(v) for v in row] for row in x]

    def at(place, e):
        return [[v + e * (place == (k, i)) for i, v in enumerate(row)] for k, row in enumerate(start)]

    for place in np.ndindex(x.shape):
        exact = slope(lambda e, p=place: precise_end(at(p, e), mpmath.mpf(0.3), mpmath.mpf(0.8), bar, module))
        assert abs(x0_bar[place] - exact) <= 1e-14 * np.abs(x0_bar).max()
    exact = slope(lambda e: precise_end(start, 0.3 + e, mpmath.mpf(0.8), bar, module))
    assert abs(parameters_bar["alpha"] - exact) <= 1e-14 * abs(exact)
    exact = slope(lambda e: precise_end(start, mpmath.mpf(0.3), 0.8 + e, bar, module))
    assert abs(parameters_bar["beta"] - exact) <= 1e-14 * abs(exact)


def test_long_runs_are_pulled_back_in_segments(monkeypatch):
    solver, x = made("fput"), beginning(made("fput"))
    bar = np.random.default_rng(8).normal(size=(4, *x.shape))
    whole = solver.pullback(x, H, 23, bar, 9)
    monkeypatch.setattr(solver.backend._module, "MAX_TAPE", 5 * x.size)
    part = solver.pullback(x, H, 23, bar, 9)
    assert all(np.array_equal(a, b) for a, b in zip(whole[:2], part[:2], strict=True))
    assert whole.parameters_bar == part.parameters_bar


def test_members_and_their_disorder_have_cotangents():
    solver = made("xxz_disorder")
    x, random = beginning(solver), np.random.default_rng(9)
    many, disorder = x + 0.1 * random.random((3, *x.shape)), random.random((3, SITES))
    bar, strengths = random.normal(size=many.shape), np.array([0.8, 1.0, 1.2])
    x1, x0_bar, parameters_bar = solver.pullback(many, H, STEPS, bar, B=disorder, J=strengths, delta=0.7)
    each = [solver.pullback(many[m], H, STEPS, bar[m], B=disorder[m], J=strengths[m], delta=0.7) for m in range(3)]
    assert np.array_equal(x1, [e.x1 for e in each])
    assert np.array_equal(x0_bar, [e.x0_bar for e in each])
    assert np.array_equal(parameters_bar["B"], [e.parameters_bar["B"] for e in each])
    assert np.array_equal(parameters_bar["J"], [e.parameters_bar["J"] for e in each])
    assert parameters_bar["delta"] == pytest.approx(sum(e.parameters_bar["delta"] for e in each), rel=1e-14)
    assert solver.pullback(x, H, 0, bar[0], B=0.5).parameters_bar["B"] == 0.0
    steps = np.array([0.5, 1.0, -1.5]) * H
    one = solver.pullback(x, steps, STEPS, bar, B=0.5)
    alone = [solver.pullback(x, steps[m], STEPS, bar[m], B=0.5) for m in range(3)]
    assert np.array_equal(one.x1, [e.x1 for e in alone])
    assert np.array_equal(one.x0_bar, [e.x0_bar for e in alone])
    with pytest.raises(TypeError, match="'B' must be real"):
        solver.pullback(x, H, 1, bar[0], B=1j * disorder[0])


def test_lattices_may_have_no_members_to_pull_back():
    solver, none = made("xxz_disorder"), np.empty((0, 3, SITES))
    x1, x0_bar, parameters_bar = solver.pullback(none, H, STEPS, none, B=np.ones(SITES), J=np.empty(0))
    assert (x1.shape, x0_bar.shape) == (none.shape, none.shape)
    assert [parameters_bar[name].shape for name in ("B", "J", "delta")] == [(SITES,), (0,), ()]


def weighed_tangents(solver, x, bar, stride, parameters):
    """Return the derivatives of Σ bar·frames along some directions of the start, computed by tangent vectors, and the
    directions.
    """
    along = np.random.default_rng(6).normal(size=(2, *x.shape))
    products = np.array([np.sum(bar[0] * v) for v in along])
    run = solver.tangents(x, H, STEPS + 1, along, stride, **arguments(solver, parameters))
    for weights, (_, carried) in zip(bar[1:], run, strict=True):
        products += [np.sum(weights * v) for v in carried]
    return products, along


@pytest.mark.thin(3)
@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in IN_C])
def test_c_pulls_back_what_numpy_does_and_tangent_vectors_say(name):
    solver, numpy, random = made(name, "c"), made(name), np.random.default_rng(5)
    x = beginning(solver, IN_C[name])
    at_sites = {p: 1 + random.random(x.shape[1:]) for p in solver.interface.at_sites}
    bar, parameters = (
        random.normal(size=(4, *x.shape)),
        LATTICES.get(name, LATTICES.get(name.partition(" ")[0], at_sites)),
    )
    frames, x0_bar, parameters_bar = solver.pullback(x, H, STEPS + 1, bar, 2, **arguments(solver, parameters))
    assert np.array_equal(frames, solver.integrate(x, H, STEPS + 1, 2, **arguments(solver, parameters)).x)
    expected = numpy.pullback(x, H, STEPS + 1, bar, 2, **arguments(solver, parameters))
    assert x0_bar == pytest.approx(expected.x0_bar, rel=1e-13, abs=1e-13)
    for parameter, value in expected.parameters_bar.items():
        assert parameters_bar[parameter] == pytest.approx(value, rel=1e-12, abs=1e-13), parameter
    slopes, along = weighed_tangents(solver, x, bar, 2, parameters)
    assert [np.sum(x0_bar * v) for v in along] == pytest.approx(slopes, rel=1e-12)


@pytest.mark.parametrize(("name", "scale"), [("toda fast", 1), ("toda fast", 30), ("rotors fast", 30)])
def test_functions_go_back_by_what_is_for_small_arguments_or_for_any(name, scale):
    in_c, numpy, random = (*(made(name, target) for target in ("c", "numpy")), np.random.default_rng(5))
    x, bar = beginning(in_c) * [[1], [scale]], random.normal(size=(2, SITES))
    small_argument, expected = (
        solver.pullback(x, H, STEPS, bar, parameters=LATTICES.get(name, {})) for solver in (in_c, numpy)
    )
    assert small_argument.x0_bar == pytest.approx(expected.x0_bar, rel=1e-12, abs=1e-12)


def test_fields_before_sweeps_are_found_again():
    """The reverse pass recomputes them by inverse flows, so that they are not stored: rotations and scalings at each
    site, along bonds and of pairs, and damping by forces.
    """
    for name in ("ablowitz_ladik", "volterra", "chiral_magnet", "food_web", "outer_planets", "driven", "relaxing"):
        spec = phigen.spec.loads(OWN[name]) if name in OWN else phigen.spec.load(bundled()[name])
        program = compile_spec(spec, adjoint=True).program
        assert can_recompute_fields(program, program.step), name


def test_derivatives_that_transposes_call_have_the_short_way_of_their_functions():
    spec = phigen.spec.load(bundled()["ablowitz_ladik"])
    rows = in_lanes(compile_spec(spec, adjoint=True, profile="fast").program)
    assert {"sinroot", "sinroot1"} <= {*rows.small_argument} == {*rows.limited}


def test_functions_of_what_sweeps_keep_are_called_once_on_the_way_back():
    """|ψ|² determines the rotation of a phase, and a flow does not change it, so the reverse pass needs one
    evaluation.
    """
    program = compile_spec(phigen.spec.load(bundled()["dnls"]), adjoint=True).program
    called = [
        sum(e.op in ("sin", "versin", "cos") for e in topological(kernel.roots))
        for part in transposes(program, program.step)
        for kernel in part
    ]
    assert sorted(called) == [0, 0, 2]


UNSTABLE = """phigen: 1
name: unstable
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
parameters: {k: 9}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - k*q**2/2 + (q[i+1] - q)**2/8
"""


#: Fields that grow fast, along the bonds of a graph.
UNSTABLE_GRAPH = """phigen: 1
name: unstable
lattice: {graph: bonds}
coordinates: [q, p]
parameters: {k: 9}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: {sites: p**2/2 - k*q**2/2, bonds: "(q[a] - q[b])**2/8"}
"""


@pytest.mark.thin(2)
@pytest.mark.parametrize(("text", "parameters"), [(UNSTABLE, {}), (UNSTABLE_GRAPH, RING)], ids=["grid", "graph"])
def test_sweeps_are_undone_over_single_steps_where_fields_grow_fast(text, parameters):
    """Fields grow by a factor of 1e15 in 40 steps: the last state has lost all digits of the first one."""
    spec, random = phigen.spec.loads(text), np.random.default_rng(8)
    in_c, numpy = (phigen.compile(spec, target=target, adjoint=True) for target in ("c", "numpy"))
    x, bar = random.normal(size=(2, 2, SITES))
    in_c_result, expected = (solver.pullback(x, 0.3, 40, bar, parameters=parameters) for solver in (in_c, numpy))
    assert in_c_result.x0_bar == pytest.approx(expected.x0_bar, rel=1e-12)
    assert in_c_result.parameters_bar["k"] == pytest.approx(expected.parameters_bar["k"], rel=1e-12)


#: Velocities decrease by a factor of 1e7 in a step, so that the inverse flow loses their digits; along one axis, and
#: along bonds.
DAMPED = """phigen: 1
name: damped
time: t
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
parameters: {g: 60, a: {value: 0.3, at: sites}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + (q[i+1] - q)**2/2 + q**4/4 - a*q*cos(t)
forces: {vector: {p: -g*p}}
order: 2
"""
DAMPED_GRAPH = (
    DAMPED.replace("axes: [i], boundary: periodic", "graph: bonds")
    .replace("time: t\n", "")
    .replace(
        "p**2/2 + (q[i+1] - q)**2/2 + q**4/4 - a*q*cos(t)", '{sites: p**2/2 + a*q**4/4, bonds: "(q[a] - q[b])**2/2"}'
    )
)


@pytest.mark.thin(2)
@pytest.mark.parametrize(("text", "parameters"), [(DAMPED, {}), (DAMPED_GRAPH, RING)], ids=["grid", "graph"])
def test_flows_of_a_step_are_made_anew_where_velocities_are_damped_away(text, parameters):
    spec, random = phigen.spec.loads(text), np.random.default_rng(8)
    in_c, numpy = (phigen.compile(spec, target=target, adjoint=True) for target in ("c", "numpy"))
    x, bar = random.normal(size=(2, 2, SITES))
    for h in (0.01, 0.3):  # with 0.01 by a factor of 1.8, over single steps; with 0.3 as above
        in_c_result, expected = (solver.pullback(x, h, 40, bar, parameters=parameters) for solver in (in_c, numpy))
        assert in_c_result.x0_bar == pytest.approx(expected.x0_bar, rel=1e-12, abs=1e-13)
        assert in_c_result.parameters_bar["g"] == pytest.approx(expected.parameters_bar["g"], rel=1e-12)
        assert in_c_result.parameters_bar["a"] == pytest.approx(expected.parameters_bar["a"], rel=1e-12)


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


@pytest.mark.parametrize(
    ("name", "steps", "stride"), [("driven", 17, 7), ("heisenberg_plane small", 150, 60), ("driven_graph", 70, 40)]
)
def test_c_has_the_same_bits_for_any_memory(monkeypatch, name, steps, stride):
    """Steps are repeated from stored states or, where there is no room for these, from earlier ones; the bits are the
    same.
    """
    solver, random = made(name, "c"), np.random.default_rng(8)
    x = 0.3 * beginning(solver, IN_C[name])
    bar, parameters = random.normal(size=(1 + -(-steps // stride), *x.shape)), LATTICES.get(name, {})
    whole = solver.pullback(x, H, steps, bar, stride, parameters=parameters)
    for memory_limit, states in ((0, 1), (0, 4), (1200, 1)):
        monkeypatch.setattr(c_lattice, "MAX_TAPE_BYTES", 0)
        monkeypatch.setattr(c_lattice, "MIN_TAPE_VALUES", memory_limit)
        monkeypatch.setattr(c_lattice, "MIN_CHECKPOINTS", states)
        part = solver.pullback(x, H, steps, bar, stride, parameters=parameters)
        assert np.array_equal(part.x1, whole.x1)
        assert np.array_equal(part.x0_bar, whole.x0_bar)
        assert same(part.parameters_bar, whole.parameters_bar)


def test_segments_of_the_series_in_c_are_made_again_to_round_off(monkeypatch):
    solver, random = made("driven composed", "c"), np.random.default_rng(8)
    x, bar = 0.3 * random.random((2, SITES)), random.normal(size=(4, 2, SITES))
    whole = solver.pullback(x, H, 17, bar, 7)
    assert np.array_equal(whole.x1, solver.integrate(x, H, 17, 7).x)
    for memory_limit, states in ((0, 1), (1200, 1)):
        monkeypatch.setattr(c_lattice, "MAX_TAPE_BYTES", 0)
        monkeypatch.setattr(c_lattice, "MIN_TAPE_VALUES", memory_limit)
        monkeypatch.setattr(c_lattice, "MIN_CHECKPOINTS", states)
        part = solver.pullback(x, H, 17, bar, 7)
        assert part.x1 == pytest.approx(whole.x1, abs=1e-14)
        assert part.x0_bar == pytest.approx(whole.x0_bar, abs=1e-13)
        assert part.parameters_bar["A"] == pytest.approx(whole.parameters_bar["A"], rel=1e-13)


def test_all_of_a_run_is_kept_where_steps_are_dear(monkeypatch):
    """Steps of the series are costly. Of a longer run, as many steps are stored as there is room for."""
    solver, segment_lengths = made("driven composed", "c"), []
    x = 0.3 * beginning(solver)
    monkeypatch.setattr(c_lattice, "MIN_TAPE_VALUES", 0)
    monkeypatch.setattr(c_lattice, "expect_room", lambda what, size: segment_lengths.append(size))

    def room(steps):
        solver.pullback(x, H, steps, x)
        return segment_lengths[-1]

    whole, half = room(1000), room(500)
    assert whole - half == pytest.approx(half - room(1), rel=0.01)
    monkeypatch.setattr(c_lattice, "MAX_TAPE_BYTES", half)
    assert room(1000) == half


#: Sizes for several threads. That of "fput" exceeds the caches, so its reverse pass uses wavefront blocking.
LARGE = {"driven": 6000, "driven composed": 6000, "heisenberg_plane small": (80, 76), "fput": 140_000}
LARGE |= {"driven_graph": 2000, "paired fast": 513}
LARGE |= {"heisenberg_plane fast": (80, 76), "heisenberg fast": (40, 40, 40)}


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", LARGE)
def test_c_has_the_same_bits_for_any_threads(name):
    solver, random = made(name, "c"), np.random.default_rng(8)
    x = 0.3 * beginning(solver, LARGE[name])
    bar, parameters = random.normal(size=x.shape), {}
    if solver.interface.at_bonds:
        ends = [[i, (i + k) % LARGE[name]] for k in (1, 7) for i in range(LARGE[name])]
        parameters = {"bonds": np.array(ends), "J": random.normal(size=len(ends))}
    results = [*with_threads(lambda: solver.pullback(x, H, 1, bar, parameters=parameters))]
    for one in results:
        assert np.array_equal(one.x0_bar, results[0].x0_bar)
        assert same(one.parameters_bar, results[0].parameters_bar)
    expected = made(name).pullback(x, H, 1, bar, parameters=parameters)
    assert np.allclose(results[0].x0_bar, expected.x0_bar, rtol=1e-12, atol=1e-12)
    for parameter, value in expected.parameters_bar.items():  # sums over rows with many segments
        assert results[0].parameters_bar[parameter] == pytest.approx(value, rel=1e-11, abs=1e-11), parameter


@pytest.mark.parametrize("name", ["driven", pytest.param("driven composed", marks=pytest.mark.slow)])
def test_long_pullbacks_in_c_are_interrupted(name):
    solver, x = made(name, "c"), np.full((2, 4000), 0.1)  # a size for one thread
    handler = signal.getsignal(signal.SIGINT)
    threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        solver.pullback(x, 1e-3, 1_000_000, x)
    assert signal.getsignal(signal.SIGINT) is handler
    assert np.isfinite(solver.pullback(x, 1e-3, 2, x).x0_bar).all()


def test_what_cannot_be_pulled_back_is_told():
    solver = made("fput")
    x = beginning(solver)
    with pytest.raises(StepError) as failed:
        solver.pullback(1e90 * x, H, 9, x)
    assert failed.value.status == "NOT_FINITE"
    with pytest.raises(ValueError, match="cotangent must have shape"):
        solver.pullback(x, H, STEPS, x[0])
    with pytest.raises(TypeError, match="adjoint=True"):
        phigen.compile("fput", target="numpy").pullback(x, H, STEPS, x)
    with pytest.raises(SpecError, match="adjoint is not offered for lattices with noise"):
        made("thermal_heisenberg")
    in_c = made("driven", "c")
    with pytest.raises(StepError) as failed:
        in_c.pullback(1e90 * x, H, 9, x)
    assert (failed.value.status, failed.value.step) == ("NOT_FINITE", 0)
