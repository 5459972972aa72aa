"""A generated NumPy module, loaded from its source text."""

from __future__ import annotations

import hashlib
import linecache
from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np

from phigen.runtime.interface import BackendError, Floats, Interface, MissingExtraError, Progress, row_steps

_REPORTS = 100


def load_module(source: str, name: str) -> ModuleType:
    """The module of a source text; tracebacks through it show its lines."""
    filename = f"<phigen {name} {hashlib.sha256(source.encode()).hexdigest()[:12]}>"
    # No modification time: linecache.checkcache leaves such entries alone.
    linecache.cache[filename] = (len(source), None, source.splitlines(keepends=True), filename)
    module = ModuleType(name)
    module.__file__ = filename
    exec(compile(source, filename, "exec"), module.__dict__)  # text that phigen itself generated
    return module


class NumpySolver:
    """The back end over a generated module; needs no compiler, and makes an ensemble one call."""

    target = "numpy"

    def __init__(self, module: ModuleType, interface: Interface, gauge: Floats | None = None) -> None:
        self.interface = interface
        self.module: Any = module
        self._options = {} if gauge is None else {"gauge": gauge}

    def with_gauge(self, gauge: Floats) -> NumpySolver:
        """See `phigen.runtime.interface.Backend`."""
        return NumpySolver(self.module, self.interface, gauge)

    @classmethod
    def from_source(cls, source: str, interface: Interface) -> NumpySolver:
        """Load the text of a generated module."""
        return cls(load_module(source, interface.name), interface)

    def integrate(
        self, x0: Floats, h: float, steps: int, stride: int, parameters: Mapping[str, float], progress: Progress | None
    ) -> Floats:
        """See `phigen.runtime.interface.Backend`."""
        if progress is None:
            return self._rows(x0, h, steps, stride, parameters)
        # A chunk is a multiple of the stride, so that its rows fall on those of the whole.
        chunk = stride * max(1, -(-steps // (stride * _REPORTS)))
        parts = [x0[np.newaxis]]
        for done in range(0, steps, chunk):
            count = min(chunk, steps - done)
            try:
                rows = self._rows(parts[-1][-1], h, count, stride, parameters)
            except BackendError as error:
                states = np.concatenate([*parts, error.states[1:]])
                raise BackendError(error.status, done + error.step, states) from error
            parts.append(rows[1:])
            progress(done + count)
        return np.concatenate(parts)

    def ensemble(self, x0: Floats, h: float, steps: int, parameters: Mapping[str, float]) -> Floats:
        """See `phigen.runtime.interface.Backend`."""
        if steps == 0 or len(x0) == 0:
            return x0.copy()
        try:
            rows = self.module.integrate(x0, h, steps, stride=steps, **self._options, **parameters)
        except self.module.StepError as error:
            states = np.asarray(error.states, dtype=np.float64)
            members = tuple(int(m) for m in error.members)
            raise BackendError(str(error.status), int(error.step), states[-1], members) from error
        return np.asarray(rows[-1], dtype=np.float64)

    def step_tangent(self, x: Floats, h: float, parameters: Mapping[str, float]) -> tuple[Floats, Floats]:
        """See `phigen.runtime.interface.Backend`."""
        if not hasattr(self.module, "step_tangent"):
            raise MissingExtraError("step_tangent")
        try:
            following, tangent = self.module.step_tangent(x, h, **self._options, **parameters)
        except self.module.StepError as error:
            raise BackendError(str(error.status), 0, x[np.newaxis]) from error
        return np.asarray(following, dtype=np.float64), np.asarray(tangent, dtype=np.float64)

    def hamiltonian(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """See `phigen.runtime.interface.Backend`."""
        return np.asarray(self.module.hamiltonian(x, **parameters), dtype=np.float64)

    def casimirs(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """See `phigen.runtime.interface.Backend`."""
        return np.asarray(self.module.casimirs(x, **parameters), dtype=np.float64)

    def vector_field(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """See `phigen.runtime.interface.Backend`."""
        return np.asarray(self.module.vector_field(x, **parameters), dtype=np.float64)

    def _rows(self, x0: Floats, h: float, steps: int, stride: int, parameters: Mapping[str, float]) -> Floats:
        if steps == 0:
            return x0[np.newaxis].copy()
        try:
            rows = self.module.integrate(x0, h, steps, stride=stride, **self._options, **parameters)
        except self.module.StepError as error:
            states = np.asarray(error.states, dtype=np.float64).reshape(-1, self.interface.dimension)
            raise BackendError(
                str(error.status), int(error.step), _ending_at(states, int(error.step), stride)
            ) from error
        return np.asarray(rows, dtype=np.float64)


def _ending_at(states: Floats, good: int, stride: int) -> Floats:
    """The rows a trajectory of ``good`` steps has, as far as they are there."""
    return states[: len(row_steps(good, stride))]
