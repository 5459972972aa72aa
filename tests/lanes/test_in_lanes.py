"""The SIMD lowering, which chooses the functions that are evaluated at several points at once."""

import pytest
from support import BODY, compile_text, compiled

from phigen.lanes.in_lanes import LANES, MAX_STACK_BYTES, Blocks, Packs, in_lanes

PAIR = "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
EULER = f"{PAIR}birealisation: {{kind: canonical-euler, side: q}}\norder: 1\n"


def lowered(text, order=None, scheme=None):
    return in_lanes(compile_text(text, order, scheme).program)


def test_implicit_steps_are_solved_in_blocks():
    lowered_program = lowered(f"{BODY}order: 4\n")
    assert isinstance(lowered_program, Blocks)
    assert [k.kernel.name for k in lowered_program.kernels] == ["linearise", "evaluate", "invert"]
    evaluate = lowered_program.kernels[1].kernel
    assert [o.name for o in evaluate.outputs] == ["displacement", "increment"]
    assert lowered_program.vectorised


def test_calls_of_the_library_are_no_vector_instructions():
    for function, vectorised in (("sin", True), ("tanh", True), ("abs", True), ("tan", False)):
        assert lowered(f"{PAIR}hamiltonian: p**2/2 + {function}(q)\norder: 2\n").vectorised is vectorised


def test_formulas_call_functions_in_lanes():
    assert {"cosh", "exp"} <= lowered(f"{PAIR}hamiltonian: p**2/2 + cosh(q)\norder: 2\n").calls


def test_sparse_matrices_keep_their_factors():
    chain = "coordinates: [x1, x2, x3, x4, x5, x6, x7]\n"
    rows = [[(j - i) if abs(i - j) == 1 else 0 for j in range(7)] for i in range(7)]
    text = f"{chain}poisson: {{log_canonical: {rows}}}\nhamiltonian: x1 + x2 + x3 + x4 + x5 + x6 + x7\norder: 2\n"
    lowered_program = lowered(text)
    assert [k.kernel.name for k in lowered_program.kernels] == [
        "linearise",
        "evaluate",
        "factorise",
        "substitute",
        "substitute",
    ]
    assert [(k.single, k.sparse) for k in lowered_program.kernels] == [
        (False, True),
        (False, False),
        (False, False),
        (False, False),
        (True, False),
    ]


@pytest.mark.parametrize(
    ("text", "near"),
    [
        (f"{EULER}hamiltonian: p**2/2 - cos(q)\n", ()),
        (f"{EULER}hamiltonian: p**2/2 + tan(q)\n", None),
        (f"{EULER}hamiltonian: p**2/2 + abs(q)**(7/3)\n", None),
        (f"{EULER}hamiltonian: p**2/2 - cos(q)\nsolver: {{lanes: false}}\n", None),
    ],
)
def test_members_with_explicit_steps_are_packed_if_every_function_has_a_version_for_lanes(text, near):
    lowered_program = lowered(text)
    assert (
        lowered_program is None
        if near is None
        else isinstance(lowered_program, Packs) and lowered_program.small_argument == near
    )


def test_flows_take_polynomials_near_zero():
    lowered_program = in_lanes(compiled("toda3", 4, "splitting").program)
    assert isinstance(lowered_program, Packs)
    assert len(lowered_program.kernels) == len(compiled("toda3", 4, "splitting").program.step.flows)
    assert lowered_program.small_argument


@pytest.mark.parametrize(("dimension", "able"), [(3, True), (40, False)])
def test_steps_that_need_too_much_memory_are_not_computed_in_lanes(dimension, able):
    names = [f"x{i}" for i in range(dimension)]
    rows = [[(j - i) if abs(i - j) == 1 else 0 for j in range(dimension)] for i in range(dimension)]
    text = f"coordinates: {names}\npoisson: {{matrix: {rows}}}\nhamiltonian: {' + '.join(f'{n}**2' for n in names)}\n"
    lowered_program = lowered(f"{text}order: 2\nbirealisation: constant\n".replace("'", ""))
    assert isinstance(lowered_program, Blocks) is able
    if able:
        assert lowered_program.grouped(0)
        assert not lowered_program.grouped(MAX_STACK_BYTES // (8 * LANES))
