"""The functions of phigen for Python: `load` a system, `compile` it to a solver, get its `formulas` in sympy.

import phigen
system = phigen.load("rigid_body.yaml")
solver = phigen.compile(system, target="c", order=4)
trajectory = solver.integrate([1, 1, 1], h=0.05, steps=20_000, stride=10, I2=2.5)
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, TypeAlias, Unpack, overload

from phigen import registry, resources
from phigen import spec as specs
from phigen.compilation import Compilation
from phigen.compiler import compile_proved, emit
from phigen.errors import Diagnostic, PhigenWarning, SpecError
from phigen.geometry.system import System, system_from_spec, system_of_lattice
from phigen.proofs.examination import located
from phigen.spec import limits
from phigen.spec.model import Overrides, Spec
from phigen.spec.names import ARGUMENTS, IDENTIFIER, PROFILES, SCHEMES, SPEC_NAME, TIMED_ARGUMENTS, argument_hint
from phigen.spec.taken import objection

if TYPE_CHECKING:
    from phigen.lattice.lattice_system import LatticeSystem
    from phigen.notation.sympy_formulas import SympyFormulas
    from phigen.runtime.backend import Backend
    from phigen.runtime.interface import Interface
    from phigen.runtime.lattice import LatticeSolver
    from phigen.runtime.solver import Solver
    from phigen.scheme.program import Program

#: The types that `compile` accepts.
Source: TypeAlias = "str | PathLike[str] | Spec | System | LatticeSystem | Compilation"


def load(path: str | PathLike[str]) -> System | LatticeSystem:
    """Return the system that a spec file defines; ``path`` is the file, or the name of a bundled spec.

    The result is a `System`, or a `LatticeSystem` for a lattice. Its attribute ``spec`` holds the other parts of the
    file. Raises `SpecError` with all errors of the file.
    """
    spec = specs.load(resources.file_of(fspath(path)))
    try:
        if spec.lattice:
            from phigen.lattice.lattice_system import lattice_from_spec

            return lattice_from_spec(spec)
        return system_from_spec(spec)
    except SpecError as error:
        raise located(error, spec) from None


@overload
def compile(
    source: System,
    target: str = "auto",
    order: int | None = None,
    *,
    scheme: str | None = None,
    tangent: bool = False,
    profile: str | None = None,
    device: int | None = None,
) -> Solver: ...


@overload
def compile(
    source: Source,
    target: str = "auto",
    order: int | None = None,
    *,
    scheme: str | None = None,
    tangent: bool = False,
    profile: str | None = None,
    device: int | None = None,
) -> Any: ...


def compile(
    source: Source,
    target: str = "auto",
    order: int | None = None,
    *,
    scheme: str | None = None,
    tangent: bool = False,
    adjoint: bool = False,
    profile: str | None = None,
    device: int | None = None,
) -> Any:
    """Return a solver, in C or for another target, of the system that ``source`` defines.

    ``source`` is a `System`, a spec, the path of a spec file, the name of a bundled spec, or a compilation.

    ``target`` is ``c``, ``numpy``, ``opencl``, ``cuda`` or ``auto``. The target ``auto`` is C if there is a compiler,
    else NumPy with a `PhigenWarning`. With ``opencl`` and ``cuda``, ensembles and lattices run on a device, see
    `Solver.device`; the argument ``device`` is the number of the device to use.

    ``order`` and ``scheme`` (``series``, ``splitting``, ``gauss``, ``auto``) override the settings of the spec.
    ``tangent`` adds the method `Solver.step_tangent` to the solver. ``adjoint`` adds `Solver.pullback` and
    `Solver.jacobian`. A method that the spec requests is always included. ``profile`` is the profile of the code,
    ``fast`` by default; the profile in a spec only applies to ``phigen build``.

    Compiled C is stored in a cache, under a hash of its content. Returns a `Solver`, or a `LatticeSolver` for a
    lattice. Raises `SpecError` and `LimitError`. Raises `CheckError` if a statement is refuted, for instance if π is
    not Poisson. Raises `ToolchainError` if C was requested and there is no working compiler, or if the compiler named
    in CC does not work.
    """
    expect_runnable(target)
    if device is not None and target not in registry.DEVICES:
        raise ValueError(f"device={device!r} is for the targets {' and '.join(registry.DEVICES)}, not {target!r}")
    compilation = compilation_of(source, order=order, scheme=scheme, tangent=tangent, adjoint=adjoint, profile=profile)
    return (lattice_solver_of if compilation.spec.lattice else solver_of)(compilation, target, device)


def expect_runnable(target: str) -> None:
    """Raise `ValueError` for a target that is unknown, or that Python cannot run."""
    if target != "auto" and not registry.find(target).loader:
        runnable = ", ".join(registry.RUNNABLE)
        raise ValueError(f"Python cannot run the target {target!r}; it can run {runnable}")


def formulas(source: Source, order: int | None = None, *, terms: int | None = None) -> SympyFormulas:
    """Return formulas of the method that `compile` uses, in sympy.

    The formulas are the maps α and β of the bi-realisation, the terms S_1 … S_k of the generating function, and H minus
    the multiples of Casimirs. ``terms`` requests S_1 … S_terms instead of the terms of the method. Raises the errors of
    `compile`. Also raises `SpecError` for a splitting and for Gauss collocation, which have no bi-realisation.
    """
    from phigen.notation.sympy_formulas import sympy_formulas

    if terms is not None and not (isinstance(terms, int) and 1 <= terms <= limits.ORDER):
        raise ValueError(f"terms must be an integer from 1 to {limits.ORDER}, not {terms!r}")
    return sympy_formulas(compilation_of(source, order=order), terms)


def compilation_of(source: Source, **options: Unpack[Overrides]) -> Compilation:
    """Return the compilation of a source. The statements about the system and the method are proved.

    The options override the spec, see `phigen.spec.model.Spec.overridden`. If the options state no profile, a source
    that is a compilation keeps its profile; all other sources get the profile ``fast``. Raises the errors of `compile`.
    """
    _expect_valid(**options)
    if isinstance(source, Compilation):
        spec = source.spec.overridden(**options)
        return source if spec == source.spec else compile_proved(spec, system=source.known_system)
    if isinstance(source, System):
        return compile_proved((source.spec or _spec_of(source)).for_running(**options), system=source)
    if not isinstance(source, Spec | str | PathLike) and isinstance(getattr(source, "spec", None), Spec):
        # Any other source with a spec is a LatticeSystem. It is not recognised by isinstance, because importing the
        # class would load the package of lattices for every system.
        source = source.spec
    if isinstance(source, Spec):
        return compile_proved(source.for_running(**options))
    if isinstance(source, str | PathLike):
        return compile_proved(specs.load(resources.file_of(fspath(source))).for_running(**options))
    raise TypeError(f"cannot compile {type(source).__name__}; give a path, a System, a LatticeSystem or a Spec")


def _expect_valid(**options: Unpack[Overrides]) -> None:
    """Raise `ValueError` for invalid values of the options ``order``, ``scheme`` and ``profile``."""
    order, scheme, profile = (options.get(name) for name in ("order", "scheme", "profile"))
    if order is not None and not (isinstance(order, int) and 1 <= order <= limits.ORDER):
        raise ValueError(f"order must be an integer from 1 to {limits.ORDER}, not {order!r}")
    if scheme is not None and scheme not in SCHEMES:
        raise ValueError(f"unknown scheme {scheme!r}; there are {', '.join(SCHEMES)}")
    if profile is not None and profile not in PROFILES:
        raise ValueError(f"unknown profile {profile!r}; there are {', '.join(PROFILES)}")


def solver_of(compilation: Compilation, target: str = "auto", device: int | None = None) -> Solver:
    """Build and load the solver of a compilation, and return it.

    Raises `ToolchainError` if C was requested and cannot be compiled.
    """
    from phigen.runtime.solver import Solver

    if compilation.spec.lattice:
        raise system_of_lattice(compilation.spec)
    return Solver(*_loaded(compilation.program, target, device), compilation.spec)


def lattice_solver_of(compilation: Compilation, target: str = "auto", device: int | None = None) -> LatticeSolver:
    """Build and load the solver of the compilation of a lattice, and return it.

    Raises `ToolchainError` if C was requested and cannot be compiled.
    """
    from phigen.runtime.lattice import LatticeSolver

    return LatticeSolver(*_loaded(compilation.program, target, device), compilation.spec)


def _loaded(program: Program, target: str, device: int | None) -> tuple[Any, Any]:
    """Return the loaded solver of a program in the language of a target, and its `Interface`."""
    interface = interface_of(program)
    target_name = chosen_target(target, _warn)
    files = files_of(program, target_name, f"phigen build {program.name}.yaml")
    return backend_of(files, interface, target_name, device), interface


def files_of(program: Program, target: str, command: str) -> dict[str, str]:
    """Return the files (name → text) that Python loads for a target.

    For a device, the files contain code for the device, and code in C or NumPy for the computations that run on the
    processor.
    """
    if target not in registry.DEVICES:
        return emit(program, target, command)
    host = "numpy" if program.step.kind.sites else chosen_target("auto", _warn)
    return {**emit(program, host, command), **emit(program, target, command)}


def _warn(message: str) -> None:
    warnings.warn(message, PhigenWarning, stacklevel=2)


def backend_of(files: Mapping[str, str], interface: Interface, target: str = "", device: int | None = None) -> Backend:
    """Return the loaded solver of generated files (name → text), in the language of a target.

    By default the target follows from the names of the files. ``device`` is the number of a device, for targets that
    run on devices. Raises `ToolchainError`.
    """
    language = registry.find(target) if target else registry.target_of(files, interface.name)
    return language.load(files, interface, device)


def interface_of(program: Program) -> Interface:
    """Return the `Interface` of a program: names, sizes and features of the solver, which Python needs to run
    it.

    For a lattice, the result is a `LatticeInterface`.
    """
    from phigen.runtime.interface import Interface, LatticeInterface

    interface = Interface(
        name=program.name,
        coordinates=program.coordinates,
        order=program.order,
        parameters={p.name: float(p.value) for p in program.parameters},
        positive=frozenset(p.name for p in program.parameters if p.positive),
        nonnegative=frozenset(p.name for p in program.parameters if p.nonnegative),
        casimirs=program.casimirs,
        time=program.time,
        moving=frozenset(["energy", *program.pushed] if program.time or program.forced else ()),
        monitored=program.is_monitored,
        attitude=program.attitude.shape if program.attitude else (),
        position=bool(program.attitude and program.attitude.group.translation),
        noise=program.noise.sources if program.noise else (),
        draws=program.noise.draws if program.noise else 0,
        single=program.single,
        observables=program.observed,
    )
    step = program.step.swept
    if step is None:
        from phigen.targets.device.members import ensemble_launch

        return replace(interface, ensemble=ensemble_launch(program))
    from phigen.targets.device.launches import launches

    sites, relative = step.sites, step.relative
    if relative:  # a momentum of a body without mass defines no velocity, so masses must be positive
        bound = "positive" if relative.momenta else "nonnegative"
        interface = replace(interface, **{bound: getattr(interface, bound) | {relative.mass}})
    every_other = bool(step.partners and not step.partners.graph)
    return LatticeInterface(
        **vars(interface),
        axes=sites.axes,
        at_sites=sites.parameters,
        observed_fields=program.observables.fields,
        casimir_kinds=step.casimir_kinds,
        periods=sites.periods,
        least=sites.min_sizes,
        required=frozenset(p.name for p in program.parameters if p.values is not None),
        first_open=sites.open_axes[0],
        open_axes=sites.open_axes,
        colour_period=sites.colours // math.gcd(sites.colours, sites.weights[0]),
        graph=bool(step.partners and step.partners.graph),
        pairs=every_other,
        compensated=program.compensated,
        at_bonds=sites.at_bonds,
        masses=relative.mass if relative else "",
        colours=sites.colours,
        colour_weights=sites.weights,
        launches=launches(program, step),
        slow_steps=every_other or step.equation is not None,
    )


def chosen_target(target: str, warn: Callable[[str], None] = lambda message: None) -> str:
    """Return ``target``; if it is ``auto``, return the target C if there is a compiler, else NumPy.

    If NumPy replaces C, ``warn`` receives the reason. Raises `ToolchainError` if the compiler named in CC does not
    work.
    """
    from phigen.runtime import toolchain

    if target != "auto":
        return target
    try:
        toolchain.find()
    except toolchain.NoCompilerError as error:
        target = registry.automatic(compiler=False)
        warn(f"using {registry.TARGETS[target].title}, which is slower: {error}")
        return target
    return registry.automatic(compiler=True)


def _spec_of(system: System) -> Spec:
    """Return a spec for a system built in Python. Settings that are not part of a system have their defaults."""
    _expect_names(system)
    return Spec(
        name=system.name,
        coordinates=system.coordinates,
        poisson=system.form,
        hamiltonian=system.hamiltonian,
        time=system.time,
        parameters=system.parameters,
        casimirs={name: system.casimirs[name] for name in system.declared},
        invariants=system.invariants,
        locations=system.locations,
    )


def _expect_names(system: System) -> None:
    """Raise `SpecError` if the names of the system, its coordinates or its parameters cannot be used in generated
    code."""
    problems = [objection(system.name)] if re.fullmatch(SPEC_NAME, system.name) else [_malformed(system.name, _HINT)]
    problems += [
        _malformed(name, "a name consists of letters, digits and _, and does not start with a digit")
        for name in (*system.coordinates, *system.times, *system.parameter_names)
        if not re.fullmatch(IDENTIFIER, name)
    ]
    reserved_names = TIMED_ARGUMENTS if system.time else ARGUMENTS
    reserved = [name for name in system.parameter_names if name in reserved_names]
    problems += [(f"a parameter cannot be called {name!r}", argument_hint(name)) for name in reserved]
    diagnostics = [Diagnostic(message, hint=hint) for message, hint in filter(None, problems)]
    if diagnostics:
        raise SpecError(diagnostics)


_HINT = "a spec name consists of at most 31 lower-case letters, digits and _, and starts with a letter"


def _malformed(name: str, hint: str) -> tuple[str, str]:
    return f"the name {name!r} cannot be used in generated code", hint
