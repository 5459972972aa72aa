"""Systems from short texts, for the tests."""

from __future__ import annotations

from phigen.geometry.families import dimension
from phigen.geometry.system import System, build_system, system_from_spec
from phigen.spec import loads
from phigen.spec.model import LieAlgebraForm, MatrixForm
from phigen.symbolic.expression import ZERO


def system(coordinates: str, poisson: str, hamiltonian: str | None = None, extra: str = "") -> System:
    """The system of a spec with these parts; ``poisson`` and ``extra`` are YAML, coordinates separated by spaces."""
    names = coordinates.split()
    return system_from_spec(
        loads(
            f"phigen: 1\nname: t\ncoordinates: [{', '.join(names)}]\npoisson: {poisson}\n"
            f"hamiltonian: {hamiltonian or names[0]}\norder: 2\n{extra}"
        )
    )


def family(name: str, size: int, sign: int = 1) -> System:
    """The dual of a named algebra in coordinates x1, x2, …"""
    names = [f"x{i + 1}" for i in range(dimension(name, size))]
    return build_system("t", names, [], LieAlgebraForm(sign=sign, family=name, size=size), ZERO)


def typed(original: System) -> System:
    """The same system with its π as a matrix, everything else forgotten."""
    return build_system(
        original.name, original.coordinates, original.parameters, MatrixForm(original.poisson), original.hamiltonian
    )


def texts(expressions: object) -> list[str]:
    """Expressions as text."""
    return [str(e) for e in expressions]  # type: ignore[attr-defined]
