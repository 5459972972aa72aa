"""Files of a binding. A binding is a module in another language that calls the generated C. The templates of the files
are in ``templates/bindings``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from phigen.api import interface_of
from phigen.errors import SpecError
from phigen.targets.c.language import members
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
class BindingLanguage:
    """Language of a binding: its files, comments, number types and reserved words.

    ``files`` maps the name of each file to the templates whose texts form the file; NAME in a file name stands for the
    name of the solver. ``comment`` is the beginning of a comment line. ``reals`` are the types for C's double and
    float. ``words`` are the reserved words of the language, which cannot be names of struct fields. ``caseless`` is
    true if the language does not distinguish upper and lower case.
    """

    files: Mapping[str, tuple[str, ...]]
    comment: str
    reals: tuple[str, str]
    words: frozenset[str] = frozenset()
    caseless: bool = False


LANGUAGES = {
    "cpp": BindingLanguage({"NAME.hpp": ("cpp.hpp",)}, "//", ("double", "float")),
    "fortran": BindingLanguage(
        {"NAME.f90": tuple(f"fortran{part}.f90" for part in ("", "_interface", "_procedures", "_optional", "_status"))},
        "!",
        ("c_double", "c_float"),
        caseless=True,
    ),
    "julia": BindingLanguage({"NAME.jl": ("julia.jl",)}, "#", ("Cdouble", "Cfloat"), frozenset(_JULIA.split())),
    "matlab": BindingLanguage({"NAME_mex.c": ("matlab.c",)}, "//", ("double", "float")),
    "rust": BindingLanguage(
        {
            "rust/src/lib.rs": ("rust.rs", "rust_model.rs", "rust_solver.rs"),
            "rust/build.rs": ("rust_build.rs",),
            "rust/Cargo.toml": ("rust.toml",),
        },
        "//",
        ("f64", "f32"),
        frozenset(_RUST.split()),
    ),
}


def binding(compilation: Compilation, language: str) -> dict[str, str]:
    """Return the files (name → text) of a binding; ``language`` is a key of `LANGUAGES`.

    Raises `SpecError` for lattices.
    """
    spec, name = compilation.spec, compilation.spec.name
    if spec.lattice:
        message = f"{name} is a lattice, for which there are no bindings yet"
        hint = "call the functions that the C header declares, or write an ordinary spec by phigen show --expand SIZES"
        raise SpecError([spec.diagnostic(("lattice",), message, hint)])
    target = LANGUAGES[language]
    values = _values(compilation, target)
    files = {}
    for file, templates in target.files.items():
        comment = "#" if file.endswith(".toml") else target.comment
        notice = f"{name} for {language}. DO NOT EDIT: phigen detects changes by the checksum below."
        notice_lines = [notice, f"SPDX-License-Identifier: {spec.license}"]
        body = "".join(render("bindings", template, values) for template in templates)
        files[file.replace("NAME", name)] = sealed(notice_lines, body, f"{comment} ", "", "")
    return files


def _values(compilation: Compilation, language: BindingLanguage) -> dict[str, object]:
    """Return the variables of the templates: names, counts and features of the solver."""
    spec, program = compilation.spec, compilation.program
    interface = interface_of(program)
    struct = list(members(program).values())
    observed = [("observables", len(interface.observables))] if interface.observables else []
    described = {p.name: _described(p.description, p.unit) for p in spec.parameters}
    return {
        "NAME": interface.name,
        "title": plain(spec.title) or interface.name,
        "dimension": interface.dimension,
        "order": interface.order,
        "coordinates": ", ".join(interface.coordinates),
        "casimirs": ", ".join(interface.casimirs),
        "casimir_names": ", ".join(interface.casimirs) or "none",
        "casimir_count": len(interface.casimirs),
        "observables": ", ".join(interface.observables),
        "observable_count": len(interface.observables),
        "fields": [("vector_field", interface.dimension), *observed],
        "movers": ("set_state", "kick") if program.offers("kicks") else (),
        "parameter_names": ", ".join(struct) or "none",
        "GUARD": f"{interface.name.upper()}_HPP",
        "timed": bool(interface.time),
        "monitored": interface.monitored,
        "noise": bool(interface.noise),
        "element": interface.element,
        "rotation": interface.element - 3 * interface.position,
        "after_rotation": interface.element - 3 * interface.position + 1,
        "position": interface.position,
        "kicks": program.offers("kicks"),
        "interpolated": program.step.kind.collocates,
        "real": language.reals[interface.single],
        "parameters": [
            (field, member, repr(value), described[p])
            for field, member, (p, value) in zip(
                _fields(struct, language), struct, interface.parameters.items(), strict=True
            )
        ],
    }


def _described(description: str, unit: str) -> str:
    """Return the description of a parameter as one line for a comment, with its unit in brackets."""
    return (plain(description) or "parameter") + f" [{plain(unit)}]" * bool(unit)


def _fields(names: Iterable[str], language: BindingLanguage) -> list[str]:
    """Return valid names of struct fields in the language, one for each of the ``names``.

    A reserved word, or a name that equals an earlier field, gets trailing underscores. In languages that do not
    distinguish upper and lower case, such as Fortran, a name that begins with an underscore gets the prefix "p".
    """
    fields: list[str] = []
    for name in names:
        field = f"p{name}" if language.caseless and name.startswith("_") else name
        while field in language.words or _occurs(field, fields, language.caseless):
            field += "_"
        fields.append(field)
    return fields


def _occurs(field: str, fields: Iterable[str], caseless: bool) -> bool:
    return any(field == other_field or (caseless and field.lower() == other_field.lower()) for other_field in fields)
