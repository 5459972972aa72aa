"""Sweeps in NumPy that differ in the colour of their sites only, or in their seams: one function, which others call."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from phigen.scheme.steps import Sweep, Sweeps


def chosen(step: Sweeps, sweep: Sweep, new: str, old: str) -> str:
    """The new values where a sweep is made, the old ones elsewhere."""
    if sweep.window is not None:
        return f"np.where(sites.beside, {new}, {old})"
    if sweep.inside:
        return f"sites.inside({'colour' if _argument(step, sweep) else 'None'}, {new}, {old})"
    return f"sites.coloured(colour, {new}, {old})" if _argument(step, sweep) else new


def early(sweep: Sweep, unchanged: str) -> list[str]:
    """The statements that leave out sweeps near seams where colours fit the sizes."""
    return ["    if not sites.beside.any():", f"        return {unchanged}"] if sweep.window is not None else []


def functions(step: Sweeps, sweeps: Iterable[tuple[Sweep, str, str, Sequence[str]]]) -> Iterator[str]:
    """The functions of sweeps, given with their names, arguments and statements."""
    known: dict[tuple[str, ...], str] = {}
    for sweep, name, arguments, statements in sweeps:
        first, own = known.setdefault((arguments, *statements), name), _argument(step, sweep)
        if first == name:
            yield "\n".join([f"def _{name}({arguments}{own}):", *statements, ""])
        else:
            yield f"def _{name}({arguments}):\n    return _{first}({arguments}{own})\n"


def _argument(step: Sweeps, sweep: Sweep) -> str:
    """The argument that says at sites of which colour a sweep is made, where it is not made at all, or its seams."""
    if sweep.window is not None:
        return f", window={sweep.window}"
    return "" if sweep.colour is None or step.sites.colours == 1 else f", colour={sweep.colour}"
