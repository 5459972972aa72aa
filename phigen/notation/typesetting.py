"""Conversion of formulas from MathML to LaTeX, with line breaks.

The MathML is the markup of `phigen.notation.mathml`. Widths of formulas are upper estimates in em for the fonts of TeX.
A line breaks before a plus or minus sign outside parentheses. If this would leave a large gap at the end of the line,
the line breaks before a sign inside parentheses. If there is no sign, the line breaks between factors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

#: Width of a line in em: slightly less than the text width of the LaTeX class article at 10, 11 and 12 points.
LINE = 31.0
#: Indentation of continued lines in LaTeX, and its width in em.
INDENT, INDENTED = "\\quad ", 1.0
#: The cost of ending a line at some place is the fraction of the line that stays empty, plus this number for each pair
#: of parentheses around the place. The line ends where the cost is least.
_SHORTER = 0.35
#: A line break between two factors costs as much as a break at a sign inside this number of additional pairs of
#: parentheses.
_FACTORS = 4
#: A fraction, root or exponent that is wider than this fraction of a line is written inline, so that it can be broken.
_WIDE = 0.6

_GREEK = {
    "α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta", "ε": "varepsilon", "ζ": "zeta", "η": "eta", "θ": "theta",
    "ι": "iota", "κ": "kappa", "λ": "lambda", "μ": "mu", "ν": "nu", "ξ": "xi", "π": "pi", "ρ": "rho", "σ": "sigma",
    "τ": "tau", "υ": "upsilon", "φ": "varphi", "χ": "chi", "ψ": "psi", "ω": "omega", "Γ": "Gamma", "Δ": "Delta",
    "Θ": "Theta", "Λ": "Lambda", "Ξ": "Xi", "Π": "Pi", "Σ": "Sigma", "Φ": "Phi", "Ψ": "Psi", "Ω": "Omega",
    "∗": "ast",
}  # fmt: skip
_FUNCTIONS = ("arccos", "arcsin", "arctan", "cos", "cosh", "cot", "exp", "log", "max", "min", "sin", "sinh", "tan",
              "tanh")  # fmt: skip
_TIMES, _APPLY = "\u2062", "\u2061"
_SIGNS = {
    "−": (" - ", 1.25), "+": (" + ", 1.25), "=": (" = ", 1.4), "·": (" \\cdot ", 0.8), "…": ("\\cdots", 1.3),
    ",": (", ", 0.5), "{": ("\\{", 0.5), "}": ("\\}", 0.5), "|": ("|", 0.3), "/": ("/", 0.5), _TIMES: (" ", 0.0),
    _APPLY: ("", 0.0), "∑": ("\\sum", 1.0), "∏": ("\\prod", 1.0), "<": (" < ", 1.4),
}  # fmt: skip
_ACCENTS = {"˙": "dot", "~": "tilde"}
_TALL = ("mfrac", "msqrt", "mroot", "mtable")


@dataclass(frozen=True)
class Atom:
    """Part of a LaTeX formula, with its width in em. A line never breaks inside a part.

    ``level`` determines the cost of a line break before the part: it is the number of pairs of parentheses around the
    break, plus `_FACTORS` for a break between two factors. If ``level`` is None, no line may break there.
    """

    text: str
    width: float
    level: int | None = None


def latex(*markup: str) -> str:
    """Return MathML elements, which stand side by side, as LaTeX on one line."""
    return _joined(_atoms(_elements(markup), whole=True))


def width(*markup: str) -> float:
    """Return the estimated width in em of MathML elements side by side on one line."""
    return _width(_atoms(_elements(markup), whole=True))


def lines(markup: Sequence[str], room: float) -> list[str]:
    """Return MathML elements side by side as lines of LaTeX, each of at most the width ``room`` in em if possible.

    All lines except the first are indented by `INDENTED`, which counts as part of their width.
    """
    elements = _elements(markup)
    unbroken = _atoms(elements, whole=True)
    if _width(unbroken) <= room:
        return [_joined(unbroken)]
    atoms, broken_lines, begin = _atoms(elements, whole=False), [], 0
    while begin < len(atoms):
        end = _end(atoms, begin, room - (INDENTED if begin else 0.0))
        times = "\\cdot " if begin and (atoms[begin].level or 0) >= _FACTORS else ""
        broken_lines.append(times + _joined(atoms[begin:end]))
        begin = end
    return broken_lines


def _end(atoms: Sequence[Atom], begin: int, room: float) -> int:
    """Return the index of the atom with which a new line begins; the present line begins at ``begin``.

    The break is at the best place within the width ``room``. If no break is possible there, it is at the first possible
    place after this width.
    """
    width_used, best, least = 0.0, len(atoms), float("inf")
    for position in range(begin, len(atoms)):
        level = atoms[position].level
        if level is not None and position > begin:
            cost = (room - width_used) / room + _SHORTER * level
            if width_used > room and best == len(atoms):
                return position
            if width_used <= room and cost <= least:
                best, least = position, cost
        width_used += atoms[position].width
        if width_used > room and best < len(atoms):
            return best
    return len(atoms)


def _joined(atoms: Sequence[Atom]) -> str:
    return " ".join("".join(a.text for a in atoms).split())


def _width(atoms: Sequence[Atom]) -> float:
    return sum(a.width for a in atoms)


def _elements(markup: Sequence[str]) -> list[Element]:
    return list(ElementTree.fromstring(f"<mrow>{''.join(markup)}</mrow>"))


def _flattened(elements: Sequence[Element]) -> Iterator[Element]:
    for element in elements:
        if element.tag == "mrow":
            yield from _flattened(list(element))
        else:
            yield element


def _atoms(elements: Sequence[Element], depth: int = 0, *, whole: bool) -> list[Atom]:
    """Return MathML elements side by side as `Atom` objects.

    ``depth`` is the number of pairs of parentheses around the elements. ``whole`` says that the line will not be
    broken, so that wide fractions and exponents need not be written inline.
    """
    flat, listed_atoms, bars = list(_flattened(elements)), list[Atom](), 0
    tall = _tall_parentheses(flat)
    for position, element in enumerate(flat):
        text, previous = element.text or "", flat[position - 1].text if position else "("
        if element.tag != "mo":
            is_function = position + 1 < len(flat) and flat[position + 1].text == _APPLY
            listed_atoms += _of_element(element, depth, called=is_function, whole=whole)
        elif text in ("(", ")"):
            depth += 1 if text == "(" else -1
            listed_atoms.append(_parenthesis(text, tall=position in tall, whole=whole))
        elif text == "−" and (previous in ("(", ",", "=") or (previous == "|" and bars % 2)):
            listed_atoms.append(Atom("-", 0.8))
        elif text in ("+", "−", "="):
            listed_atoms.append(Atom(*_SIGNS[text], level=None if previous == "(" else depth))
        elif text == _TIMES:
            listed_atoms.append(Atom(" ", 0.0, depth + _FACTORS))
        else:
            bars += text == "|"
            listed_atoms.append(Atom(*_SIGNS[text]))
    return listed_atoms


def _parenthesis(text: str, *, tall: bool, whole: bool) -> Atom:
    if not tall:
        return Atom(text, 0.4)
    sizes = ("\\left", "\\right") if whole else ("\\biggl", "\\biggr")
    return Atom(f"{sizes[text == ')']}{text} ", 0.8)


def _tall_parentheses(flat: Sequence[Element]) -> set[int]:
    """Return the positions of those parentheses that enclose a fraction, a root or a matrix."""
    tall, open_positions = set(), list[int]()
    for position, element in enumerate(flat):
        if element.tag == "mo" and element.text == "(":
            open_positions.append(position)
        elif element.tag == "mo" and element.text == ")":
            begin = open_positions.pop()
            if any(part.tag in _TALL for e in flat[begin:position] for part in e.iter()):
                tall |= {begin, position}
    return tall


def _of_element(element: Element, depth: int, *, called: bool, whole: bool) -> list[Atom]:
    parts = list(element)
    match element.tag:
        case "mi":
            return [_identifier(element.text or "", called=called)]
        case "mn":
            return [Atom(element.text or "", 0.5 * len(element.text or ""))]
        case "mtext":
            return [Atom(f"\\quad \\text{{{element.text}}}", 1 + 0.5 * len(element.text or ""), depth)]
        case "mover":
            inner = _one(parts[:1])
            return [Atom(f"\\{_ACCENTS[parts[1].text or '']}{{{inner.text}}}", inner.width)]
        case "msub" | "msup" | "msubsup":
            return _scripts(element.tag, parts, depth, called=called, whole=whole)
        case "mfrac":
            return _fraction(parts, depth, whole=whole)
        case "msqrt":
            inner = _one(parts)
            if not whole and inner.width > _WIDE * LINE:
                return _raised(_enclosed(parts, depth), Atom("\\frac{1}{2}", 0.6))
            return [Atom(f"\\sqrt{{{inner.text}}}", inner.width + 1.0)]
        case "mroot":
            inner, degree = _one(parts[:1]), _one(parts[1:])
            return [Atom(f"\\sqrt[{degree.text}]{{{inner.text}}}", inner.width + 1.0)]
    raise ValueError(f"no LaTeX for the element {element.tag}")


def _one(elements: Sequence[Element]) -> Atom:
    """Return MathML elements side by side as one atom, which is never broken."""
    atoms = _atoms(elements, whole=True)
    return Atom(_joined(atoms), _width(atoms))


def _identifier(name: str, *, called: bool) -> Atom:
    stem = name.rstrip("′″")
    primes = name[len(stem) :].replace("′", "'").replace("″", "''")
    if stem in _GREEK:
        return Atom(f"\\{_GREEK[stem]}{primes} ", 0.65 + 0.3 * len(primes))
    if stem in _FUNCTIONS and called:
        return Atom(f"\\{stem} ", 0.5 * len(stem) + 0.2)
    if not stem.isascii():
        return Atom(f"\\text{{{stem}}}{primes}", 0.6 * len(name))
    if len(stem) > 1:
        escaped = stem.replace("_", "\\_")
        return Atom(f"\\{'operatorname' if called else 'mathit'}{{{escaped}}}{primes}", 0.55 * len(name) + 0.2)
    return Atom(f"{name}", 0.9 if stem in "mwMW" else 0.75 if stem.isupper() else 0.58)


def _scripts(kind: str, parts: Sequence[Element], depth: int, *, called: bool, whole: bool) -> list[Atom]:
    """Return the atoms of a base with an index, an exponent or both. Within an atom, no line breaks.

    A base that is a sum in parentheses may be broken. A power of e with a long exponent becomes exp(…), whose argument
    may be broken too.
    """
    base, *scripts = parts
    script_atoms = [_one([s]) for s in scripts]
    if not whole and kind == "msup" and base.text == "e" and script_atoms[0].width > 0.75 * _WIDE * LINE:
        return [Atom("\\exp ", 1.7), *_enclosed(scripts, depth)]
    signs = {"msub": "_", "msup": "^", "msubsup": "_^"}[kind]
    text = "".join(f"{sign}{{{script.text}}}" for sign, script in zip(signs, script_atoms, strict=True))
    carrier = [_identifier(base.text or "", called=True)] if called else _atoms([base], depth, whole=whole)
    return _raised(carrier, Atom(text, 0.75 * max(s.width for s in script_atoms) + 0.1), marks="")


def _raised(atoms: list[Atom], script: Atom, marks: str = "^") -> list[Atom]:
    last, text = atoms[-1], f"{marks}{{{script.text}}}" if marks else script.text
    return [*atoms[:-1], replace(last, text=last.text.rstrip() + text, width=last.width + script.width)]


def _fraction(parts: Sequence[Element], depth: int, *, whole: bool) -> list[Atom]:
    above, below = (_one([part]) for part in parts)
    if whole or max(above.width, below.width) <= _WIDE * LINE:
        return [Atom(f"\\frac{{{above.text}}}{{{below.text}}}", max(above.width, below.width) + 0.3)]
    if below.width > 0.5 * _WIDE * LINE:
        return [*_factor(parts[:1], depth), Atom(" \\Big/ ", 0.8), *_enclosed(parts[1:], depth)]
    return [Atom(f"\\frac{{1}}{{{below.text}}} ", below.width + 0.5), *_factor(parts[:1], depth)]


def _enclosed(elements: Sequence[Element], depth: int) -> list[Atom]:
    """Return MathML elements, with parentheses around them, as atoms."""
    tall = any(part.tag in _TALL for e in elements for part in e.iter())
    left, right = (_parenthesis(sign, tall=tall, whole=False) for sign in "()")
    return [left, *_atoms(elements, depth + 1, whole=False), right]


def _factor(elements: Sequence[Element], depth: int) -> list[Atom]:
    """Return MathML elements as the atoms of a factor of a product: a sum gets parentheses."""
    atoms = _atoms(elements, depth, whole=False)
    return _enclosed(elements, depth) if any(a.level == depth for a in atoms) else atoms
