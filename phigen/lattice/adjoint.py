"""The transpose of a step of a lattice: kernels at a site that pull cotangents back.

A sweep adds to some fields of a site what it reads around: from the cotangents of those a kernel finds, at each site,
what they give to every value that was read, and targets hand that over to where the value came from. Of the series,
x' = x + a(y) with y = r(x, y): μ = (∂r/∂y)ᵀμ + (∂a/∂y)ᵀλ and x̄ = λ + (∂a/∂x)ᵀλ + (∂r/∂x)ᵀμ, by the kernels of r and a.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phigen.scheme.adjoint import completed, pulled_back
from phigen.scheme.kernel import Kernel
from phigen.scheme.staging import TABLE, Coefficients
from phigen.scheme.steps import BACK, Adjoint, Equation, Partners, Sweep

#: What kernels at sites read, of which cotangents are found.
_READ = ("site", "start", "gathered", "bonds", "params")


def transposed(
    swept: Sequence[Sequence[Sweep]],
    solved: Equation | None,
    prepare: Kernel,
    refresh: Kernel | None,
    coefficients: Coefficients,
    partners: Partners | None,
) -> Adjoint:
    """The transposes of all kernels of a step, each called as its kernel with `BACK`."""
    kernels: list[Kernel] = []
    for sweep in (sweep for part in swept for sweep in part):
        kernels += [sweep.kernel, *(sweep.gather.kernels if sweep.gather else ())]
    kernels += [solved.relax, solved.advance] if solved else []
    kernels += partners.field.kernels if solved and partners else ()
    return completed(coefficients, [_back(kernel, coefficients) for kernel in kernels], prepare, refresh)


def _back(kernel: Kernel, coefficients: Coefficients) -> Kernel:
    table = {} if "params" in kernel.inputs else {TABLE: coefficients.table}
    (output,) = kernel.outputs
    along = {array: kernel.inputs[array] for array in _READ if kernel.inputs.get(array)}
    return pulled_back(
        replace(kernel, inputs={**kernel.inputs, **table}),
        kernel.name + BACK,
        {f"{output.name}_bar": output.values},
        along | table,
        "cotangents of all that is read, from those of what is found",
    )
