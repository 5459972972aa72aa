"""Forces and damping: orders, symplectic leaves, agreement of targets, derivatives, and which statements are proved."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import COMMAND, compile_text, javascript, slow_but, solver

from phigen import resources
from phigen.compiler import emit, examine
from phigen.errors import SpecError
from phigen.proofs.examination import refutation
from phigen.spec import load, loads
from phigen.study.summary import summarise
from phigen.study.verification import verify

SPAN = 2.0

SPIN = """time: t
coordinates: [x, y, z]
parameters: {lam: {value: 0.3, positive: true}, g: 0.4, K: 0.3}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: -z - K*x**2
casimirs: {C: x**2 + y**2 + z**2}
damping: lam
tangent: true
"""

#: Systems by kind of step: their text, a start, and the lowest order.
SYSTEMS = {
    "damped": (SPIN, [0.8, 0.1, 0.5]),
    "covector": (SPIN + "forces: {covector: {x: g*y*z, y: sin(t)*x}}\n", [0.8, 0.1, 0.5]),
    "vector": (SPIN + "forces: {covector: {x: g*y*z}, vector: {z: 0.5*sin(t)*x, y: -g*y}}\n", [0.8, 0.1, 0.5]),
    "monitored": (
        SPIN.replace("time: t\n", "") + "forces: {covector: {x: g*y*z}, vector: {y: -g*y}}\nmonitor: 1/(1 + x**2)\n",
        [0.8, 0.1, 0.5],
    ),
    "populations": (
        """coordinates: [x, y]
poisson: {log_canonical: [[0, 1], [-1, 0]]}
hamiltonian: x + y - log(x) - 1.5*log(y)
forces: {covector: {x: 0.2*y, y: -0.1*x}, vector: {x: -0.1*x**2}}
tangent: true
""",
        [0.6, 1.5],
    ),
    "split": (
        """time: t
coordinates: [q, p]
parameters: {g: 0.4}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q)
forces: {covector: {q: g*p}, vector: {p: 0.5*sin(t) - g*p**2, q: 0.1*p}}
scheme: splitting
tangent: true
""",
        [0.6, 0.9],
    ),
    # damping has its own flows: one of the field, which rotates with the time, and one of each axis
    "split damping": (SPIN.replace("-z -", "-z*cos(t) - 0.2*x + 0.1*z**2 -") + "scheme: splitting\n", [0.8, 0.1, 0.5]),
    "split on leaves": (
        SPIN.replace("damping: lam\n", "forces: {covector: {x: g*x*(x**2 + y**2 + z**2), y: g*y}}\n").replace(
            "time: t\n", "scheme: splitting\n"
        ),
        [0.8, 0.1, 0.5],
    ),
    "path": (
        """coordinates: [x, y, z]
poisson: {nambu: [x**2/2 + y**2/2 + z**4/4]}
hamiltonian: x*y + z**2/2
casimirs: {C: x**2/2 + y**2/2 + z**4/4}
birealisation: karasev
damping: 0.2
forces: {covector: {x: 0.3*z}}
tangent: true
""",
        [0.4, 0.5, 0.6],
    ),
}
pytestmark = pytest.mark.few("damped", "vector", "populations", "split", "split damping", "path", of=SYSTEMS)


@cache
def made(kind, order=2):
    return compile_text(SYSTEMS[kind][0] + f"order: {order}\n")


def final(kind, n, order=2, target="numpy"):
    return solver(made(kind, order), target).integrate(SYSTEMS[kind][1], SPAN / n, n, n).x[-1]


def reference(kind):
    integrator, timed = solver(made(kind), "numpy"), bool(made(kind).program.time)

    def field(t, x):
        rate = 1 / (1 + x[0] ** 2) if kind == "monitored" else 1
        return rate * (integrator.vector_field(x, t) if timed else integrator.vector_field(x))

    return solve_ivp(field, (0, SPAN), SYSTEMS[kind][1], method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]


ORDERS = [(kind, order) for kind in SYSTEMS for order in (2, 4)]


@pytest.mark.thin(2)
@pytest.mark.parametrize(("kind", "order"), slow_but([o for o in ORDERS if o != ("path", 4)], ORDERS))
def test_the_order_is_reached(kind, order):
    coarse, fine = (np.max(np.abs(final(kind, n, order) - reference(kind))) for n in (20, 40))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.3)


@pytest.mark.thin(3)
@pytest.mark.parametrize("kind", SYSTEMS)
def test_targets_agree_to_roundoff(kind):
    expected = final(kind, 20, 4)
    assert final(kind, 20, 4, "c") == pytest.approx(expected, abs=1e-13)
    x = javascript(made(kind, 4), f"x0: {SYSTEMS[kind][1]}", f"s.integrate({SPAN / 20}, 20)", "[...s.x]")
    assert x == pytest.approx(expected, abs=1e-13)


@pytest.mark.thin(2)
@pytest.mark.parametrize("kind", ["damped", "covector", "path", "split damping", "split on leaves"])
def test_covectors_keep_casimirs(kind):
    """A force that is not tangent to the leaves, such as f in place of πζ, changes Casimirs at the order of the
    step.
    """
    run = solver(made(kind), "c").integrate(SYSTEMS[kind][1], 0.1, 20_000, 100)
    assert np.ptp(run.casimirs["C"]) < 1e-13


def test_damping_takes_energy_down_to_the_minimum():
    energy = solver(made("damped"), "c").integrate(SYSTEMS["damped"][1], 0.1, 2_000).energy
    assert (np.diff(energy) <= 1e-15).all()
    assert energy[-1] == pytest.approx(-np.sqrt(0.9), abs=1e-12)  # at rest, the spin is along the field


#: Damped spins with a splitting, for a linear and a quadratic H, which is smallest at the end.
SPUN = SPIN.replace("time: t\n", "") + "scheme: splitting\n"


@pytest.mark.parametrize("start", [[0.8, 0.1, 0.5], [0, 0, -1], [1e-9, 0, -1], [0, 0, 0]])
@pytest.mark.parametrize("h", [1e-3, 4.0, 200.0])
def test_spheres_are_kept_by_steps_of_any_size_and_from_any_start(h, start):
    """Starts along the field, against it, close to both, and at the centre, where a quotient with cancellation would
    change the length.
    """
    x = solver(compile_text(SPUN), "c").integrate(start, h, 200).x
    assert np.ptp(np.linalg.norm(x, axis=1)) < 3e-14


@pytest.mark.parametrize(
    "text",
    [
        SPUN.replace("-z", "-g*z"),
        SPUN.replace("-z - K*x**2", "-g*z").replace(
            "damping: lam", "forces: {covector: {x: K*(x + y)*z, y: -K*(x + y)*z, z: K*(x + y)*(y - x)}}"
        ),
    ],
)
def test_a_field_or_an_axis_may_vanish(text):
    at_rest = solver(compile_text(text), "numpy").integrate([0.8, 0.1, 0.5], 0.1, 3, g=0, K=0)
    assert at_rest.x == pytest.approx(np.tile([0.8, 0.1, 0.5], (4, 1)))


def test_damping_in_a_splitting_takes_energy_in_every_step():
    """With a wrong sign, or with half of a part missing, the energy grows or the spin ends elsewhere."""
    run = solver(compile_text(SPUN), "c").integrate([0.1, 0.2, -0.9], 0.1, 1_000, K=1.0)
    assert (np.diff(run.energy) <= 1e-15).all()
    assert run.energy[-1] == pytest.approx(-0.86 - 0.25, abs=2e-3)  # between the field and the axis


@pytest.mark.parametrize("kind", ["covector", "vector"])
def test_the_energy_is_what_time_and_forces_put_in(kind):
    """The energy balance has the error of the method, while the work itself is large."""
    errors_by_step = {}
    for n in (100, 200):
        rows = solver(made(kind), "c").integrate(SYSTEMS[kind][1], 10 / n, n)
        errors_by_step[n] = summarise("phigen", made(kind).system, None, dict(rows.parameters), rows.t, rows.x)
    assert abs(errors_by_step[100].work) > 0.1
    assert errors_by_step[100].units["energy"].moves
    assert errors_by_step[100].units["C"].moves == (kind == "vector")
    assert errors_by_step[100].energy.error / errors_by_step[200].energy.error == pytest.approx(4, rel=0.2)


def test_an_ensemble_takes_the_steps_of_its_members():
    starts = np.array([[0.8, 0.1, 0.5], [0.1, 0.9, 0.2], [0.3, 0.3, 0.9]])
    run = solver(made("vector"), "c").ensemble(starts, 0.1, 50)
    single = [solver(made("vector"), "c").integrate(x, 0.1, 50, 50).x[-1] for x in starts]
    assert run == pytest.approx(np.array(single), abs=1e-13)


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("kind", slow_but(["populations"], ["populations", "path"]))
def test_verification_asks_for_what_is_promised(kind):
    """The tangent map is the derivative of a step, though ∂(∇S + hζ) is not symmetric. Energy and Poisson map are not
    required.
    """
    solvers = {target: solver(made(kind), target) for target in ("c", "numpy")}
    verification = verify(made(kind), solvers, "test", SYSTEMS[kind][1], {}, 0.1, 50, quick=True)
    assert verification.failures == []
    required = {c.name.partition(":")[0] for c in verification.checks if c.limit}
    assert "tangent map against differences" in required
    assert "Poisson defect, exact tangent" not in required
    assert ("Casimir C" in required) == (kind == "path")


def test_what_is_proved_of_forces():
    groups = examine(made("damped").spec).groups
    assert [(s.name, s.verdict) for s in groups["Forces"]] == [
        ("the forces keep C", "proved"),
        ("the damping changes H at the rate -λ |π∇H|²", "proved"),
    ]
    (rate, _) = examine(made("vector").spec).groups["Forces"]
    assert rate.name.startswith("dC/dt = ")
    assert rate.name.endswith(", by the vector force")


TURNING = """phigen: 1
name: damped
coordinates: [m1, m2, m3]
parameters: {k: 0.1, s: {value: 2, positive: true}}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: m3
damping: RATE
"""
RUNS = "runs: {one: {initial: [1, 0, 0], step: 0.1, steps: 5}, two: {initial: [1, 0, 0], step: 0.1, steps: 5, MORE}}\n"


@pytest.mark.parametrize(
    ("rate", "more", "verdict", "detail"),
    [
        ("s/2", "", "proved", "by its form"),
        ("k**2", "", "proved", "by its form"),
        ("-1", "", "refuted", "negative by its form"),
        ("-s", "", "refuted", "negative by its form"),
        ("k", "", "checked numerically", "at the starts of runs, 1"),
        ("k", RUNS.replace("MORE", "stride: 1"), "checked numerically", "at the starts of runs, 2"),
        ("k", RUNS.replace("MORE", "parameters: {k: -0.5}"), "refuted", "-0.5 where a run starts"),
        ("k*m1", RUNS.replace("[1", "[-2").replace("MORE", "stride: 1"), "refuted", "-0.2 where a run starts"),
    ],
)
def test_damping_takes_energy_where_its_rate_is_not_negative(rate, more, verdict, detail):
    examination = examine(loads(TURNING.replace("RATE", rate) + more, "a.yaml"))
    (stated,) = examination.groups["Damping"]
    assert (stated.verdict, stated.detail) == (verdict, detail)
    if verdict == "refuted":
        assert "a.yaml:7:10: error: λ ≥ 0" in refutation(examination)
        assert "a negative λ adds energy" in refutation(examination)


def test_damping_of_which_nothing_is_known_has_no_statement():
    assert "Damping" not in examine(loads(TURNING.replace("RATE", "k*m1"), "a.yaml")).groups


def test_damping_at_the_sites_of_a_lattice_is_looked_at_too():
    spec = resources.bundled_specs() / "lattices" / "thermal_heisenberg.yaml"
    (stated,) = examine(load(spec)).groups["Damping"]
    assert stated.verdict == "proved"
    text = spec.read_text(encoding="utf-8").replace("damping: lambda\n", "damping: -lambda\n")
    assert [s.verdict for s in examine(loads(text, "a.yaml")).groups["Damping"]] == ["refuted"]


def test_the_code_does_not_claim_a_poisson_map():
    text = "\n".join(emit(made("vector").program, "c", COMMAND).values())
    assert "A Poisson Hamiltonian integrator" not in text
    assert "with forces a step is not a Poisson map; the forces change C" in text


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("scheme: splitting\nforces: {covector: {x: y**2}}", "the force ζ_x = y\\*\\*2 has no elementary flow"),
        ("scheme: splitting\ndamping: lam*z", "the damping of x, y, z has no elementary flow"),
        ("order: 4\ncomposition: none", "has order 2 without a composition"),
        ("birealisation: karasev\nforces: {vector: {x: 1}}", "use a covector force, .*, or scheme: splitting"),
        ("order: 2\nmodified_hamiltonian: 1", "not offered for a system with forces"),
    ],
)
def test_what_cannot_be_done_is_refused(more, message):
    text = SPIN.replace("damping: lam", "order: 2" if "vector" in more or "damping" in more else "damping: lam")
    with pytest.raises(SpecError, match=message):
        compile_text(text.replace("time: t\n", "") + more + "\n")
