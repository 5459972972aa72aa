"""The transpose of a step: kernels that compute the cotangents of its inputs from the cotangents of its results, by
reverse accumulation.

The cotangent of the new state x' determines the cotangents of the old state x and of the coefficients of the step. The
cotangents of the coefficients are summed over the steps of a run. At the end of the run the transpose of ``prepare``,
which computes the coefficients from the parameters, is applied once.

Each kind of step has its formulas. *newton*: the step solves y + a(y) = x for y, and x' = x + d(y). The kernel
``linearise`` computes the matrices J = 1 + ∂a/∂y and M = ∂d/∂y. Let λ be the cotangent of x', and μ = J⁻ᵀ Mᵀ λ. The
cotangent of x is λ + μ. The cotangent of a coefficient is the derivative of λ·d − μ·a with respect to this coefficient.
*explicit* steps and flows: one reverse sweep over their formulas. *path*: see `adjoint_path`. *gauss*: see
`gauss_adjoint`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.scheme.kernel import EXPONENTS, Kernel, Output
from phigen.scheme.path import PathSlopes, path_of, used_by_path
from phigen.scheme.staging import TABLE, Coefficients
from phigen.scheme.steps import Adjoint, PathAdjoint
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    call,
    fold,
    gradient,
    neg,
    rebuild,
    symbol,
    symbols_of,
    topological,
    total,
)
from phigen.symbolic.symbols import LEVEL, Symbol, cotangent, momentum


def pulled_back(
    kernel: Kernel,
    name: str,
    seeds: Mapping[str, Sequence[Expression]],
    variables: Mapping[str, Sequence[str]],
    purpose: str,
) -> Kernel:
    """Return the transpose of ``kernel``: it computes cotangents of inputs from the cotangents of some values.

    The keys of ``seeds`` are the new inputs, which hold the cotangents of the values listed under the key.
    ``variables`` maps the name of an input array of ``kernel`` to its symbols. For an array ``x`` the new kernel has
    the output ``x_bar``: the derivatives of Σ cotangent · value, summed over all values, with respect to the symbols of
    ``x``. ``purpose`` is the comment in the generated code.
    """
    value = total(
        symbol(Symbol(seed, i)) * e for seed, values in seeds.items() for i, e in enumerate(values) if not e.is_zero
    )
    plain_slopes = gradient(value, [s for symbols in variables.values() for s in symbols])
    slopes = iter(_without_cosines(plain_slopes, [e for values in seeds.values() for e in values]))
    outputs = tuple(
        Output(f"{array}_bar", tuple(next(slopes) for _ in symbols)) for array, symbols in variables.items()
    )
    inputs = {**kernel.inputs, **{seed: tuple(Symbol(seed, i) for i in range(len(v))) for seed, v in seeds.items()}}
    return Kernel(name, purpose, inputs, outputs)


def _without_cosines(slopes: Sequence[Expression], values: Sequence[Expression]) -> list[Expression]:
    """Return the derivatives ``slopes`` with cos(a) written as 1 − versin(a) wherever the ``values`` already contain
    versin(a)."""
    versine_arguments = {e.args[0] for e in topological(values) if e.op == "versin"}

    def visit(e: Expression, args: list[Expression]) -> Expression:
        if e.op == "cos" and e.args[0] in versine_arguments:
            return ONE - call("versin", *args)
        return rebuild(e, args)

    return fold(slopes, visit) if versine_arguments else list(slopes)


def newton_adjoint(linearise: Kernel, coefficients: Coefficients) -> Kernel:
    """Return the kernel that computes the cotangents of the coefficients of a Newton step.

    The kernel is evaluated at the solution y of the implicit equation. Its inputs are λ, the cotangent of the new state
    x' (``increment_bar``), and −μ with μ = J⁻ᵀ Mᵀ λ (``displacement_bar``). J is the Newton matrix, and M the
    derivative of the increment x' − x with respect to y.
    """
    displacement, increment, *_ = linearise.outputs
    kernel = replace(linearise, inputs={**linearise.inputs, TABLE: coefficients.table})
    return pulled_back(
        kernel,
        "linearise_adjoint",
        {"displacement_bar": displacement.values, "increment_bar": increment.values},
        {TABLE: coefficients.table},
        "at the point y: cotangents of the coefficients, from those of displacement and increment",
    )


def explicit_adjoint(explicit: Kernel, coefficients: Coefficients, name: str = "explicit_adjoint") -> Kernel:
    """Return the kernel that computes the cotangents of the state and of the coefficients, for an explicit step or a
    flow.

    The kernel reads the cotangent of the increment of the state.
    """
    kernel = replace(explicit, inputs={**explicit.inputs, TABLE: coefficients.table})
    return pulled_back(
        kernel,
        name,
        {"increment_bar": explicit.outputs[0].values},
        {"state": kernel.inputs["state"], TABLE: coefficients.table},
        "cotangents of the state and of the coefficients, from that of the increment",
    )


def gauss_adjoint(
    field: Kernel, change: Kernel, coordinates: Sequence[str], coefficients: Coefficients
) -> list[Kernel]:
    """Return three kernels that together transpose a Gauss step.

    Let the method have the weights w_j, which contain the step size, and the coefficients μ_ij. A step starts at x. Let
    z be the unknowns of a stage, and f(x, z) their vector field. The stages Z_i solve Z_i = Σ_j μ_ij L_j with the
    increments L_j = w_j f(x, Z_j). The new state is x' = x + D(x, Σ_j L_j), with a map D(x, z). Let λ be the cotangent
    of x', and ε = (∂D/∂z)ᵀ λ. The cotangents ζ_i of Z_i and κ_i of L_i satisfy ζ_i = w_i (∂f/∂z)ᵀ κ_i and κ_i = ε + Σ_j
    μ_ji ζ_j. Fixed-point sweeps solve these equations.

    The first kernel computes ζ_i from κ_i, and is called in every sweep. The second kernel computes what one stage
    contributes to the cotangents of x and of the values in the table ``coefficients``. The third kernel is the
    transpose of D.
    """
    seeds = {"move_bar": field.outputs[0].values}
    start = {"x": tuple(coordinates), TABLE: coefficients.table}
    at_stages = (
        ("stage_field_adjoint", {"z": field.inputs["z"]}, "cotangents of the unknowns of a stage"),
        ("stage_start_adjoint", start, "cotangents of the start of the step and of the coefficients"),
    )
    kernels = [
        pulled_back(field, name, seeds, inputs, f"{description}, from that of its increment")
        for name, inputs, description in at_stages
    ]
    purpose = (
        "cotangents of the start, of the sum of stage increments and of the coefficients, from that of the increment"
    )
    inputs = {"x": tuple(coordinates), "z": change.inputs["z"], TABLE: coefficients.table}
    seeds = {"change_bar": change.outputs[0].values}
    return [*kernels, pulled_back(change, "stage_change_adjoint", seeds, inputs, purpose)]


def completed(
    coefficients: Coefficients,
    steps: Sequence[Kernel],
    prepare: Kernel,
    refresh: Kernel | None,
    path: PathAdjoint | None = None,
) -> Adjoint:
    """Return the transpose of a whole step, including the computation of its coefficients.

    ``steps`` are the transposed kernels of the step itself. This function adds the transposes of ``prepare``, which
    computes coefficients before the steps, and of ``refresh``, which computes the coefficients that change from step to
    step. Before this call, the table of coefficients must be complete, and ``prepare`` and ``refresh`` must be built.
    """
    differentiated = {"params": prepare.inputs["params"]}
    if prepare.inputs.get("gauge") == (LEVEL,):
        differentiated["gauge"] = (LEVEL,)
    unused = frozenset() if path else _unused_coefficients(steps)
    prepared_symbols = coefficients.prepared_symbols
    refresh_adjoint = refresh and pulled_back(
        refresh,
        "refresh_adjoint",
        {"now_bar": _without_unused(refresh.outputs[0].values, unused, len(prepared_symbols))},
        {TABLE: prepared_symbols},
        "cotangents of the constant coefficients, from those of the coefficients that change during a run",
    )
    if refresh_adjoint:
        unused &= _unused_coefficients([refresh_adjoint])
    prepare_adjoint = _prepare_adjoint(prepare, differentiated, unused)
    constant = _constant_coefficients(coefficients, differentiated)
    return Adjoint(tuple(_without(kernel, constant) for kernel in steps), prepare_adjoint, refresh_adjoint, path)


def _unused_coefficients(kernels: Sequence[Kernel]) -> frozenset[int]:
    """Return the indices of the coefficients whose cotangents are 0 in each of the transposed ``kernels``.

    Examples are the coefficients of attitudes, since attitudes are not differentiated.
    """
    rows = [o.values for kernel in kernels for o in kernel.outputs if o.name == f"{TABLE}_bar"]
    used = {k for values in rows for k, e in enumerate(values) if not e.is_zero}
    return frozenset(range(max(map(len, rows), default=0))) - used


def _without_unused(values: Sequence[Expression], unused: Collection[int], first: int = 0) -> list[Expression]:
    """Return coefficients with those in ``unused`` replaced by 0; ``first`` is the index of the first coefficient."""
    return [ZERO if k in unused else e for k, e in enumerate(values, first)]


def _prepare_adjoint(prepare: Kernel, differentiated: Mapping[str, Sequence[str]], unused: Collection[int]) -> Kernel:
    """Return the transpose of ``prepare``, the kernel that computes the coefficients from the parameters.

    ``differentiated`` are the symbols whose cotangents are computed, by input array: the parameters, and the energy
    level if there is a monitor. Coefficients may be entries of matrix exponentials exp(tA). If the matrices tA depend
    on ``differentiated`` symbols, the transpose also reads the cotangents of these matrices.
    """
    table_values = list(prepare.outputs[0].values)
    exponents = [e for start, n in prepare.exponentials for e in table_values[start : start + n * n]]
    values = table_values[: len(table_values) - len(exponents)]
    seeds = {"coef_bar": [*_without_unused(values, unused), *[ZERO] * len(exponents)]}
    purpose = "cotangents of the parameters, from those of the coefficients"
    if {s for symbols in differentiated.values() for s in symbols}.isdisjoint(symbols_of(*exponents)):
        return pulled_back(prepare, "prepare_adjoint", seeds, differentiated, purpose)
    kernel = pulled_back(prepare, "prepare_adjoint", seeds | {EXPONENTS: exponents}, differentiated, purpose)
    exponents_kernel = Kernel(
        "exponents",
        "the matrices tA whose exponentials are coefficients",
        prepare.inputs,
        (Output("exponents", tuple(exponents)),),
    )
    return replace(kernel, exponentials=prepare.exponentials, exponents=exponents_kernel)


def _constant_coefficients(coefficients: Coefficients, differentiated: Mapping[str, Sequence[str]]) -> list[bool]:
    """Return for each coefficient whether it is independent of all ``differentiated`` symbols."""
    names = {s for symbols in differentiated.values() for s in symbols}
    return [names.isdisjoint(symbols_of(e)) for e in coefficients.written_out(coefficients.everything)]


def _without(kernel: Kernel, constant: Sequence[bool]) -> Kernel:
    """Return a copy of a transposed kernel in which the cotangents of constant coefficients are 0.

    ``constant`` says for each coefficient whether it is constant.
    """
    outputs = [
        replace(o, values=tuple(ZERO if is_constant else e for e, is_constant in zip(o.values, constant, strict=True)))
        if o.name == f"{TABLE}_bar"
        else o
        for o in kernel.outputs
    ]
    return replace(kernel, outputs=tuple(outputs))


def level_adjoint(system: System) -> Kernel:
    """Return the kernel of the gradient of H with respect to the state and the parameters.

    The reverse pass of a monitored system needs this gradient, because the energy level e = −H(x₀) depends on the start
    x₀ and on the parameters.
    """
    variables = [*system.coordinates, *system.parameter_names]
    slopes = gradient(system.hamiltonian, variables)
    n = system.dimension
    return Kernel(
        "level_adjoint",
        "the gradient of the Hamiltonian with respect to the state and to the parameters",
        {"params": system.parameter_names, "x": system.coordinates},
        (Output("x_bar", tuple(slopes[:n])), Output("params_bar", tuple(slopes[n:]))),
    )


def adjoint_path(system: System, coefficients: Coefficients, curvature: Kernel, slopes: PathSlopes) -> PathAdjoint:
    """Return the transpose of a step along a path ṁ = π(m)p.

    The transpose has two parts: recurrences that follow the path backwards, together with cotangents, and the transpose
    of ∇S_h with respect to the coefficients. Let λ be the cotangent of the new state x' = m(1), and ν the cotangent of
    the mean y = ∫ m dt. The cotangent a of m starts at a = λ, and satisfies ȧ = ∂(π(m)p)/∂mᵀ a + ν if time runs
    backwards along the path. The cotangent of x is the final value of a. The cotangent of p is ω = ∫ π(m)ᵀ a dt. The
    cotangent of a coefficient c is ∫ ∂(a·π(m)p)/∂c dt. Since p = ∇S_h(y), ν = Hess S_hᵀ ω. Together these equations are
    a linear equation for ω.
    """
    coordinates = system.coordinates
    p = [symbol(momentum(c)) for c in coordinates]
    a = [symbol(cotangent(c)) for c in coordinates]
    nu = [symbol(momentum(cotangent(c))) for c in coordinates]
    flow = coefficients.hoist(hamiltonian_vector_field(system.poisson, p))
    power = total(e * f for e, f in zip(a, flow, strict=True))
    used_coefficients = used_by_path(system, coefficients)
    sources = gradient(power, [*coordinates, *map(momentum, coordinates), *used_coefficients])
    n = system.dimension
    rates = [*map(neg, flow), *(s + v for s, v in zip(sources[:n], nu, strict=True)), *sources[n:]]
    names = [*coordinates, *map(cotangent, coordinates), *(cotangent(momentum(c)) for c in coordinates)]
    recurrences = path_of([*names, *map(cotangent, used_coefficients)], rates)
    kernel = replace(curvature, inputs={**curvature.inputs, TABLE: coefficients.table})
    slope = pulled_back(
        kernel,
        "slope_adjoint",
        {"slope_bar": curvature.outputs[0].values},
        {TABLE: coefficients.table},
        "cotangents of the coefficients, from that of p = grad S_h(y)",
    )
    return PathAdjoint(
        recurrences, tuple(coefficients.slots.index(s) for s in used_coefficients), curvature, slope, slopes
    )
