"""The kinds of bi-realisations, by name.

Each kind has a module, which is imported and listed here. The module of a kind contains the name of the kind, as the
constant KIND, and the function ``build``, which makes the bi-realisation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System
from phigen.realisations import (
    auto,
    canonical_euler,
    cayley,
    constant,
    custom,
    exponential,
    gauged,
    group_map,
    karasev,
    log_canonical,
    product,
    pullback,
    spray,
)
from phigen.realisations.protocol import BiRealisation, Builder
from phigen.spec.model import BirealisationChoice


def _of_parts(build: Callable[[System, BirealisationChoice, Builder], BiRealisation]) -> Builder:
    """Return the builder of a kind whose bi-realisations are made from others, such as a product over the
    blocks of π.

    The third argument of ``build`` is the builder of the other bi-realisations, whose kind is ``choice.of``.
    """

    def built(system: System, choice: BirealisationChoice) -> BiRealisation:
        return build(system, replace(choice, kind=choice.of, of="auto"), builder(choice.of))

    return built


BUILDERS: dict[str, Builder] = {
    auto.KIND: auto.build,
    constant.KIND: constant.build,
    canonical_euler.KIND: canonical_euler.build,
    log_canonical.KIND: log_canonical.build,
    gauged.KIND: gauged.build,
    exponential.KIND: exponential.build,
    cayley.KIND: cayley.build,
    group_map.KIND: group_map.build,
    product.KIND: _of_parts(product.build),
    pullback.KIND: _of_parts(pullback.build),
    karasev.KIND: karasev.build,
    spray.KIND: spray.build,
    custom.KIND: custom.build,
}


def realise(system: System, choice: BirealisationChoice | None = None) -> BiRealisation:
    """Return the bi-realisation that a spec requests; the default is ``auto``.

    The axioms are not proved here; `phigen.realisations.axioms.check` proves them. Raises `SpecError` for an unknown
    kind and for a kind that does not apply to the system. The error is located at ``birealisation`` or ``poisson`` in
    the spec.
    """
    choice = choice or BirealisationChoice()
    try:
        return builder(choice.kind)(system, choice)
    except SpecError as error:
        place = system.locations.get(("birealisation",)) or system.locations.get(("poisson",))
        raise type(error)(
            [Diagnostic(d.message, d.location or place, d.hint, d.source_line, d.severity) for d in error.diagnostics]
        ) from None


def builder(kind: str) -> Builder:
    """Return the function that builds bi-realisations of a kind. Raises `SpecError` for an unknown kind."""
    build = BUILDERS.get(kind)
    if build is not None:
        return build
    raise SpecError([Diagnostic(f"unknown birealisation {kind!r}", hint=_choices())])


def _choices() -> str:
    return "available: " + ", ".join(BUILDERS)
