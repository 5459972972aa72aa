"""The modules of the runtime in JavaScript, and which solvers have them.

Other modules import these without a condition. They call functions of `HOOKS` without one too: where these are left
out, so are the statements that call them. Modules `members_NAME` hold members of the class Solver, which are put where
it says ``// #members NAME``.
"""

from __future__ import annotations

from collections.abc import Mapping

from phigen.scheme.step_kinds import STEP_KINDS
from phigen.targets.features import holds

_KINDS = [kind.name for kind in STEP_KINDS.values() if not kind.sites]

#: Modules of ordinary systems, in their order, each with its condition on switches.
MODULES = {
    "errors": "",
    "march": "",
    "solver": "",
    "timed": "TIMED",
    "autonomous": "!TIMED",
    "observed_timed": "OBSERVED && TIMED",
    "observed_autonomous": "OBSERVED && !TIMED",
    "prepare_gauge": "GAUGE",
    "prepare_plain": "!GAUGE",
    "prepare_flows": "SPLITTING && !MONITOR && !KICKS",
    "prepare_kicks": "SPLITTING && !MONITOR && KICKS",
    "tables_flows": "SPLITTING",
    "tables_stages": "!SPLITTING",
    "saving": "",
    "nonnegative": "NONNEGATIVE",
    **{kind: kind.upper() for kind in _KINDS},
    "gauss_framed": "GAUSS && FRAMED",
    "gauss_fixed": "GAUSS && !FRAMED",
    "flow_alone": "SPLITTING && !ATTITUDE",
    "flow_turning": "SPLITTING && ATTITUDE",
    "taylor_product": "PATH && TAYLOR_PRODUCT",
    "taylor_chain": "PATH && TAYLOR_CHAIN",
    "taylor_power": "PATH && TAYLOR_POWER",
    "philox": "NOISE",
    "noise": "NOISE",
    "noise_of_flows": "NOISE && SPLITTING",
    "noise_timed": "NOISE && TIMED",
    "noise_autonomous": "NOISE && !TIMED",
    "renewed_time": "RENEWED && !NOISE",
    "renewed_stages": "RENEWED && !SPLITTING",
    "renewed_flows": "RENEWED && SPLITTING && !NOISE",
    "renewed_noise": "RENEWED && SPLITTING && NOISE",
    "history": "HISTORY && !GAUSS",
    "history_moved": "HISTORY && KICKED",
    "start_predicted": "IMPLICIT && !NOISE",
    "start_noisy": "IMPLICIT && NOISE",
    "guess": "IMPLICIT",
    "noise_size": "IMPLICIT && NOISE",
    "noise_none": "IMPLICIT && !NOISE",
    "gauge_taken": "GAUGE",
    "gauge": "GAUGE_CHOSEN && GAUGE_SEARCHED",
    "gauge_formula": "GAUGE_CHOSEN && !GAUGE_SEARCHED",
    "level": "MONITOR",
    "level_stages": "MONITOR && IMPLICIT",
    "level_gauss": "MONITOR && GAUSS",
    "level_flows": "MONITOR && SPLITTING",
    "level_moved": "MONITOR && KICKED",
    "attitude": "ATTITUDE",
    "attitude_first": "ATTITUDE && !RATE_OF_GAUGE",
    "attitude_gauge": "RATE_OF_GAUGE",
    "attitude_rate_gauge": "RATE_OF_GAUGE && GAUGE",
    "attitude_rate_plain": "RATE_OF_GAUGE && !GAUGE",
    "attitude_position": "POSITION",
    "attitude_body": "ATTITUDE && !SPATIAL",
    "attitude_space": "ATTITUDE && SPATIAL",
    "attitude_matrices": "MATRICES",
    "attitude_adds_body_matrix": "MATRICES && !SPATIAL",
    "attitude_adds_space_matrix": "MATRICES && SPATIAL",
    "attitude_exponential": "MATRICES && EXPONENTIAL",
    "attitude_orthogonal": "MATRICES && NORMALISE",
    "attitude_rate_matrix": "MATRICES && RATE_OF_GAUGE",
    "attitude_quaternions": "ATTITUDE && !MATRICES",
    "attitude_adds_body": "ATTITUDE && !MATRICES && !SPATIAL",
    "attitude_adds_space": "ATTITUDE && !MATRICES && SPATIAL",
    "attitude_adds_body_position": "POSITION && !SPATIAL",
    "attitude_adds_space_position": "POSITION && SPATIAL",
    "attitude_screws": "POSITION",
    "attitude_lengthened": "LENGTHENED",
    "attitude_rate": "ATTITUDE && !MATRICES && RATE_OF_GAUGE",
    "attitude_rate_position": "RATE_OF_GAUGE && POSITION",
    "attitude_stages": "TURNED_IN_STAGES",
    "attitude_element": "TURNED_IN_STAGES && !TURNED_BY_COVECTOR",
    "attitude_covector": "TURNED_BY_COVECTOR",
    "tangent": "TANGENT",
    "tangent_solve": "TANGENT && IMPLICIT",
    **{f"tangent_{kind}": f"TANGENT && {kind.upper()}" for kind in _KINDS},
    "run_plain": "TANGENT && SPLITTING && !CORRECTED",
    "run_corrected": "TANGENT && SPLITTING && CORRECTED",
    "algebra": "!SPLITTING || GAUGE_SEARCHED || TANGENT",
    "linear": "IMPLICIT",
}

#: Modules of lattices, likewise.
LATTICE_MODULES = {
    "errors": "",
    "march": "",
    "lattice": "",
    "sites_timed": "TIMED",
    "rows_plain": "!KICKS",
    "rows_kicks": "KICKS",
    "rows_renewed": "RENEWED",
    "counts_graph": "OBSERVED && GRAPH",
    "counts_pairs": "OBSERVED && !GRAPH",
    "sites": "",
    "philox": "NOISE",
    "site_noise": "NOISE",
    "flows": "SPLIT",
    "sweeps": "!SPLIT",
    "krylov": "!SPLIT",
    "site_tangent": "!SPLIT && TANGENT",
}

#: Members of the class Solver, by the ends of the names of their modules.
MEMBERS = {
    "constants": "OBSERVED",
    "attitude": "ATTITUDE",
    "position": "POSITION",
    "kicks": "KICKED",
    "tangent": "TANGENT",
    "interpolate": "GAUSS",
    "ensemble": "ENSEMBLE",
    "modified": "MODIFIED && !TIMED && !GAUGE",
    "modified_gauge": "MODIFIED && !TIMED && GAUGE",
    "modified_timed": "MODIFIED && TIMED",
    "observed": "OBSERVED",
    "noise_fields": "NOISE",
    "lattice_constants": "OBSERVED",
    "lattice_field_constants": "OBSERVED_FIELDS",
    "lattice_tangent": "TANGENT",
    "lattice_observed": "OBSERVED",
    "lattice_observed_fields": "OBSERVED_FIELDS",
}

#: Functions that others call in statements of their own, each with the condition for the statement.
HOOKS = {
    "addPosition": "POSITION",
    "addPositions": "POSITION",
    "beginAttitude": "ATTITUDE",
    "beginElement": "ATTITUDE",
    "clearHistory": "HISTORY && !GAUSS",
    "drawStep": "NOISE",
    "expectFewSteps": "NOISE",
    "expectNonnegative": "NONNEGATIVE",
    "expectPassingTime": "MONITOR",
    "forgetSteps": "GAUSS",
    "makeOrthogonal": "NORMALISE",
    "makePerTau": "MONITOR",
    "makeUnit": "!MATRICES",
    "moveHistory": "HISTORY",
    "moveUniformly": "POSITION",
    "multiplyPositions": "POSITION",
    "normalise": "NORMALISE",
    "orderDraws": "SPLITTING",
    "pass": "MONITOR",
    "renew": "RENEWED",
    "renewRows": "RENEWED",
    "restartAttitude": "RATE_OF_GAUGE",
    "shorten": "LENGTHENED",
    "takeDraws": "NOISE",
    "takeGauge": "GAUGE",
    "takeLevel": "MONITOR",
    "takeTime": "TIMED",
    "takeTurningRate": "RATE_OF_GAUGE",
    "turnByFlows": "ATTITUDE",
    "turnStage": "ATTITUDE",
}


def chosen(table: Mapping[str, str], switches: Mapping[str, bool]) -> list[str]:
    """Return the names in a table whose conditions hold."""
    return [name for name, condition in table.items() if not condition or holds(condition, switches)]
