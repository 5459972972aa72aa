"""Declaration for ctypes of the functions in a generated C solver: the types of their arguments and results."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

from phigen.runtime.binding import bound
from phigen.runtime.interface import Interface

_POINTER, _DOUBLE, _SIZE, _INT = ctypes.c_void_p, ctypes.c_double, ctypes.c_size_t, ctypes.c_int
_SIGNATURES = {
    "solver_size": (_SIZE, ()),
    "solver_steps_done": (_SIZE, (_POINTER,)),
    "init": (_INT, (_POINTER, _POINTER, _POINTER)),
    "integrate": (_INT, (_POINTER, _DOUBLE, _SIZE)),
    "hamiltonian": (_DOUBLE, (_POINTER, _POINTER)),
    "casimirs": (None, (_POINTER, _POINTER, _POINTER)),
    "vector_field": (None, (_POINTER, _POINTER, _POINTER)),
}


# Signatures for a Hamiltonian that depends on the time: the time is an additional argument. All but ``init_at`` replace
# the signatures of the same names in `_SIGNATURES`.
_TIMED = {
    "init_at": (_INT, (_POINTER, _POINTER, _POINTER, _DOUBLE)),
    "hamiltonian": (_DOUBLE, (_POINTER, _DOUBLE, _POINTER)),
    "vector_field": (None, (_POINTER, _DOUBLE, _POINTER, _POINTER)),
}

_WORD, _LONG = ctypes.c_uint32, ctypes.c_uint64

# Signatures of functions that only systems with noise have.
_NOISY = {
    "set_noise": (_INT, (_POINTER, _LONG, _WORD, _LONG)),
    "integrate_along": (_INT, (_POINTER, _DOUBLE, _SIZE, _POINTER)),
}

# Signatures of optional functions, which the C has if the spec or the options of the build request them.
_EXTRAS = {
    "ensemble": (_INT, (_POINTER, _POINTER, _SIZE, _DOUBLE, _SIZE, _POINTER)),
    "ensemble_at": (_INT, (_POINTER, _POINTER, _SIZE, _DOUBLE, _DOUBLE, _SIZE, _POINTER)),
    "ensemble_each": (_INT, (_POINTER, _POINTER, _SIZE, _POINTER, _SIZE, _SIZE, _POINTER, _POINTER)),
    "step_tangent": (_INT, (_POINTER, _DOUBLE, _POINTER)),
    "pullback": (_INT, (_POINTER, _DOUBLE, _SIZE, _SIZE, _POINTER, _POINTER, _POINTER, _POINTER, _POINTER)),
    "trail_size": (_SIZE, ()),
    "trail_size_each": (_SIZE, ()),
    "pullback_each": (_INT, (_POINTER, _POINTER, _SIZE, _POINTER, _SIZE, _SIZE, *(_POINTER,) * 6)),
    "level_bar": (None, (_POINTER, _POINTER, _DOUBLE, _POINTER, _POINTER)),
    "init_gauge": (_INT, (_POINTER, _POINTER, _POINTER, _POINTER)),
    "set_state": (_INT, (_POINTER, _POINTER)),
    "kick": (_INT, (_POINTER, _POINTER)),
    "set_parameters": (_INT, (_POINTER, _POINTER)),
    "interpolate": (_INT, (_POINTER, _POINTER, _SIZE, _POINTER)),
    "solver_time": (_DOUBLE, (_POINTER,)),
    "monitor": (_DOUBLE, (_POINTER, _POINTER)),
    "attitude": (None, (_POINTER, _POINTER)),
    "noise_fields": (None, (_POINTER, _POINTER, _POINTER)),
    "observables": (None, (_POINTER, _POINTER, _POINTER)),
    "ensemble_of": (_INT, (_POINTER, _POINTER, _SIZE, _DOUBLE, _SIZE, _LONG, _WORD, _LONG, _POINTER)),
    "ensemble_attitudes": (_INT, ()),  # the arguments depend on the system, see `_of_attitudes`
    "set_attitude": (_INT, (_POINTER, _POINTER, _POINTER)),
}


def functions_of(library: Any, interface: Interface) -> Any:
    """Return a namespace of the functions of a solver's library, with the types of their arguments and results.

    Raises `ToolchainError` if a required function is missing.
    """
    offered = {name: s for name, s in _EXTRAS.items() if hasattr(library, f"{interface.name}_{name}")}
    dated = _dated(offered, interface) | (_NOISY if interface.noise else {})
    timed = _TIMED if interface.time else {}
    if interface.time or "init_gauge" in offered:  # an additional argument: the times or gauges of the members
        _, signature_each = _EXTRAS["ensemble_each"]
        offered |= (
            {"ensemble_each": (_INT, (*signature_each[:3], _POINTER, *signature_each[3:]))}
            if "ensemble_each" in offered
            else {}
        )
        _, signature_pullback = _EXTRAS["pullback_each"]
        pullback_name = "pullback_each"
        offered |= (
            {pullback_name: (_INT, (*signature_pullback[:3], _POINTER, *signature_pullback[3:]))}
            if pullback_name in offered
            else {}
        )
    monitored = {"pullback": (_INT, (*_EXTRAS["pullback"][1], _POINTER))} if "level_bar" in offered else {}
    return bound(
        library,
        interface.name,
        {**_SIGNATURES, **offered, **timed, **monitored, **dated, **_of_attitudes(offered, interface)},
        single=interface.single,
    )


def _of_attitudes(offered: Mapping[str, Any], interface: Interface) -> dict[str, tuple[Any, tuple[Any, ...]]]:
    """Return the signature of the function that integrates ensembles with attitudes; {} if the library lacks it.

    The function takes additional arguments if the members have initial times or gauges, or if the system has noise.
    """
    name = "ensemble_attitudes"
    times_or_gauges = (_POINTER,) if interface.time or "init_gauge" in offered else ()
    noise_types = (_LONG, _WORD, _LONG) if interface.noise else ()
    result_types = (_SIZE, _POINTER, _POINTER, _POINTER)
    arguments = (_POINTER, _POINTER, _POINTER, _SIZE, *times_or_gauges, _POINTER, _SIZE, *noise_types, *result_types)
    return {name: (_INT, arguments)} if name in offered else {}


def _dated(offered: Mapping[str, Any], interface: Interface) -> dict[str, tuple[Any, tuple[Any, ...]]]:
    """Return those signatures in which the time is an additional argument; {} if H does not depend on the time."""
    time_positions = {"observables": 1, "noise_fields": 1, "ensemble_of": 3} if interface.time else {}
    dated = {name: (offered[name], position) for name, position in time_positions.items() if name in offered}
    return {name: (result, (*a[:position], _DOUBLE, *a[position:])) for name, ((result, a), position) in dated.items()}
