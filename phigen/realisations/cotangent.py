"""Exterior calculus with polynomials on T*U, the set of all (x, p), for Poisson sprays and Moser's trick.

The variables are z = (x_1, …, x_n, p_1, …, p_n). The canonical form is ω = Σ dx_i ∧ dp_i, so that {x_i, p_j} = δ_ij.
The *weight* of a form is the number of its factors p and dp, that is its eigenvalue under the Lie derivative along the
Euler field E = Σ p_i ∂_{p_i}. So ω has weight 1. The Lie derivative along a spray raises weights by 1. A function or
form is stored as a dictionary: weight → the part of this weight.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

from phigen.realisations.protocol import covector_names
from phigen.symbolic.expression import Expression, symbols_of
from phigen.symbolic.tower import Poly, Tower

#: A vector field or a 1-form: one component for each of the 2n variables x and p.
Components = list[Poly]
#: A 2-form Σ w_ab dz_a ∧ dz_b: (a, b) with a < b → w_ab, without zeros.
TwoForm = dict[tuple[int, int], Poly]
#: A function by weight: weight (here the degree in p) → the part of this weight.
GradedFunction = dict[int, Poly]
GradedForm = dict[int, TwoForm]


class Cotangent:
    """The ring of functions on T*U that contains some expressions and all their derivatives in x and p.

    ``size`` is n. Variable number a < n is x_a, and variable number n + i is p_i. Parameters are further symbols of the
    ring.
    """

    def __init__(self, coordinates: Sequence[str], expressions: Sequence[Expression]) -> None:
        self.size = len(coordinates)
        self.names = (*coordinates, *covector_names(coordinates))
        parameters = [s for s in symbols_of(*expressions) if s not in self.names]
        self.tower = Tower([*self.names, *parameters], expressions, self.names)
        self.variables = [self.tower.variable(name) for name in self.names]

    # -- functions --------------------------------------------------------------------------------

    def along(self, field: Components, f: Poly) -> Poly:
        """Return the derivative L_Y f = Σ Y_a ∂_a f of a function f along a vector field Y."""
        return self.tower.combine(
            y * d for y, name in zip(field, self.names, strict=True) if y != 0 and (d := self.derivative(f, name)) != 0
        )

    def derivative(self, f: Poly, name: str) -> Poly:
        """Return ∂f/∂z for the variable z called ``name``."""
        return self.tower.derivative(f, name)

    def scaled(self, f: Poly, factor: Fraction) -> Poly:
        """Return the product of a function f and a number."""
        return f * self.tower.constant(factor)

    # -- forms ------------------------------------------------------------------------------------

    def canonical(self) -> TwoForm:
        """Return the canonical form ω = Σ dx_i ∧ dp_i."""
        return {(i, self.size + i): self.tower.constant(1) for i in range(self.size)}

    def contract(self, field: Components, form: TwoForm) -> Components:
        """Return the contraction ι_Y w = Σ w_ab (Y_a dz_b − Y_b dz_a) of a 2-form w with a vector field Y."""
        result = [self.tower.zero] * len(self.names)
        for (a, b), w in form.items():
            result[b] = result[b] + w * field[a]
            result[a] = result[a] - w * field[b]
        return result

    def exterior(self, form: Components) -> TwoForm:
        """Return the exterior derivative of a 1-form Σ λ_b dz_b."""
        result: TwoForm = {}
        for b, component in enumerate(form):
            if component == 0:
                continue
            for a, name in enumerate(self.names):
                if a != b and (d := self.derivative(component, name)) != 0:
                    key, term = ((a, b), d) if a < b else ((b, a), -d)
                    result[key] = result[key] + term if key in result else term
        return {key: w for key, w in result.items() if w != 0}

    def lie(self, field: Components, form: TwoForm) -> TwoForm:
        """Return the Lie derivative L_Y w = d ι_Y w of a closed 2-form w along a vector field Y."""
        return self.exterior(self.contract(field, form))

    def vanishes(self, form: TwoForm) -> bool:
        """Whether a 2-form is proved to be 0."""
        return all(self.tower.is_zero(w) for w in form.values())

    def sum(self, forms: Iterable[tuple[Fraction, TwoForm]]) -> TwoForm:
        """Return a linear combination of 2-forms, given as pairs (factor, form)."""
        result: TwoForm = {}
        for factor, form in forms:
            for key, w in form.items():
                term = self.scaled(w, factor)
                result[key] = result[key] + term if key in result else term
        return {key: w for key, w in result.items() if w != 0}

    def euler(self) -> Components:
        """Return the Euler field E = Σ p_i ∂_{p_i}."""
        return [self.tower.zero] * self.size + self.variables[self.size :]

    def dual(self, form: Components) -> Components:
        """Return the vector field Y with ι_Y ω = λ for a 1-form λ. The x components of Y are λ_p, its p components
        −λ_x.
        """
        return [*form[self.size :], *(-f for f in form[: self.size])]
