"""Formulas of the theory, as pieces of MathML. They do not depend on the system."""

from __future__ import annotations

from phigen.notation.mathml import math


def _i(name: str) -> str:
    return f"<mi>{name}</mi>"


def _o(sign: str) -> str:
    return f"<mo>{sign}</mo>"


def _sub(base: str, index: str) -> str:
    return f"<msub>{_i(base)}<mrow>{index}</mrow></msub>"


def _of(function: str, *arguments: str) -> str:
    argument_list = _o(",").join(arguments)
    return (
        f'{function}<mo>&#x2061;</mo><mrow><mo stretchy="false">(</mo>{argument_list}<mo stretchy="false">)</mo></mrow>'
    )


_x, _y, _p, _s, _m = map(_i, "xypsm")
_NABLA_S = f"<mrow><mi>∇</mi>{_sub('S', _i('h'))}</mrow>"
_SLOPE = _of(_NABLA_S, _y)
_x_n, _x_next = _sub("x", _i("n")), _sub("x", f"{_i('n')}{_o('+')}<mn>1</mn>")
_MEAN = f"<mrow><msubsup><mo>∫</mo><mn>0</mn><mn>1</mn></msubsup>{_of(_m, _s)}<mi>d</mi>{_s}</mrow>"
_FOLLOWED = f'<mover accent="true">{_m}<mo>˙</mo></mover>{_o("=")}{_of(_i("π"), _m)}{_p}'
_HALF_ROOT = f"<mfrac><msqrt>{_s}</msqrt><mn>2</mn></mfrac>"

#: The equations of motion.
MOTION = [math(f'<mover accent="true">{_x}<mo>˙</mo></mover>{_o("=")}{_of(_i("π"), _x)}<mi>∇</mi>{_of(_i("H"), _x)}')]

#: Equations of a step from x_n to x_{n+1}. STEP has the form with α and β. PATH_STEP is for bi-realisations that are
#: defined by the path ṁ = π(m)p.
STEP = [
    [math(f"{_of(_i('α'), _y, _SLOPE)}{_o('=')}{_x_n}"), " solved for ", math(_y) + ", "],
    [math(f"{_x_next}{_o('=')}{_of(_i('β'), _y, _SLOPE)}")],
]
PATH_STEP = [
    [math(f"{_p}{_o('=')}{_of(_NABLA_S, _MEAN)}"), " solved for ", math(_p), " with the path ",
     math(f"{_of(_m, '<mn>0</mn>')}{_o('=')}{_x_n}") + ", ", math(_FOLLOWED) + ", "],
    [math(f"{_x_next}{_o('=')}{_of(_m, '<mn>1</mn>')}")],
]  # fmt: skip
ALPHA_BETA_OF_A_PATH = [
    [math(_FOLLOWED) + ", ", math(f"{_x}{_o('=')}{_MEAN}") + ", ",
     math(f"{_of(_i('α'), _x, _p)}{_o('=')}{_of(_m, '<mn>0</mn>')}") + ", ",
     math(f"{_of(_i('β'), _x, _p)}{_o('=')}{_of(_m, '<mn>1</mn>')}")],
]  # fmt: skip

_MINUS_P = f'<mo form="prefix">−</mo>{_p}'
BETA_OF_ALPHA = [math(f"{_of(_i('β'), _x, _p)}{_o('=')}{_of(_i('α'), _x, _MINUS_P)}")]

#: The function φ of the exponential bi-realisation.
PHI = [
    "where ",
    math(
        f"{_of(_i('φ'), _s)}{_o('=')}<mfrac><mn>1</mn>{_s}</mfrac><mrow><mo>(</mo><mn>1</mn>{_o('−')}{_HALF_ROOT}"
        f"{_of(_i('cot'), _HALF_ROOT)}<mo>)</mo></mrow>"
    ),
    math(f"{_o('=')}<mfrac><mn>1</mn><mn>12</mn></mfrac>{_o('+')}<mfrac>{_s}<mn>720</mn></mfrac>{_o('+')}{_o('…')}"),
]

GAUGED = f"{_i('H')}{_o('→')}{_i('H')}"
MODIFIED = f'<mover accent="true">{_i("H")}<mo>~</mo></mover>{_o("=")}{_i("H")}{_o("+")}'
