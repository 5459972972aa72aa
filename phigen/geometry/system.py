"""Hamiltonian systems on Poisson manifolds with global coordinates: what the compiler makes of a spec before it chooses
a method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, cast

from phigen.display import display
from phigen.errors import Diagnostic, Location, SpecError, missing_attribute
from phigen.geometry.casimirs import found_casimirs
from phigen.geometry.forces import Forces, forces_of
from phigen.geometry.forms import structure
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.noise import Source, sources_of
from phigen.geometry.shapes import LiePoisson, Matrix, Shape
from phigen.spec.model import Parameter, PoissonForm, Spec, SpecForces, SpecNoise
from phigen.symbolic.expression import ZERO, Expression, gradient, text, total
from phigen.symbolic.symbols import increment

if TYPE_CHECKING:
    from phigen.geometry.sympy_bridge import SympySystem

#: Largest number of characters of H in the text that represents a system in Python; longer expressions are shortened.
_SHOWN = 60


@dataclass(frozen=True, repr=False)
class System:
    """A system ẋ = π(x)∇H(x), or ẋ = π(x)∇H(t, x), possibly with ``forces`` and with sources of ``noise``.

    ``poisson`` is the n×n matrix π_ij = {x_i, x_j}. The symbols of all expressions are coordinates, parameters and the
    time. ``shape`` is the recognised shape of π, and ``form`` its form in the spec. ``casimirs`` has the declared
    Casimirs in the order of the spec, then those that phigen found (``C1``, ``C2``, …). ``declared`` has the names of
    the declared Casimirs. ``time`` is the symbol of t, which H and the invariants may contain, or "". ``observables``
    are quantities to record; nothing is proved about them. ``notes`` says which searches were omitted, and why.
    ``spec`` is the spec of the system, or None if the system was built in Python. ``standing`` has the parameters that
    stand for the time, see `frozen`.
    """

    name: str
    coordinates: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    poisson: Matrix
    hamiltonian: Expression
    casimirs: Mapping[str, Expression]
    invariants: Mapping[str, Expression]
    shape: Shape
    form: PoissonForm
    time: str = ""
    forces: Forces | None = None
    noise: tuple[Source, ...] = ()
    declared: tuple[str, ...] = ()
    observables: Mapping[str, Expression] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    locations: Mapping[tuple[Any, ...], Location] = field(default_factory=dict)
    spec: Spec | None = field(default=None, repr=False, compare=False)
    standing: tuple[str, ...] = ()

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Raise an `AttributeError`. For ``run``, ``runs`` and ``integrate``, the message says that solvers have
            them.
            """
            raise missing_attribute(self, name)

    def __repr__(self) -> str:
        hamiltonian = text(self.hamiltonian)
        energy = hamiltonian if len(hamiltonian) <= _SHOWN else f"{hamiltonian[:_SHOWN]}…"
        return f"<System {self.name}: ({', '.join(self.coordinates)}), H = {energy}>"

    @property
    def dimension(self) -> int:
        """The number of coordinates."""
        return len(self.coordinates)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The names of the parameters, in the order of the spec."""
        return tuple(p.name for p in self.parameters)

    @property
    def times(self) -> tuple[str, ...]:
        """The symbol of the time as a tuple of length 1; empty if the system does not depend on the time."""
        return (self.time,) if self.time else ()

    @property
    def increments(self) -> tuple[str, ...]:
        """The symbols of the noise increments ΔW in a step, one for each source."""
        return tuple(increment(k) for k in range(len(self.noise)))

    @property
    def driven(self) -> bool:
        """Whether H may change along the motion: it depends on the time, or there are forces or noise."""
        return bool(self.time) or self.forces is not None or bool(self.noise)

    @property
    def frozen(self) -> System:
        """This system with the time as a parameter, for statements at a fixed time."""
        standing = tuple(Parameter(t, Fraction(0)) for t in self.times)
        return replace(self, parameters=(*self.parameters, *standing), time="", standing=self.times)

    @property
    def positive(self) -> tuple[str, ...]:
        """The names of the parameters that are declared positive or nonnegative.

        Parameters that may be 0 are included, since a statement that holds for all positive values also holds at 0.
        """
        return tuple(p.name for p in self.parameters if p.bound)

    @property
    def lie_algebra(self) -> LieAlgebra | None:
        """The Lie algebra of a Lie–Poisson π; None for other shapes."""
        return self.shape.algebra if isinstance(self.shape, LiePoisson) else None

    def vector_field(self) -> tuple[Expression, ...]:
        """Return the vector field π(∇H + ζ) + f, one expression for each coordinate. Noise is left out.

        ζ is the covector force, and f is the vector force.
        """
        slope = gradient(self.hamiltonian, self.coordinates)
        if self.forces is None:
            return hamiltonian_vector_field(self.poisson, slope)
        covector = [s + z for s, z in zip(slope, self.forces.covector, strict=True)]
        tangent = hamiltonian_vector_field(self.poisson, covector)
        return tuple(a + b for a, b in zip(tangent, self.forces.vector, strict=True))

    def forced_rate(self, function: Expression) -> Expression:
        """Return the contribution of the forces to dF/dt for a function F: ∇F·(πζ + f). For F = H, this is the power of
        the forces.

        ζ is the covector force, and f is the vector force.
        """
        if self.forces is None:
            return ZERO
        field = hamiltonian_vector_field(self.poisson, self.forces.covector)
        slopes = gradient(function, self.coordinates)
        return total(s * (a + b) for s, a, b in zip(slopes, field, self.forces.vector, strict=True) if not s.is_zero)

    def forced_rate_of_casimir(self, casimir: Expression) -> Expression:
        """Return the contribution of the vector force f to dC/dt for a Casimir C: ∇C·f. The covector force does not
        change C.
        """
        if self.forces is None:
            return ZERO
        slopes = gradient(casimir, self.coordinates)
        return total(s * f for s, f in zip(slopes, self.forces.vector, strict=True) if not s.is_zero)

    @property
    def pushed(self) -> tuple[str, ...]:
        """The names of the Casimirs that forces change."""
        return tuple(name for name, c in self.casimirs.items() if not self.forced_rate_of_casimir(c).is_zero)

    @classmethod
    def from_sympy(
        cls,
        coordinates: Sequence[Any],
        poisson: Any,
        hamiltonian: Any,
        parameters: Mapping[Any, Any] | None = None,
        *,
        casimirs: Mapping[str, Any] | None = None,
        invariants: Mapping[str, Any] | None = None,
        name: str = "system",
        time: Any = None,
    ) -> System:
        """Return a system that is given by sympy objects.

        ``coordinates`` are symbols or names. ``poisson`` is an n×n matrix or a nested sequence. ``parameters`` maps
        symbols or names to default values; a symbol that sympy knows to be positive becomes a positive parameter.
        ``time`` is the symbol or the name of the time, if H depends on it. Raises `SpecError` for a matrix of the wrong
        size, and for unknown symbols and functions.
        """
        from phigen.geometry.sympy_bridge import parts

        return build_system(name, **parts(coordinates, poisson, hamiltonian, parameters, casimirs, invariants, time))

    def to_sympy(self) -> SympySystem:
        """Return coordinates, π, H, parameters, Casimirs and invariants as sympy objects; see `SympySystem`."""
        from phigen.geometry.sympy_bridge import given_back

        return given_back(self)

    def _repr_latex_(self) -> str:
        """The formulas of π, H, Casimirs and invariants as LaTeX, which notebooks display."""
        return cast(str, display("formulas of a system")(self))

    def _repr_html_(self) -> str:
        """The formulas and parameters of the system as HTML, which notebooks display."""
        return cast(str, display("page of a system")(self))


def system_from_spec(spec: Spec) -> System:
    """Return the system of a spec: the matrix π, its shape, and the Casimirs that phigen finds for it.

    No statement is proved here, except that matrices or structure constants define a Lie algebra. Raises `SpecError`
    for matrices that do not span a Lie algebra, for structure constants that violate the Jacobi identity, and for sizes
    that do not match the number of coordinates.
    """
    if spec.lattice:
        raise system_of_lattice(spec)
    system = build_system(
        spec.name,
        spec.coordinates,
        spec.parameters,
        spec.poisson,
        spec.hamiltonian,
        casimirs=spec.casimirs,
        invariants=spec.invariants,
        locations=spec.locations,
        time=spec.time,
        forces=spec.forces,
        noise=spec.noise,
    )
    return replace(system, spec=spec, observables=spec.observables)


def system_of_lattice(spec: Spec) -> SpecError:
    """Return the exception to raise if the spec is a lattice, but a fixed number of coordinates is needed."""
    message = f"{spec.name} is a lattice; a system with a fixed number of coordinates is needed here"
    hint = "phigen.compile accepts it; phigen show --expand SIZES prints a small one as an ordinary spec"
    return SpecError([spec.diagnostic(("lattice",), message, hint)])


def build_system(
    name: str,
    coordinates: Sequence[str],
    parameters: Sequence[Parameter],
    form: PoissonForm,
    hamiltonian: Expression,
    *,
    casimirs: Mapping[str, Expression] | None = None,
    invariants: Mapping[str, Expression] | None = None,
    locations: Mapping[tuple[Any, ...], Location] | None = None,
    time: str = "",
    forces: SpecForces | None = None,
    noise: Mapping[str, SpecNoise] | None = None,
) -> System:
    """Return the `System` that the arguments describe. The shape of π is recognised, and further Casimirs are searched
    for.
    """
    locations = locations or {}
    declared = dict(casimirs or {})
    try:
        matrix, shape = structure(form, coordinates)
    except SpecError as error:
        raise _with_place(error, locations) from None
    used_names = {*coordinates, time, *(p.name for p in parameters), *declared, *(invariants or {})}
    further_casimirs, notes = found_casimirs(coordinates, matrix, shape, form, declared, used_names)
    acting = None
    if forces:
        acting = forces_of(forces, coordinates, hamiltonian_vector_field(matrix, gradient(hamiltonian, coordinates)))
    return System(
        name,
        tuple(coordinates),
        tuple(parameters),
        matrix,
        hamiltonian,
        declared | further_casimirs,
        dict(invariants or {}),
        shape,
        form,
        time,
        acting,
        sources_of(noise or {}),
        tuple(declared),
        notes=notes,
        locations=locations,
    )


def hamiltonian_vector_field(poisson: Matrix, differential: Sequence[Expression]) -> tuple[Expression, ...]:
    """Return π∇F, the product of the n×n matrix ``poisson`` and the covector ``differential`` = ∇F."""
    return tuple(
        total(entry * d for entry, d in zip(row, differential, strict=True) if not (entry.is_zero or d.is_zero))
        for row in poisson
    )


def _with_place(error: SpecError, locations: Mapping[tuple[Any, ...], Location]) -> SpecError:
    """Return the error; diagnostics without a location get the location of the section ``poisson``."""
    place = locations.get(("poisson",))
    return SpecError(
        [Diagnostic(d.message, d.location or place, d.hint, d.source_line, d.severity) for d in error.diagnostics]
    )
