"""Runs of solvers as functions of PyTorch, with gradients. Needs the package torch.

The solver runs on the CPU, in double precision. Gradients are computed by `Solver.pullback`; there are no second
derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from phigen.errors import MissingPackageError
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.propagation import Propagation
from phigen.runtime.solver import Solver

try:
    import torch
except ImportError as error:
    raise MissingPackageError("phigen.torch needs torch\n  hint: pip install torch") from error


def propagator(
    solver: Solver | LatticeSolver,
    *,
    h: float,
    steps: int,
    stride: int | None = None,
    t0: float | None = None,
    **shared: Any,
) -> Callable[..., Any]:
    """Return the run of a solver as a function f(x0, parameters={}) of tensors, with gradients exact to
    round-off.

    f returns the last state, of the same shape (…, DIM) as ``x0``. With a ``stride``, f returns all rows of
    `Solver.integrate`, (…, rows, DIM). For a lattice, DIM stands for (coordinates, *sizes). ``parameters`` maps names
    to tensors whose shapes broadcast to (…); all other parameters have their defaults. Results have the precision and
    the device of ``x0``.

    Gradients need a solver compiled with ``adjoint=True``. Further arguments, such as ``bonds=``, apply to all runs. f
    raises `StepError` if a step fails.
    """
    runs = Propagation(solver, h, steps, stride, t0, shared)

    def propagate(x0: Any, parameters: Mapping[str, Any] | None = None) -> Any:
        tensors = {name: torch.as_tensor(v, dtype=x0.dtype, device=x0.device) for name, v in (parameters or {}).items()}
        runs.expect(tuple(x0.shape), {name: tuple(value.shape) for name, value in tensors.items()})
        return _DifferentiableRun.apply(runs, tuple(tensors), x0, *tensors.values())

    return propagate


class _DifferentiableRun(torch.autograd.Function):  # type: ignore[misc]
    """Function of PyTorch that integrates a run. Its backward pass is the transposed derivative of the run."""

    @staticmethod
    def forward(runs: Propagation, names: tuple[str, ...], x0: Any, *values: Any) -> Any:
        parameters = dict(zip(names, map(_numbers, values), strict=True))
        return torch.as_tensor(runs.run(_numbers(x0), parameters), dtype=x0.dtype, device=x0.device)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
        ctx.runs, ctx.names, *tensors = inputs
        ctx.save_for_backward(*tensors)

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, cotangent: Any) -> tuple[Any, ...]:
        x0, *values = ctx.saved_tensors
        parameters = dict(zip(ctx.names, map(_numbers, values), strict=True))
        x0_bar, bars = ctx.runs.transposed(_numbers(x0), parameters, _numbers(cotangent))
        parameter_bars = [torch.as_tensor(bars[name], dtype=x0.dtype, device=x0.device) for name in ctx.names]
        return None, None, torch.as_tensor(x0_bar, dtype=x0.dtype, device=x0.device), *parameter_bars


def _numbers(tensor: Any) -> Any:
    return tensor.detach().cpu().numpy()
