"""Ensembles in NumPy: members side by side in the arrays of a generated module, which those leave that fail."""

from __future__ import annotations

from typing import Any

import numpy as np

from phigen.runtime.interface import Floats, row_steps
from phigen.runtime.members import Members


def ensemble(module: Any, members: Members, gauge: Floats | None, turned: Floats | None = None) -> Floats:
    """Final states or frames, as `phigen.runtime.backend.Backend.ensemble` has them; gauges are (members, Casimirs)."""
    frames = members.frames() if members.stride else None
    if not len(members):
        return members.x0.copy() if frames is None else frames
    abreast = Abreast(module, members, gauge, None if turned is None else turned[0].copy())
    if frames is not None:
        frames[1:] = np.nan
    marks = row_steps(members.steps, members.stride or max(members.steps, 1))
    for row, steps in enumerate(np.diff(marks), 1):
        abreast.advance(int(steps))
        if frames is not None:
            frames[row, abreast.who] = abreast.x
        if turned is not None:
            turned[row] = np.nan
            turned[row, abreast.who] = abreast.turned[abreast.who]
    if turned is not None and frames is None:
        turned[-1] = abreast.turned
    return members.told(abreast.final if frames is None else frames, abreast.failures, abreast.failed_at)


class Abreast:
    """Members that have not failed, ``who`` and at ``x``, with what the loop of ``integrate`` holds of them.

    ``final`` is where each member came, ``turned`` with which attitude, ``failures`` tells how members failed, and
    ``failed_at`` after how many steps the first did. With ``first`` (members, numbers) members have attitudes, and
    begin with these.
    """

    def __init__(self, module: Any, members: Members, gauge: Floats | None, first: Floats | None) -> None:
        self._module, self._members, self._done = module, members, 0
        self.failures, self.failed_at, self.final = dict[int, str](), -1, members.x0.copy()
        self.who, self.x, self._carry = np.arange(len(members)), members.x0, np.zeros_like(members.x0)
        values = module._values(dict(members.parameters))
        with np.errstate(all="ignore"):
            self._stages = module._coefficients(values, self.x, members.h[()], gauge)
        self._memory = [(self._carry, self._carry)] * len(self._stages)
        self._first, self._turned, self.turned = first, (self._carry, self._carry), np.empty_like(members.x0)
        if first is not None:
            still = module._identity(len(members))
            self._rate, self._turned = module._rates(values, self.x, gauge), (still, np.zeros_like(still))
            self.turned = first.copy()
        self._look()

    def advance(self, steps: int) -> None:
        """Make so many steps. One in which members fail is made again without them."""
        with np.errstate(all="ignore"):
            while steps and len(self.who):
                failed = self._step()
                if failed:
                    self._leave(failed)
                else:
                    steps -= 1
        self._tell()

    def _tell(self) -> None:
        """Where those who are left are now."""
        self.final[self.who] = self.x
        if self._first is not None:
            elapsed = self._done * self._h
            elapsed = elapsed[:, np.newaxis] if np.ndim(elapsed) else elapsed
            self.turned[self.who] = self._module._attitude(self._first, self._turned[0], self._rate, elapsed)

    def _look(self) -> None:
        """What of the steps depends on who is left: their sizes, the times of the start, the random numbers."""
        left, draws = self._members.part(self.who), self._members.draws
        self._h, self._t0 = left.h[()], left.t0[()]
        if hasattr(self._module, "_drawing"):
            self._drawn = self._module._drawing(self._h, len(left), draws.seed, left.paths, draws.step)

    def _of_step(self) -> tuple[Any, ...]:
        """What stages of the next step depend on, beside the state."""
        now = self._t0 + self._done * self._h, self._h
        return (*now, self._drawn(self._done)) if hasattr(self._module, "_drawing") else now

    def _step(self) -> dict[int, str]:
        """One step of all; or, where some fail in a stage, none, and by their places among ``who`` how they do."""
        module, memory = self._module, list(self._memory)
        x, carry, turned = self.x, self._carry, self._turned
        own = self._of_step() if hasattr(module, "_renewed") else ()
        for k, prepared in enumerate(self._stages):
            stage = module._renewed(prepared, *own) if own else prepared
            before = stage, x, carry
            x, carry, memory[k], status = module._advance(stage, x, carry, memory[k])
            if hasattr(module, "_time_of"):
                nowhere = np.isnan(module._time_of(stage, before[1], memory[k][0]))
                status = np.where((status == "") & nowhere, "NOT_FINITE", status)
            failed = np.flatnonzero(status != "")
            if len(failed):
                return {int(m): str(status[m]) for m in failed}
            if self._first is not None:
                turned = module._turn_stage(*before, memory[k][0], *turned)
        self.x, self._carry, self._memory, self._turned = x, carry, memory, turned
        self._done += 1
        return {}

    def _leave(self, failed: dict[int, str]) -> None:
        """Who is left keeps all that it had, guesses too: so its bits are those that it has without the others."""
        kept = np.delete(np.arange(len(self.who)), list(failed))
        self._tell()
        self.failures |= {int(self.who[m]): status for m, status in failed.items()}
        self.failed_at = self._done if self.failed_at < 0 else self.failed_at
        self.who, self.x, self._carry = self.who[kept], self.x[kept], self._carry[kept]
        self._memory = [(a[kept], b[kept]) for a, b in self._memory]
        self._stages = [self._module._stage_at(stage, kept) for stage in self._stages]
        if self._first is not None:
            self._first, self._turned = self._first[kept], (self._turned[0][kept], self._turned[1][kept])
            self._rate = None if self._rate is None else self._rate[kept]
        self._look()
