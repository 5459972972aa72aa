"""The files of the runtime in C that only some solvers have, each with the condition for it.

Other files include these without a condition: of a file that is left out, the include guard counts as defined.
"""

from __future__ import annotations

from collections.abc import Mapping

#: Conditions on switches (`phigen.targets.c.features`) by files.
CONDITIONS = {
    "adjoint.c": "ADJOINT",
    "adjoint_each.c": "ADJOINT && EACH",
    "adjoint_gauss.c": "GAUSS",
    "adjoint_groups.c": "ABREAST",
    "adjoint_kept.c": "!SPLITTING",
    "adjoint_lanes.c": "TRACED",
    "adjoint_segments.c": "SPLITTING",
    "attitude.c": "ATTITUDE",
    "attitudes.c": "ATTITUDES",
    "blocks.c": "BLOCKS",
    "ensemble.c": "ENSEMBLE",
    "expansion_lanes.c": "PATH",
    "explicit.c": "EXPLICIT || SPLITTING",
    "gauge_formula.c": "GAUGE && !MONITOR && !GAUGE_SEARCH",
    "gauge.c": "GAUGE_SEARCH && !MONITOR",
    "gauss.c": "GAUSS",
    "groups.c": "GROUPS",
    "implicit.c": "IMPLICIT",
    "lane_functions_double.c": "!SINGLE",
    "lane_functions_single.c": "SINGLE",
    "lattice_adjoint.c": "ADJOINT",
    "lattice_adjoint_flows.c": "!SERIES",
    "lattice_adjoint_stages.c": "SERIES",
    "lattice_back.c": "ADJOINT",
    "lattice_band.c": "BANDED",
    "lattice_by_hand.c": "BY_HAND",
    "lattice_flows.c": "!SERIES",
    "lattice_keeping.c": "!UNDONE",
    "lattice_krylov.c": "KRYLOV",
    "lattice_noise.c": "NOISE",
    "lattice_stages.c": "SERIES",
    "lattice_tangent.c": "TANGENT",
    "lattice_undoing.c": "UNDONE",
    "lattice_waves.c": "WAVES",
    "level.c": "MONITOR",
    "members.c": "EACH || GROUPS || PACKS || ATTITUDES",
    "newton.c": "NEWTON",
    "noise.c": "NOISE",
    "packs.c": "PACKS",
    "path.c": "PATH",
    "placing.c": "KICKED",
    "recurrence.c": "RECURRENCES",
    "tangent.c": "TANGENT",
}


def holds(condition: str, switches: Mapping[str, bool]) -> bool:
    """Whether a condition holds: alternatives (``||``) of switches or their negations that hold together (``&&``)."""
    return any(
        all(switches[s.removeprefix("!")] != s.startswith("!") for s in part.split(" && "))
        for part in condition.split(" || ")
    )


def guard(file: str) -> str:
    """The include guard of a file of the runtime."""
    return f"PHI_FILE_{file.split('.')[0].upper()}"


def left_out(switches: Mapping[str, bool]) -> dict[str, str]:
    """The files that a solver lacks, with their include guards."""
    known = dict.fromkeys(_SWITCHES, False) | dict(switches)
    return {file: guard(file) for file, condition in CONDITIONS.items() if not holds(condition, known)}


_SWITCHES = {s.removeprefix("!") for c in CONDITIONS.values() for part in c.split(" || ") for s in part.split(" && ")}
