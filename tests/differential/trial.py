"""Checks of drawn systems: which apply, what they find, and how a system that fails is made smaller and shown."""

from __future__ import annotations

import random
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self

from differential.reference import DisagreementError

from phigen.errors import PhigenWarning, SpecError

#: How often a system is drawn for a seed, until one is offered.
_ATTEMPTS = 6


class System(Protocol):
    """A drawn system, ordinary or a lattice."""

    seed: int
    kind: str

    @property
    def text(self) -> str:
        """The spec."""
        ...

    def simpler(self) -> Iterator[Self]:
        """Yield systems with a part less."""
        ...


class RefusedError(Exception):
    """phigen does not offer what was drawn, and says so with a `SpecError`."""


@dataclass(frozen=True)
class Check:
    """A statement about the solvers of a system, tested by ``run``, which raises `DisagreementError`.

    ``applies`` says of which systems it is true. ``lines`` is a script that shows the two sides, after the solver
    ``s``, the state ``x``, the step ``h`` and numpy as ``np``.
    """

    name: str
    run: Callable[[Any], None]
    applies: Callable[[Any], bool]
    lines: str = ""


@dataclass(frozen=True)
class Failure:
    """A check that failed, on a system that was made as small as it still fails on."""

    check: str
    message: str
    system: System
    script: str

    def __str__(self) -> str:
        script = "\n".join(f"    {line}" for line in self.script.splitlines())
        return f"{self.system.kind} {self.system.seed}: {self.check}: {self.message}\n{self.system.text}\n{script}"


#: The result of checking one system: failures, the names of the checks that were made, and why it was refused.
@dataclass(frozen=True)
class Outcome:
    failures: tuple[Failure, ...]
    made: tuple[str, ...]
    refused: str = ""


@dataclass(frozen=True)
class Suite:
    """How systems of one kind are drawn, prepared and checked."""

    draw: Callable[[int, int], Any]
    prepare: Callable[[Any], Any]
    checks: Sequence[Check]
    script: Callable[[Any, Check | None], str]

    def outcome(self, seed: int, *, shrink: bool = True) -> Outcome:
        """Check the system of a seed: the first of its draws that phigen does not refuse."""
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
        """The messages of the checks that fail, the names of those that were made, and why phigen refuses it."""
        try:
            trial = self.prepare(system)
        except RefusedError as error:
            return {}, [], str(error)
        except Exception as error:  # whatever it is, it is a defect
            return {"it compiles": _said(error)}, [], ""
        failures, checks_made = dict[str, str](), list[str]()
        for check in self.checks:
            if only in (None, check.name) and check.applies(trial):
                checks_made.append(check.name)
                try:
                    check.run(trial)
                except DisagreementError as error:
                    failures[check.name] = str(error)
                except Exception as error:  # as well
                    failures[check.name] = _said(error)
        return failures, checks_made, ""

    def _shrunk(self, system: Any, name: str, most: int = 60) -> Any:
        """The system with all parts left out without which the check still fails."""
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
    """The last lines of an error that nobody expected."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {' / '.join(lines[:6])} ({place.filename}:{place.lineno})"


def refused(error: SpecError) -> RefusedError:
    """What a system is refused with, in one line."""
    return RefusedError("; ".join(d.message for d in error.diagnostics))


def numbers(seed: int, salt: str) -> random.Random:
    """Random numbers of a check."""
    return random.Random(f"{salt} {seed}")
