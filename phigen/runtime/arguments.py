"""What users give to a solver, checked: numbers, counts, states and parameters."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from reprlib import repr as shortened
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from phigen.runtime.interface import FIRST_DRAWS, Draws, Floats, Interface
from phigen.runtime.members import Members

#: What counts of steps have to fit into.
_MOST = int(np.iinfo(np.int64).max)

#: The largest number of the C of ``real: float``.
LARGEST_SINGLE = float(np.finfo(np.float32).max)

#: What counts have to fit into that choose random numbers.
_LARGEST = {"seed": 2**64 - 1, "member": 2**32 - 1, "step0": _MOST}


#: Random numbers of which nothing was said.
NONE_DRAWN: Mapping[str, int | None] = MappingProxyType({})


@dataclass(frozen=True)
class Beginning:
    """A state where a trajectory begins, at its time, and what its steps depend on, all of it checked.

    ``first`` are the numbers of the attitude and position there, if they were given.
    """

    x: Floats
    h: float
    values: Mapping[str, Any]
    t0: float = 0.0
    draws: Draws = FIRST_DRAWS
    first: Floats | None = None


def step_size(h: float) -> float:
    """A step size: finite, and not 0."""
    size = number(h, "the step size h")
    if size == 0:
        raise ValueError("the step size h must not be 0")
    return size


def end(until: float, begin: float, h: float) -> float:
    """The span of time until an end, of the sign of the step."""
    span = number(until, "the time until") - begin
    if span * h <= 0:
        raise ValueError(f"until = {until!r} is never reached from {begin!r} by steps of {h!r}")
    return span


def count(value: int, what: str, minimum: int, most: int = _MOST) -> int:
    """An integer from ``minimum`` to ``most``."""
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{what} must be an integer, not {_shown(value)}") from None
    if number < minimum:
        raise ValueError(f"{what} must be at least {minimum}, not {_shown(number)}")
    if number > most:
        raise ValueError(f"{what} must be at most {most}, not {_shown(number)}")
    return number


def start_time(t0: float | None, interface: Interface, more: dict[str, float]) -> float:
    """The time of a start, 0 by default. Without a time, t0 may be a parameter, which joins ``more``."""
    if t0 is None or interface.time:
        return 0.0 if t0 is None else number(t0, "the time t0")
    if "t0" not in interface.parameters:
        raise TypeError(f"t0 has no meaning: the Hamiltonian of {interface.name} does not depend on the time")
    more["t0"] = t0
    return 0.0


def draws(interface: Interface, more: dict[str, Any], named: Mapping[str, int | None] = NONE_DRAWN) -> Draws:
    """The random numbers of the noise, by seed, member and step0.

    Without noise these names may be those of parameters, which join ``more``.
    """
    given = {name: value for name, value in named.items() if value is not None}
    if interface.noise:
        numbers = {name: count(value, name, 0, _LARGEST[name]) for name, value in given.items()}
        return Draws(numbers.get("seed", 0), numbers.get("member", 0), numbers.get("step0", 0))
    for name in given:
        if name not in interface.parameters:
            raise TypeError(f"{name} was given, but {interface.name} has no noise")
    more |= given
    return Draws()


def increments(given: ArrayLike, interface: Interface) -> Floats:
    """The increments of the noise in some steps (steps, draws)."""
    if not interface.noise:
        raise TypeError(f"increments were given, but {interface.name} has no noise")
    found = real(given, "increments")
    if found.ndim != 2 or found.shape[1] != interface.draws:
        raise ValueError(f"increments must have shape (steps, {interface.draws}), not {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError("increments must be finite")
    return found


def expect_no_noise(what: str, interface: Interface) -> None:
    """`TypeError` for what makes steps in parts, which have other random numbers than the whole."""
    if interface.noise:
        raise TypeError(f"{what} is not available with noise: parts of a step are not on the same path")


def times_within(times: ArrayLike, t: Floats) -> Floats:
    """The times (times,) that were asked for, of a trajectory with rows at ``t``; `ValueError` for others."""
    wanted = np.atleast_1d(np.asarray(times, dtype=np.float64))
    low, high = sorted((float(t[0]), float(t[-1])))
    slack = 1e-9 * (high - low)
    if wanted.ndim != 1 or not ((wanted >= low - slack) & (wanted <= high + slack)).all():
        raise ValueError(f"times must be numbers between {low!r} and {high!r}")
    return wanted


def rows_at(t: Floats, x: Floats, wanted: Floats) -> Floats:
    """The rows of ``x`` (rows, DIM) at some of the times ``t``, where others are not on the path: `ValueError`."""
    nearest = np.argmin(np.abs(t[:, np.newaxis] - wanted), axis=0)
    apart = np.abs(t[nearest] - wanted)
    if (apart > 1e-9 * np.ptp(t)).any():
        between = float(wanted[int(np.argmax(apart))])
        message = f"with noise only states that are stored can be asked for: {between!r} is between two of them"
        raise ValueError(f"{message}, where the path is not known; stride=1 stores all steps")
    found: Floats = x[nearest]
    return found


def times(t: ArrayLike | None, interface: Interface, shape: tuple[int, ...], more: dict[str, Any]) -> Floats | None:
    """The times of states of a ``shape``, one row; None where there is no time, and t may be a parameter."""
    if not interface.time:
        if t is not None and "t" not in interface.parameters:
            raise TypeError(f"t was given, but the Hamiltonian of {interface.name} does not depend on the time")
        more |= {} if t is None else {"t": t}
        return None
    if t is None:
        raise TypeError(f"t is missing: the Hamiltonian of {interface.name} depends on the time")
    found = np.array(np.broadcast_to(np.asarray(t, dtype=np.float64), shape)).reshape(-1)
    if not np.isfinite(found).all():
        raise ValueError("the times t must be finite")
    return found


def together(given: Mapping[str, Any] | None, more: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters that were ``given`` in a mapping, and ``more`` that were by keyword; none in both."""
    both = sorted(set(given or {}) & set(more))
    if both:
        raise TypeError(f"parameter {both[0]!r} is given twice")
    return {**(given or {}), **more}


def parameters(interface: Interface, given: Mapping[str, float] | None, more: Mapping[str, float]) -> dict[str, float]:
    """The values of all parameters: those ``given`` and ``more``, which exclude each other, and defaults."""
    values = {name: float(value) for name, value in interface.parameters.items()}
    asked = together(given, more)
    expect_known(asked, interface.parameters)
    for name, value in asked.items():
        values[name] = number(value, f"parameter {name!r}")
        if name in interface.positive and values[name] <= 0:
            raise ValueError(f"parameter {name!r} must be positive, not {_shown(value)}")
    return values


def state(x: ArrayLike, what: str, interface: Interface) -> Floats:
    """One state (DIM,), a copy."""
    found = states(x, what, interface)
    if found.ndim != 1:
        expected = f"({interface.dimension},)"
        raise ValueError(f"{what} must have shape {expected}, not {found.shape}; for many states use ensemble")
    return found


def members(x: ArrayLike, what: str, interface: Interface) -> Floats:
    """Many states (members, DIM), a copy."""
    found = states(x, what, interface)
    if found.ndim != 2:
        raise ValueError(f"{what} must have shape (members, {interface.dimension}), not {found.shape}")
    return found


def ensemble(
    X0: ArrayLike,
    h: ArrayLike,
    steps: int,
    stride: int | None,
    t0: ArrayLike | None,
    given: Mapping[str, ArrayLike] | None,
    more: Mapping[str, ArrayLike],
    interface: Interface,
    draws: Draws = FIRST_DRAWS,
) -> Members:
    """The members of an ensemble, by what `Solver.ensemble` is given."""
    own: dict[str, Any] = {name: v for name, v in {**(given or {}), **more}.items() if np.ndim(v) > 0}
    if t0 is not None and np.ndim(t0) > 0 and not interface.time:
        own["t0"] = t0  # then it is the name of a parameter, or of nothing
    several: list[Any] = [v for v in (h, t0, *own.values()) if v is not None and np.ndim(v) > 0]
    if np.ndim(X0) == 1 and several:
        start = np.tile(state(X0, "X0", interface), (len(several[0]), 1))
    else:
        start = members(X0, "X0", interface)
    shape = (len(start),)
    # Names are checked with a number in place of each array.
    plain: list[dict[str, Any]] = [
        {n: 1.0 if n in own else v for n, v in (part or {}).items()} for part in (given, more)
    ]
    alone: Any = 1.0 if t0 is not None and np.ndim(t0) > 0 else t0
    begin: Floats = np.asarray(start_time(alone, interface, plain[1]))
    values = {name: np.asarray(value) for name, value in parameters(interface, *plain).items()}
    for name in own.keys() & values.keys():
        values[name] = array(own[name], f"parameter {name!r}", shape)
        if name in interface.positive and not (values[name] > 0).all():
            m = int(np.argmin(values[name] > 0))
            raise ValueError(f"parameter {name!r} must be positive, not {float(values[name][m])}, as of member {m}")
    if alone is not t0 and interface.time:
        begin = array(t0, "the times t0", shape)  # type: ignore[arg-type]
    size = array(h, "the step size h", shape) if np.ndim(h) > 0 else np.asarray(step_size(h))  # type: ignore[arg-type]
    if not size.all():
        raise ValueError("the step size h must not be 0")
    stride = 0 if stride is None else count(stride, "stride", 1)
    paths = draws.member + np.arange(len(start))
    if len(paths) and paths[-1] > _LARGEST["member"]:
        raise ValueError(f"member must be at most {_LARGEST['member'] + 1 - len(paths)} for {len(paths)} members")
    return Members(start, size, count(steps, "steps", 0), values, begin, stride, draws, paths)


def states(x: ArrayLike, what: str, interface: Interface) -> Floats:
    """States (…, DIM), a copy: what the caller does to his array later is his affair."""
    found = real(x, what)
    names = interface.coordinates
    if found.ndim == 0 or found.shape[-1] != len(names):
        last = f"{len(names)} ({', '.join(names)})"
        raise ValueError(f"{what} must have a last axis of length {last}, but its shape is {found.shape}")
    if not np.isfinite(found).all():
        index = tuple(np.argwhere(~np.isfinite(found))[0].tolist())
        place = f"{names[index[-1]]}" + (f" of member {index[0]}" if len(index) > 1 else "")
        raise ValueError(f"{what} must be finite, but {place} is {float(found[index])!r}")
    return found


def firsts(attitude0: ArrayLike | None, position0: ArrayLike | None, interface: Interface, members: int) -> Floats:
    """`first` for each of some members, (members, numbers): one for all, or one for each; by default the identity."""
    if not interface.attitude:
        first(np.eye(1), None, interface)  # which says why there is none
    several = np.ndim(attitude0) > len(interface.attitude) if attitude0 is not None else False
    placed = position0 is not None and np.ndim(position0) > 1
    turns = array(attitude0, "attitude0", (members, *interface.attitude)) if several else None  # type: ignore[arg-type]
    places = array(position0, "position0", (members, 3)) if placed and interface.position else None  # type: ignore[arg-type]
    begin = np.empty((members, interface.element))
    identity = np.eye(interface.attitude[0])[0] if len(interface.attitude) == 1 else np.eye(interface.attitude[0])
    for m in range(members):
        own = attitude0 if turns is None else turns[m]
        begin[m] = first(identity if own is None else own, position0 if places is None else places[m], interface)
    return begin


def first(attitude0: ArrayLike | None, position0: ArrayLike | None, interface: Interface) -> Floats | None:
    """The numbers of an attitude, a quaternion of length 1 or a matrix, and a position; None if neither is given."""
    if attitude0 is None and position0 is None:
        return None
    for given, there, what in (
        (attitude0, bool(interface.attitude), "attitude0"),
        (position0, interface.position, "position0"),
    ):
        if given is not None and not there:
            where = "reconstruct: quaternion or matrix in its spec asks for one, positions belong to se(3)"
            raise TypeError(f"{interface.name} has no {what[:-1]}: {where}")
    shape = interface.attitude
    start = np.eye(shape[0]) if len(shape) == 2 else np.eye(4)[0]
    attitude = start if attitude0 is None else array(attitude0, "attitude0", shape)
    if len(shape) == 1:
        if not attitude.any():
            raise ValueError("attitude0 must not be 0")
        attitude = attitude / np.abs(attitude).max()
        attitude /= np.sqrt(attitude @ attitude)
    place = np.zeros(3) if position0 is None else array(position0, "position0", (3,))
    return np.concatenate([attitude.ravel(), place]) if interface.position else attitude.ravel()


def array(given: ArrayLike, what: str, shape: tuple[int, ...]) -> Floats:
    """A copy of an array of finite numbers of that shape."""
    found = real(given, what)
    if found.shape != shape:
        raise ValueError(f"{what} must have shape {shape}, not {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError(f"{what} must be finite")
    return found


def real(given: ArrayLike, what: str) -> Floats:
    """A copy of an array of numbers: not of complex ones, whose imaginary parts would be lost, nor of texts."""
    try:
        kind = np.asarray(given).dtype.kind
        if kind in "SU":
            raise TypeError("text is not a number")
        if kind != "c":
            return np.array(given, dtype=np.float64)
    except OverflowError:
        raise ValueError(f"{what} must be finite, but a number in it is too large") from None
    except (TypeError, ValueError) as error:
        raise TypeError(f"{what} must be an array of numbers: {error}") from None
    raise TypeError(f"{what} must be real")


def number(value: float, what: str) -> float:
    """A finite number."""
    if isinstance(value, str | bytes | bytearray):  # which float would read
        raise TypeError(f"{what} must be a number, not {_shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        raise ValueError(f"{what} must be finite, not {_shown(value)}") from None
    except (TypeError, ValueError):
        raise TypeError(f"{what} must be a number, not {_shown(value)}") from None
    if not math.isfinite(number):
        raise ValueError(f"{what} must be finite, not {_shown(value)}")
    return number


def _shown(value: Any) -> str:
    """A value in a message; integers of thousands of digits cannot even be printed."""
    if isinstance(value, int) and abs(value) > _MOST:
        return f"an integer of {int(math.log10(abs(value))) + 1} digits"
    return shortened(value)


def beyond_single(numbers: Mapping[str, Any]) -> str:
    """Which of some numbers, or arrays of them, has no place in single precision, in words; nothing if all have."""
    for name, value in numbers.items():
        largest = max(np.ravel(value).tolist(), key=abs, default=0.0)
        if abs(largest) > LARGEST_SINGLE:
            return f"{name} = {largest!r} is too large for single precision, which ends at {LARGEST_SINGLE:.2g}"
    return ""


def expect_known(names: Iterable[str], known: Mapping[str, float]) -> None:
    """Raises `TypeError` for the first name that no parameter has."""
    for name in names:
        if name not in known:
            raise TypeError(_unknown(name, known))


def _unknown(name: str, known: Mapping[str, float]) -> str:
    near = get_close_matches(name, known, n=1)
    if near:
        return f"unknown parameter {name!r}; did you mean {near[0]!r}?"
    listed = f"the system has {', '.join(known)}" if known else "the system has none"
    return f"unknown parameter {name!r}; {listed}"
