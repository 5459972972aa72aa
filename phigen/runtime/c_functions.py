"""Signatures of the functions of a generated C solver."""

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


# Signatures if the Hamiltonian depends on the time; they replace those of the same name.
_TIMED = {
    "init_at": (_INT, (_POINTER, _POINTER, _POINTER, _DOUBLE)),
    "hamiltonian": (_DOUBLE, (_POINTER, _DOUBLE, _POINTER)),
    "vector_field": (None, (_POINTER, _DOUBLE, _POINTER, _POINTER)),
}

# Signatures of functions of systems with noise.
_WORD, _LONG = ctypes.c_uint32, ctypes.c_uint64
_NOISY = {
    "set_noise": (_INT, (_POINTER, _LONG, _WORD, _LONG)),
    "integrate_along": (_INT, (_POINTER, _DOUBLE, _SIZE, _POINTER)),
}

# Optional functions: present if the spec or the options of the build include them.
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
    "ensemble_attitudes": (_INT, ()),  # with the order of arguments of `_of_attitudes`
    "set_attitude": (_INT, (_POINTER, _POINTER, _POINTER)),
}


def functions_of(library: Any, interface: Interface) -> Any:
    """Return a namespace of the functions of a library. Raises `ToolchainError` if a required one is missing."""
    offered = {name: s for name, s in _EXTRAS.items() if hasattr(library, f"{interface.name}_{name}")}
    dated = _dated(offered, interface) | (_NOISY if interface.noise else {})
    timed = _TIMED if interface.time else {}
    if interface.time or "init_gauge" in offered:  # an additional argument: the time, or the gauge, of each member
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
    """Return the signature of ensembles with attitudes; {} if the library has no such function.

    There are further arguments for times or gauges of the members and for random numbers, if the system has them.
    """
    name = "ensemble_attitudes"
    times_or_gauges = (_POINTER,) if interface.time or "init_gauge" in offered else ()
    noise_types = (_LONG, _WORD, _LONG) if interface.noise else ()
    result_types = (_SIZE, _POINTER, _POINTER, _POINTER)
    arguments = (_POINTER, _POINTER, _POINTER, _SIZE, *times_or_gauges, _POINTER, _SIZE, *noise_types, *result_types)
    return {name: (_INT, arguments)} if name in offered else {}


def _dated(offered: Mapping[str, Any], interface: Interface) -> dict[str, tuple[Any, tuple[Any, ...]]]:
    """Return the signatures of functions with the time as an additional argument; {} if the system has no time."""
    time_positions = {"observables": 1, "noise_fields": 1, "ensemble_of": 3} if interface.time else {}
    dated = {name: (offered[name], position) for name, position in time_positions.items() if name in offered}
    return {name: (result, (*a[:position], _DOUBLE, *a[position:])) for name, ((result, a), position) in dated.items()}
