"""Statements on attitudes: a step conserves the angular momentum, and rotates with the angular velocity ∇H.

g₀ and g₁ are the attitudes before and after a step, as group elements, and τ is the attitude increment. If x is the
momentum in the body, g₁ = g₀ τ and x₁ = Ad*_τ x₀, and the momentum in space is constant. If x is the momentum in space,
g₁ = τ g₀, and the momentum in the body is constant. The constant momentum does not determine τ: a product of τ and a
rotation that fixes x also conserves the momentum. So a second statement says that the rate of rotation tends to ∇H for
h → 0. Here H is the Hamiltonian of the spec, from which no Casimirs are subtracted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from itertools import combinations, islice

from phigen.attitude import free_bodies
from phigen.attitude.elements import cross, direction, dot, element, product, rotated, with_phi
from phigen.attitude.flow_elements import Turning, constancy, factor_elements, joined, turnings
from phigen.attitude.group import Group
from phigen.attitude.matrices import multiplied
from phigen.compilation import Compilation, CompiledGauss, CompiledSeries, CompiledSplitting
from phigen.gauss.rotation import group_element
from phigen.gauss.stage_map import at_unknowns, stage_map, vector_field
from phigen.geometry.lie_algebra import LieAlgebra, Representation
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.cayley import trilinear
from phigen.realisations.protocol import BiRealisation, covector_names, covector_symbols
from phigen.scheme.attitude import uniform
from phigen.scheme.program import Attitude
from phigen.splitting.euler import CYCLIC
from phigen.splitting.ring import KICK, TIME
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    derivative,
    fold,
    gradient,
    number,
    rebuild,
    sparse_derivatives,
    substitute,
    symbol,
    total,
)
from phigen.symbolic.special import SPECIAL
from phigen.symbolic.symbols import LEVEL, Symbol
from phigen.symbolic.verdict import Statement, decide_zero

Vector = Sequence[Expression]

#: Symbols for the four components of a quaternion, the attitude before a step.
BEFORE = tuple(symbol(Symbol("attitude", i)) for i in range(4))


def check(compilation: Compilation) -> Iterator[Statement]:
    """Yield the statements about the attitude that a method computes; none if it computes no attitude."""
    attitude = compilation.program.attitude
    if attitude is not None:
        yield from compilation.by_kind(
            partial(_series_statements, attitude),
            partial(_splitting_statements, attitude),
            partial(_gauss_statements, attitude),
        )


def _series_statements(attitude: Attitude, compilation: CompiledSeries) -> Iterator[Statement]:
    """Yield the statements on the attitude increment of a step by series, and on its rate ∇S_1 for h → 0."""
    system, group, chart = compilation.system, attitude.group, compilation.realisation
    # With forces, α and β are evaluated at p = ∇S_h + hζ, but the attitude increment is that of ∇S_h alone.
    pushed = system.forces is not None and any(not z.is_zero for z in system.forces.covector)
    if group.matrices:
        yield from _matrix_statements(system, chart, attitude)
    elif chart.path:
        if not pushed:
            yield path_statement(system, group)
    else:
        p = covector_symbols(system.coordinates)
        group_element = element(
            [p[i] for i in group.rotation], [p[i] for i in group.translation], cayley=attitude.cayley
        )
        stated = element_statements(
            group, group_element, p, chart.alpha, chart.beta, cayley=attitude.cayley, positive=system.positive
        )
        yield from islice(stated, 1 if pushed else None)
    slope = gradient(_first_term(compilation), system.coordinates)
    yield rate_statement(system, attitude, slope, None if system.forces else compilation.monitor)


def _first_term(compilation: CompiledSeries) -> Expression:
    """Return S_1 as an expression, which is not expanded if it has too many terms."""
    try:
        first = compilation.series.polynomial(1)
    except OverflowError:
        return compilation.series.graph(1)[0]
    return first.tower.expression(first.terms[0])


def _gauss_statements(attitude: Attitude, compilation: CompiledGauss) -> Iterator[Statement]:
    """Yield the statement on the rate of the group element at the start of a Gauss step."""
    system, group = compilation.system, attitude.group
    pace = compilation.gauge.pace(system)
    points = stage_map(compilation.discretised, compilation.gauss, pace)
    values = group_element(points, group)
    assert values is not None  # the program has an attitude, so the group element exists
    at_start = dict.fromkeys(points.unknowns, ZERO)
    slopes = dict(zip(points.unknowns, substitute(vector_field(points, at_unknowns(points)), at_start), strict=True))
    rates = [total(substitute([e], at_start)[0] * slopes[z] for z, e in row.items())
             for row in sparse_derivatives(values, points.unknowns)]  # fmt: skip
    turning_rates = {i: 2 * rate for i, rate in zip(group.rotation, rates[1:4], strict=True)}
    turning_rates |= dict(zip(group.translation, rates[4:], strict=True))
    slope = [turning_rates.get(i, ZERO) for i in range(system.dimension)]
    yield rate_statement(system, attitude, slope, compilation.gauge.monitor)


def rate_statement(system: System, attitude: Attitude, slope: Vector, monitor: Expression | None = None) -> Statement:
    """Return the statement that the attitude rotates with ∇H for h → 0, in components of the Lie algebra.

    ``slope`` is ∇S_1, the rate of the attitude increment. Gradients of Casimirs that were subtracted from H are added
    to ``slope``. With a ``monitor`` g, which rescales time by dt = g dτ, the sum must equal g∇H where K = g (H − H(x₀))
    is 0.
    """
    group, velocity = attitude.group, list(gradient(system.hamiltonian, system.coordinates))
    if monitor:
        velocity = [monitor * w for w in velocity]
        slope = substitute(list(slope), {LEVEL: -system.hamiltonian})
    differences = [w - s for w, s in zip(velocity, slope, strict=True)]
    components = differences if group.matrices else [differences[i] for i in (*group.rotation, *group.translation)]
    put_back = attitude.rate.roots[: len(components)] if attitude.rate else [ZERO] * len(components)
    sum_name = "∇S_1" + " + ∇(λC)" * bool(attitude.rate)
    residuals = [("", a - b) for a, b in zip(components, put_back, strict=True)]
    title = f"ġ is that of H: {sum_name} = " + ("g∇H where K = 0" if monitor else "∇H")
    return decide_zero(title, residuals, system.positive, "the attitude has the order of x")


def path_statement(system: System, group: Group) -> Statement:
    """Return the statement that the momentum Ad*_g m is constant along the path ṁ = π(m)p, whose ends are α and
    β.

    If m is the momentum in the body, ġ = g·p, and Ad*_g m is the momentum in space. If m is the momentum in space, ġ =
    p·g, and Ad*_g m is the momentum in the body.
    """
    m, p = [symbol(c) for c in system.coordinates], covector_symbols(system.coordinates)
    slope = hamiltonian_vector_field(system.poisson, p)
    r, t = [p[i] for i in group.rotation], [p[i] for i in group.translation]
    residuals = []
    for triple in (group.rotation, *group.vectors):
        rotated_momenta = cross([m[i] for i in triple], r)
        if triple == group.rotation and t:
            rotated_momenta = [
                a + b for a, b in zip(rotated_momenta, cross([m[i] for i in group.translation], t), strict=True)
            ]
        if triple == group.rotation and group.vectors and not t:
            continue
        residuals += [
            ("", slope[i] + (a if group.spatial else -a)) for i, a in zip(triple, rotated_momenta, strict=True)
        ]
    name = "d/dt Ad*_g m = 0 for ṁ = π(m)p, ġ = " + ("p g" if group.spatial else "g p")
    return decide_zero(name, residuals, system.positive, "so τ = exp(p) for the path of p")


def _splitting_statements(attitude: Attitude, compilation: CompiledSplitting) -> Iterator[Statement]:
    """Yield the statements on the attitude for a splitting H = Σ H_k: each ∇H_k is constant along the flow of
    H_k.

    The last statement says that the sum of all parts, and of the Casimirs that were subtracted from H, is H.
    """
    system, splitting, group = compilation.system, compilation.splitting, attitude.group
    elements = turnings(compilation.discretised, group, splitting.flows, put_back=uniform(system))
    order = "exp(t∇H_{k}) g₀" if group.spatial else "g₀ exp(t∇H_{k})"
    for k, (turning, flow) in enumerate(zip(elements, splitting.flows, strict=True), 1):
        bodies = [body.hamiltonian for body in turning.bodies]
        parts = [e for e in (turning.left, *turning.factors, *bodies) if not e.is_zero]
        name = f"∇H_{k} is constant along the flow of H_{k}, hence g₁ = {order.format(k=k)}"
        if len(parts) > 1:
            name = (
                f"H_{k} in {len(parts)} parts with gradients constant along their flows, hence g₁ = {order.format(k=k)}"
            )
        residuals = [("sum", flow.hamiltonian - total(parts)), *_stays(system, turning)]
        stated = constancy(system, turning, name)
        statement = decide_zero(name, residuals, system.positive)
        if turning.factors or not bodies or not statement.holds:
            yield stated if statement.holds else statement
        if bodies:
            name = f"the group element of the free body in H_{k} has the angular velocity of the body"
            yield decide_zero(name, [*_weights(turning, group), *free_bodies.identities()], system.positive)
        if group.matrices and turning.factors:
            yield exponential_statement(system, group, turning, f"the matrix of the flow of H_{k} is exp(t∇H_{k})")
        elif turning.left.is_zero and len(turning.factors) == 1 and not turning.bodies:
            step_element = joined(group, factor_elements(system, group, turning))
            start = [symbol(c) for c in system.coordinates]
            end = [a + b for a, b in zip(start, flow.increment, strict=True)]
            name = f"Ad*_g₁ x₁ = Ad*_g₀ x₀ for the flow of H_{k}"
            differences = _residuals(group, [ONE + step_element[0], *step_element[1:4]], step_element[4:], start, end)
            yield decide_zero(name, differences, system.positive, "any g₀")
    put_back = [turning.left for turning in elements if not turning.left.is_zero]
    hamiltonians = substitute([f.hamiltonian for f in splitting.flows], {KICK: ZERO})
    slope = gradient(total(hamiltonians) - total(put_back), system.coordinates)
    yield rate_statement(system, attitude, slope)


def _stays(system: System, turning: Turning) -> Iterator[tuple[str, Expression]]:
    """Yield the rates of the coordinates of free rigid bodies in the flows of other terms, as pairs (label, rate).

    The bodies and the terms belong to one part of H. All rates are 0 if the flows of the terms do not move the bodies.
    """
    for factor in turning.factors if turning.bodies else ():
        rates = hamiltonian_vector_field(system.poisson, gradient(factor, system.coordinates))
        rate_of = dict(zip(system.coordinates, rates, strict=True))
        yield from ((f"rate of {c}", rate_of[c]) for body in turning.bodies for c in body.coordinates)


def _weights(turning: Turning, group: Group) -> Iterator[tuple[str, Expression]]:
    """Yield the residuals of α_i = ±(w_k − w_j) for free rigid bodies, for cyclic (i, j, k).

    The w_i are the second derivatives of H (inverse moments of inertia). The α_i are factors in the attitude increment
    of the body. The sign is + if the coordinates are the momentum in the body, and − for the momentum in space.
    """
    for body in turning.bodies:
        w = [derivative(derivative(body.hamiltonian, c), c) for c in body.coordinates]
        for a, (j, k) in zip(body.factors, CYCLIC, strict=True):
            yield "α", a - (w[j] - w[k] if group.spatial else w[k] - w[j])


def exponential_statement(system: System, group: Group, turning: Turning, name: str) -> Statement:
    """Return the statement that each factor 1 + E of the attitude increment solves dE/dt = (1 + E)P with E = 0 at t =
    0.

    Each factor belongs to a term H_i of the Hamiltonian; P is the matrix of ∇H_i.
    """
    residuals = []
    for factor, factor_element in zip(turning.factors, factor_elements(system, group, turning), strict=True):
        rate = group.generator(gradient(factor, system.coordinates))
        derivatives = [a + b for a, b in zip(rate, multiplied(factor_element, rate), strict=True)]
        residuals += [("", derivative(e, TIME) - w) for e, w in zip(factor_element, derivatives, strict=True)]
        residuals += [("at t = 0", e) for e in substitute(factor_element, {TIME: ZERO})]
    return decide_zero(name, residuals, system.positive)


def _matrix_statements(system: System, chart: BiRealisation, attitude: Attitude) -> Iterator[Statement]:
    """Yield the statements for attitudes that are matrices.

    The first says that the matrices of the group represent the bracket. The second says that the attitude increment is
    the exponential, or the Cayley transform, of the matrix of p; it is left out if steps follow paths.
    """
    algebra = system.lie_algebra
    assert algebra is not None
    yield representation_statement(system, algebra, attitude.group)
    if attitude.cayley:
        yield cayley_statement(system, algebra, attitude.group, chart.alpha, chart.beta)
    elif not chart.path:
        yield ends_statement(system, chart.beta)


def representation_statement(system: System, algebra: LieAlgebra, group: Group) -> Statement:
    """Return the statement that the matrices E_i of a group represent the bracket: [E_i, E_j] = ± Σ c_ij^k E_k.

    The structure constants are those of {x_i, x_j} = Σ c_ij^k x_k. The sign is + if increments multiply from the left.
    """
    n, size = range(algebra.dimension), range(group.rows)
    residuals = []
    for i, j in combinations(n, 2):
        a, b, row = group.matrices[i], group.matrices[j], algebra.bracket(i, j)
        for r in size:
            for s in size:
                commutator = total(a[r][k] * b[k][s] - b[r][k] * a[k][s] for k in size)
                expected = total(c * group.matrices[k][r][s] for k, c in row.items())
                residuals.append((f"({i + 1}, {j + 1})", commutator + (-expected if group.spatial else expected)))
    sign = "" if group.spatial else "−"
    name = f"[E_i, E_j] = {sign}Σ c_ij^k E_k, so that Ad*_g m is constant for ṁ = π(m)p, ġ = "
    return decide_zero(name + ("P g" if group.spatial else "g P"), residuals, system.positive)


def ends_statement(system: System, beta: Vector) -> Statement:
    """Return the statement that β(x, p) is the end of the path ṁ = π(m)p with mean x, for a β that is linear in x.

    With Mx = π(x)p, the end is b(M)x for b(z) = z/(1 − e^{−z}). b is the only solution of z b' = b + z b − b² with b(0)
    = 1.
    """
    names, p = system.coordinates, covector_symbols(system.coordinates)
    twice = substitute(beta, dict(zip(names, beta, strict=True)))
    end_velocity = substitute(hamiltonian_vector_field(system.poisson, p), dict(zip(names, beta, strict=True)))
    scaled = [total(pi * d for pi, d in zip(p, gradient(b, covector_names(names)), strict=True)) for b in beta]
    residuals = [(c, d - (b + m - t)) for c, d, b, m, t in zip(names, scaled, beta, end_velocity, twice, strict=True)]
    name = "p·∂β/∂p = β + π(β)p − β(β, p): α and β are ends of the path of p, hence τ = exp(p)"
    return decide_zero(name, residuals, system.positive)


def cayley_statement(system: System, algebra: LieAlgebra, group: Group, alpha: Vector, beta: Vector) -> Statement:
    """Return the statement that the attitude increment τ conserves the momentum: Ad*_g₁ β = Ad*_g₀ α.

    The attitude before the step is g₀. The attitude after the step is g₁ = g₀ τ or, if x is the momentum in space, g₁ =
    τ g₀. τ is the Cayley transform of P, which is the matrix of the covector p. The statement is decided on the
    elements (1 ± P/2) E_i (1 ∓ P/2), where E_i are the matrices of the basis.
    """
    p, n = covector_symbols(system.coordinates), range(algebra.dimension)
    sign = 1 if group.spatial else -1
    matrices = tuple(
        {(r, s): e for r, row in enumerate(m) for s, e in enumerate(row) if not e.is_zero} for m in group.matrices
    )
    form = trilinear(algebra, Representation("", group.rows, matrices))
    terms = form or {}
    residuals = []
    for i in n:
        half = [total(sign * c * p[a] / 2 for a in n for m, c in algebra.bracket(a, i).items() if m == k) for k in n]
        square = [total(c * p[a] * p[b] / 4 for (j, a, b, m), c in terms.items() if (j, m) == (i, k)) for k in n]
        momenta = (beta, alpha) if group.spatial else (alpha, beta)
        # With the matrix P of p and the matrices E_i of the basis, and if x is the momentum in space:
        # ⟨β, (1 + P/2) E_i (1 − P/2)⟩ = ⟨α, (1 − P/2) E_i (1 + P/2)⟩.
        # If x is the momentum in the body, P has the other sign.
        first_equation = [total((h - q) * x for h, q, x in zip(half, square, momenta[0], strict=True)), momenta[0][i]]
        less = [total((-h - q) * x for h, q, x in zip(half, square, momenta[1], strict=True)), momenta[1][i]]
        residuals.append((f"E_{i + 1}", total(first_equation) - total(less)))
    order = "τ g₀" if group.spatial else "g₀ τ"
    return decide_zero(f"Ad*_g₁ x₁ = Ad*_g₀ x₀ for g₁ = {order}, τ = (1 + P/2)/(1 − P/2)", residuals, system.positive)


def element_statements(
    group: Group, group_element: Vector, p: Vector, start: Vector, end: Vector, *, cayley: bool, positive: Sequence[str]
) -> Iterator[Statement]:
    """Yield two statements on the attitude increment ``group_element``: it is exp(p), and it conserves
    momentum.

    With ``cayley`` the increment is the Cayley transform of p instead. If x is the momentum in the body, the momentum
    in space is conserved. If x is the momentum in space, the momentum in the body is conserved. ``start`` and ``end``
    are the states before and after a step; the attitude before the step is any quaternion.
    """
    covectors = [p[i] for i in group.rotation], [p[i] for i in group.translation]
    increment = direction(*covectors, cayley=cayley)
    phi = ZERO if cayley else _doubled(dot(covectors[0], covectors[0]))
    group_covectors, factor = with_phi(*covectors, phi), increment.factor
    labelled = [("length", dot(increment.turn, increment.turn) - increment.length**2)]
    labelled += [
        ("quaternion", increment.length * a - b)
        for a, b in zip([ONE + group_element[0], *group_element[1:4]], increment.turn, strict=True)
    ]
    labelled += [
        ("position", increment.length**2 * a - b) for a, b in zip(group_element[4:], increment.shift, strict=True)
    ]
    labelled += [("φ(s)", a - factor * b) for a, b in zip(increment.turn, group_covectors.turn, strict=True)]
    labelled += [("φ(s)", a - factor**2 * b) for a, b in zip(increment.shift, group_covectors.shift, strict=True)]
    name = "τ = (1 + P/2)/(1 − P/2)" if cayley else "τ = exp(p)"
    residuals = zip([label for label, _ in labelled], _with_phi([e for _, e in labelled], _quarter), strict=True)
    yield decide_zero(f"the quaternion of {name} has length 1", residuals, positive)
    simple = with_phi(*covectors, ZERO if cayley else _any(ZERO))
    first, last = (_with_phi(part, _any) for part in (start, end))
    order = "τ g₀" if group.spatial else "g₀ τ"
    frame = "body" if group.spatial else "space"
    conserved = _residuals(group, simple.turn, simple.shift, first, last)
    yield decide_zero(
        f"Ad*_g₁ x₁ = Ad*_g₀ x₀ for g₁ = {order}", conserved, positive, f"the momentum in {frame}, any g₀"
    )


def _residuals(
    group: Group, turn: Vector, shift: Vector, start: Vector, end: Vector
) -> Iterator[tuple[str, Expression]]:
    """Yield the changes of conserved vectors in a step, with labels. They are 0 if the step conserves the momentum.

    The vectors are ``group.vectors`` or, if there are none, the momentum. The attitude rotates each vector to
    coordinates in which it is constant. Let g₀ be the quaternion of the attitude before the step, and τ that of the
    attitude increment. Changes are multiplied by |g₀|²|τ|². For se(3), the change of the angular momentum is computed
    for g₀ = 1 and multiplied by |τ|⁴.
    """
    square = dot(turn, turn)
    product_after = product(turn, BEFORE) if group.spatial else product(BEFORE, turn)
    first, last = (_conjugate(q) if group.spatial else list(q) for q in (BEFORE, product_after))
    triples = [("rotated vector", v) for v in group.vectors] or [("momentum", group.rotation)]
    for label, triple in triples:
        momentum_before, momentum_after = (
            rotated(first, [start[i] for i in triple]),
            rotated(last, [end[i] for i in triple]),
        )
        yield from ((label, a - square * b) for a, b in zip(momentum_after, momentum_before, strict=True))
    if group.translation:
        yield from (("momentum", e) for e in _screwed(group, turn, shift, start, end))


def _screwed(group: Group, turn: Vector, shift: Vector, start: Vector, end: Vector) -> list[Expression]:
    """Return the change of the angular momentum of se(3) in a step from the attitude g₀ = 1 to the attitude τ."""
    square = dot(turn, turn)
    (momentum_before, _), (momentum_after, force) = (
        ([x[i] for i in group.rotation], [x[i] for i in group.translation]) for x in (start, end)
    )
    if group.spatial:
        pushed = cross(shift, force)
        momentum_after = [square * a - b for a, b in zip(momentum_after, pushed, strict=True)]
        return [
            a - square**2 * b for a, b in zip(rotated(_conjugate(turn), momentum_after), momentum_before, strict=True)
        ]
    pushed = cross(shift, rotated(turn, force))
    return [
        square * (a - square * b) + c
        for a, b, c in zip(rotated(turn, momentum_after), momentum_before, pushed, strict=True)
    ]


def _with_phi(expressions: Sequence[Expression], value: Callable[[Expression], Expression]) -> list[Expression]:
    """Return the expressions with each φ(s) replaced by ``value(s)``. Each φ′(s) is expressed by s and φ(s), by the
    differential equation of φ.

    The proofs use no other property of the function φ.
    """

    def visit(e: Expression, args: list[Expression]) -> Expression:
        if e.op not in SPECIAL:
            return rebuild(e, args)
        phi, s = value(args[0]), args[0]
        return phi if e.op == SPECIAL[0] else (s * phi**2 / 2 - 3 * phi / 2 + number(Fraction(1, 8))) / s

    return fold(expressions, visit)


def _any(s: Expression) -> Expression:
    """Return a symbol in place of φ(s). A statement that is proved with this symbol holds for any function φ."""
    return symbol(Symbol("phi"))


def _quarter(s: Expression) -> Expression:
    """Return (1 − c)/s in place of φ(s), where the symbol c stands for 1 − sφ(s). In the proofs, s is |p|²/4."""
    return (ONE - symbol(Symbol("cosine"))) / s


def _doubled(s: Expression) -> Expression:
    """Return φ(s) = (1 − 2w cot 2w)/s with w = √s/4, computed from φ(s/4).

    The doubling formula is 2w cot 2w = (c² − w²)/c with c = w cot w = 1 − φ(s/4)s/4.
    """
    c = symbol(Symbol("cosine"))
    return (ONE - (c**2 - s / 16) / c) / s


def _conjugate(q: Vector) -> list[Expression]:
    return [q[0], *(-v for v in q[1:])]
