"""Systems for tests: those of the corpus with their runs, and some written in a few lines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from typing import Any

import pytest

from phigen import resources, spec
from phigen.compilation import Compilation
from phigen.compiler import compile_spec
from phigen.geometry.system import System, system_from_spec
from phigen.realisations.catalogue import realise
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.discretisation import hamilton_jacobi
from phigen.spec.model import Run
from phigen.symbolic.expression import Expression, symbol
from phigen.symbolic.numeric import evaluate_with_scale
from phigen.symbolic.symbols import momentum

#: Systems of the corpus that depend on the time; tests/generated/test_time.py tests them, and `NAMES` leaves them out.
TIMED = ("duffing", "seasonal_predator_prey", "spin_resonance")
#: Systems of the corpus with forces; tests/generated/test_forces.py tests them.
FORCED = ("landau_lifshitz", "thruster_body")
#: Systems of the corpus with noise; tests/generated/test_noise.py tests them.
NOISY = ("double_well", "thermal_chain", "thermal_spin")
#: Systems of the corpus with a monitor; tests/scheme/test_monitor.py and tests/splitting/test_logarithmic.py test them.
MONITORED = ("kepler_eccentric",)
#: Systems of the corpus with the scheme Gauss collocation; tests/gauss tests them.
COLLOCATED = ("comet_jupiter", "kowalevski_gauss")
#: Systems of the corpus with the scheme splitting; tests/splitting tests them.
SPLIT = ("earth_moon", "planets", "satellite_wheels")
NAMES = sorted(
    {path.stem for path in resources.bundled_specs().glob("*.yaml")}
    - {*TIMED, *FORCED, *NOISY, *MONITORED, *COLLOCATED, *SPLIT}
)


#: Lattices of the corpus; tests/lattice/test_corpus.py tests them.
LATTICES = sorted(path.stem for path in (resources.bundled_specs() / "lattices").glob("*.yaml"))


@cache
def spec_of(name: str) -> spec.Spec:
    """Return the spec of a system of the corpus."""
    return spec.load(resources.bundled()[name])


#: Pairs (system, run) of all runs of the systems in `NAMES`.
RUNS = [(name, run) for name in NAMES for run in spec_of(name).runs]

#: One system for each kind of step and each kind of bi-realisation in the corpus; tests/test_corpus.py checks that.
#: `make test` runs long tests for these systems only, and `make test-all` for the others too.
QUICK = (
    "ablowitz_ladik3", "lotka_volterra", "nambu_pendulum", "pendulum", "pendulum_euler", "poisson_not_hamiltonian",
    "rigid_body",
)  # fmt: skip


#: Systems that add little to tests: other systems, some with few coordinates, have the same kinds of steps,
#: bi-realisations and functions. Tests with the mark `corpus` include them only with `--corpus`. Golden files show
#: changes of their C and NumPy.
ALIKE = (
    "charged_particle", "cyclotron", "dzhanibekov", "engel_geodesics", "gaussian_moments", "guiding_centre",
    "harmonic_oscillator", "kowalevski_top", "predator_prey", "quaternion_top", "rigid_body_dual", "rigid_body_paper",
    "satellite", "sir_epidemic", "sklyanin_gyrostat", "so4_manakov", "spin_chain5", "toda3_quadratic", "volterra5",
)  # fmt: skip


def slow_but(quick: Iterable[Any], of: Iterable[Any] = NAMES) -> list[Any]:
    """Return the cases ``of`` as parameters of a test; those that are not in ``quick`` have the mark `slow`. A tuple
    gives the values of several parameters.
    """
    values = [each if isinstance(each, tuple) else (each,) for each in of]
    chosen = [each if isinstance(each, tuple) else (each,) for each in quick]
    return [pytest.param(*each, marks=() if each in chosen else pytest.mark.slow) for each in values]


BODY = """coordinates: [x1, x2, x3]
poisson: {brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}}
hamiltonian: x1**2/2 + x2**2/4 + x3**2/6
"""

#: A rattleback. When its spin reverses, the equation of a step has further solutions, at other energies.
RATTLEBACK = """coordinates: [pitch, roll, spin]
poisson: {brackets: {pitch: {spin: 4*pitch}, roll: {spin: -roll}}}
hamiltonian: (pitch**2 + roll**2 + spin**2)/2
order: 6
"""

#: The brackets of so(3) in a basis that depends on the parameters r and s.
SCALED = """coordinates: [x, y, z]
parameters: {r: 2, s: 3}
poisson: {brackets: {x: {y: r*z, z: -y/r}, y: {z: s*x}}}
hamiltonian: x**4/4 + y**2/2 + x*y*z
casimirs: {C: x**2*r*s + y**2 + r**2*z**2}
"""

SPECIES = """coordinates: [x1, x2, x3]
poisson: {log_canonical: [[0, 1, 1], [-1, 0, 1], [-1, -1, 0]]}
hamiltonian: x1 + x2 + x3
"""


def plain(specification: spec.Spec) -> spec.Spec:
    """Return the spec with the profile ``fast``, and with no gauge where the spec leaves the gauge to phigen:
    tests/generated/test_gauge.py tests gauges, and tests/generated/test_profiles.py the other profile.
    """
    return replace(
        specification, profile="fast", gauge="none" if specification.gauge == "auto" else specification.gauge
    )


def compile_anew(text: str, order: int | None = None, scheme: str | None = None, **more: Any) -> Compilation:
    """Compile a spec, given as YAML without its first two keys. The compilation is not cached, as some tests modify
    phigen itself.
    """
    return compile_spec(plain(spec.loads(f"phigen: 1\nname: t\n{text}")), order=order, scheme=scheme, **more)


#: Compile a spec, given as YAML without its first two keys, and cache the compilation.
compile_text = cache(compile_anew)


def small(compilation: Compilation) -> Compilation:
    """Return the compilation with the profile ``small``, whose C compiles in a third of the time."""
    return replace(compilation, program=replace(compilation.program, profile="small"))


@cache
def as_given(name: str) -> Compilation:
    """Compile a spec of the corpus without changes."""
    specification = spec_of(name)
    return compile_spec(specification, system=None if specification.lattice else described(name)[1])


@cache
def compiled(name: str, order: int | None = None, scheme: str | None = None) -> Compilation:
    """Compile a spec of the corpus after the changes that `plain` makes."""
    specification = spec_of(name)
    if order is None and scheme is None and specification.profile == "fast" and not as_given(name).program.gauge:
        return as_given(name)
    return compile_spec(plain(specification), order=order, scheme=scheme, system=described(name)[1])


@cache
def described(name: str) -> tuple[spec.Spec, System, BiRealisation]:
    """Return the spec, the system and the bi-realisation of a system of the corpus. This takes little time, as no
    solver is generated, so tests can choose systems by it.
    """
    specification = spec_of(name)
    system = system_from_spec(specification)
    return specification, system, realise(system, specification.birealisation)


def first_run(compilation: Compilation) -> Run:
    """Return the first run of the spec of a compilation."""
    return next(iter(compilation.spec.runs.values()))


@dataclass(frozen=True)
class Setting:
    """Numbers of a run: initial state, step size, and the values of all parameters."""

    x: tuple[float, ...]
    h: float
    parameters: Mapping[str, float]


def setting(compilation: Compilation, name: str | None = None) -> Setting:
    """Return the numbers of a run of the spec: the named run, or the first one."""
    run = compilation.spec.runs[name] if name else first_run(compilation)
    defaults = {p.name: float(p.value) for p in compilation.spec.parameters}
    return Setting(
        tuple(float(v) for v in run.initial),
        float(run.step),
        {**defaults, **{k: float(v) for k, v in run.parameters.items()}},
    )


def casimir_scales(compilation: Compilation, at: Setting) -> list[float]:
    """Return a scale for the round-off errors of each Casimir at a state: the absolute value of its largest term, but
    at least that of the Casimir.
    """
    values = _fractions(compilation.spec.coordinates, at)
    pairs = evaluate_with_scale(list(compilation.system.casimirs.values()), values, 30)
    return [max(abs(float(value)), 1e-300) for value, _ in pairs]


def _fractions(coordinates: Sequence[str], at: Setting) -> dict[str, Fraction]:
    return {k: Fraction(v) for k, v in [*zip(coordinates, at.x, strict=True), *at.parameters.items()]}


def series_of(system, realisation, terms, static=()):
    """Return the terms S_1 … S_terms of the Hamilton–Jacobi series of a system, as elements of a differential ring."""
    return hamilton_jacobi(system, realisation, terms, static).polynomial(terms)


def symbols(names: str) -> list[Expression]:
    """Return symbols for names separated by spaces; ``p:x`` denotes the momentum of x."""
    return [symbol(momentum(n[2:]) if n.startswith("p:") else n) for n in names.split()]
