"""Casimirs of log-canonical structures as powers: ½ Σ u_i log x_i² is printed as log|Π x_i^u_i|."""

from __future__ import annotations

from phigen.symbolic.expression import ONE, Expression, fold, symbols_of
from phigen.symbolic.readable import readable


def as_powers(casimir: Expression) -> str | None:
    """Return the text ``log|x1**u1*…|`` for a Casimir of the form ½ Σ u_i log x_i²; None for another form."""
    exponents = fold([casimir], _exponents)[0]
    if not exponents or None in exponents:
        return None
    factors = [_power(name, u * 2) for name, u in exponents.items() if name is not None]
    return f"log|{'*'.join(factors)}|"


#: A linear combination of log x_i² as {name of x_i: coefficient}; the key None has the constant term. An expression
#: that is no linear combination of this kind is represented by None.
_Sum = dict[str | None, Expression] | None


def _exponents(node: Expression, args: list[_Sum]) -> _Sum:
    """Return a node as a linear combination of terms log x², where x is a symbol; None if the node has another form.

    ``args`` are the results for the arguments of the node.
    """
    if any(a is None for a in args) and node.op != "log":
        return None
    parts = [a for a in args if a is not None]
    if node.op == "log" and node.args[0].op == "pow" and node.args[0].value == 2:
        base = node.args[0].args[0]
        return {base.value: ONE} if base.op == "symbol" else None
    match node.op:
        case "add" | "sub":
            sign = 1 if node.op == "add" else -1
            exponents = dict(parts[0])
            for name, u in parts[1].items():
                exponents[name] = exponents[name] + u * sign if name in exponents else u * sign
            return exponents
        case "neg":
            return {name: -u for name, u in parts[0].items()}
        case "mul" if set(parts[0]) == {None} or set(parts[1]) == {None}:
            scale, logarithms = (parts[0], parts[1]) if set(parts[0]) == {None} else (parts[1], parts[0])
            return {name: scale[None] * u for name, u in logarithms.items()}
    return {None: node} if not any(set(p) - {None} for p in parts) else None


def _power(name: str, exponent: Expression) -> str:
    exponent_text = readable([exponent], None)[0]
    if exponent_text == "1":
        return name
    needs_no_parentheses = exponent_text.isdigit() or (
        not symbols_of(exponent) and "/" not in exponent_text and "-" not in exponent_text
    )
    return (
        f"{name}**{exponent_text}"
        if needs_no_parentheses or exponent_text.isidentifier()
        else f"{name}**({exponent_text})"
    )
