"""Checks of random systems: a suite draws a system, runs the checks that apply, and reduces a failing system to a small
one.
"""

from __future__ import annotations

import random
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self

from differential.reference import DisagreementError

from phigen.errors import PhigenWarning, SpecError

#: Number of draws for a seed, in case phigen refuses the first ones.
_ATTEMPTS = 6


class System(Protocol):
    """A random system: a lattice, or a system with named coordinates ("ordinary")."""

    seed: int
    kind: str

    @property
    def text(self) -> str:
        """Text of the spec."""
        ...

    def simpler(self) -> Iterator[Self]:
        """Yield simpler systems, each with one part removed."""
        ...


class RefusedError(Exception):
    """phigen refuses a random system with a `SpecError`, for instance because it does not offer a combination of
    options.
    """


@dataclass(frozen=True)
class Check:
    """A property of the solvers of a system. ``run`` tests it and raises `DisagreementError` if it fails.

    ``applies`` decides for which systems the property holds. ``lines`` is the end of a script that prints the two
    results, with the solver ``s``, the state ``x``, the step ``h`` and numpy as ``np``.
    """

    name: str
    run: Callable[[Any], None]
    applies: Callable[[Any], bool]
    lines: str = ""


@dataclass(frozen=True)
class Failure:
    """A failed check, with the smallest system found on which it still fails."""

    check: str
    message: str
    system: System
    script: str

    def __str__(self) -> str:
        script = "\n".join(f"    {line}" for line in self.script.splitlines())
        return f"{self.system.kind} {self.system.seed}: {self.check}: {self.message}\n{self.system.text}\n{script}"


#: Result for one system: the failures, the names of the checks that ran, and the reason if phigen refused the system.
@dataclass(frozen=True)
class Outcome:
    failures: tuple[Failure, ...]
    made: tuple[str, ...]
    refused: str = ""


@dataclass(frozen=True)
class Suite:
    """Suite for one kind of system: functions that draw a system, prepare it, and check it."""

    draw: Callable[[int, int], Any]
    prepare: Callable[[Any], Any]
    checks: Sequence[Check]
    script: Callable[[Any, Check | None], str]

    def outcome(self, seed: int, *, shrink: bool = True) -> Outcome:
        """Check the system of a seed: the first draw that phigen does not refuse. A failing system is replaced by a
        smaller one if ``shrink``.
        """
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PhigenWarning)
            for attempt in range(_ATTEMPTS):
                system = self.draw(seed, attempt)
                found_failures, checks_made, refused = self._tried(system, None)
                if not refused:
                    break
            small = [self._shrunk(system, name) if shrink else system for name in found_failures]
            again = [
                self._tried(s, name)[0].get(name, found_failures[name])
                for s, name in zip(small, found_failures, strict=True)
            ]
        named = {check.name: check for check in self.checks}
        failures = tuple(
            Failure(name, message, s, self.script(s, named.get(name)))
            for name, message, s in zip(found_failures, again, small, strict=True)
        )
        return Outcome(failures, tuple(checks_made), refused)

    def _tried(self, system: Any, only: str | None) -> tuple[dict[str, str], list[str], str]:
        """Run the checks, or ``only`` one of them, on a system. Return the messages of failed checks by name, the names
        of the checks that ran, and the reason if phigen refused the system.
        """
        try:
            trial = self.prepare(system)
        except RefusedError as error:
            return {}, [], str(error)
        except Exception as error:  # any other exception is a defect
            return {"it compiles": _said(error)}, [], ""
        failures, checks_made = dict[str, str](), list[str]()
        for check in self.checks:
            if only in (None, check.name) and check.applies(trial):
                checks_made.append(check.name)
                try:
                    check.run(trial)
                except DisagreementError as error:
                    failures[check.name] = str(error)
                except Exception as error:  # any other exception is a failure too
                    failures[check.name] = _said(error)
        return failures, checks_made, ""

    def _shrunk(self, system: Any, name: str, most: int = 60) -> Any:
        """Return a system reduced as far as possible such that the check ``name`` still fails."""
        tries, progress = 0, True
        while progress and tries < most:
            progress = False
            for simpler in system.simpler():
                tries += 1
                if name in self._tried(simpler, name)[0]:
                    system, progress = simpler, True
                    break
                if tries >= most:
                    break
        return system


def _said(error: Exception) -> str:
    """Return a one-line description of an unexpected exception, with the place where it was raised."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {' / '.join(lines[:6])} ({place.filename}:{place.lineno})"


def refused(error: SpecError) -> RefusedError:
    """Return a `RefusedError` with the messages of a `SpecError` on one line."""
    return RefusedError("; ".join(d.message for d in error.diagnostics))


def numbers(seed: int, salt: str) -> random.Random:
    """Return a random generator for a seed and a word that distinguishes checks."""
    return random.Random(f"{salt} {seed}")
