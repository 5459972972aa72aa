"""The files of a binding, each from one template of ``templates/bindings``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from phigen.api import interface_of
from phigen.errors import SpecError
from phigen.targets.c.kernels import members
from phigen.targets.header import plain, sealed
from phigen.targets.rendering import render

if TYPE_CHECKING:
    from phigen.compilation import Compilation

_RUST = """as async await box break const continue crate dyn else enum extern false final fn for if impl in
let loop macro match mod move mut override priv pub ref return self static struct super trait true
try type typeof unsafe unsized use virtual where while yield Self abstract become do gen"""
_JULIA = """baremodule begin break catch const continue do else elseif end export false finally for function global if
import let local macro module quote return struct true try using while"""


@dataclass(frozen=True)
class Language:
    """How a binding is written.

    ``files`` maps names, in which NAME is that of the solver, to the templates of their parts. ``comment`` begins a
    line of comment. ``reals`` are its words for double and float. ``words`` cannot be names of fields; ``caseless``
    says that a and A are the same name.
    """

    files: Mapping[str, tuple[str, ...]]
    comment: str
    reals: tuple[str, str]
    words: frozenset[str] = frozenset()
    caseless: bool = False


LANGUAGES = {
    "cpp": Language({"NAME.hpp": ("cpp.hpp",)}, "//", ("double", "float")),
    "fortran": Language(
        {"NAME.f90": ("fortran.f90", "fortran_procedures.f90", "fortran_status.f90")},
        "!",
        ("c_double", "c_float"),
        caseless=True,
    ),
    "julia": Language({"NAME.jl": ("julia.jl",)}, "#", ("Cdouble", "Cfloat"), frozenset(_JULIA.split())),
    "matlab": Language({"NAME_mex.c": ("matlab.c",)}, "//", ("double", "float")),
    "rust": Language(
        {
            "rust/src/lib.rs": ("rust.rs", "rust_solver.rs"),
            "rust/build.rs": ("rust_build.rs",),
            "rust/Cargo.toml": ("rust.toml",),
        },
        "//",
        ("f64", "f32"),
        frozenset(_RUST.split()),
    ),
}


def binding(compilation: Compilation, language: str) -> dict[str, str]:
    """Return the files of a binding by their names. Raises `SpecError` for lattices."""
    spec, name = compilation.spec, compilation.spec.name
    if spec.lattice:
        message = f"a binding of {name}: not for lattices in this version"
        hint = "the header of the C declares what can be called; phigen show --expand SIZES writes an ordinary spec"
        raise SpecError([spec.diagnostic(("lattice",), message, hint)])
    made, values = LANGUAGES[language], _values(compilation, LANGUAGES[language])
    files = {}
    for file, templates in made.files.items():
        comment = "#" if file.endswith(".toml") else made.comment
        notice = f"{name} for {language}. DO NOT EDIT: the checksum below notices."
        about = [notice, f"SPDX-License-Identifier: {spec.license}"]
        body = "".join(render("bindings", template, values) for template in templates)
        files[file.replace("NAME", name)] = sealed(about, body, f"{comment} ", "", "")
    return files


def _values(compilation: Compilation, language: Language) -> dict[str, object]:
    """What the templates are printed from."""
    spec, program = compilation.spec, compilation.program
    about = interface_of(program)
    struct = list(members(program).values())
    observed = [("observables", len(about.observables))] if about.observables else []
    described = {p.name: _described(p.description, p.unit) for p in spec.parameters}
    return {
        "NAME": about.name,
        "title": plain(spec.title) or about.name,
        "dimension": about.dimension,
        "order": about.order,
        "coordinates": ", ".join(about.coordinates),
        "casimirs": ", ".join(about.casimirs),
        "casimir_names": ", ".join(about.casimirs) or "none",
        "casimir_count": len(about.casimirs),
        "observables": ", ".join(about.observables),
        "observable_count": len(about.observables),
        "fields": [("vector_field", about.dimension), *observed],
        "movers": ("set_state", "kick") if program.offers("kicks") else (),
        "parameter_names": ", ".join(struct) or "of no name",
        "GUARD": f"{about.name.upper()}_HPP",
        "timed": bool(about.time),
        "monitored": about.monitored,
        "noise": bool(about.noise),
        "element": about.element,
        "kicks": program.offers("kicks"),
        "real": language.reals[about.single],
        "parameters": [
            (field, member, repr(value), described[p])
            for field, member, (p, value) in zip(
                _fields(struct, language), struct, about.parameters.items(), strict=True
            )
        ],
    }


def _described(description: str, unit: str) -> str:
    """A comment of one line on a parameter."""
    return (plain(description) or "parameter") + f" [{plain(unit)}]" * bool(unit)


def _fields(names: Iterable[str], language: Language) -> list[str]:
    """Names of fields in the order of ``names``: what a language cannot have is changed until it can."""
    fields: list[str] = []
    for name in names:
        field = f"p{name}" if language.caseless and name.startswith("_") else name
        while field in language.words or _taken(field, fields, language.caseless):
            field += "_"
        fields.append(field)
    return fields


def _taken(field: str, fields: Iterable[str], caseless: bool) -> bool:
    return any(field == other or (caseless and field.lower() == other.lower()) for other in fields)
