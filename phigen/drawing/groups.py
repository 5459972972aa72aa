"""Groups of coordinates that a picture shows together, found by their names: (q, p), (x1, y1), (P1, P2, P3), …"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

Group = tuple[str, ...]


def groups(coordinates: Sequence[str]) -> list[Group]:
    """Return the coordinates in groups of up to three, in order. A group of one coordinate is drawn over time.

    Up to three coordinates are one group. More coordinates are first paired by their names: a position with its
    momentum, such as q with p, q1 with p1, or x with px. If all coordinates are paired, the groups are the pairs. Two
    pairs are an exception: one group has the two positions, which show the orbit in a plane, and the other group has
    the two momenta. If a coordinate remains unpaired, successive names with the same letters, or with the same number,
    form a group. Long groups are split.
    """
    names = tuple(coordinates)
    if len(names) <= 3:
        return [names]
    pairs = _pairs(names)
    if is_orbit(names):
        return [(pairs[0][0], pairs[1][0]), (pairs[0][1], pairs[1][1])]
    if 2 * len(pairs) == len(names):
        return pairs
    return [part for run in _runs(names) for part in _parts(run)]


def phase_planes(coordinates: Sequence[str]) -> list[Group]:
    """Return the planes of Poincaré sections: pairs of a position and its momentum, if all coordinates form pairs.

    Otherwise the planes are `groups`.
    """
    pairs = _pairs(tuple(coordinates))
    return pairs if len(coordinates) > 3 and 2 * len(pairs) == len(coordinates) else groups(coordinates)


def is_orbit(coordinates: Sequence[str]) -> bool:
    """Return whether the coordinates are two positions and their momenta, which describe an orbit in a plane."""
    return len(coordinates) == 4 and len(_pairs(tuple(coordinates))) == 2


def _pairs(names: Group) -> list[Group]:
    return [(q, p) for q in names if (p := _momentum(q, names))]


def _momentum(q: str, names: Group) -> str | None:
    candidates = [f"p{q}", f"p_{q}", f"p{q[1:]}" if q.startswith("q") else ""]
    return next((p for p in candidates if p in names), None)


def _runs(names: Group) -> list[Group]:
    """Return groups of successive names that have equal letters, or equal numbers, whichever gives fewer groups."""
    by_letters = _split(names, lambda name: re.sub(r"[\d_]+$", "", name))
    by_number = _split(names, lambda name: name[len(re.sub(r"\d+$", "", name)) :])
    return min(by_number, by_letters, key=len)


def _split(names: Group, kind: Callable[[str], str]) -> list[Group]:
    runs: list[list[str]] = []
    for name in names:
        if runs and kind(runs[-1][-1]) == kind(name):
            runs[-1].append(name)
        else:
            runs.append([name])
    return [tuple(run) for run in runs]


def _parts(run: Group) -> list[Group]:
    """Split a long group into groups of two or three names.

    The groups have three names if the long group begins with x, y, z or if its length is divisible by 3. Otherwise they
    have two names, except that the first group has three if the length is odd.
    """
    if run[:3] == ("x", "y", "z") or len(run) % 3 == 0:
        return [run[i : i + 3] for i in range(0, len(run), 3)]
    first = 3 if len(run) % 2 and len(run) > 1 else 0
    return [run[:first]] * bool(first) + [run[i : i + 2] for i in range(first, len(run), 2)]
