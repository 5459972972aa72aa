"""A Hamiltonian system on a Poisson manifold with global coordinates: the second stage of the compiler."""

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

#: Characters of a Hamiltonian that the representation of a system shows.
_SHOWN = 60


@dataclass(frozen=True, repr=False)
class System:
    """ẋ = π(x)∇H(x), or ẋ = π(x)∇H(t, x), possibly with ``forces`` and sources of ``noise``.

    ``poisson`` is the n×n matrix π_ij = {x_i, x_j}; expressions use the coordinates and parameters as symbols.
    ``casimirs`` holds the declared ones first, in the order of the spec, then the found ones (``C1``, ``C2``, …;
    ``declared`` has the names of the former). ``shape`` is the recognised shape of π, ``form`` the form in the spec.
    ``time`` is the symbol of t, which H and the invariants may contain; empty if there is none. ``observables`` are
    quantities to record; nothing is proved about them. ``notes`` says which searches were omitted, and why. ``spec``
    is the spec of the system, None if it was built in Python.
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

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Raise an `AttributeError` that says where runs are."""
            raise missing_attribute(self, name)

    def __repr__(self) -> str:
        hamiltonian = text(self.hamiltonian)
        energy = hamiltonian if len(hamiltonian) <= _SHOWN else f"{hamiltonian[:_SHOWN]}…"
        return f"<System {self.name}: ({', '.join(self.coordinates)}), H = {energy}>"

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the spec."""
        return tuple(p.name for p in self.parameters)

    @property
    def times(self) -> tuple[str, ...]:
        """The symbol of the time, if there is one."""
        return (self.time,) if self.time else ()

    @property
    def increments(self) -> tuple[str, ...]:
        """The symbols of the increments of the noise in a step, one for each source."""
        return tuple(increment(k) for k in range(len(self.noise)))

    @property
    def driven(self) -> bool:
        """Whether H is not an invariant: it depends on the time, or forces or noise do work."""
        return bool(self.time) or self.forces is not None or bool(self.noise)

    @property
    def frozen(self) -> System:
        """The system with its time as one more parameter."""
        standing = tuple(Parameter(t, Fraction(0)) for t in self.times)
        return replace(self, parameters=(*self.parameters, *standing), time="")

    @property
    def positive(self) -> tuple[str, ...]:
        """Names of the parameters that are positive or nonnegative: a statement for all positive values also holds
        at 0."""
        return tuple(p.name for p in self.parameters if p.bound)

    @property
    def lie_algebra(self) -> LieAlgebra | None:
        """The Lie algebra of a Lie–Poisson π, else None."""
        return self.shape.algebra if isinstance(self.shape, LiePoisson) else None

    def vector_field(self) -> tuple[Expression, ...]:
        """π∇H plus the forces, one expression for each coordinate."""
        slope = gradient(self.hamiltonian, self.coordinates)
        if self.forces is None:
            return hamiltonian_vector_field(self.poisson, slope)
        covector = [s + z for s, z in zip(slope, self.forces.covector, strict=True)]
        tangent = hamiltonian_vector_field(self.poisson, covector)
        return tuple(a + b for a, b in zip(tangent, self.forces.vector, strict=True))

    def forced_rate(self, function: Expression) -> Expression:
        """Contribution of the forces to the rate of change of a function F: ∇F·(πζ + f). For H it is their power."""
        if self.forces is None:
            return ZERO
        field = hamiltonian_vector_field(self.poisson, self.forces.covector)
        slopes = gradient(function, self.coordinates)
        return total(s * (a + b) for s, a, b in zip(slopes, field, self.forces.vector, strict=True) if not s.is_zero)

    def forced_rate_of_casimir(self, casimir: Expression) -> Expression:
        """Contribution of the forces to the rate of change of a Casimir: ∇C·f, since πζ conserves it."""
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
        """A system from sympy objects.

        ``coordinates`` are symbols (or names), ``poisson`` an n×n matrix or nested sequence, ``parameters``
        maps symbols (or names) to default values; a symbol declared positive makes a positive parameter. ``time`` is
        the symbol (or name) of the time, if the Hamiltonian depends on it.
        Raises `SpecError` for a matrix of the wrong size, unknown symbols and functions.
        """
        from phigen.geometry.sympy_bridge import parts

        return build_system(name, **parts(coordinates, poisson, hamiltonian, parameters, casimirs, invariants, time))

    def to_sympy(self) -> SympySystem:
        """Coordinates, π, H, parameters, Casimirs and invariants as sympy objects; see `SympySystem`."""
        from phigen.geometry.sympy_bridge import given_back

        return given_back(self)

    def _repr_latex_(self) -> str:
        """π, H, Casimirs and invariants, for notebooks."""
        return cast(str, display("formulas of a system")(self))

    def _repr_html_(self) -> str:
        """HTML of the system with its parameters, for notebooks."""
        return cast(str, display("page of a system")(self))


def system_from_spec(spec: Spec) -> System:
    """The system of a spec: π in matrix form, its shape, and the Casimirs that the form gives.

    Nothing is proved here (`phigen.geometry.checks` does that), except what a Lie algebra needs to exist.
    Raises `SpecError` for matrices that do not span a Lie algebra, structure constants without Jacobi
    identity, and sizes that do not match the number of coordinates.
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
    """Refuse a lattice where one system of a few coordinates is required."""
    message = f"{spec.name} is a lattice, and this is for one system of a few coordinates"
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
    """A `System` from its parts; see `system_from_spec`."""
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
    """The product of an n×n matrix and a covector, zero entries skipped."""
    return tuple(
        total(entry * d for entry, d in zip(row, differential, strict=True) if not (entry.is_zero or d.is_zero))
        for row in poisson
    )


def _with_place(error: SpecError, locations: Mapping[tuple[Any, ...], Location]) -> SpecError:
    """The error, with the place of the spec's ``poisson`` section if it has no place."""
    place = locations.get(("poisson",))
    return SpecError(
        [Diagnostic(d.message, d.location or place, d.hint, d.source_line, d.severity) for d in error.diagnostics]
    )
