"""Systems that tests share: those of the corpus and their runs, and some written in a few lines."""

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

#: The corpus, without the systems that depend on the time: tests/generated/test_time.py is about these.
TIMED = ("duffing", "seasonal_predator_prey", "spin_resonance")
#: Those with forces: tests/generated/test_forces.py.
FORCED = ("landau_lifshitz", "thruster_body")
#: Those with noise: tests/generated/test_noise.py.
NOISY = ("double_well", "thermal_chain", "thermal_spin")
#: Those with a monitor: tests/scheme/test_monitor.py and tests/splitting/test_logarithmic.py.
MONITORED = ("kepler_eccentric",)
#: Those by Gauss collocation: tests/gauss.
COLLOCATED = ("comet_jupiter", "kowalevski_gauss")
#: Those by splitting: tests/splitting.
SPLIT = ("earth_moon", "planets", "satellite_wheels")
NAMES = sorted(
    {path.stem for path in resources.bundled_specs().glob("*.yaml")}
    - {*TIMED, *FORCED, *NOISY, *MONITORED, *COLLOCATED, *SPLIT}
)


#: The lattices of the corpus: tests/lattice/test_corpus.py is about these.
LATTICES = sorted(path.stem for path in (resources.bundled_specs() / "lattices").glob("*.yaml"))


@cache
def spec_of(name: str) -> spec.Spec:
    """The spec of a system of the corpus."""
    return spec.load(resources.bundled()[name])


#: Every run of the corpus, as pairs of names.
RUNS = [(name, run) for name in NAMES for run in spec_of(name).runs]

#: One system for each kind of step and of bi-realisation that the corpus has; tests/test_corpus.py tells what they
#: cover. What takes long is done for these by `make test`, and for all by `make test-all`.
QUICK = (
    "ablowitz_ladik3", "lotka_volterra", "nambu_pendulum", "pendulum", "pendulum_euler", "poisson_not_hamiltonian",
    "rigid_body",
)  # fmt: skip


#: Systems whose steps, bi-realisations and functions others have, of few coordinates as well: what is marked `corpus`
#: goes through them where `--corpus` is given. That the C and NumPy of them is what it was, golden files tell.
ALIKE = (
    "charged_particle", "cyclotron", "dzhanibekov", "engel_geodesics", "gaussian_moments", "guiding_centre",
    "harmonic_oscillator", "kowalevski_top", "predator_prey", "quaternion_top", "rigid_body_dual", "rigid_body_paper",
    "satellite", "sir_epidemic", "sklyanin_gyrostat", "so4_manakov", "spin_chain5", "toda3_quadratic", "volterra5",
)  # fmt: skip


def slow_but(quick: Iterable[Any], of: Iterable[Any] = NAMES) -> list[Any]:
    """Parameters of a test, some of them quick and the others slow; tuples are several parameters."""
    values = [each if isinstance(each, tuple) else (each,) for each in of]
    chosen = [each if isinstance(each, tuple) else (each,) for each in quick]
    return [pytest.param(*each, marks=() if each in chosen else pytest.mark.slow) for each in values]


BODY = """coordinates: [x1, x2, x3]
poisson: {brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}}
hamiltonian: x1**2/2 + x2**2/4 + x3**2/6
"""

#: Its reversals have solutions far away, at other energies.
RATTLEBACK = """coordinates: [pitch, roll, spin]
poisson: {brackets: {pitch: {spin: 4*pitch}, roll: {spin: -roll}}}
hamiltonian: (pitch**2 + roll**2 + spin**2)/2
order: 6
"""

#: so(3) in a basis that depends on parameters.
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
    """The spec with all code for speed, and with no gauge where it leaves that to phigen: tests/generated/test_gauge.py
    is about gauges, tests/generated/test_profiles.py about short code."""
    return replace(
        specification, profile="fast", gauge="none" if specification.gauge == "auto" else specification.gauge
    )


def compile_anew(text: str, order: int | None = None, scheme: str | None = None, **more: Any) -> Compilation:
    """The compilation of a spec given as YAML without its first two keys, made by the phigen of this moment."""
    return compile_spec(plain(spec.loads(f"phigen: 1\nname: t\n{text}")), order=order, scheme=scheme, **more)


#: The same, made once: for all tests but those that change phigen itself.
compile_text = cache(compile_anew)


def small(compilation: Compilation) -> Compilation:
    """The same compilation with short C, which compiles in a third of the time."""
    return replace(compilation, program=replace(compilation.program, profile="small"))


@cache
def as_given(name: str) -> Compilation:
    """The compilation of a spec of the corpus, as it stands."""
    specification = spec_of(name)
    return compile_spec(specification, system=None if specification.lattice else described(name)[1])


@cache
def compiled(name: str, order: int | None = None, scheme: str | None = None) -> Compilation:
    """The compilation of a system of the corpus, plain."""
    specification = spec_of(name)
    if order is None and scheme is None and specification.profile == "fast" and not as_given(name).program.gauge:
        return as_given(name)
    return compile_spec(plain(specification), order=order, scheme=scheme, system=described(name)[1])


@cache
def described(name: str) -> tuple[spec.Spec, System, BiRealisation]:
    """What is known of a system of the corpus before anything of its solver is made: quick, for choosing tests."""
    specification = spec_of(name)
    system = system_from_spec(specification)
    return specification, system, realise(system, specification.birealisation)


def first_run(compilation: Compilation) -> Run:
    """The first run of a spec."""
    return next(iter(compilation.spec.runs.values()))


@dataclass(frozen=True)
class Setting:
    """The numbers of a run: state, step size, parameters (all of them)."""

    x: tuple[float, ...]
    h: float
    parameters: Mapping[str, float]


def setting(compilation: Compilation, name: str | None = None) -> Setting:
    """The numbers of a run of the spec, the first unless another is named."""
    run = compilation.spec.runs[name] if name else first_run(compilation)
    defaults = {p.name: float(p.value) for p in compilation.spec.parameters}
    return Setting(
        tuple(float(v) for v in run.initial),
        float(run.step),
        {**defaults, **{k: float(v) for k, v in run.parameters.items()}},
    )


def casimir_scales(compilation: Compilation, at: Setting) -> list[float]:
    """The size of each Casimir at a state: the largest term that occurs in it, at least its value."""
    values = _fractions(compilation.spec.coordinates, at)
    pairs = evaluate_with_scale(list(compilation.system.casimirs.values()), values, 30)
    return [max(abs(float(value)), 1e-300) for value, _ in pairs]


def _fractions(coordinates: Sequence[str], at: Setting) -> dict[str, Fraction]:
    return {k: Fraction(v) for k, v in [*zip(coordinates, at.x, strict=True), *at.parameters.items()]}


def series_of(system, realisation, terms, static=()):
    """S_1 … S_terms of a system in a tower."""
    return hamilton_jacobi(system, realisation, terms, static).polynomial(terms)


def symbols(names: str) -> list[Expression]:
    """Symbols from names separated by spaces; ``p:x`` is the momentum of x."""
    return [symbol(momentum(n[2:]) if n.startswith("p:") else n) for n in names.split()]
