"""The interface of bi-realisations: the record that every kind returns, and the type of the function that builds it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import Expression, substitute, symbol, symbols_of, topological
from phigen.symbolic.symbols import momentum
from phigen.symbolic.tower import Tower

PAPER = (
    "O. Cosserat, C. Laurent-Gengoux, V. Salnikov, "
    "Numerical Methods in Poisson Geometry and their Application to Mechanics"
)


@dataclass(frozen=True)
class BiRealisation:
    """Two maps α, β : (x, p) → x that satisfy the axioms in `phigen.realisations.axioms`.

    All tuples have one expression for each coordinate, in the symbols NAME of the coordinates, the symbols
    ``momentum(NAME)`` of the components of the covector p, and the parameters. With {x_i, p_j} = δ_ij: {α_i, α_j} =
    π_ij∘α, {β_i, β_j} = −π_ij∘β, {α_i, β_j} = 0.

    - ``displacement``: α − x, in a form in which no terms of the size of x cancel
    - ``increment``: β − α, in a form with the same property
    - ``symmetric``: whether β(x, p) = α(x, −p)
    - ``exact``: false for a truncated series. Steps are then Poisson maps only up to a power of the step size
    - ``degree``: for a truncated series, the degree d in p up to which α and β are correct; the brackets of their
      components are correct up to degree d − 1
    - ``path``: whether the solver follows the path ṁ = π(m)p (Karasev's construction). Then ``alpha`` and ``beta`` are
      truncated series; the S_i are computed from these, but no step evaluates them
    - ``inner``: for a pull-back, the system in the coordinates y in which the spec states π, and the bi-realisation of
      this system; the axioms are proved in y
    - ``explanation``: the chosen form and the reason, for the user; ``reference``: the source of the formulas
    """

    kind: str
    coordinates: tuple[str, ...]
    alpha: tuple[Expression, ...]
    beta: tuple[Expression, ...]
    displacement: tuple[Expression, ...]
    increment: tuple[Expression, ...]
    symmetric: bool
    exact: bool = True
    path: bool = False
    degree: int | None = None
    inner: tuple[System, BiRealisation] | None = None
    explanation: str = ""
    reference: str = PAPER

    @property
    def covector(self) -> tuple[str, ...]:
        """The names of the symbols of the covector p, in the order of the coordinates."""
        return covector_names(self.coordinates)

    @property
    def label(self) -> str:
        """The kind of the bi-realisation, as displayed to users. If the bi-realisation is a truncated series, the text
        says that it is approximate.
        """
        if self.exact:
            return self.kind
        return f"{self.kind} (approximate" + (")" if self.degree is None else f", Poisson up to degree {self.degree})")


#: Type of the functions that build the bi-realisation of a system. They raise `SpecError` if their kind does not apply
#: to the system.
Builder = Callable[[System, BirealisationChoice], BiRealisation]


def covector_names(coordinates: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the symbols of the covector p, in the order of the coordinates."""
    return tuple(momentum(c) for c in coordinates)


def covector_symbols(coordinates: Sequence[str]) -> list[Expression]:
    """Return the symbols of the covector p as expressions."""
    return [symbol(name) for name in covector_names(coordinates)]


def reversed_covector(expressions: Sequence[Expression], coordinates: Sequence[str]) -> list[Expression]:
    """Return the expressions with −p in place of the covector p."""
    return substitute(expressions, {name: -symbol(name) for name in covector_names(coordinates)})


def is_symmetric(alpha: Sequence[Expression], beta: Sequence[Expression], coordinates: Sequence[str]) -> bool:
    """Whether β(x, p) = α(x, −p) is proved. Methods with a symmetric bi-realisation are symmetric and have even
    order."""
    mirrored = reversed_covector(alpha, coordinates)
    pairs = [(a, b) for a, b in zip(mirrored, beta, strict=True) if a is not b]
    roots = [e for pair in pairs for e in pair]
    tower = Tower(symbols_of(*roots), roots)
    images = tower.convert_all(roots)
    return all(tower.is_zero(a - b) for a, b in zip(images[::2], images[1::2], strict=True))


def simplified_differences(left: Sequence[Expression], right: Sequence[Expression]) -> tuple[Expression, ...]:
    """Return left − right for each component. The normal form in a polynomial ring is taken if it has fewer
    operations.
    """
    roots = [a - b for a, b in zip(left, right, strict=True)]
    tower = Tower(symbols_of(*roots), roots)
    images = [tower.expression(element) for element in tower.convert_all(roots)]
    return tuple(min(image, raw, key=_operations) for image, raw in zip(images, roots, strict=True))


def _operations(e: Expression) -> int:
    return sum(1 for node in topological([e]) if node.args)


def refuse(message: str, hint: str = "") -> SpecError:
    """Return the error for a bi-realisation that does not apply to a system; the caller adds the place in the spec."""
    return SpecError([Diagnostic(message, hint=hint)])
