"""Reader of ``poisson:``. It converts the YAML nodes of a Poisson structure to a form, which is a record of
`model.py`.

The reader checks names, repetitions, and the sizes of matrices. The Jacobi identity is checked later.
"""

# `return reader.error(…)` reports an error and returns None, which stands for a value that could not be read.
# mypy: disable-error-code="func-returns-value"

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from phigen.spec.declarations import Declarations
from phigen.spec.grammar import AllowedNames
from phigen.spec.model import (
    CanonicalForm,
    LieAlgebraForm,
    LogCanonicalForm,
    MatrixForm,
    NambuForm,
    PoissonForm,
    ProductForm,
    PullbackForm,
)
from phigen.spec.names import FAMILIES, FAMILY_HELP, FAMILY_NAME, SPEC_FUNCTIONS
from phigen.spec.problems import counted, intended, shown
from phigen.spec.yaml_source import Scalar
from phigen.symbolic.expression import ZERO, Expression, neg
from phigen.symbolic.neighbours import ENDS, minus

Rows = list[list[Scalar | None] | None]
Pairs = dict[tuple[int, int], tuple[Scalar, Expression]]


def poisson_form(raw: Mapping[str, Any], declared: Declarations) -> PoissonForm | None:
    """Return the form of the Poisson structure under ``poisson:``; None after errors, which are reported."""
    for form, read_form in _FORMS.items():
        if form in raw:
            return read_form(
                raw[form], declared if form in ("matrix", "brackets") else replace(declared, indexed=False)
            )
    return None


def brackets_of_sites(raw: Mapping[str, Any], declared: Declarations) -> dict[tuple[str, str], Expression]:
    """Return the brackets {f, g} of fields at different sites of a lattice: neighbours on a grid, or ends of a
    bond.

    Keys are pairs of symbols. For two symbols f and g, either (f, g) or (g, f) is a key.
    """
    if "bonds" in raw:
        return _along_bonds(raw["bonds"], declared)
    return _of_neighbours(raw.get("brackets") or {}, declared) if declared.relation == "grid" else {}


def _of_neighbours(table: Mapping[str, Any], declared: Declarations) -> dict[tuple[str, str], Expression]:
    brackets: dict[tuple[str, str], tuple[Scalar, Expression]] = {}
    space, scope = declared.neighbours, declared.scope()
    for key, row in table.values():
        for second_field, cell in (row or {}).values():
            if "[" not in second_field.text or key.text not in declared.coordinates:
                continue
            place, value = declared.neighbour(second_field), declared.formula(cell, scope)
            if place is None or value is None:
                continue
            base, offset = place
            if not any(offset):
                declared.reader.error(second_field, f"{second_field.text!r} is at the site itself", f"write {base}")
                continue
            mirrored = base, space.at(key.text, minus(offset))
            if mirrored in brackets and space.shifted([neg(value)], minus(offset))[0] is not brackets[mirrored][1]:
                first_place = brackets[mirrored][0].location
                message = f"{{{key.text}, {second_field.text}}} is not the negative of its mirror image, as it must be"
                declared.reader.error(
                    second_field, message, f"that is in line {first_place.line}, column {first_place.column}"
                )
            elif mirrored not in brackets:
                brackets[key.text, space.at(base, offset)] = second_field, value
    return {pair: value for pair, (_, value) in brackets.items()}


def _along_bonds(table: Mapping[str, Any], declared: Declarations) -> dict[tuple[str, str], Expression]:
    if declared.relation != "graph":
        message = "poisson: bonds needs lattice: {graph: NAME}"
        _fail(declared, ("bonds",), message, 'neighbours on a grid are named in brackets: {x: {"y[i+1]": …}}')
        return {}
    brackets: dict[tuple[str, str], Expression] = {}
    space, scope = declared.neighbours, declared.bond_scope()
    for key, row in table.values():
        first = declared.neighbour(key, ENDS)
        for second_field, cell in (row or {}).values():
            second, value = declared.neighbour(second_field, ENDS), declared.formula(cell, scope)
            if first is None or second is None or value is None:
                continue
            pair = space.at(*first), space.at(*second)
            if {first[1], second[1]} != {(end,) for end in ENDS}:
                declared.reader.error(
                    second_field,
                    "a bracket along a bond couples its two ends, a and b",
                    "write a bracket of x[a] and y[b]",
                )
            elif pair[::-1] in brackets and brackets[pair[::-1]] is not neg(value):
                message = f"{{{pair[0]}, {pair[1]}}} is not the negative of {{{pair[1]}, {pair[0]}}}, as it must be"
                declared.reader.error(second_field, message, "give only one of them")
            elif pair[::-1] not in brackets:
                brackets[pair] = value
    return brackets


def _fail(declared: Declarations, path: tuple[Any, ...], message: str, hint: str = "") -> None:
    declared.reader.problems.add(message, declared.reader.locations[*declared.within, *path], hint)


def _entries(
    rows: Rows, path: tuple[Any, ...], declared: Declarations, scope: AllowedNames, size: int
) -> tuple[tuple[Expression, ...], ...] | None:
    """Return a size×size matrix of expressions; None after reported errors.

    ``path`` are the keys from the Poisson structure to the matrix.
    """
    key_path, error_count = ".".join(str(p) for p in path if isinstance(p, str)), len(declared.reader.problems.found)
    if len(rows) != size:
        hint = "give one row for each coordinate" if size == len(declared.coordinates) else "give a square matrix"
        _fail(declared, path, f"{key_path}: expected {counted(size, 'row')}, found {len(rows)}", hint)
    matrix = []
    for i, row in enumerate(rows):
        if row is not None and len(row) != size:
            _fail(
                declared, (*path, i), f"{key_path}: row {i + 1} has {counted(len(row), 'entry', 'entries')}, not {size}"
            )
        matrix.append(tuple(declared.formula(cell, scope) or ZERO for cell in row or ()))
    return tuple(matrix) if len(declared.reader.problems.found) == error_count else None


def _matrix(rows: Rows, declared: Declarations) -> PoissonForm | None:
    entries = _entries(rows, ("matrix",), declared, declared.scope(), _dimension(declared, len(rows)))
    return MatrixForm(entries) if entries is not None else None


def _log_canonical(rows: Rows, declared: Declarations) -> PoissonForm | None:
    scope = declared.constants("an entry of log_canonical")
    a = _entries(rows, ("log_canonical",), declared, scope, _dimension(declared, len(rows)))
    return LogCanonicalForm(a) if a is not None else None


def _dimension(declared: Declarations, otherwise: int) -> int:
    """Return the number of coordinates, or ``otherwise`` if some of them could not be read."""
    return otherwise if declared.incomplete else len(declared.coordinates)


def _brackets(table: Mapping[str, Any], declared: Declarations) -> PoissonForm:
    pairs: Pairs = {}
    scope = declared.scope()
    for key, row in table.values():
        i = declared.coordinate(key)
        for second_name, cell in (row or {}).values():
            # A bracket with a neighbour x[i+1] is a bracket between sites. `brackets_of_sites` reads it.
            if "[" in second_name.text and declared.relation == "grid":
                continue
            j = declared.coordinate(second_name)
            value = declared.formula(cell, scope)
            if i is not None and j is not None and value is not None:
                _state(pairs, (i, j), (key, second_name), value, declared)
    n = len(declared.coordinates)
    matrix = [[ZERO] * n for _ in range(n)]
    for (i, j), (_, value) in pairs.items():
        matrix[i][j], matrix[j][i] = value, neg(value)
    return MatrixForm(tuple(map(tuple, matrix)))


def _state(
    pairs: Pairs, pair: tuple[int, int], keys: tuple[Scalar, Scalar], value: Expression, declared: Declarations
) -> None:
    """Record {x_i, x_j} = value in ``pairs``; report a value that contradicts skew symmetry."""
    (i, j), (a, b) = pair, keys
    if i == j:
        declared.reader.error(b, f"the bracket of {a.text!r} with itself is always 0", "remove it")
    elif (j, i) in pairs and pairs[j, i][1] is not neg(value):
        first_place = pairs[j, i][0].location
        message = f"{{{a.text}, {b.text}}} is not the negative of {{{b.text}, {a.text}}}, as it must be"
        hint = f"the other is in line {first_place.line}, column {first_place.column}; give only one of them"
        declared.reader.error(b, message, hint)
    else:
        pairs[i, j] = b, value


def _canonical(raw: Mapping[str, Any], declared: Declarations) -> PoissonForm | None:
    roles: dict[str, str] = {}
    for key in ("q", "p"):
        for node in raw.get(key, ()):
            if node is None or declared.coordinate(node) is None:
                continue
            if node.text in roles:
                declared.reader.error(node, f"canonical: {node.text!r} is already in {roles[node.text]}")
            roles.setdefault(node.text, key)
    if "q" not in raw or "p" not in raw:
        return None
    q, p = raw["q"], raw["p"]
    if len(q) != len(p):
        return _fail(declared, ("canonical",), f"canonical: {len(q)} positions q, but {len(p)} momenta p")
    if None in q or None in p:
        return None
    return CanonicalForm(tuple(node.text for node in q), tuple(node.text for node in p))


def _lie_algebra(raw: Mapping[str, Any] | Scalar, declared: Declarations) -> PoissonForm | None:
    if isinstance(raw, Scalar):
        return _family(raw, 1, declared)
    sign = -1 if raw.get("sign") == "minus" else 1
    if "name" in raw:
        return _family(raw["name"], sign, declared)
    if "matrices" in raw:
        return _spanned(raw["matrices"], sign, declared)
    if "structure_constants" in raw:
        return _structure_constants(raw["structure_constants"], sign, declared)
    return None


def _family(node: Scalar, sign: int, declared: Declarations) -> PoissonForm | None:
    match = FAMILY_NAME.fullmatch(node.text)
    family, n = (match[1], int(match[2])) if match else ("", 0)
    if family not in FAMILIES:
        name, _, rest = node.text.partition("(")
        meant = intended(name, FAMILIES)
        guess = f"did you mean '{meant}({rest}'?" if meant else f"names are {FAMILY_HELP}"
        return declared.reader.error(node, f"the Lie algebra {shown(node.text)} is not known", guess)
    least, dimension = FAMILIES[family]
    if n < least or (family == "sp" and n % 2):
        return declared.reader.error(node, f"the Lie algebra {node.text} is not available", f"names are {FAMILY_HELP}")
    size = len(declared.coordinates)
    if dimension(n) != size and not declared.incomplete:
        message = f"{node.text} has dimension {dimension(n)}, but there are {counted(size, 'coordinate')}"
        return declared.reader.error(node, message)
    return LieAlgebraForm(sign=sign, family=family, size=n)


def _spanned(rows_of_matrices: list[Rows | None], sign: int, declared: Declarations) -> PoissonForm | None:
    path, n = ("lie_algebra", "matrices"), _dimension(declared, len(rows_of_matrices))
    if len(rows_of_matrices) != n:
        _fail(
            declared,
            path,
            f"lie_algebra: {counted(len(rows_of_matrices), 'matrix', 'matrices')} for {counted(n, 'coordinate')}",
            "give one matrix for each coordinate",
        )
    scope = declared.constants("a matrix of a Lie algebra")
    size = len(rows_of_matrices[0] or ())
    matrices = [
        _entries(m, (*path, i), declared, scope, size) if m is not None else None
        for i, m in enumerate(rows_of_matrices)
    ]
    return LieAlgebraForm(sign=sign, matrices=tuple(m for m in matrices if m is not None))


def _structure_constants(table: Mapping[str, Any], sign: int, declared: Declarations) -> PoissonForm:
    scope, stated = declared.constants("a structure constant"), dict[int, Pairs]()
    constants: dict[int, dict[int, dict[int, Expression]]] = {}
    for first, row in table.values():
        for second, sums in (row or {}).values():
            for third, cell in (sums or {}).values():
                i, j, k = (_basis_index(key, declared) for key in (first, second, third))
                value = declared.formula(cell, scope)
                if i is None or j is None or k is None or value is None:
                    continue
                _state(stated.setdefault(k, {}), (i, j), (first, second), value, declared)
                constants.setdefault(i, {}).setdefault(j, {})[k] = value
    return LieAlgebraForm(sign=sign, structure_constants=constants)


def _basis_index(key: Scalar, declared: Declarations) -> int | None:
    index, n = int(key.text[1:]) - 1, len(declared.coordinates)
    if index < n or declared.incomplete:
        return index
    return declared.reader.error(
        key, f"there is no basis element {key.text}", f"with {n} coordinates the basis elements are E1 to E{n}"
    )


def _nambu(nodes: list[Scalar | None], declared: Declarations) -> PoissonForm | None:
    number = len(declared.coordinates) - 2
    if len(nodes) != number and not declared.incomplete:
        _fail(declared, ("nambu",), f"nambu: expected n-2 = {number} Casimirs, found {len(nodes)}")
    casimirs = [declared.formula(node, declared.scope()) for node in nodes]
    return NambuForm(tuple(c for c in casimirs if c is not None))


def _product(entries: list[Mapping[str, Any] | None], declared: Declarations) -> PoissonForm | None:
    places_by_name: dict[str, Scalar] = {}
    blocks: list[tuple[tuple[str, ...], PoissonForm | None]] = []
    for i, block in enumerate(entries):
        if "coordinates" not in (block or {}):  # the missing key was reported when the block was read
            blocks.append(((), None))
            continue
        nodes = [node for node in (block or {}).get("coordinates", ()) if node is not None]
        for node in nodes:
            if declared.coordinate(node) is not None and node.text in places_by_name:
                declared.reader.error(node, f"product: {node.text!r} is in two blocks")
            places_by_name[node.text] = node
        names = tuple(node.text for node in nodes)
        message = "brackets in a block of a product depend on its own coordinates only, not on"
        inner = declared.inside((*declared.within, "product", i), names, message)
        blocks.append((names, poisson_form(block or {}, inner)))
    missing_names = [c for c in declared.coordinates if c not in places_by_name]
    if missing_names and all(names for names, _ in blocks) and not declared.incomplete:
        return _fail(
            declared,
            ("product",),
            f"product: {missing_names[0]!r} is in no block",
            "write every coordinate in exactly one block",
        )
    complete = tuple((names, form) for names, form in blocks if form is not None)
    return ProductForm(complete) if len(complete) == len(blocks) else None


def _pullback(raw: Mapping[str, Any], declared: Declarations) -> PoissonForm | None:
    image, inner_form = raw.get("map"), raw.get("of")
    if image is None or inner_form is None:
        return None
    n = len(declared.coordinates)
    if len(image) != n and not declared.incomplete:
        message = f"pullback: map has {counted(len(image), 'component')} for {counted(n, 'coordinate')}"
        _fail(declared, ("pullback", "map"), message)
    for name, (key, _) in image.items():
        if name in declared.nodes or name in declared.coordinates or name in SPEC_FUNCTIONS:
            declared.reader.error(key, f"pullback: {name!r} is in use already", "choose another name")
    names = tuple(image)
    forward = [declared.formula(node, declared.scope()) for _, node in image.values()]
    inner_path = (*declared.within, "pullback", "of")
    inner = declared.inside(inner_path, names, "this structure must use the new coordinates of map:, not")
    form = poisson_form(inner_form, inner)
    backward = _inverse(raw["inverse"], declared, inner) if "inverse" in raw else None
    if form is None or None in forward:
        return None
    return PullbackForm(names, form, tuple(e for e in forward if e is not None), backward)


def _inverse(
    entries: Mapping[str, tuple[Scalar, Scalar | None]], declared: Declarations, inner: Declarations
) -> tuple[Expression, ...] | None:
    for key, _ in entries.values():
        declared.coordinate(key)
    missing_names = [c for c in declared.coordinates if c not in entries]
    if missing_names and not declared.incomplete:
        return _fail(declared, ("pullback", "inverse"), f"pullback: inverse has no formula for {missing_names[0]!r}")
    return tuple(inner.formula(entries[c][1], inner.scope()) or ZERO for c in declared.coordinates if c in entries)


_FORMS: dict[str, Callable[[Any, Declarations], PoissonForm | None]] = {
    "matrix": _matrix,
    "brackets": _brackets,
    "canonical": _canonical,
    "log_canonical": _log_canonical,
    "lie_algebra": _lie_algebra,
    "nambu": _nambu,
    "product": _product,
    "pullback": _pullback,
}
