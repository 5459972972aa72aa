"""Checks and conversions of the arguments that users pass to solvers: numbers, counts, states and parameters."""

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

#: Largest number of steps: the largest signed integer of 64 bits. NumPy stores step numbers as signed integers.
_MOST = int(np.iinfo(np.int64).max)

#: Largest finite number in single precision. States and parameters of C with ``real: float`` cannot be larger.
LARGEST_SINGLE = float(np.finfo(np.float32).max)

#: Largest values of the arguments that select random numbers: the largest numbers of the types uint64, uint32 and
#: int64.
_LARGEST = {"seed": 2**64 - 1, "member": 2**32 - 1, "step0": _MOST}


#: Value of the argument ``selections`` if seed, member and step0 are all omitted.
NONE_DRAWN: Mapping[str, int | None] = MappingProxyType({})


@dataclass(frozen=True)
class Beginning:
    """Checked arguments of a trajectory: initial state ``x`` at the time ``t0``, step size ``h``, and parameter
    ``values``.

    ``draws`` selects the random numbers. ``first`` are the values of the initial attitude and position, None for the
    default. ``level`` is the energy level e of a lattice with a monitor; None stands for −H(x).
    """

    x: Floats
    h: float
    values: Mapping[str, Any]
    t0: float = 0.0
    draws: Draws = FIRST_DRAWS
    first: Floats | None = None
    level: float | None = None


def level(interface: Interface, by_keyword: dict[str, Any]) -> float | None:
    """Return the energy level e that the argument ``gauge`` sets, and remove ``gauge`` from ``by_keyword``.

    Only lattices with a monitor have this argument. If the argument is missing, returns None; e is then −H of the
    initial state. Raises `ValueError` unless the value is one finite number.
    """
    if not interface.monitored or "gauge" not in by_keyword:
        return None
    value = np.ravel(np.asarray(by_keyword.pop("gauge"), dtype=np.float64))
    if value.shape != (1,) or not np.isfinite(value).all():
        raise ValueError("gauge must be one finite number, the energy level e")
    return float(value[0])


def step_size(h: float) -> float:
    """Return the step size ``h`` as a float. Raises `ValueError` if it is 0 or not finite, `TypeError` if it is no
    number."""
    size = number(h, "the step size h")
    if size == 0:
        raise ValueError("the step size h must not be 0")
    return size


def end(until: float, begin: float, h: float) -> float:
    """Return the time span ``until`` − ``begin``. Raises `ValueError` if steps of size ``h`` lead away from
    ``until``.
    """
    span = number(until, "the time until") - begin
    if span * h <= 0:
        raise ValueError(f"until = {until!r} is never reached from {begin!r} by steps of {h!r}")
    return span


def count(value: int, name: str, minimum: int, maximum: int = _MOST) -> int:
    """Return ``value`` if it is an integer from ``minimum`` to ``maximum``; ``name`` is its name in messages.

    Raises `TypeError` for values that are no integers, `ValueError` for integers outside of the range.
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} must be an integer, not {_shown(value)}") from None
    if number < minimum:
        raise ValueError(f"{name} must be at least {minimum}, not {_shown(number)}")
    if number > maximum:
        raise ValueError(f"{name} must be at most {maximum}, not {_shown(number)}")
    return number


def start_time(t0: float | None, interface: Interface, by_keyword: dict[str, float]) -> float:
    """Return the initial time ``t0`` of a trajectory; the default is 0.

    If the Hamiltonian does not depend on the time, ``t0`` can only be the value of a parameter with the name t0. This
    value is then added to ``by_keyword``, and 0 is returned.
    """
    if t0 is None or interface.time:
        return 0.0 if t0 is None else number(t0, "the time t0")
    if "t0" not in interface.parameters:
        raise TypeError(f"t0 is not used: the Hamiltonian of {interface.name} does not depend on the time")
    by_keyword["t0"] = t0
    return 0.0


def draws(interface: Interface, by_keyword: dict[str, Any], selections: Mapping[str, int | None] = NONE_DRAWN) -> Draws:
    """Return the selection of random numbers, from the arguments seed, member and step0.

    If the system has no noise, seed, member and step0 can only be names of parameters. The values of these parameters
    are then added to ``by_keyword``.
    """
    selected = {name: value for name, value in selections.items() if value is not None}
    if interface.noise:
        numbers = {name: count(value, name, 0, _LARGEST[name]) for name, value in selected.items()}
        return Draws(numbers.get("seed", 0), numbers.get("member", 0), numbers.get("step0", 0))
    for name in selected:
        if name not in interface.parameters:
            raise TypeError(f"{name} was given, but {interface.name} has no noise")
    by_keyword |= selected
    return Draws()


def increments(values: ArrayLike, interface: Interface) -> Floats:
    """Return prescribed increments of the noise as an array: one row for each step, with all increments of the step.

    Raises `TypeError` if the system has no noise, and `ValueError` for other shapes and for values that are not finite.
    """
    if not interface.noise:
        raise TypeError(f"increments were given, but {interface.name} has no noise")
    rows = real(values, "increments")
    if rows.ndim != 2 or rows.shape[1] != interface.draws:
        raise ValueError(f"increments must have shape (steps, {interface.draws}), not {rows.shape}")
    if not np.isfinite(rows).all():
        raise ValueError("increments must be finite")
    return rows


def expect_no_noise(argument: str, interface: Interface) -> None:
    """Raise `TypeError` if the system has noise: a shorter step would draw other random numbers than a whole step.

    ``argument`` is the name of the argument that needs a shorter step.
    """
    if interface.noise:
        raise TypeError(f"{argument} is not available with noise: a shorter step would draw other random numbers")


def times_within(times: ArrayLike, t: Floats) -> Floats:
    """Return times as an array (times,). Raises `ValueError` if a time is outside the range of the trajectory's times
    ``t``."""
    requested_times = np.atleast_1d(np.asarray(times, dtype=np.float64))
    low, high = sorted((float(t[0]), float(t[-1])))
    slack = 1e-9 * (high - low)
    if requested_times.ndim != 1 or not ((requested_times >= low - slack) & (requested_times <= high + slack)).all():
        raise ValueError(f"times must be numbers between {low!r} and {high!r}")
    return requested_times


def rows_at(t: Floats, x: Floats, requested_times: Floats) -> Floats:
    """Return those rows of ``x`` (rows, DIM) that are at the requested times; ``t`` (rows,) are the times of the rows.

    Raises `ValueError` for a time at which there is no row.
    """
    nearest = np.argmin(np.abs(t[:, np.newaxis] - requested_times), axis=0)
    apart = np.abs(t[nearest] - requested_times)
    if (apart > 1e-9 * np.ptp(t)).any():
        earliest_between = float(requested_times[int(np.argmax(apart))])
        message = f"the time {earliest_between!r} is between two stored states"
        raise ValueError(f"{message}, where the path of the noise is not known; stride=1 stores all states")
    rows: Floats = x[nearest]
    return rows


def times(
    t: ArrayLike | None, interface: Interface, shape: tuple[int, ...], by_keyword: dict[str, Any]
) -> Floats | None:
    """Return the times ``t`` of states as a flat array, with one time for each state.

    ``shape`` is the shape of the array of states without the last axis. Returns None if the Hamiltonian does not depend
    on the time; a parameter may then have the name t, and its value is added to ``by_keyword``.
    """
    if not interface.time:
        if t is not None and "t" not in interface.parameters:
            raise TypeError(f"t was given, but the Hamiltonian of {interface.name} does not depend on the time")
        by_keyword |= {} if t is None else {"t": t}
        return None
    if t is None:
        raise TypeError(f"t is missing: the Hamiltonian of {interface.name} depends on the time")
    rows = np.array(np.broadcast_to(np.asarray(t, dtype=np.float64), shape)).reshape(-1)
    if not np.isfinite(rows).all():
        raise ValueError("the times t must be finite")
    return rows


def together(mapped: Mapping[str, Any] | None, by_keyword: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters from a mapping and from keyword arguments in one dict. Raises `TypeError` for a name that is in
    the mapping and among the keyword arguments.
    """
    repeated = sorted(set(mapped or {}) & set(by_keyword))
    if repeated:
        raise TypeError(f"parameter {repeated[0]!r} is given twice")
    return {**(mapped or {}), **by_keyword}


def broken_bound(name: str, value: ArrayLike, interface: Interface) -> str:
    """Return the name of the bound that ``value`` violates: ``positive``, ``nonnegative``, or "" if it violates
    none.

    ``name`` is the name of the parameter.
    """
    least = float(np.min(np.asarray(value), initial=np.inf))
    if name in interface.positive and not least > 0:
        return "positive"
    return "nonnegative" if name in interface.nonnegative and not least >= 0 else ""


def parameters(
    interface: Interface, mapped: Mapping[str, float] | None, by_keyword: Mapping[str, float]
) -> dict[str, float]:
    """Return the values of all parameters. A parameter that is in neither of the two mappings has its default
    value.

    Raises `TypeError` for unknown names and names passed twice, `ValueError` for values that are not admissible.
    """
    values = {name: float(value) for name, value in interface.parameters.items()}
    requested = together(mapped, by_keyword)
    expect_known(requested, interface.parameters)
    for name, value in requested.items():
        values[name] = number(value, f"parameter {name!r}")
        if violated := broken_bound(name, values[name], interface):
            raise ValueError(f"parameter {name!r} must be {violated}, not {_shown(value)}")
    return values


def state(x: ArrayLike, argument: str, interface: Interface) -> Floats:
    """Return a copy of one state (DIM,). Raises `TypeError` for values that are not numbers, and `ValueError` for other
    shapes and for values that are not finite.
    """
    copy = states(x, argument, interface)
    if copy.ndim != 1:
        expected = f"({interface.dimension},)"
        raise ValueError(f"{argument} must have shape {expected}, not {copy.shape}; for many states use ensemble")
    return copy


def members(x: ArrayLike, argument: str, interface: Interface) -> Floats:
    """Return a copy of the states of an ensemble (members, DIM). Raises `TypeError` for values that are not numbers,
    and `ValueError` for other shapes and for values that are not finite.
    """
    copies = states(x, argument, interface)
    if copies.ndim != 2:
        raise ValueError(f"{argument} must have shape (members, {interface.dimension}), not {copies.shape}")
    return copies


def ensemble(
    X0: ArrayLike,
    h: ArrayLike,
    steps: int,
    stride: int | None,
    t0: ArrayLike | None,
    mapped: Mapping[str, ArrayLike] | None,
    by_keyword: Mapping[str, ArrayLike],
    interface: Interface,
    draws: Draws = FIRST_DRAWS,
) -> Members:
    """Return the checked arguments of `Solver.ensemble` as one `Members`."""
    per_member: dict[str, Any] = {name: v for name, v in {**(mapped or {}), **by_keyword}.items() if np.ndim(v) > 0}
    if t0 is not None and np.ndim(t0) > 0 and not interface.time:
        per_member["t0"] = t0  # if H does not depend on the time, t0 can only be the name of a parameter
    several: list[Any] = [v for v in (h, t0, *per_member.values()) if v is not None and np.ndim(v) > 0]
    if np.ndim(X0) == 1 and several:
        start = np.tile(state(X0, "X0", interface), (len(several[0]), 1))
    else:
        start = members(X0, "X0", interface)
    shape = (len(start),)
    # Here only names of parameters are checked, so a number replaces each array over members. The arrays are checked
    # below.
    shared_values: list[dict[str, Any]] = [
        {n: 1.0 if n in per_member else v for n, v in (part or {}).items()} for part in (mapped, by_keyword)
    ]
    alone: Any = 1.0 if t0 is not None and np.ndim(t0) > 0 else t0
    begin: Floats = np.asarray(start_time(alone, interface, shared_values[1]))
    values = {name: np.asarray(value) for name, value in parameters(interface, *shared_values).items()}
    for name in per_member.keys() & values.keys():
        values[name] = array(per_member[name], f"parameter {name!r}", shape)
        if violated := broken_bound(name, values[name], interface):
            m = int(np.argmin(values[name] >= 0 if violated == "nonnegative" else values[name] > 0))
            raise ValueError(f"parameter {name!r} of member {m} must be {violated}, not {float(values[name][m])}")
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


def states(x: ArrayLike, argument: str, interface: Interface) -> Floats:
    """Return a copy of states (…, DIM), so that the caller may change the array later.

    Raises `TypeError` for arrays that are not of real numbers, `ValueError` for other shapes and non-finite values.
    """
    copy = real(x, argument)
    names = interface.coordinates
    if copy.ndim == 0 or copy.shape[-1] != len(names):
        last = f"{len(names)} ({', '.join(names)})"
        raise ValueError(f"{argument} must have a last axis of length {last}, but its shape is {copy.shape}")
    if not np.isfinite(copy).all():
        index = tuple(np.argwhere(~np.isfinite(copy))[0].tolist())
        element = f"{names[index[-1]]}" + (f" of member {index[0]}" if len(index) > 1 else "")
        raise ValueError(f"{argument} must be finite, but {element} is {float(copy[index])!r}")
    return copy


def firsts(attitude0: ArrayLike | None, position0: ArrayLike | None, interface: Interface, members: int) -> Floats:
    """Return an array with a row for each member: the components of its initial attitude and of its initial position.

    ``attitude0`` and ``position0`` are single values for all members, or have a first axis of members. The defaults are
    the identity and the origin.
    """
    if not interface.attitude:
        first(np.eye(1), None, interface)  # raises the `TypeError` that says why this system has no attitude
    several = np.ndim(attitude0) > len(interface.attitude) if attitude0 is not None else False
    has_member_positions = position0 is not None and np.ndim(position0) > 1
    turns = array(attitude0, "attitude0", (members, *interface.attitude)) if several else None  # type: ignore[arg-type]
    positions = array(position0, "position0", (members, 3)) if has_member_positions and interface.position else None  # type: ignore[arg-type]
    begin = np.empty((members, interface.element))
    identity = np.eye(interface.attitude[0])[0] if len(interface.attitude) == 1 else np.eye(interface.attitude[0])
    for m in range(members):
        attitude = attitude0 if turns is None else turns[m]
        begin[m] = first(
            identity if attitude is None else attitude, position0 if positions is None else positions[m], interface
        )
    return begin


def first(attitude0: ArrayLike | None, position0: ArrayLike | None, interface: Interface) -> Floats | None:
    """Return an initial attitude (a unit quaternion or a matrix) and a position as one flat array of numbers.

    Returns None if neither is passed. Raises `TypeError` if the system has no attitude or no position, and `ValueError`
    for other shapes.
    """
    if attitude0 is None and position0 is None:
        return None
    if attitude0 is not None and not interface.attitude:
        raise TypeError(f"{interface.name} has no attitude: add `reconstruct: quaternion` or `matrix` to its spec")
    if position0 is not None and not interface.position:
        raise TypeError(f"{interface.name} has no position: only systems on se(3) with `reconstruct` have positions")
    shape = interface.attitude
    start = np.eye(shape[0]) if len(shape) == 2 else np.eye(4)[0]
    attitude = start if attitude0 is None else array(attitude0, "attitude0", shape)
    if len(shape) == 1:
        if not attitude.any():
            raise ValueError("attitude0 must not be 0")
        attitude = attitude / np.abs(attitude).max()
        attitude /= np.sqrt(attitude @ attitude)
    position = np.zeros(3) if position0 is None else array(position0, "position0", (3,))
    return np.concatenate([attitude.ravel(), position]) if interface.position else attitude.ravel()


def array(values: ArrayLike, argument: str, shape: tuple[int, ...]) -> Floats:
    """Return a copy of an array. Raises `ValueError` unless it has this ``shape`` and all values are finite."""
    copy = real(values, argument)
    if copy.shape != shape:
        raise ValueError(f"{argument} must have shape {shape}, not {copy.shape}")
    if not np.isfinite(copy).all():
        raise ValueError(f"{argument} must be finite")
    return copy


def real(values: ArrayLike, argument: str) -> Floats:
    """Return a copy of an array of real numbers.

    Raises `TypeError` for texts and for complex numbers, whose imaginary parts would be lost.
    """
    try:
        kind = np.asarray(values).dtype.kind
        if kind in "SU":
            raise TypeError("text is not a number")
        if kind != "c":
            return np.array(values, dtype=np.float64)
    except OverflowError:
        raise ValueError(f"{argument} must be finite, but a number in it is too large") from None
    except (TypeError, ValueError) as error:
        raise TypeError(f"{argument} must be an array of numbers: {error}") from None
    raise TypeError(f"{argument} must be real")


def number(value: float, argument: str) -> float:
    """Return ``value`` as a float; ``argument`` is its name in messages.

    Raises `TypeError` if the value is not a number, `ValueError` if it is not finite.
    """
    if isinstance(value, str | bytes | bytearray):  # refused, since float() would convert text to a number
        raise TypeError(f"{argument} must be a number, not {_shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        raise ValueError(f"{argument} must be finite, not {_shown(value)}") from None
    except (TypeError, ValueError):
        shape = np.shape(value) if isinstance(value, list | tuple | np.ndarray) else ()
        several = f"an array of shape {shape}" if shape else _shown(value)
        raise TypeError(f"{argument} must be {'one' if shape else 'a'} number, not {several}") from None
    if not math.isfinite(number):
        raise ValueError(f"{argument} must be finite, not {_shown(value)}")
    return number


def _shown(value: Any) -> str:
    """Return a value as text for a message.

    Python's ``repr`` refuses integers with thousands of digits. For long integers the text is the number of digits.
    """
    if isinstance(value, int) and abs(value) > _MOST:
        return f"an integer of {int(math.log10(abs(value))) + 1} digits"
    return shortened(value)


def beyond_single(numbers: Mapping[str, Any]) -> str:
    """Return a message about a number that is too large for single precision; "" if there is none.

    ``numbers`` has numbers and arrays by name. The message is about the first number that is too large.
    """
    for name, value in numbers.items():
        largest = max(np.ravel(value).tolist(), key=abs, default=0.0)
        if abs(largest) > LARGEST_SINGLE:
            return f"{name} = {largest!r} is too large for single precision, which ends at {LARGEST_SINGLE:.2g}"
    return ""


def expect_known(names: Iterable[str], known: Mapping[str, float]) -> None:
    """Raise `TypeError` if one of the names is not a parameter; ``known`` are the parameters by name."""
    for name in names:
        if name not in known:
            raise TypeError(_unknown(name, known))


def _unknown(name: str, known: Mapping[str, float]) -> str:
    if name == "h":
        return "unknown parameter 'h'; the step size of a run is step="
    similar_names = get_close_matches(name, known, n=1)
    if similar_names:
        return f"unknown parameter {name!r}; did you mean {similar_names[0]!r}?"
    known_names = f"the system has {', '.join(known)}" if known else "the system has none"
    return f"unknown parameter {name!r}; {known_names}"
