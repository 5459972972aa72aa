"""The transpose of a step of a lattice: kernels at a site that propagate cotangents backwards.

A sweep adds increments to some fields of a site; the increments depend on values around the site. The transposed kernel
takes the cotangents of the increments. For each value that the kernel of the sweep reads, the transposed kernel returns
a contribution to the cotangent of this value. Targets add the contribution at the site of the value.

In the series a stage is y = r(x, y), x' = x + a(y). Let λ be the cotangent of x'. Then μ = (∂r/∂y)ᵀμ + (∂a/∂y)ᵀλ is
solved for μ, and x̄ = λ + (∂r/∂x)ᵀμ is the cotangent of x. The products with transposed derivatives are computed by the
transposed kernels of r and a.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phigen.scheme.adjoint import completed, pulled_back
from phigen.scheme.kernel import Kernel
from phigen.scheme.staging import TABLE, Coefficients
from phigen.scheme.steps import BACK, Adjoint, Equation, Partners, Sweep

#: Names of the input arrays with respect to which kernels at sites are differentiated.
_DIFFERENTIATED_INPUTS = ("site", "start", "gathered", "bonds", "params")


def transposed(
    swept: Sequence[Sequence[Sweep]],
    solved: Equation | None,
    prepare: Kernel,
    refresh: Kernel | None,
    coefficients: Coefficients,
    partners: Partners | None,
) -> Adjoint:
    """Return the transposes of all kernels of a step. The name of a transpose is that of the kernel, with the suffix
    `BACK`.
    """
    kernels: list[Kernel] = []
    for sweep in (sweep for part in swept for sweep in part):
        kernels += [sweep.kernel, *(sweep.gather.kernels if sweep.gather else ())]
    kernels += [solved.relax, solved.advance] if solved else []
    kernels += partners.field.kernels if solved and partners else ()
    return completed(coefficients, [_transposed_kernel(kernel, coefficients) for kernel in kernels], prepare, refresh)


def _transposed_kernel(kernel: Kernel, coefficients: Coefficients) -> Kernel:
    table_input = {} if "params" in kernel.inputs else {TABLE: coefficients.table}
    (output,) = kernel.outputs
    variables = {array: kernel.inputs[array] for array in _DIFFERENTIATED_INPUTS if kernel.inputs.get(array)}
    transpose = pulled_back(
        replace(kernel, inputs={**kernel.inputs, **table_input}),
        kernel.name + BACK,
        {f"{output.name}_bar": output.values},
        variables | table_input,
        "cotangents of the values that are read, from those of the results",
    )
    return replace(transpose, role=kernel.role.transposed)
