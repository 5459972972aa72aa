"""A Poisson spray as a vector field X on T*U: its construction from a spec, the checks, and Lie series along it.

T*U is the set of all (x, p). The field is X = Σ (πp)_i ∂_{x_i} + Σ f_j(x, p) ∂_{p_j} with f_j = Σ f_jkl(x) p_k p_l. So
the x components of X are πp, and the derivative along X raises the degree in p by 1. The article `PAPER` in
`phigen.realisations.protocol` defines sprays in the section "Poisson Spray and Moser's trick". The example of that
section sums over i < j, where all i, j are meant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import factorial

from phigen.errors import Diagnostic, LimitError
from phigen.geometry.shapes import LogCanonical
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.cotangent import Components, Cotangent, GradedForm
from phigen.realisations.protocol import covector_names, covector_symbols, refuse
from phigen.symbolic.expression import ZERO, Expression, symbol, symbols_of
from phigen.symbolic.readable import shortened
from phigen.symbolic.symbols import plain
from phigen.symbolic.tower import Poly

#: Largest number of monomials in one term of a Lie series.
MOST_TERMS = 20_000


@dataclass(frozen=True)
class Spray:
    """A Poisson spray X on T*U.

    ``field`` has the components of X for x, then those for p, as elements of the ring ``space``. ``name`` is the name
    of the spray in texts for users.
    """

    space: Cotangent
    field: Components
    name: str

    def apply(self, f: Poly) -> Poly:
        """Return L_X f, the derivative of a function f along the spray X."""
        return self.space.along(self.field, f)


def make_spray(system: System, name_or_forces: str | Sequence[Expression]) -> Spray:
    """Return the spray that a spec requests. `phigen.realisations.spray.build` explains the values of
    ``name_or_forces``.

    Raises `SpecError` if the p components are not quadratic forms in p.
    """
    name, forces = _covector_part(system, name_or_forces)
    velocity = hamiltonian_vector_field(system.poisson, covector_symbols(system.coordinates))
    space = Cotangent(system.coordinates, [*velocity, *forces])
    spray = Spray(space, space.tower.convert_all([*velocity, *forces]), name)
    _expect_quadratic(system, spray, forces)
    return spray


def _covector_part(system: System, name_or_forces: str | Sequence[Expression]) -> tuple[str, Sequence[Expression]]:
    if not isinstance(name_or_forces, str):
        return "given in the spec", _checked(system, name_or_forces)
    if name_or_forces == "natural" or (name_or_forces == "auto" and isinstance(system.shape, LogCanonical)):
        return "natural", _natural(system)
    if name_or_forces in ("auto", "flat"):
        return "flat", [ZERO] * system.dimension
    raise refuse(
        f"unknown spray {name_or_forces!r}",
        "write auto, flat or natural, or a list with one expression for each coordinate",
    )


def _natural(system: System) -> list[Expression]:
    if not isinstance(system.shape, LogCanonical):
        raise refuse(
            f"the natural spray is that of {{x_i, x_j}} = a_ij x_i x_j; this π is {system.shape}", "try spray: flat"
        )
    p = covector_symbols(system.coordinates)
    products = [symbol(c) * pi for c, pi in zip(system.coordinates, p, strict=True)]
    rates = hamiltonian_vector_field(system.shape.a, products)
    return [-(pj * rate) for pj, rate in zip(p, rates, strict=True)]


def _checked(system: System, forces: Sequence[Expression]) -> Sequence[Expression]:
    if len(forces) != system.dimension:
        raise refuse(f"spray has {len(forces)} components for {system.dimension} coordinates")
    known_symbols = {*system.coordinates, *system.parameter_names, *covector_names(system.coordinates)}
    unknown = [s for s in symbols_of(*forces) if s not in known_symbols]
    if unknown:
        raise refuse(f"spray uses {plain(unknown[0])}, which is not a coordinate, a parameter or p_NAME")
    return forces


def _expect_quadratic(system: System, spray: Spray, forces: Sequence[Expression]) -> None:
    """Raise `SpecError` unless the p components ``forces`` of the spray are quadratic forms in p.

    The condition is that each component, as an element of the ring, is homogeneous of degree 2 in p: a smooth function
    of p with this property is a quadratic form.
    """
    space, n = spray.space, system.dimension
    tower = space.tower
    non_polynomial = [
        k
        for k, g in enumerate(tower.generators, len(tower.symbols))
        if any(tower.depends_on(a, space.names[n:]) for a in g.arguments)
    ]
    for c, component, e in zip(system.coordinates, spray.field[n:], forces, strict=True):
        degrees = {sum(m[n : 2 * n]) for m in component.to_dict()}
        if degrees - {2} or any(component.degrees()[k] for k in non_polynomial):
            raise refuse(
                f"spray: the component of p_{c}, {shortened(e)}, is not homogeneous of degree 2 in the covector",
                "write each component of a spray as Σ f_kl(x) p_k p_l",
            )


def lie_series(spray: Spray, f: Poly, length: int, most_terms: int = MOST_TERMS) -> list[Poly]:
    """Return the terms L_Xᵏ f / k! of a Lie series for k = 0 … length.

    Raises `LimitError` for a term with more than ``most_terms`` monomials.
    """
    result = [f]
    for k in range(1, length + 1):
        result.append(spray.space.scaled(spray.apply(result[-1]), Fraction(1, k)))
        if len(result[-1]) > most_terms:
            raise LimitError(
                [Diagnostic(f"the Lie series of the spray has more than {most_terms} terms", hint="use a lower degree")]
            )
    return result


def centred_form(spray: Spray, top: int) -> GradedForm:
    """Return the parts of the 2-form Ω₀ = ∫_{−½}^{½} Φˢ*ω ds up to the weight ``top``.

    Φ is the flow of the spray X, and ω is the canonical form. The part of weight k + 1 is L_Xᵏ ω / ((k+1)! 2ᵏ) for even
    k. There are no parts of even weight.
    """
    space, form = spray.space, spray.space.canonical()
    result = {1: form}
    for k in range(1, top):
        form = space.lie(spray.field, form)
        if k % 2 == 0:
            result[k + 1] = space.sum([(Fraction(1, factorial(k + 1) * 2**k), form)])
    return result
