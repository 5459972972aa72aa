"""C sources of an FMU: the solver as ``phigen build`` writes it, and functions of FMI 2.0 and 3.0 that call the solver.

The functions of FMI are in ``templates/c/runtime/fmu*.c``; this module adds the constants of a system.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from phigen.fmu.variables import Variable, first_numbers, first_run
from phigen.targets.c.amalgamation import Amalgam
from phigen.targets.c.emitter import runtime_of
from phigen.targets.c.layout import fitted
from phigen.targets.c.real import literal
from phigen.targets.header import sealed
from phigen.targets.rendering import render

if TYPE_CHECKING:
    from phigen.compilation import Compilation


def layer(compilation: Compilation, variables: Sequence[Variable], token: str) -> str:
    """Return the text of ``NAME_fmi.c``: the functions of FMI, which call the solver declared in ``NAME.h``."""
    program = compilation.program
    switches = runtime_of(program)[0].switches
    amalgam = Amalgam(program.name, switches, {"solver.h": "", "fmu_model.h": _model(compilation, variables, token)})
    text = amalgam.text("fmu.c")
    body = "\n".join(['#include "' + program.name + '.h"', *sorted(amalgam.headers), "", text])
    lines = [
        f"{program.name} as a functional mock-up unit for co-simulation, of FMI 2.0 and 3.0.",
        "DO NOT EDIT: phigen detects changes by the checksum below.",
        f"SPDX-License-Identifier: {program.about.license}",
    ]
    return sealed(lines, fitted(body))


def token_of(compilation: Compilation, files: dict[str, str]) -> str:
    """Return a hash of the generated files and of the first run of the spec.

    ``modelDescription.xml`` and the compiled library both contain the hash. The library starts only if the two hashes
    are equal.
    """
    identity = "".join(files[name] for name in sorted(files)) + repr(first_run(compilation.spec))
    digest = hashlib.sha256(identity.encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def _model(compilation: Compilation, variables: Sequence[Variable], token: str) -> str:
    program, spec = compilation.program, compilation.spec
    digits = literal if program.single else repr
    run, numbers = first_run(spec), first_numbers(compilation)
    starts = [v.start for v in variables if v.start is not None]
    attitude = [v.start or 0.0 for v in variables[numbers["ATTITUDE"] : numbers["POSITION"]]]
    parameters = [v.start or 0.0 for v in variables[numbers["PARAMETER"] : numbers["STEP"]]]
    assert len(starts) == numbers["ENERGY"] - 1
    return render(
        "c",
        "fmu_model.h",
        {
            "NAME": program.name,
            "real": "float" if program.single else "double",
            "token": token,
            "numbers": list(numbers.items()),
            "most": max(1, len(program.casimirs), len(program.observed)),
            "parameters": ", ".join(digits(v) for v in parameters) or "0",
            "start": ", ".join(digits(float(x)) for x in run.initial),
            "attitude": ", ".join(digits(v) for v in attitude),
            "step": repr(float(run.step)),
            "seed": run.seed,
        },
    )
