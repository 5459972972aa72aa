"""C99 as a target language: the spelling of formulas, and the names of functions and parameters in a solver."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

from phigen.ir.passes.forms import LANE, NEAR, OWN
from phigen.lanes.lane_functions import LANE_FORMULAS, LANE_FUNCTIONS
from phigen.scheme.program import Program
from phigen.symbolic import functions as elementary
from phigen.targets.c import phrases
from phigen.targets.language import Language
from phigen.targets.names import Scope, identifiers
from phigen.targets.printer import Printer
from phigen.targets.reserved import C_RESERVED, Reserved

FUNCTIONS = elementary.written_in("c")
LANGUAGE = Language(
    reserved=C_RESERVED,
    functions=FUNCTIONS,
    constants={"pi": "3.141592653589793", "E": "2.718281828459045"},  # M_PI is not defined under -std=c99
)


@cache
def reserved_members(name: str) -> Reserved:
    """Return the names that members of structs must not have: reserved words, phrases of the runtime
    (`phigen.targets.c.phrases`), and macros of the solver.
    """
    return _extended(name, "[A-Z0-9_]*[A-Z0-9]")


@cache
def reserved_variables(name: str) -> Reserved:
    """Return the names that variables must not have: those of `reserved_members`, and all names with a prefix of the
    solver.
    """
    return _extended(name, r"\w*[^\W_]")


def _extended(name: str, pattern: str) -> Reserved:
    guards = {f"{name.upper()}_{end}" for end in ("H", "HPP", "DEVICE_H")}
    words = C_RESERVED.words | phrases.names() | guards
    return Reserved(words, re.compile(f"{C_RESERVED.pattern.pattern}|{re.escape(name)}_{pattern}"))


@cache
def elementary_functions(name: str) -> dict[str, str]:
    """Return the names of elementary functions in the code of a solver, by their names in expressions.

    A solver defines functions that the C library lacks, and versions of functions for small arguments and for SIMD
    lanes (see `phigen.ir.passes.forms`). The names of these functions begin with ``name``, the name of the solver. Some
    versions are formulas that call other functions. For such a version, the result has the formula in place of a name.
    """
    lanes = {f: f"{name}_{f}{LANE}" for f in LANE_FUNCTIONS}
    formulas = {f: text.format_map(lanes) for f, text in LANE_FORMULAS.items()}
    general = {f: f"{name}_{f}" for f in elementary.FUNCTIONS}
    near = {f + NEAR: f"{name}_{f}{NEAR}" for f in general}
    of_solver = {f + OWN: text for f, text in general.items()}
    in_lanes = {f + LANE: text for f, text in {**lanes, **formulas}.items()}
    return {**general, **FUNCTIONS, **near, **of_solver, **in_lanes}


def printer(scope: Scope, functions: Mapping[str, str] = FUNCTIONS) -> Printer:
    """Return the printer of formulas in C, with the identifiers of a scope."""
    return replace(LANGUAGE, functions=functions).printer(scope)


def members(program: Program) -> dict[str, str]:
    """Return the names of the members of the parameter struct, by the names of the parameters."""
    return identifiers((p.name for p in program.parameters), reserved_members(program.name))
