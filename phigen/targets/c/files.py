"""The files of the runtime in C that only some solvers have, each with the condition for it.

Other files include these without a condition: of a file that is left out, the include guard counts as defined. They
call functions of `CALLS` without one too: where these are left out, so are the statements that call them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

#: Conditions on switches (`phigen.targets.c.features`) by files.
CONDITIONS = {
    "adjoint.c": "ADJOINT",
    "adjoint_each.c": "ADJOINT && EACH",
    "adjoint_explicit.c": "EXPLICIT",
    "adjoint_gauss.c": "GAUSS",
    "adjoint_groups.c": "ABREAST",
    "adjoint_kept.c": "!SPLITTING",
    "adjoint_kept_explicit.c": "EXPLICIT",
    "adjoint_kept_implicit.c": "!EXPLICIT",
    "adjoint_lanes.c": "TRACED",
    "adjoint_newton.c": "NEWTON",
    "adjoint_newton_lanes.c": "NEWTON",
    "adjoint_path.c": "PATH",
    "adjoint_path_lanes.c": "!NEWTON",
    "adjoint_segments.c": "SPLITTING",
    "adjoint_splitting.c": "SPLITTING",
    "attitude.c": "ATTITUDE",
    "attitude_matrices.c": "MATRICES",
    "attitude_quaternions.c": "!MATRICES",
    "attitudes.c": "ATTITUDES",
    "blocks.c": "BLOCKS",
    "blocks_adams.c": "COMPOSED && !PATH",
    "blocks_elapsed.c": "MONITOR",
    "blocks_guess.c": "!COMPOSED || PATH",
    "blocks_learnt.h": "BLOCKS",
    "blocks_renewed.c": "RENEWED",
    "blocks_turned.c": "ATTITUDE",
    "chain_by_points.c": "!SWEPT",
    "chain_swept.c": "SWEPT",
    "elapsed.c": "MONITOR",
    "ensemble.c": "ENSEMBLE",
    "expansion_lanes.c": "PATH",
    "explicit.c": "EXPLICIT || SPLITTING",
    "explicit_stage.c": "EXPLICIT && COMPOSED",
    "gauge.c": "GAUGE_SEARCH && !MONITOR",
    "gauge_formula.c": "GAUGE && !MONITOR && !GAUGE_SEARCH",
    "gauss.c": "GAUSS",
    "graph.c": "GRAPH",
    "groups.c": "GROUPS",
    "history_differences.h": "GUESSED && !RECURRENCES && !GAUSS",
    "history_gauss.h": "GAUSS",
    "history_recurrences.h": "RECURRENCES",
    "implicit.c": "IMPLICIT",
    "lane_functions_double.c": "!SINGLE",
    "lane_functions_single.c": "SINGLE",
    "lattice_adjoint.c": "ADJOINT",
    "lattice_adjoint_flows.c": "!SERIES",
    "lattice_adjoint_renewed.c": "RENEWED",
    "lattice_adjoint_stages.c": "SERIES",
    "lattice_back.c": "ADJOINT",
    "lattice_band.c": "BANDED",
    "lattice_by_hand.c": "BY_HAND",
    "lattice_by_hand.h": "BY_HAND",
    "lattice_carry.c": "COMPENSATED",
    "lattice_flows.c": "!SERIES",
    "lattice_found_flows.c": "WAVES || ADJOINT",
    "lattice_graph.h": "GRAPH",
    "lattice_grid.h": "!GRAPH",
    "lattice_guess.h": "GUESSES",
    "lattice_guesses.c": "GUESSES",
    "lattice_keeping.c": "!UNDONE",
    "lattice_kicks.c": "KICKED",
    "lattice_krylov.c": "KRYLOV",
    "lattice_krylov_differences.c": "!SLOPES",
    "lattice_krylov_slopes.c": "SLOPES",
    "lattice_made_flows.c": "!WAVES && !ADJOINT && !NOISE || !WAVES && !ADJOINT && RENEWED",
    "lattice_matrix.c": "BANDED",
    "lattice_newton_tangent.c": "TANGENT",
    "lattice_noise.c": "NOISE",
    "lattice_observed.c": "OBSERVED",
    "lattice_observed_fields.c": "OBSERVED_FIELDS",
    "lattice_passed.c": "TIMED || NOISE",
    "lattice_pieces.c": "SERIES",
    "lattice_renewed.c": "RENEWED && !SERIES",
    "lattice_saved.c": "!SERIES && !NOISE && !COMPENSATED",
    "lattice_saved_compensated.c": "!SERIES && COMPENSATED",
    "lattice_saved_noise.c": "!SERIES && NEAR && NOISE && !COMPENSATED",
    "lattice_seams.c": "SEAMS",
    "lattice_share.c": "SHARED",
    "lattice_shares.c": "SHARES",
    "lattice_site_blocks.c": "SITE_BLOCKS",
    "lattice_stages.c": "SERIES",
    "lattice_tangent.c": "TANGENT",
    "lattice_tangent_flows.c": "!SERIES",
    "lattice_tangent_stages.c": "SERIES",
    "lattice_time.c": "TIMED",
    "lattice_trail_kept.c": "!UNDONE",
    "lattice_trail_undone.c": "UNDONE",
    "lattice_undoing.c": "UNDONE",
    "lattice_undoing_sites.c": "!TAKES",
    "lattice_undoing_taken.c": "TAKES",
    "lattice_vectors.c": "TANGENT",
    "lattice_waves.c": "WAVES",
    "lattice_without_guesses.c": "!GUESSES",
    "level.c": "MONITOR",
    "members.c": "EACH || GROUPS || PACKS || ATTITUDES",
    "members_attitudes.c": "ATTITUDES",
    "newton.c": "NEWTON",
    "newton_corrected.c": "!SPARSE",
    "newton_corrected_sparse.c": "SPARSE",
    "newton_inverted.c": "!INVERSE_UNROLLED && !SPARSE && !PATH",
    "newton_linearised.c": "!PATH",
    "newton_sparse.c": "SPARSE && !PATH",
    "newton_unrolled.c": "INVERSE_UNROLLED && !SPARSE && !PATH",
    "noise.c": "NOISE",
    "packs.c": "PACKS",
    "packs_explicit.c": "EXPLICIT",
    "packs_splitting.c": "!EXPLICIT",
    "path.c": "PATH",
    "path_lanes.c": "PATH",
    "placing.c": "KICKED",
    "placing_level.c": "MONITOR",
    "placing_recurrences.c": "RECURRENCES",
    "predictor.c": "GUESSED",
    "predictor_differences.c": "GUESSED && !RECURRENCES",
    "predictor_recurrences.c": "RECURRENCES",
    "recurrence.c": "RECURRENCES",
    "rows_many.c": "!ONE_ROW",
    "rows_single.c": "ONE_ROW",
    "splitting.c": "SPLITTING",
    "tangent.c": "TANGENT",
    "tangent_explicit.c": "TANGENT && EXPLICIT",
    "tangent_gauss.c": "TANGENT && GAUSS",
    "tangent_implicit.c": "TANGENT && IMPLICIT",
    "tangent_newton.c": "TANGENT && NEWTON",
    "tangent_path.c": "TANGENT && PATH",
    "tangent_product.c": "TANGENT",
    "tangent_splitting.c": "TANGENT && SPLITTING",
}

#: Functions that others call in statements of their own, each with the condition for the statement.
CALLS = {
    "phi_clear_carry": "COMPENSATED",
    "phi_connect": "GRAPH",
    "phi_copy_carry": "COMPENSATED",
    "phi_find_all_lines": "!ONE_ROW",
    "phi_find_seams": "SEAMS",
    "phi_place": "!ONE_ROW",
    "phi_place_matrix": "BANDED",
    "phi_put_at_bonds": "GRAPH && BOND_PARAMETERS",
    "phi_put_kinds": "SEAMS",
    "phi_put_parameters": "SITE_PARAMETERS",
}


def holds(condition: str, switches: Mapping[str, bool]) -> bool:
    """Whether a condition holds: alternatives (``||``) of switches or their negations that hold together (``&&``)."""
    return any(
        all(switches[s.removeprefix("!")] != s.startswith("!") for s in part.split(" && "))
        for part in condition.split(" || ")
    )


def guard(file: str) -> str:
    """The include guard of a file of the runtime."""
    return f"PHI_FILE_{file.removesuffix('.c').replace('.', '_').upper()}"


def left_out(switches: Mapping[str, bool]) -> dict[str, str]:
    """The files that a solver lacks, with their include guards."""
    return {file: guard(file) for file in _lacking(CONDITIONS, switches)}


def calls_left_out(switches: Mapping[str, bool]) -> list[str]:
    """The functions that the statements of a solver do not call."""
    return _lacking(CALLS, switches)


def _lacking(conditions: Mapping[str, str], switches: Mapping[str, bool]) -> list[str]:
    known = dict.fromkeys(_switches(conditions.values()), False) | dict(switches)
    return [name for name, condition in conditions.items() if not holds(condition, known)]


def _switches(conditions: Iterable[str]) -> set[str]:
    return {s.removeprefix("!") for c in conditions for part in c.split(" || ") for s in part.split(" && ")}
