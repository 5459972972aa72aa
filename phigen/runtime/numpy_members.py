"""Ensembles in NumPy: a generated module makes the steps of all members together, on arrays with one row per member.

Members that fail are removed from the arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phigen.runtime.interface import BackendError, Floats, row_steps
from phigen.runtime.members import Members


def ensemble(module: Any, members: Members, gauge: Floats | None, attitudes: Floats | None = None) -> Floats:
    """Return the final states (members, DIM) or all frames (rows, members, DIM) of an ensemble.

    ``gauge`` (members, Casimirs) has the multiples of Casimirs that are subtracted from H, None if there are none. If
    ``attitudes`` is passed, its first row has the initial attitudes, and the computed attitudes are written into the
    other rows.
    """
    frames = members.frames() if members.stride else None
    if not len(members):
        if not module._admissible(module._values(dict(members.parameters))):
            raise BackendError("BAD_ARGUMENT", 0, members.x0)
        return members.x0.copy() if frames is None else frames
    batch = MemberBatch(module, members, gauge, None if attitudes is None else attitudes[0].copy())
    if frames is not None:
        frames[1:] = np.nan
    marks = row_steps(members.steps, members.stride or max(members.steps, 1))
    for row, steps in enumerate(np.diff(marks), 1):
        batch.advance(int(steps))
        if frames is not None:
            frames[row, batch.numbers] = batch.x
        if attitudes is not None:
            attitudes[row] = np.nan
            attitudes[row, batch.numbers] = batch.turned[batch.numbers]
    if attitudes is not None and frames is None:
        attitudes[-1] = batch.turned
    return members.checked(batch.final if frames is None else frames, batch.failures, batch.failed_at)


def _refused(module: Any, members: Members) -> list[int]:
    """Return the numbers of the members for which no step is possible.

    Either their parameters are not admissible, or the monitor g is not positive at their start.
    """
    values = module._values(dict(members.parameters))
    refused = set(map(int, module._refused(values, members.x0))) if hasattr(module, "_refused") else set()
    if not module._admissible(values):
        each = (module._values(members.numbers(m)[1]) for m in range(len(members)))
        refused |= {m for m, numbers in enumerate(each) if not module._admissible(numbers)}
    return sorted(refused)


class MemberBatch:
    """The members that have not failed, and the variables of the loop over steps.

    ``numbers`` (members,) are the numbers of these members, and ``x`` their states. ``final`` and ``turned`` have the
    last state and the last attitude of all members, including failed members. ``failures`` maps failed members to their
    status. ``failed_at`` is the number of steps before the first failure. ``first`` has the initial attitude of each
    member; it is None if the spec has no attitude.
    """

    def __init__(self, module: Any, members: Members, gauge: Floats | None, first: Floats | None) -> None:
        self._module, self._members, self._done = module, members, 0
        self.failures, self.failed_at, self.final = dict[int, str](), -1, members.x0.copy()
        self.numbers, self.x, self._carry = np.arange(len(members)), members.x0, np.zeros_like(members.x0)
        values = module._values(dict(members.parameters))
        with np.errstate(all="ignore"):
            self._stages = module._coefficients(values, self.x, members.h[()], gauge)
        self._memory = [(self._carry, self._carry)] * len(self._stages)
        self._first, self._turned, self.turned = first, (self._carry, self._carry), np.empty_like(members.x0)
        if first is not None:
            identity = module._identity(len(members))
            self._rate, self._turned = module._rates(values, self.x, gauge), (identity, np.zeros_like(identity))
            self.turned = first.copy()
        self._before, self._running = self.x, False
        self._select_settings()
        if refused := _refused(module, members):
            self._leave(dict.fromkeys(refused, "BAD_ARGUMENT"))

    def advance(self, steps: int) -> None:
        """Make ``steps`` steps. If members fail in a step, they are removed, and the step is repeated for the remaining
        members.
        """
        with np.errstate(all="ignore"):
            self._begin_run(steps)
            while steps and len(self.numbers):
                failed = self._step()
                if failed:
                    self._leave(failed)
                else:
                    steps -= 1
            self._end_run()
        self._report()

    def _begin_run(self, steps: int) -> None:
        """Apply the inverse corrector before a sequence of steps, if the method has a corrector."""
        if hasattr(self._module, "_followed") and steps and len(self.numbers):
            self._before = self.x
            self.x, self._carry = self._module._followed(self._module.BEGIN, self._stages[0], self.x, self._carry)
            self._running = True

    def _end_run(self) -> None:
        """Apply the corrector after a sequence of steps, if the method has a corrector.

        If the result of a member is not finite, this member fails, and gets back its state from before the sequence.
        """
        if not self._running:
            return
        x, carry = self._state()
        failed_members = np.flatnonzero(~np.isfinite(x).all(axis=-1))
        self.x, self._carry, self._running = np.where(np.isfinite(x), x, self._before), carry, False
        if len(failed_members):
            self._leave(dict.fromkeys(failed_members.tolist(), "NOT_FINITE"))

    def _state(self) -> tuple[Floats, Floats]:
        """Return the states of the members that have not failed, and the compensation terms of these states.

        If the method has a corrector, it is applied to the states that are returned.
        """
        if not self._running:
            return self.x, self._carry
        end: tuple[Floats, Floats] = self._module._followed(self._module.END, self._stages[0], self.x, self._carry)
        return end

    def _report(self) -> None:
        """For the members in ``numbers``, copy the states to the array ``final`` and the attitudes to the array
        ``turned``.
        """
        x, _ = self._state()
        self.final[self.numbers] = np.where(np.isfinite(x), x, self._before) if self._running else x
        if self._first is not None:
            elapsed = self._done * self._h
            elapsed = elapsed[:, np.newaxis] if np.ndim(elapsed) else elapsed
            self.turned[self.numbers] = self._module._attitude(self._first, self._turned[0], self._rate, elapsed)

    def _select_settings(self) -> None:
        """Store the step sizes, initial times and random numbers of the members that have not failed."""
        left, draws = self._members.part(self.numbers), self._members.draws
        self._h, self._t0 = left.h[()], left.t0[()]
        if hasattr(self._module, "_drawing"):
            self._drawn = self._module._drawing(self._h, len(left), draws.seed, left.paths, draws.step)

    def _of_step(self) -> tuple[Any, ...]:
        """Return arguments for the stages of the next step: time, step size and, with noise, increments of the
        noise.
        """
        time_and_step = self._t0 + self._done * self._h, self._h
        return (*time_and_step, self._drawn(self._done)) if hasattr(self._module, "_drawing") else time_and_step

    def _step(self) -> dict[int, str]:
        """Make one step of all remaining members. If some members fail, no member is advanced.

        Returns the status of each failed member. The keys are the indices of failed members in the array ``numbers``.
        """
        module, memory = self._module, list(self._memory)
        x, carry, attitudes = self.x, self._carry, self._turned
        of_step = self._of_step() if hasattr(module, "_renewed") else ()
        for k, prepared in enumerate(self._stages):
            stage = module._renewed(prepared, *of_step) if of_step else prepared
            stage_before = stage, x, carry
            x, carry, memory[k], status = module._advance(stage, x, carry, memory[k])
            if hasattr(module, "_time_of"):
                nowhere = np.isnan(module._time_of(stage, stage_before[1], memory[k][0]))
                status = np.where((status == "") & nowhere, "NOT_FINITE", status)
            failed = np.flatnonzero(status != "")
            if len(failed):
                return {int(m): str(status[m]) for m in failed}
            if self._first is not None:
                attitudes = module._turn_stage(*stage_before, memory[k][0], *attitudes)
        self.x, self._carry, self._memory, self._turned = x, carry, memory, attitudes
        self._done += 1
        return {}

    def _leave(self, failed: dict[int, str]) -> None:
        """Remove failed members. The predictors of the remaining members are not changed, so the bits of their states
        do not depend on this removal.
        """
        remaining = np.delete(np.arange(len(self.numbers)), list(failed))
        self._report()
        self.failures |= {int(self.numbers[m]): status for m, status in failed.items()}
        self.failed_at = self._done if self.failed_at < 0 else self.failed_at
        self.numbers, self.x, self._carry = self.numbers[remaining], self.x[remaining], self._carry[remaining]
        self._before = self._before[remaining]
        # Predictors are arrays (members, DIM) or, in Gauss methods, (unknowns, members, stages). So the axis of members
        # is the last axis but one. An array with one axis has only the axis of members.
        self._memory = [
            (np.take(a, remaining, max(a.ndim - 2, 0)), np.take(b, remaining, max(b.ndim - 2, 0)))
            for a, b in self._memory
        ]
        self._stages = [self._module._stage_at(stage, remaining) for stage in self._stages]
        if self._first is not None:
            self._first, self._turned = self._first[remaining], (self._turned[0][remaining], self._turned[1][remaining])
            self._rate = None if self._rate is None else self._rate[remaining]
        self._select_settings()
