"""The functions of a generated C solver, with the types of their arguments."""

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


# Where there is a time, in place of those of the same name.
_TIMED = {
    "init_at": (_INT, (_POINTER, _POINTER, _POINTER, _DOUBLE)),
    "hamiltonian": (_DOUBLE, (_POINTER, _DOUBLE, _POINTER)),
    "vector_field": (None, (_POINTER, _DOUBLE, _POINTER, _POINTER)),
}

# Where there is noise.
_WORD, _LONG = ctypes.c_uint32, ctypes.c_uint64
_NOISY = {
    "set_noise": (_INT, (_POINTER, _LONG, _WORD, _LONG)),
    "integrate_along": (_INT, (_POINTER, _DOUBLE, _SIZE, _POINTER)),
}

# What is there only if it was asked for, or not left out.
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
    "solver_time": (_DOUBLE, (_POINTER,)),
    "monitor": (_DOUBLE, (_POINTER, _POINTER)),
    "attitude": (None, (_POINTER, _POINTER)),
    "noise_fields": (None, (_POINTER, _POINTER, _POINTER)),
    "observables": (None, (_POINTER, _POINTER, _POINTER)),
    "ensemble_of": (_INT, (_POINTER, _POINTER, _SIZE, _DOUBLE, _SIZE, _LONG, _WORD, _LONG, _POINTER)),
    "ensemble_attitudes": (_INT, ()),  # as `_of_attitudes` has it
    "set_attitude": (_INT, (_POINTER, _POINTER, _POINTER)),
}


def functions_of(library: Any, interface: Interface) -> Any:
    """A namespace of the functions that a library has; `ToolchainError` where one is missing."""
    offered = {name: s for name, s in _EXTRAS.items() if hasattr(library, f"{interface.name}_{name}")}
    own = _dated(offered, interface) | (_NOISY if interface.noise else {})
    timed = _TIMED if interface.time else {}
    if interface.time or "init_gauge" in offered:  # times, or a gauge of each
        _, each = _EXTRAS["ensemble_each"]
        offered |= {"ensemble_each": (_INT, (*each[:3], _POINTER, *each[3:]))} if "ensemble_each" in offered else {}
        _, back = _EXTRAS["pullback_each"]
        named = "pullback_each"
        offered |= {named: (_INT, (*back[:3], _POINTER, *back[3:]))} if named in offered else {}
    monitored = {"pullback": (_INT, (*_EXTRAS["pullback"][1], _POINTER))} if "level_bar" in offered else {}
    return bound(
        library,
        interface.name,
        {**_SIGNATURES, **offered, **timed, **monitored, **own, **_of_attitudes(offered, interface)},
        single=interface.single,
    )


def _of_attitudes(offered: Mapping[str, Any], interface: Interface) -> dict[str, tuple[Any, tuple[Any, ...]]]:
    """The signature of ensembles with attitudes: times or a gauge of each, and random numbers, where there are such."""
    name = "ensemble_attitudes"
    own = (_POINTER,) if interface.time or "init_gauge" in offered else ()
    drawn = (_LONG, _WORD, _LONG) if interface.noise else ()
    rest = (_SIZE, _POINTER, _POINTER, _POINTER)
    arguments = (_POINTER, _POINTER, _POINTER, _SIZE, *own, _POINTER, _SIZE, *drawn, *rest)
    return {name: (_INT, arguments)} if name in offered else {}


def _dated(offered: Mapping[str, Any], interface: Interface) -> dict[str, tuple[Any, tuple[Any, ...]]]:
    """Return the signatures of functions that take the time too, where there is one."""
    places = {"observables": 1, "noise_fields": 1, "ensemble_of": 3} if interface.time else {}
    found = {name: (offered[name], at) for name, at in places.items() if name in offered}
    return {name: (result, (*a[:at], _DOUBLE, *a[at:])) for name, ((result, a), at) in found.items()}
