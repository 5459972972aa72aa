"""Systems for tests, made from short texts."""

from __future__ import annotations

from phigen.geometry.families import dimension
from phigen.geometry.system import System, build_system, system_from_spec
from phigen.spec import loads
from phigen.spec.model import LieAlgebraForm, MatrixForm
from phigen.symbolic.expression import ZERO


def system(coordinates: str, poisson: str, hamiltonian: str | None = None, extra: str = "") -> System:
    """Return the system of a spec with these parts. ``coordinates`` are names with spaces between them; ``poisson`` and
    ``extra`` are YAML.
    """
    names = coordinates.split()
    return system_from_spec(
        loads(
            f"phigen: 1\nname: t\ncoordinates: [{', '.join(names)}]\npoisson: {poisson}\n"
            f"hamiltonian: {hamiltonian or names[0]}\norder: 2\n{extra}"
        )
    )


def family(name: str, size: int, sign: int = 1) -> System:
    """Return the system on the dual of a named Lie algebra, with coordinates x1, x2, … and H = 0."""
    names = [f"x{i + 1}" for i in range(dimension(name, size))]
    return build_system("t", names, [], LieAlgebraForm(sign=sign, family=name, size=size), ZERO)


def typed(original: System) -> System:
    """Return the system with π given as a matrix of expressions, so that its form in the spec is unknown."""
    return build_system(
        original.name, original.coordinates, original.parameters, MatrixForm(original.poisson), original.hamiltonian
    )


def texts(expressions: object) -> list[str]:
    """Return the expressions as texts, for comparison with expected formulas."""
    return [str(e) for e in expressions]  # type: ignore[attr-defined]
