"""Benchmark of the eight planets: phigen's methods for near-integrable systems against REBOUND, if it is installed.

All methods start from the same Cartesian state of the nine bodies about their centre of mass, in astronomical units and
days (WHFast512 in units with G = 1). They return the state of all bodies every ten years, and one function computes the
energy of these states. The steps between two outputs are one call. Times are CPU times of one core, the least over all
intervals of ten years; the methods take turns.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.tables import table
from phigen import resources, spec
from phigen.api import solver_of
from phigen.compiler import compile_spec
from phigen.runtime.solver import Solver

PLANETS = 8
#: Days between two outputs.
DECADE = 3650.0
AXES = "xyz"
Bodies = tuple[NDArray[np.float64], NDArray[np.float64]]

#: Methods of phigen: relative coordinates (``coordinates_from``), composition, order, and step in days.
PHIGEN = (
    ("jacobi", "wisdom-holman-17", 2, 5.0),
    ("jacobi", "wisdom-holman-17", 2, 2.5),
    ("jacobi", "wisdom-holman-modified-17", 4, 5.0),
    ("jacobi", "wisdom-holman-modified-17", 4, 3.65),
    ("jacobi", "aba-10-6-4", 4, 10.0),
    ("jacobi", "aba-10-6-4", 4, 20.0),
    ("democratic_heliocentric", "wisdom-holman-17", 2, 5.0),
)
#: Integrators of REBOUND: name, options and step in days. With safe_mode 0, positions and velocities are synchronised
#: at outputs only.
REBOUND = (
    ("whfast", {"corrector": 17, "safe_mode": 0}, 5.0),
    ("whfast", {"corrector": 17, "safe_mode": 0}, 2.5),
    ("whfast", {"corrector": 17, "kernel": "lazy", "safe_mode": 0}, 5.0),
    ("whfast", {"corrector": 17, "kernel": "lazy", "safe_mode": 0}, 2.5),
    ("whfast512", {"corrector": 17}, 5.0),
)


@dataclass(frozen=True)
class Contestant:
    """Method with a step in days; ``advance`` makes a number of steps, and returns positions and velocities (9, 3)."""

    name: str
    step: float
    advance: Callable[[int], Bodies]


def measured(quick: bool, say: Callable[[str], None]) -> str:
    """Return the table: nanoseconds for a planet and step, nanoseconds for a planet and day, largest relative energy
    error."""
    masses, q, v, gm = planets()
    contestants = [*phigen_methods(masses, q, v), *rebound_methods(masses, q, v, gm, say)]
    first = energy(masses, q, v, gm)
    best, worst = dict.fromkeys(range(len(contestants)), np.inf), dict.fromkeys(range(len(contestants)), 0.0)
    for _ in range(5 if quick else 100):
        for k, contestant in enumerate(contestants):
            steps = round(DECADE / contestant.step)
            began = time.process_time()
            state = contestant.advance(steps)
            best[k] = min(best[k], (time.process_time() - began) / steps)
            worst[k] = max(worst[k], abs(energy(masses, *state, gm) / first - 1))
    rows = []
    for k, contestant in enumerate(contestants):
        nanoseconds = best[k] * 1e9 / PLANETS
        rows.append(
            [
                contestant.name,
                f"{contestant.step:g}",
                f"{nanoseconds:.0f}",
                f"{nanoseconds / contestant.step:.1f}",
                f"{worst[k]:.1e}",
            ]
        )
    return table(["method", "step, d", "ns a planet and step", "ns a planet and day", "energy error"], rows)


def planets() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Return masses (9,), positions and velocities (9, 3) about the centre of mass, and the constant GM of the Sun."""
    source = spec.load(resources.bundled()["planets"])
    values = {p.name: float(p.value) for p in source.parameters}
    masses = np.array([1.0, *(values[f"m{i}"] for i in range(1, PLANETS + 1))])
    q, p = np.zeros((2, PLANETS + 1, 3))
    q[1:], p[1:] = np.array([float(e) for e in source.runs["orbits"].initial]).reshape(2, PLANETS, 3)
    p[0] = -p[1:].sum(axis=0)
    return masses, q - masses @ q / masses.sum(), p / masses[:, np.newaxis], values["GM"]


def energy(masses: NDArray[np.float64], q: NDArray[np.float64], v: NDArray[np.float64], gm: float) -> float:
    """Return the total energy of the bodies, in masses of the Sun times (astronomical units per day)²."""
    i, j = np.triu_indices(len(masses), 1)
    distances = np.linalg.norm(q[i] - q[j], axis=1)
    return float((masses @ (v**2).sum(axis=1)) / 2 - gm * (masses[i] * masses[j] / distances).sum())


def spec_text(change: str, composition: str, order: int) -> str:
    """Return the spec of all nine bodies in Cartesian coordinates; ``change`` is its value of ``coordinates_from``."""
    source = spec.load(resources.bundled()["planets"])
    bodies = range(PLANETS + 1)
    values = {p.name: float(p.value) for p in source.parameters} | {"m0": 1.0}
    q = [f"{a}{i}" for i in bodies for a in AXES]
    kinetic = " + ".join(f"(px{i}**2 + py{i}**2 + pz{i}**2)/(2*m{i})" for i in bodies)
    pairs = " - ".join(
        f"GM*m{i}*m{j}/sqrt({' + '.join(f'({a}{i} - {a}{j})**2' for a in AXES)})" for i in bodies for j in range(i)
    )
    parameters = [f"m{i}: {{value: {values[f'm{i}']!r}, positive: true}}" for i in bodies]
    return (
        f"phigen: 1\nname: nine_bodies\ncoordinates: [{', '.join([*q, *(f'p{c}' for c in q)])}]\n"
        f"parameters: {{GM: {values['GM']!r}, {', '.join(parameters)}}}\n"
        f"poisson: {{canonical: {{q: [{', '.join(q)}], p: [{', '.join(f'p{c}' for c in q)}]}}}}\n"
        f"hamiltonian: {kinetic} - {pairs}\n"
        f"scheme: splitting\ncoordinates_from: {change}\ncomposition: {composition}\norder: {order}\n"
    )


def phigen_methods(masses: NDArray[np.float64], q: NDArray[np.float64], v: NDArray[np.float64]) -> Iterator[Contestant]:
    """Yield phigen's methods, compiled once for each spec."""
    solvers: dict[str, Solver] = {}
    momenta = masses[:, np.newaxis] * v
    start = np.concatenate([q.ravel(), momenta.ravel()])
    for change, composition, order, step in PHIGEN:
        text = spec_text(change, composition, order)
        if text not in solvers:
            solvers[text] = solver_of(compile_spec(spec.loads(text)), "c")
        solver = solvers[text]
        session = solver.session(start)

        def advance(steps: int, session=session, step=step) -> Bodies:  # type: ignore[no-untyped-def]
            session.step(step, steps)
            q_now, p_now = session.x.reshape(2, PLANETS + 1, 3)
            return q_now, p_now / masses[:, np.newaxis]

        yield Contestant(f"phigen, {change.replace('_', ' ')}, `{composition}`", step, advance)


def rebound_methods(
    masses: NDArray[np.float64],
    q: NDArray[np.float64],
    v: NDArray[np.float64],
    gm: float,
    say: Callable[[str], None],
) -> Iterator[Contestant]:
    """Yield the methods of REBOUND; none if it is not installed."""
    try:
        import rebound
    except ImportError:
        say("rebound is not installed")
        return
    for name, options, step in REBOUND:
        unit = np.sqrt(gm) if name == "whfast512" else 1.0  # number of time units in a day; WHFast512 requires G = 1
        simulation = rebound.Simulation()
        simulation.G = 1.0 if name == "whfast512" else gm
        for m, at, velocity in zip(masses, q, v / unit, strict=True):
            simulation.add(m=m, **dict(zip([*AXES, "vx", "vy", "vz"], [*at, *velocity], strict=True)))
        simulation.integrator, simulation.dt, simulation.exact_finish_time = name, step * unit, 0
        for option, value in options.items():
            setattr(simulation.integrator, option, value)
        if name == "whfast512":
            simulation.integrator.concatenate_steps = round(DECADE / step)

        def advance(steps: int, simulation=simulation, step=step, unit=unit) -> Bodies:  # type: ignore[no-untyped-def]
            simulation.integrate(simulation.t + (steps - 0.5) * step * unit, exact_finish_time=0)
            simulation.synchronize()
            found_q, found_v = np.zeros((2, PLANETS + 1, 3))
            simulation.serialize_particle_data(xyz=found_q, vxvyvz=found_v)
            return found_q, found_v * unit

        shown = ", ".join(f"{key} {value}" for key, value in options.items() if key != "safe_mode")
        yield Contestant(f"REBOUND {name.upper().replace('FAST', 'Fast')}, {shown}", step, advance)


def main(argv: Sequence[str] = ()) -> None:
    """Print the table."""
    print(measured("--quick" in argv, print))


if __name__ == "__main__":
    import sys

    main(sys.argv)
