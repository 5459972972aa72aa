"""Noise: random numbers, steps in every target, orders, equilibria, proofs, and refusals."""

from functools import cache
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm
from support import COMMAND, compile_text, javascript, run, slow_but, solver, tool, write

import phigen
from phigen.compiler import emit, examine
from phigen.errors import SpecError
from phigen.report.live import gathered
from phigen.scheme.program import MAX_NORMAL_VARIATE
from phigen.study.stochastic import strong_order
from phigen.study.verification import verify

SPIN = """coordinates: [x, y, z]
parameters: {lam: {value: 0.5, positive: true}, T: {value: 0.5, positive: true}, B: 1}
poisson: {lie_algebra: {name: so(3)}}
hamiltonian: -B*z
casimirs: {C: x**2 + y**2 + z**2}
"""
HEAT = """noise:
  x: {hamiltonian: x, amplitude: sqrt(2*lam*T)}
  y: {hamiltonian: y, amplitude: sqrt(2*lam*T)}
  z: {hamiltonian: z, amplitude: sqrt(2*lam*T)}
"""

#: Systems by kind of step and of noise: their text, a start, and the strong order.
SYSTEMS = {
    "thermal": (SPIN + HEAT + "damping: lam\ntangent: true\n", [0, 0.6, 0.8], 0.5),
    "dated": (
        SPIN + "time: t\nnoise: {z: {hamiltonian: x**2 - sin(t)*z, amplitude: 0.3*cos(2*t)}}\ntangent: true\n",
        [0, 0.6, 0.8],
        1,
    ),
    "populations": (
        """coordinates: [x, y]
poisson: {log_canonical: [[0, 1], [-1, 0]]}
hamiltonian: x + y - log(x) - 1.5*log(y)
noise: {birth: {hamiltonian: log(x), amplitude: 0.5}, death: {hamiltonian: y, amplitude: 0.5}}
order: 4
tangent: true
""",
        [0.6, 1.5],
        0.5,
    ),
    "split": (
        SPIN.replace("-B*z", "-B*z + 0.2*x**2") + "time: t\nscheme: splitting\ntangent: true\n"
        "noise: {a: {hamiltonian: x, amplitude: 0.4}, b: {hamiltonian: y*cos(t), amplitude: 0.5}}\n",
        [0, 0.6, 0.8],
        0.5,
    ),
    "path": (
        """coordinates: [x, y, z]
poisson: {nambu: [x**2/2 + y**2/2 + z**4/4]}
hamiltonian: x*y + z**2/2
casimirs: {C: x**2/2 + y**2/2 + z**4/4}
birealisation: karasev
noise: {a: {hamiltonian: x + z, amplitude: 0.2}}
forces: {covector: {x: 0.3*z}}
tangent: true
""",
        [0.4, 0.5, 0.6],
        1,
    ),
}
pytestmark = pytest.mark.few("thermal", "dated", "split", "path", of=SYSTEMS)


@cache
def made(kind):
    return compile_text(SYSTEMS[kind][0])


# --- the random numbers


def philox(counter, key, width, multipliers, weyl):
    """Return the output of Philox (J. Salmon et al.) with ten rounds on four words, computed by Python integers."""
    mask, (a, b, c, d) = 2**width - 1, counter
    for turn in range(10):
        first, second = ((k + turn * w) & mask for k, w in zip(key, weyl, strict=True))
        even, odd = multipliers[0] * a, multipliers[1] * c
        a, b, c, d = (odd >> width) ^ b ^ first, odd & mask, (even >> width) ^ d ^ second, even & mask
    return a, b, c, d


def philox4x32(counter, key):
    return philox(counter, key, 32, (0xD2511F53, 0xCD9E8D57), (0x9E3779B9, 0xBB67AE85))


#: Counter, key and output of philox4x32-10: known answers of the Random123 library.
KNOWN = [
    ([0] * 4, [0] * 2, [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]),
    ([2**32 - 1] * 4, [2**32 - 1] * 2, [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]),
    (
        [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344],
        [0xA4093822, 0x299F31D0],
        [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
    ),
]


@pytest.mark.parametrize(("counter", "key", "expected"), KNOWN)
def test_the_generator_gives_the_known_answers(counter, key, expected):
    integrator = solver(made("thermal"), "numpy").backend.module._philox(
        [np.array([c], dtype=np.uint64) for c in counter], key
    )
    assert [int(word[0]) for word in integrator] == expected == list(philox4x32(counter, key))


def test_the_rounds_are_those_of_numpy():
    """NumPy has Philox with words of 64 bits, which differs in width and constants only. It increments the counter
    before it draws.
    """
    counter, key = (np.array(words, dtype=np.uint64) for words in ([0, 2**40, 3, 2**64 - 1], [7, 2**63 + 1]))
    numpy_generator = np.random.Philox(key=key, counter=counter)
    constants = (0xD2E7470EE14C6C93, 0xCA5A826395121157), (0x9E3779B97F4A7C15, 0xBB67AE8584CAA73B)
    assert numpy_generator.random_raw(4).tolist() == list(
        philox([1, 2**40, 3, 2**64 - 1], [7, 2**63 + 1], 64, *constants)
    )


def normals(seed, member, step, count):
    """Return the normal variates of a step, from the words of the generator."""
    drawn_numbers = []
    for pair in range((count + 1) // 2):
        a, b, c, d = philox4x32([step % 2**32, step >> 32, member, pair], [seed % 2**32, seed >> 32])
        u, v = (((high >> 5) * 2**26 + (low >> 6)) / 2**53 for high, low in ((a, b), (c, d)))
        radius = min(np.sqrt(-2 * np.log(u + 2.0**-54)), MAX_NORMAL_VARIATE)
        drawn_numbers += [radius * np.cos(2 * np.pi * v), radius * np.sin(2 * np.pi * v)]
    return np.array(drawn_numbers[:count])


#: A system with p_i = −Σ ΔW_i: its momenta are the sums of the random numbers.
BARE = """coordinates: [q1, q2, q3, p1, p2, p3]
poisson: {canonical: {q: [q1, q2, q3], p: [p1, p2, p3]}}
hamiltonian: q1**2*0
noise: {a: {hamiltonian: q1}, b: {hamiltonian: q2}, c: {hamiltonian: q3}}
"""


@pytest.mark.parametrize(
    ("seed", "member", "step"), [(0, 0, 0), (2**32 + 5, 3, 2**32 - 2), (2**64 - 1, 2**32 - 1, 2**40 + 1)]
)
def test_steps_take_the_numbers_of_their_seed_member_and_step(seed, member, step):
    bare = compile_text(BARE)
    expected = -0.5 * np.cumsum([normals(seed, member, step + k, 3) for k in range(4)], axis=0)
    for target in ("c", "numpy"):
        run = solver(bare, target).integrate([0.0] * 6, 0.25, 4, seed=seed, member=member, step0=step)
        assert run.x[1:, 3:] == pytest.approx(expected, abs=1e-14)
    options = f"x0: [0, 0, 0, 0, 0, 0], seed: {seed}n, member: {member}, step0: {step}"
    assert javascript(bare, options, "s.integrate(0.25, 4)", "[...s.x]")[3:] == pytest.approx(expected[-1], abs=1e-14)


def test_the_numbers_are_normal_and_bounded():
    module = solver(compile_text(BARE), "numpy").backend.module
    drawn = np.concatenate([module._normals(3, np.arange(40_000), step).ravel() for step in range(3)])
    for power, moment in ((1, 0), (2, 1), (3, 0), (4, 3)):
        assert np.mean(drawn**power) == pytest.approx(moment, abs=5 * np.std(drawn**power) / np.sqrt(drawn.size))
    assert np.abs(drawn).max() < MAX_NORMAL_VARIATE
    still = SimpleNamespace(**vars(module))
    zero = [np.zeros(1, dtype=np.uint64)] * 4  # the smallest uniform number: log of 2^-54
    module._philox, original = (lambda counter, key: zero), module._philox
    try:
        assert module._normals(0, np.zeros(1, dtype=int), 0)[0, 0] == MAX_NORMAL_VARIATE
    finally:
        module._philox = original
    del still


# --- steps


@pytest.mark.thin(2)
@pytest.mark.parametrize("kind", SYSTEMS)
def test_targets_agree_to_roundoff(kind):
    c, numpy = (
        solver(made(kind), target).integrate(SYSTEMS[kind][1], 0.1, 40, seed=5, member=2) for target in ("c", "numpy")
    )
    assert c.x == pytest.approx(numpy.x, abs=1e-13)
    x = javascript(made(kind), f"x0: {SYSTEMS[kind][1]}, seed: 5, member: 2", "s.integrate(0.1, 40)", "[...s.x]")
    assert x == pytest.approx(c.x[-1], abs=1e-13)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("scheme", ["series", "splitting"])
def test_noise_along_a_casimir_moves_nothing(scheme, target):
    text = "coordinates: [q, p, z]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 + z*q**2\norder: 2\n"
    ends = [
        solver(compile_text(f"{text}scheme: {scheme}\n{noise}"), target).integrate([1, 0.5, 1], 0.1, 20).x[-1]
        for noise in ("", "noise: {w: {hamiltonian: z}}\n")
    ]
    assert ends[0] == pytest.approx(ends[1], abs=1e-14)


@pytest.mark.parametrize("kind", ["thermal", "dated", "split", "path"])
def test_casimirs_are_kept_at_any_temperature(kind):
    run = solver(made(kind), "c").integrate(SYSTEMS[kind][1], 0.1, 50_000, 100)
    assert np.ptp(run.x[:, 0]) > 0.5
    assert np.ptp(run.casimirs["C"]) < 1e-13


@pytest.mark.parametrize("kind", SYSTEMS)
def test_steps_without_increments_are_those_without_noise(kind):
    lines = SYSTEMS[kind][0].split("\n")
    start = next(k for k, line in enumerate(lines) if line.startswith("noise:"))
    end = next(k for k in range(start + 1, len(lines)) if not lines[k].startswith(" "))
    quiet = compile_text("\n".join(lines[:start] + lines[end:]) + ("" if "order" in SYSTEMS[kind][0] else "order: 2\n"))
    still = solver(made(kind), "numpy").integrate(
        SYSTEMS[kind][1], 0.1, increments=np.zeros((20, made(kind).program.noise.draws))
    )
    expected = solver(quiet, "numpy").integrate(SYSTEMS[kind][1], 0.1, 20)
    assert still.x == pytest.approx(expected.x, abs=1e-13)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_path_does_not_depend_on_how_it_is_cut(target):
    """The division of a run by members, by calls, by a file, or by failures of other members does not change the bits
    of a path.
    """
    one, x0 = solver(made("thermal"), target), np.array(SYSTEMS["thermal"][1])
    whole = one.integrate(x0, 0.1, 60, seed=9, member=4)
    session = one.backend.start(x0, dict(whole.parameters), draws=SimpleNamespace(seed=9, member=4, step=0))
    session.advance(0.1, 25)
    saved = one.backend.restored(session.saved(), dict(whole.parameters))
    saved.advance(0.1, 35)
    assert (saved.state() == whole.x[-1]).all()
    states = one.ensemble(np.tile(x0, (7, 1)), 0.1, 60, seed=9)
    assert (states[4] == whole.x[-1]).all()
    first = one.ensemble(np.tile(x0, (2, 1)), 0.1, 60, seed=9, member=4)
    assert (first[0] == whole.x[-1]).all()
    assert len(np.unique(states[:, 0])) == 7
    halves = one.ensemble(one.ensemble(np.tile(x0, (7, 1)), 0.1, 30, seed=9), 0.1, 30, seed=9, step0=30)
    assert halves == pytest.approx(states, abs=1e-14)


#: Program that prints the bits of all members.
THREADS = """
#include <stdio.h>
#include "t.c"
int main(void)
{
    static double x[t_DIM][64];
    for (int m = 0; m < 64; ++m) x[2][m] = 1.0;
    if (t_ensemble_of(NULL, &x[0][0], 64, 0.1, 200, 7, 3, 5, NULL) != t_OK) return 1;
    for (int i = 0; i < t_DIM; ++i)
        for (int m = 0; m < 64; ++m) printf("%a\\n", x[i][m]);
    return 0;
}
"""


def test_results_do_not_depend_on_threads(tmp_path):
    write(tmp_path, {**emit(made("thermal").program, "c", COMMAND, single_file=True), "main.c": THREADS})
    distinct_results = set()
    for flags, threads in (([], 1), (["-fopenmp"], 1), (["-fopenmp"], 3)):
        run([tool("gcc"), "-std=c99", "-O0", *flags, "main.c", "-lm", "-o", "main"], tmp_path)
        distinct_results.add(run([tmp_path / "main"], tmp_path, OMP_NUM_THREADS=str(threads)))
    assert len(distinct_results) == 1


# --- orders


@pytest.mark.thin(2)
@pytest.mark.parametrize("kind", slow_but(["thermal", "path"], SYSTEMS))
def test_the_strong_order_is_reached(kind):
    _, start, stated = SYSTEMS[kind]
    observed_order = strong_order(
        solver(made(kind), "c"),
        np.array(start),
        {p.name: float(p.value) for p in made(kind).program.parameters},
        0.0,
        0.1,
        4,
        32,
    )
    assert observed_order == pytest.approx(stated, abs=0.2)


KICKS = """coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: q**4/4
noise: {w: {hamiltonian: q, amplitude: 1/4}}
scheme: splitting
"""


def test_steps_that_follow_paths_exactly_have_no_finite_strong_order():
    """The errors are those of rounding, whose slope means nothing."""
    exact = solver(compile_text(KICKS), "c")
    assert strong_order(exact, np.array([0.3, 0.1]), {}, 0.0, 0.1, 8) == np.inf


def wrong(kind, *, drift=0.0, spread=1.0):
    """Return a solver whose reference has another drift (in units of the state) or another amplitude of the noise."""
    right = solver(made(kind), "c")
    backend = SimpleNamespace(
        vector_field=lambda x, p, t=None: right.backend.vector_field(x, p, t) + drift * x,
        noise_fields=lambda x, p, t=None: spread * right.backend.noise_fields(x, p, t),
    )
    return SimpleNamespace(interface=right.interface, integrate=right.integrate, backend=backend)


@pytest.mark.parametrize("off", [{"drift": 0.5}, {"spread": 1.1}], ids=["Itô", "amplitude"])
def test_noise_in_another_sense_has_no_strong_order(off):
    """In the Itô sense, dm = … + Σ X dW has the Stratonovich drift −½ Σ (X·∇)X = 2λT m, which is half of m with these
    numbers.
    """
    parameters = {"lam": 0.5, "T": 0.5, "B": 1.0}
    observed_order = strong_order(wrong("thermal", **off), np.array([0, 0.6, 0.8]), parameters, 0.0, 0.1, 4, 32)
    assert observed_order < 0.25


@cache
def nodes(sources):
    """Return nodes (points, sources) and weights of the Gauss–Hermite rule of degree 13 for normal variates."""
    points, weights = np.polynomial.hermite_e.hermegauss(7)
    combinations = product(zip(points, weights / weights.sum(), strict=True), repeat=sources)
    return tuple(np.array(part) for part in zip(*(zip(*pairs, strict=True) for pairs in combinations), strict=True))


def mean_map(compilation, h):
    """Return the expectation of a step of linear motion, a matrix; the average over the increments is computed by
    quadrature, without random numbers.
    """
    program, module = compilation.program, solver(compilation, "numpy").backend.module
    points, weights = nodes(program.noise.draws)
    dw = np.sqrt(h / program.noise.parts) * points
    columns = [
        module.integrate(np.tile(e, (len(dw), 1)), h, 1, increments=dw[np.newaxis])[-1]
        for e in np.eye(program.dimension)
    ]
    return np.array([np.prod(weights, axis=1) @ column for column in columns]).T


LINEAR = {
    "oscillator": """coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: (q**2 + p**2)/2
noise: {k: {hamiltonian: (q**2 + p**2)/2, amplitude: 0.5}, l: {hamiltonian: q**2/2, amplitude: 0.4}}
""",
    "spin": SPIN + HEAT,
}

#: An oscillator with friction, which is one part of the splitting.
LANGEVIN = LINEAR["oscillator"] + "forces: {vector: {p: -0.3*p}}\nscheme: splitting\n"

SPLIT = (
    SPIN
    + """scheme: splitting
noise: {x: {hamiltonian: x, amplitude: 0.7}, y: {hamiltonian: y, amplitude: 0.9}}
"""
)


def generator(compilation):
    """Return A + ½ Σ B², the matrix of dE[x]/dt for linear motion."""
    integrator, eye = solver(compilation, "numpy"), np.eye(compilation.program.dimension)
    fields = np.moveaxis(integrator.noise_fields(eye), 1, 0)
    return integrator.vector_field(eye).T + sum(b.T @ b.T for b in fields) / 2


@pytest.mark.parametrize(("text", "order"), [*((text, 1) for text in LINEAR.values()), (SPLIT, 2), (LANGEVIN, 2)])
def test_the_weak_order_is_reached(text, order):
    """If both halves of a step of a splitting used one increment, the order would be 1 for sources that do not
    commute.
    """
    compilation = compile_text(text)
    exact = expm(generator(compilation))
    coarse, fine = (np.abs(np.linalg.matrix_power(mean_map(compilation, 1 / n), n) - exact).max() for n in (8, 16))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.2)


# --- equilibria


@pytest.mark.thin(2)
@pytest.mark.parametrize(("scheme", "h"), [("series", 0.1), ("splitting", 0.5)])
def test_a_spin_in_a_bath_has_the_magnetisation_of_langevin(scheme, h):
    """The magnetisation is ⟨m⟩ = coth(B/T) − T/B. The test would see a noise of half the variance. Splittings have weak
    order 2.
    """
    integrator = solver(compile_text(SYSTEMS["thermal"][0] + f"scheme: {scheme}\n"), "c")
    members = 4_000
    starts, beta = np.tile([0.0, 0.6, 0.8], (members, 1)), 2.0
    expected = 1 / np.tanh(beta) - 1 / beta

    def missed(**parameters):
        z = integrator.ensemble(starts, h, round(15 / h), seed=1, **parameters)[:, 2]
        return abs(z.mean() - expected) / (z.std() / np.sqrt(members))

    assert missed() < 4
    assert missed(T=0.25) > 20


# --- what is proved, verified, refused


def test_what_is_proved_of_noise():
    names = {kind: [s.name for s in examine(made(kind).spec).groups["Noise"]] for kind in SYSTEMS}
    assert names == {
        "thermal": [
            "the sources of noise do not commute, hence strong order 1/2",
            "the density exp(−H/θ) on the leaves is stationary, with θ = T",
        ],
        "dated": ["the sources of noise commute, hence strong order 1"],
        "split": ["the sources of noise do not commute, hence strong order 1/2"],
        "populations": ["the sources of noise do not commute, hence strong order 1/2"],
        "path": ["the sources of noise commute, hence strong order 1"],
    }


OSCILLATOR = """coordinates: [q, p]
parameters: {gamma: {value: 0.5, positive: true}, kT: {value: 0.7, positive: true}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**4/4
"""


@pytest.mark.parametrize(
    ("more", "temperature"),
    [
        ("forces: {vector: {p: -gamma*p}}\nnoise: {heat: {hamiltonian: q, amplitude: sqrt(2*gamma*kT)}}", "kT"),
        ("forces: {covector: {q: gamma*p}}\nnoise: {heat: {hamiltonian: 3*q, amplitude: 1}}", "9/2/gamma"),
        ("damping: gamma\nnoise: {heat: {hamiltonian: q, amplitude: sqrt(2*gamma*kT)}}", ""),
        ("forces: {vector: {p: -gamma*p**3}}\nnoise: {heat: {hamiltonian: q}}", ""),
    ],
)
def test_the_temperature_is_found_where_there_is_one(more, temperature):
    statements = [s.name for s in examine(compile_text(OSCILLATOR + more + "\n").spec).groups["Noise"][1:]]
    expected = f"the density exp(−H/θ) on the leaves is stationary, with θ = {temperature}"
    assert statements == ([expected] if temperature else [])


def test_a_source_without_a_flow_in_closed_form_is_named():
    text = SPIN + "scheme: splitting\nnoise: {odd: {hamiltonian: exp(x*y) + z}}\n"
    with pytest.raises(SpecError, match="needs the flow of the noise odd in closed form"):
        compile_text(text)


@pytest.mark.thin(1)
@pytest.mark.slow
@pytest.mark.parametrize("kind", slow_but(["dated"], ["dated", "thermal", "split"]))
def test_verification_asks_for_what_is_promised(kind):
    solvers = {target: solver(made(kind), target) for target in ("c", "numpy")}
    verification = verify(
        made(kind),
        solvers,
        "test",
        SYSTEMS[kind][1],
        {p.name: float(p.value) for p in made(kind).program.parameters},
        0.1,
        50,
        quick=True,
    )
    assert verification.failures == []
    required = {c.name.partition(":")[0].partition(" (")[0] for c in verification.checks if c.limit}
    assert {"observed order, without the noise", "strong order, along common paths", "Casimir C"} <= required
    assert {
        "reversibility",
        "tangent map against differences",
        "steps that fail with the largest increments",
    } <= required
    assert ("Poisson defect, exact tangent" in required) == (kind != "thermal")  # forces act in the thermal system


def test_no_panel_of_a_report_sets_noise_beside_a_method_that_takes_none():
    assert not gathered(made("thermal"), None, None, {}).solvers


def test_the_code_says_what_noise_leaves_of_it():
    text = "\n".join(emit(made("dated").program, "c", COMMAND).values())
    assert "noise: z; in the sense of Stratonovich, along Hamiltonian fields, so it conserves all Casimirs" in text
    assert "weak order 1" in text


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("damping: lam\norder: 4", "with forces and noise a step has order 2, not 4"),
        ("scheme: splitting\nforces: {covector: {z: exp(x*y*z)}}", "the force ζ_z = .* has no elementary flow"),
        ("adjoint: true", "adjoint: not with noise"),
    ],
)
def test_what_cannot_be_done_is_refused(more, message):
    with pytest.raises(SpecError, match=message):
        compile_text(SPIN + HEAT + more + "\n")


def test_one_sided_steps_are_refused():
    """They evaluate the noise at one end of the step, which is not the Stratonovich sense."""
    with pytest.raises(SpecError, match="noise needs a symmetric bi-realisation; canonical-euler is not"):
        compile_text(LINEAR["oscillator"] + "birealisation: canonical-euler\n")


def test_arguments_of_noise_are_checked():
    noisy, quiet = solver(made("thermal"), "numpy"), solver(compile_text(SPIN), "numpy")
    for arguments, error in (
        ({"seed": -1}, ValueError),
        ({"seed": 2**64}, ValueError),
        ({"member": 2**32}, ValueError),
        ({"increments": np.zeros((2, 4))}, ValueError),
        ({"increments": np.zeros((2, 3))}, ValueError),  # for three steps
        ({"retry": 1}, TypeError),
    ):
        with pytest.raises(error):
            noisy.integrate([0, 0, 1], 0.1, 3, **arguments)
    with pytest.raises(TypeError, match="has no noise"):
        quiet.integrate([0, 0, 1], 0.1, 3, seed=1)
    with pytest.raises(TypeError, match="section is not available with noise"):
        noisy.section([0, 0, 1], 0.1, 3, lambda x: x[:, 0])
    with pytest.raises(TypeError, match="solve_ivp is not available with noise"):
        phigen.solve_ivp(noisy, (0, 1), [0, 0, 1], h=0.1)


def test_states_at_times_are_those_after_whole_steps():
    """A shorter step has other random numbers than a whole step, so its end is not on the path."""
    run = solver(made("thermal"), "numpy").integrate([0, 0, 1], 0.1, 6, 2, seed=3)
    assert run.at([0.4, 0.2]).tolist() == [run.x[2].tolist(), run.x[1].tolist()]
    for between in (0.1, 0.25):
        with pytest.raises(ValueError, match=f"the time {between} is between two stored states"):
            run.at([0.2, between])
