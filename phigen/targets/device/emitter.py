"""Emission of a program as `NAME_device.h`, a single source for OpenCL C, CUDA and HIP.

The file has three parts: macros for the differences between the languages, the runtime of ``templates/c/runtime`` with
the switch ``DEVICE``, and a kernel for ensembles. The code has the style of the profile ``small``.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import partial
from typing import Any

from phigen.errors import Diagnostic, SpecError
from phigen.scheme.program import OVERLOADED, Program
from phigen.targets.c import emitter as c
from phigen.targets.c.amalgamation import Amalgam
from phigen.targets.c.features import switches
from phigen.targets.c.layout import fitted
from phigen.targets.c.real import real_of, rendered
from phigen.targets.c.step_text import text_of
from phigen.targets.device import lattice
from phigen.targets.device.dialect import qualified
from phigen.targets.device.members import group_size, has_common_coefficients
from phigen.targets.device.registers import spilling
from phigen.targets.header import header_lines, sealed

#: Suffix of the name of a generated file.
SUFFIX = "_device.h"


def emit(program: Program, command: str) -> dict[str, str]:
    """Return a dictionary from the name of the generated file to its text. The comment at the head of the file says
    that ``command`` regenerates it.
    """
    name = program.name
    lines = [*header_lines(program, command), *_READING]
    if slow := spilling(program):
        lines += ["", f"Note: {slow}."]
    return {f"{name}{SUFFIX}": sealed(lines, text_of_device(for_devices(program)))}


_READING = (
    "OpenCL C, CUDA and HIP read this file; the kernels are at its end. A compiler for the host sees types and sizes.",
)


def for_devices(program: Program) -> Program:
    """Return the program without the parts that kernels do not use: derivatives of steps, the modified H, attitudes."""
    left_out: dict[str, Any] = {"adjoint": None, "tangent": None, "tangents": ()}
    parts = {f.name for f in fields(program.step)}
    if swept := program.step.swept:
        left_out["rates"] = replace(swept.rates, slopes=()) if swept.rates else None
    step = replace(program.step, **{part: none for part, none in left_out.items() if part in parts})
    real = OVERLOADED if program.single else program.extras.real
    extras = replace(program.extras, tangent=False, adjoint=False, modified_hamiltonian=0, real=real)
    return replace(program, step=step, extras=extras, modified=None, attitude=None, lanes=False, profile="small")


def text_of_device(program: Program) -> str:
    """Return the text of the generated header for devices, without the comment at its head.

    Raises `SpecError` for bodies in relative coordinates.
    """
    if program.step.swept and program.step.swept.relative:
        message = f"{program.name}: coordinates_from: devices have no steps in relative coordinates"
        raise SpecError([Diagnostic(message, None, "choose another target, or remove coordinates_from")])
    common = has_common_coefficients(program)
    staged = len(program.fractions) > 1
    values = {
        "NAME": program.name,
        "double": not program.single,
        "group": group_size(program),
        "common": common,
        "pointer": f"(*common)[{program.name}_COEFFICIENTS]" if staged else "*common",
    }
    language = rendered(program, "device_language.h", values)
    has = switches(program, None) | {"DEVICE": True, "KICKED": False, "COMMON": common}
    real = real_of(program)
    spelt = partial(qualified, name=program.name, common=common)
    if program.step.swept:
        kernels = {"device_lattice.h": lattice.body(program, program.step.swept, language)}
        amalgam = Amalgam(program.name, has, kernels, real)
        return fitted(_guarded(program.name, amalgam.text("device_lattice.h", spelt)))
    texts = {"device_language.h": language} | text_of(program).texts(program, program.step, None, has)
    stages = f"[{program.name}_STAGES]" if staged else ""
    coefficients = f"double coef{stages}[{program.name}_COEFFICIENTS];"
    declared = c.declared_values(program, None, has) | {"common": common, "coefficients": coefficients}
    declarations = rendered(program, "device_declarations.h", declared)
    texts |= {"device_declarations.h": declarations, "model.h": c.model(program, None, has, texts.values())}
    amalgam = Amalgam(program.name, has, c.policies(program) | texts, real)
    body = c.unrestricted(program, amalgam.text("device.c", spelt))
    body = _guarded(program.name, body)
    return fitted(body)


def _guarded(name: str, text: str) -> str:
    guard = f"{name.upper()}_DEVICE_H"
    return f"#ifndef {guard}\n#define {guard}\n{text}#endif /* {guard} */\n"
