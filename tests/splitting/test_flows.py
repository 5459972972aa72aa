"""Flows of parts of H: those with a closed form are found and proved, and errors name parts without one."""

from dataclasses import replace

import pytest
from support import compile_text

from phigen.api import solver_of
from phigen.errors import SpecError
from phigen.scheme.lowering import operation_counts
from phigen.splitting.statements import check
from phigen.symbolic.verdict import CHECKED, PROVED, REFUTED

BODY = "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: -z, z: y}, y: {z: -x}}}\n"
PLANE = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"

#: Systems, each with the formulas of its coordinates along the flows of the parts.
SYSTEMS = {
    "kick and drift": (PLANE + "hamiltonian: p**2/2 + p**4 - cos(q)", ["p shifted", "q shifted"]),
    "a kink between its kicks": (PLANE + "hamiltonian: p**2/2 + 2*abs(q)", ["q shifted", "p shifted"]),
    "one part": (PLANE + "hamiltonian: p**2/2", ["q shifted"]),
    "a sum whose parts do not commute": (
        PLANE + "parameters: {m: 2, k: 3}\nhamiltonian: p**2/(2*m) + k*q**2/2 + p*q/5",
        ["q, p rotated"],
    ),
    "uniform electric and magnetic fields": (
        "coordinates: [x, y, u, v]\nparameters: {B: 2}\n"
        "poisson: {brackets: {x: {u: 1}, y: {v: 1}, u: {v: B}}}\nhamiltonian: (u**2 + v**2)/2 + x/3",
        ["x, y, u, v rotated and shifted"],
    ),
    "a body with a Casimir taken out": (
        BODY + "parameters: {I: {value: 2, positive: true}}\nhamiltonian: x**2/2 + y**2/I + z**2/4",
        None,
    ),
    "a top of two equal moments": (
        "coordinates: [x, y, z, u, v, w]\npoisson: {lie_algebra: {name: se(3)}}\n"
        "hamiltonian: (x**2 + y**2)/2 + z**2/3 + w",
        None,
    ),
    "two spins": (
        "coordinates: [a, b, c, u, v, w]\n"
        "poisson: {brackets: {a: {b: c, c: -b}, b: {c: a}, u: {v: w, w: -v}, v: {w: u}}}\n"
        "hamiltonian: a*u + b*v + c*w",
        ["a, b, c rotated; u, v, w by linear integrals"],
    ),
    "three spins with a sum to keep": (
        "coordinates: [a1, b1, c1, a2, b2, c2, a3, b3, c3]\n"
        "poisson: {brackets: {a1: {b1: c1, c1: -b1}, b1: {c1: a1}, a2: {b2: c2, c2: -b2}, b2: {c2: a2},"
        " a3: {b3: c3, c3: -b3}, b3: {c3: a3}}}\n"
        "hamiltonian: a1*a2 + b1*b2 + c1*c2 + a2*a3 + b2*b3 + c2*c3 + a3*a1 + b3*b1 + c3*c1\n"
        "invariants: {A: a1 + a2 + a3, B: b1 + b2 + b3, C: c1 + c2 + c3}",
        [f"a{i}, b{i}, c{i} rotated; a{k}, b{k}, c{k} by linear integrals" for i, k in ((1, 2), (1, 3), (2, 3))],
    ),
    "Riccati equations": (
        "coordinates: [x, y]\npoisson: {brackets: {x: {y: 1 - x**2 - y**2}}}\nhamiltonian: x + y**2",
        ["x moved by a Riccati equation", "y moved by a Riccati equation"],
    ),
    "a logarithm": (
        "coordinates: [x, y]\npoisson: {brackets: {x: {y: exp(2*x)*y}}}\nhamiltonian: y + x**2",
        ["x moved by a logarithm", "y multiplied by a factor"],
    ),
    "a power": (
        "coordinates: [x, y]\npoisson: {brackets: {x: {y: x**3*y**2}}}\nhamiltonian: y + x",
        ["x moved by a power", "y moved by a Riccati equation"],
    ),
    "a quartic chain": (
        "coordinates: [q1, q2, p1, p2]\npoisson: {canonical: {q: [q1, q2], p: [p1, p2]}}\n"
        "hamiltonian: (p1**2 + p2**2)/2 + (q1 - q2)**4/4 + q1**2/2",
        ["q1, q2 shifted", "p1, p2 shifted"],
    ),
    "degenerate and constant": (
        "coordinates: [x, y, z]\npoisson: {matrix: [[0, 1, 2], [-1, 0, 0], [-2, 0, 0]]}\n"
        "hamiltonian: x**2 + y*z + z**3",
        ["x shifted", "y, z shifted"],
    ),
    "rotations": (BODY + "hamiltonian: x**4 + y**4 + z**4", ["x, y rotated", "x, z rotated", "y, z rotated"]),
    "angular velocity with a parameter": (
        BODY + "parameters: {I: 2}\nhamiltonian: x**2/I + sqrt(1 + y**2)",
        ["x, z rotated", "y, z rotated"],
    ),
    "hyperbolic rotations": (
        "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: z, z: y}, y: {z: x}}}\nhamiltonian: x**2 + y**2 + z",
        None,
    ),
    "shears of the Heisenberg algebra": (
        "coordinates: [x, y, z]\npoisson: {lie_algebra: {name: heisenberg(1)}}\nhamiltonian: x**2 + y**2 + z*x",
        None,
    ),
    "scalings": (
        "coordinates: [x, y, z]\npoisson: {log_canonical: [[0, 1, 2], [-1, 0, -3], [-2, 3, 0]]}\n"
        "hamiltonian: x - log(x) + y**2 + exp(z)",
        ["x, y multiplied by a factor", "x, z multiplied by a factor", "y, z multiplied by a factor"],
    ),
    "affine": (
        "coordinates: [x, y]\nparameters: {b: 2}\npoisson: {brackets: {x: {y: x + b}}}\nhamiltonian: x**2 + y**2",
        None,
    ),
    "a frequency that may vanish, and may be imaginary": (
        PLANE + "parameters: {k: 1}\nhamiltonian: p**2/2 + k*q**2/2 + p**4 + q**4",
        None,
    ),
    "a sphere of angular velocities": (
        "coordinates: [x, y, z, u, v, w]\npoisson: {lie_algebra: {name: se(3)}}\n"
        "hamiltonian: sqrt(1 + x**2 + y**2 + z**2) + u",
        None,
    ),
    "two vortices": (
        "coordinates: [x, y, u, v]\npoisson: {canonical: {q: [x, u], p: [y, v]}}\n"
        "hamiltonian: log((x - u)**2 + (y - v)**2)",
        ["x, y, u, v rotated"],
    ),
    "a rate that may vanish": (
        "coordinates: [a, b, c]\npoisson: {brackets: {a: {b: a}, b: {c: 2*a**2}}}\nhamiltonian: a + b**2 + c",
        None,
    ),
    "the height of a pendulum as a coordinate": (
        "coordinates: [x, p, V]\npoisson: {nambu: [V + cos(x)]}\nhamiltonian: p**2/2 + V",
        ["x shifted; V rotated", "p shifted"],
    ),
    "a rotation about a vector that stands still": (
        "coordinates: [x, y, z, u, v, w, a, b, c]\n"
        "poisson: {brackets: {x: {y: -z, z: y, v: -w, w: v, b: -c, c: b}, y: {z: -x, u: w, w: -u, a: c, c: -a},"
        " z: {u: -v, v: u, a: -b, b: a}}}\nparameters: {n: 0.3}\nhamiltonian: n*(x*u + y*v + z*w) + a**2 + 2*b**2",
        ["a, b, c rotated", "x, y, z shifted"],
    ),
    "a rotation about the momenta of wheels": (
        "coordinates: [x, y, z, a, b, c, u, v, w]\n"
        "poisson: {brackets: {x: {y: -z, z: y}, y: {z: -x}, a: {u: 1}, b: {v: 1}, c: {w: 1}}}\n"
        "hamiltonian: x*u + y*v/2 + z*w/3 + cos(a)",
        ["u shifted", "x, y, z, a, b, c rotated and shifted"],
    ),
    "a static vector beside a quadratic term": (
        BODY + "parameters: {B: 2}\nhamiltonian: x**2/2 + B*x + y + z/3",
        ["x, y, z rotated", "y, z rotated"],
    ),
    "a field that depends on the place": (
        "coordinates: [x, y, u, v]\npoisson: {brackets: {x: {u: 1}, y: {v: 1}, u: {v: 1 + x**2 + y**2}}}\n"
        "hamiltonian: (u**2 + v**2)/2 + x**4",
        ["y, u moved by a polynomial in t", "x, v moved by a polynomial in t"],
    ),
}


@pytest.mark.parametrize(("text", "manners"), SYSTEMS.values(), ids=SYSTEMS)
def test_flows_are_proved(text, manners):
    compilation = compile_text(text + "\n", scheme="splitting")
    statements = list(check(compilation.system, compilation.splitting))
    expected = {PROVED, CHECKED} if "exp(2*x)" in text or "x**3*y**2" in text else {PROVED}  # powers of logarithms
    assert {s.verdict for s in statements} <= expected, [str(s) for s in statements]
    if manners is not None:
        assert sorted(f.manner for f in compilation.splitting.flows) == sorted(manners)


@pytest.mark.parametrize(("text", "manners"), SYSTEMS.values(), ids=SYSTEMS)
def test_a_wrong_sign_in_one_flow_is_refuted(text, manners):
    compilation = compile_text(text + "\n", scheme="splitting")
    flows = compilation.splitting.flows
    for k, flow in enumerate(flows):
        moved = next(i for i, e in enumerate(flow.increment) if not e.is_zero)
        wrong = tuple(-e if i == moved else e for i, e in enumerate(flow.increment))
        planted = replace(compilation.splitting, flows=(*flows[:k], replace(flow, increment=wrong), *flows[k + 1 :]))
        verdicts = [s.verdict for s in check(compilation.system, planted)]
        assert [i for i, v in enumerate(verdicts) if v == REFUTED] == [k + 1]


@pytest.mark.parametrize("drag", ["-c*p*abs(p)", "-c*abs(p)**3*p", "c*p*abs(p)"])
@pytest.mark.parametrize("c", ["0.1", "{value: 0.1, positive: true}", "{value: 0.1, nonnegative: true}"])
def test_drag_by_powers_of_the_speed_is_proved_and_drag_with_a_wrong_sign_refuted(drag, c):
    text = PLANE + f"parameters: {{c: {c}}}\nhamiltonian: p**2/2 - cos(q)\nforces: {{vector: {{p: {drag}}}}}\n"
    compilation = compile_text(text, scheme="splitting")
    assert {s.verdict for s in check(compilation.system, compilation.splitting)} == {PROVED}
    flows = compilation.splitting.flows
    k = next(k for k, flow in enumerate(flows) if flow.force)
    wrong = replace(flows[k], increment=tuple(-e for e in flows[k].increment))
    planted = replace(compilation.splitting, flows=(*flows[:k], wrong, *flows[k + 1 :]))
    assert [s.verdict for s in check(compilation.system, planted)].count(REFUTED) == 1


def test_a_part_left_out_is_refuted():
    compilation = compile_text(BODY + "hamiltonian: x**4 + y**4 + z**4\n", scheme="splitting")
    planted = replace(compilation.splitting, flows=compilation.splitting.flows[1:])
    assert next(iter(check(compilation.system, planted))).verdict == REFUTED


REFUSED = {
    "q and p multiplied": (PLANE + "hamiltonian: p**2/2 + q**2*p**3", "p**3*q**2"),
    "elliptic functions": (
        "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: z*z, z: x*y}, y: {z: x*x}}}\nhamiltonian: x",
        "the term x ",
    ),
}


@pytest.mark.parametrize(("text", "named"), REFUSED.values(), ids=REFUSED)
def test_what_has_no_elementary_flow_is_refused_by_name_and_place(text, named):
    with pytest.raises(SpecError) as caught:
        compile_text(text + "\n", scheme="splitting")
    (diagnostic,) = caught.value.diagnostics
    assert named in diagnostic.message
    assert "elementary flow" in diagnostic.message
    assert (diagnostic.location.line, diagnostic.hint != "") == (5, True)


def test_two_spins_turn_by_two_cross_products():
    """The flow uses the sum of both spins; the second spin reuses values of the first. A common factor of all brackets
    is a factor of the time.
    """
    text = SYSTEMS["two spins"][0].replace("a*u + b*v + c*w", "J*(a*u + b*v + c*w)")
    flow = compile_text(f"parameters: {{J: 1.3}}\n{text}\norder: 2\n", scheme="splitting").program.step.flows[0]
    counts = operation_counts(flow.roots)
    assert counts["functions"] == 2
    assert counts["multiplications"] <= 29


@pytest.mark.parametrize("hamiltonian", ["0", "3", "k", "z"])
def test_a_hamiltonian_that_moves_nothing_is_one_part(hamiltonian):
    text = (
        "coordinates: [x, y, z]\nparameters: {k: 2}\npoisson: {brackets: {x: {y: 1}}}\nscheme: splitting\n"
        f"hamiltonian: {hamiltonian}\n"
    )
    compilation = compile_text(text)
    assert len(compilation.splitting.flows) == 1
    assert all(s.verdict == PROVED for s in check(compilation.system, compilation.splitting))
    solver = solver_of(compilation, "numpy")
    assert solver.integrate([1, 2, 3], 0.1, 4).x[-1].tolist() == [1, 2, 3]
