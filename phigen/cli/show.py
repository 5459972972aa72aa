"""``phigen show``: print the formulas of a spec."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from phigen.cli.arguments import CORRECTIONS, one_spec, order_option, scheme_option
from phigen.cli.console import heading, out, out_document, out_json, verbosity
from phigen.cli.sections import assignments, section
from phigen.cli.sources import load_one

if TYPE_CHECKING:
    from phigen.compilation import Compilation, CompiledGauss, CompiledSeries, CompiledSplitting
    from phigen.geometry.system import System
    from phigen.spec.model import Spec
    from phigen.symbolic.expression import Expression


@click.command("show")
@one_spec
@order_option
@scheme_option
@click.option("--full", is_flag=True, help="Print all terms of long formulas.")
@click.option(
    "--modified", metavar="N", type=CORRECTIONS, default=0, help="Show N corrections of the modified Hamiltonian."
)
@click.option(
    "--expand",
    "sizes",
    metavar="SIZES",
    help="Print a lattice of small sizes, such as 3x3 or those of a named run, as an ordinary spec.",
)
@click.option(
    "--lattice",
    "as_lattice",
    is_flag=True,
    help="Print a spec of identical sites as the spec of a lattice of any size.",
)
@click.option("--latex", "as_latex", is_flag=True, help="Print the formulas as LaTeX, ready for \\input.")
@click.option("--json", "as_json", is_flag=True, help="Print the formulas as JSON.")
@verbosity
def command(
    spec_file: str,
    order: int | None,
    scheme: str | None,
    full: bool,
    modified: int,
    sizes: str | None,
    as_lattice: bool,
    as_latex: bool,
    as_json: bool,
) -> None:
    """Show the formulas of a spec: π, Casimirs, the step, the modified Hamiltonian, operation counts.

    For a series, the formulas of the step are the maps α and β of the bi-realisation, and the terms S_1 … S_k.

    For a lattice the formulas are those of one site. --expand prints a small lattice as a spec without lattice, with
    one coordinate for each field of each site.
    """
    from phigen.compiler import compile_proved
    from phigen.symbolic.readable import SHOWN

    if as_latex and as_json:
        raise click.UsageError("give either --latex or --json, not both")
    spec = load_one(spec_file)
    if sizes is not None:
        from phigen.cli.expanding import expanded_text

        out_document(expanded_text(spec, sizes))
        return
    if as_lattice:
        from phigen.cli.expanding import lattice_text

        out_document(lattice_text(spec))
        return
    if spec.lattice:
        _show_cell(spec, None if full else SHOWN, as_latex=as_latex, as_json=as_json)
        return
    compilation = compile_proved(spec, order=order, scheme=scheme)
    if as_latex:
        from phigen.notation.latex import document

        out(document(compilation, modified, None if full else SHOWN))
    elif as_json:
        corrections = {"corrections": dict(_modified(compilation, modified, None))} if modified else {}
        out_json({**_described(compilation), **corrections})
    else:
        _print(compilation, modified, None if full else SHOWN)


def _show_cell(spec: Spec, max_terms: int | None, *, as_latex: bool, as_json: bool) -> None:
    from phigen.cli.show_lattice import described_cell, print_cell
    from phigen.lattice.cell_building import cell_from_spec
    from phigen.notation.cell_formulas import document

    cell = cell_from_spec(spec)
    if as_latex:
        out(document(cell))
    elif as_json:
        out_json(described_cell(spec, cell))
    else:
        print_cell(spec, cell, max_terms)


def _print(compilation: Compilation, modified: int, max_terms: int | None) -> None:
    spec, system = compilation.spec, compilation.system
    corrected = _modified(compilation, modified, max_terms)
    out(heading(f"{spec.name}: {spec.title}" if spec.title else spec.name))
    if system.parameters:
        parameter_list = ", ".join(f"{p.name} = {float(p.value):.9g}{p.inequality}" for p in system.parameters)
        section("Parameters", [parameter_list])
    section(f"Poisson tensor: {system.shape}", assignments(brackets(compilation)))
    section("Hamiltonian", assignments([("H", readable_one(system.hamiltonian, max_terms))]))
    if system.forces:
        section("Forces: ẋ = π(∇H + ζ) + f", assignments(_forces(system, max_terms)))
    if system.noise:
        section("Noise: dx = … + Σ σ π∇g ∘ dW", assignments(_noise(system, max_terms)))
    if system.casimirs:
        section("Casimirs", assignments(_casimirs(system, max_terms)))
    if system.invariants:
        section("Invariants", assignments(_named(system.invariants, max_terms)))
    compilation.by_kind(partial(_print_series, max_terms), partial(_print_splitting, max_terms), _print_collocation)
    if corrected:
        section("Modified Hamiltonian", assignments(corrected))
    section("Generated code", _code(compilation))


def _print_splitting(max_terms: int | None, compilation: CompiledSplitting) -> None:
    from phigen.notation import flows

    lines = assignments(flows.formulas(compilation, max_terms))
    section(f"Splitting: {flows.method(compilation)}", [*lines, *_unfamiliar(lines)])


def _print_collocation(compilation: CompiledGauss) -> None:
    from phigen.notation import collocation

    lines = [*assignments(collocation.equations()), *collocation.lines(compilation)]
    section(f"Gauss collocation: {collocation.method(compilation)}", lines)


def _unfamiliar(lines: Sequence[str]) -> list[str]:
    """Return a line with definitions of the unusual functions that occur in ``lines``; [] if there are none."""
    from phigen.symbolic.readable import UNFAMILIAR

    met = [
        definition for name, definition in UNFAMILIAR.items() if any(re.search(rf"\b{name}\(", line) for line in lines)
    ]
    return [f"where {', '.join(met)}"] if met else []


def _noise(system: System, max_terms: int | None) -> list[tuple[str, str]]:
    """Return the strength σ and the function g of each source of noise, as pairs of name and text."""
    terms: dict[str, Expression] = {}
    for source in system.noise:
        terms |= {f"σ_{source.name}": source.amplitude, f"g_{source.name}": source.hamiltonian}
    return _named(terms, max_terms)


def _forces(system: System, max_terms: int | None) -> list[tuple[str, str]]:
    """Return the forces of ẋ = π(∇H + ζ) + f as pairs of name and text.

    There is a pair for each component of ζ and f in the spec. With damping, which adds λ π∇H to ζ, a pair for λ
    follows.
    """
    from phigen.spec.model import SpecForces

    forces = system.spec.forces if system.spec else SpecForces()
    terms = {f"ζ_{c}": e for c, e in forces.covector.items()} | {f"f_{c}": e for c, e in forces.vector.items()}
    damping = [("λ", f"{readable_one(forces.damping, max_terms)}; it adds λ π∇H to ζ")] if forces.damping else []
    return [*_named(terms, max_terms), *damping]


def _print_series(max_terms: int | None, compilation: CompiledSeries) -> None:
    from phigen.notation import generating

    reason_lines = textwrap.wrap(compilation.realisation.explanation, 100)
    maps = assignments(_maps(compilation, max_terms))
    if any("φ" in line for line in maps):
        maps.append("where φ(s) = (1 − (√s/2) cot(√s/2))/s = 1/12 + s/720 + …")
    section(f"Bi-realisation: {compilation.realisation.kind}", [*reason_lines, *maps])
    series = [*_gauged(compilation), *assignments(_series(compilation, max_terms))]
    section(f"Generating function: {generating.method(compilation)}", series)


def brackets(compilation: Compilation) -> list[tuple[str, str]]:
    """Return the non-zero brackets of the coordinates, as pairs of name and text."""
    from phigen.symbolic.readable import readable

    system = compilation.system
    names, n = system.coordinates, system.dimension
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n) if not system.poisson[i][j].is_zero]
    texts = readable([system.poisson[i][j] for i, j in pairs])
    return [(f"{{{names[i]}, {names[j]}}}", t) for (i, j), t in zip(pairs, texts, strict=True)]


def readable_one(expression: Any, max_terms: int | None) -> str:
    """Return an expression as readable text, with at most ``max_terms`` terms."""
    from phigen.symbolic.readable import readable

    return readable([expression], max_terms)[0]


def _named(formulas: Any, max_terms: int | None) -> list[tuple[str, str]]:
    return [(name, readable_one(e, max_terms)) for name, e in formulas.items()]


def _casimirs(system: System, max_terms: int | None) -> list[tuple[str, str]]:
    """Return the Casimirs as pairs of name and text.

    A sum of logarithms, as for log-canonical structures, is written as the logarithm of a product of powers.
    """
    from phigen.notation.powers import as_powers

    return [(name, as_powers(e) or readable_one(e, max_terms)) for name, e in system.casimirs.items()]


def _maps(compilation: CompiledSeries, max_terms: int | None) -> list[tuple[str, str]]:
    """Return α and β as pairs of name and text.

    For a symmetric bi-realisation, β is shown as α(x, −p). If α and β are defined by series along a path, the first
    terms of the series are shown.
    """
    from phigen.notation.named_parts import texts

    realisation, names = compilation.realisation, compilation.system.coordinates
    ellipsis = " + …" if realisation.path else ""
    maps = {f"α_{c}": e for c, e in zip(names, realisation.alpha, strict=True)}
    if not realisation.symmetric:
        maps |= {f"β_{c}": e for c, e in zip(names, realisation.beta, strict=True)}
    result = [(name, text + ellipsis * (name in maps)) for name, text in texts(maps, max_terms)]
    return [*result, ("β(x, p)", "α(x, −p)")] if realisation.symmetric else result


def _modified(compilation: Compilation, count: int, max_terms: int | None) -> list[tuple[str, str]]:
    """Return the modified Hamiltonian H̃ = H + h^j H_j + … and its first terms H_j, as pairs of name and text."""
    from phigen.notation.generating import modified_formulas

    corrections = modified_formulas(compilation, count, max_terms)
    names = ["H", *(f"{_power(j)} H_{j}" for j, _ in corrections), "…"]
    return [("H̃", " + ".join(names)), *((f"H_{j}", str(f)) for j, f in corrections)] if corrections else []


def _gauged(compilation: CompiledSeries) -> list[str]:
    """Return a line with the function from which the S_i are derived; [] if this function is H.

    The function is H minus multiples of Casimirs.
    """
    gauge = compilation.gauge
    subtracted = [f"λ_{c} {c}" for c in gauge.free] + [f"({value}) {c}" for c, value in gauge.fixed.items()]
    return [f"of H - {' - '.join(subtracted)}, which has the same flow as H"] if subtracted else []


def _series(compilation: CompiledSeries, max_terms: int | None) -> list[tuple[str, str]]:
    from phigen.notation.generating import series_formulas

    formulas = series_formulas(compilation, max_terms)
    names = [*(f"{_power(i)} S_{i}" for i, _ in formulas.listed), *(["…"] if formulas.beyond else [])]
    rows = [("S_h", " + ".join(names)), *((f"S_{i}", str(f)) for i, f in formulas.listed)]
    return [*rows, ("…", formulas.missing)] if formulas.beyond else rows


def _power(exponent: int) -> str:
    return f"h^{exponent}" if exponent > 1 else "h"


def _code(compilation: Compilation) -> list[str]:
    program = compilation.program
    lines = [fact for fact in program.about.facts if not fact.startswith("bi-realisation")]
    lines.append(f"operations of one {program.step.kind.unit}: {program.about.counts}")
    return lines + [f"{name}: {len(text.splitlines())} lines" for name, text in _files(compilation).items()]


def _files(compilation: Compilation) -> dict[str, str]:
    from phigen.cli.generation import Options, generate

    files: dict[str, str] = {}
    for target in compilation.spec.targets:
        files |= generate(compilation, target, Options())
    return files


def _described(compilation: Compilation) -> dict[str, object]:
    from phigen.symbolic.readable import readable

    system, plan = compilation.system, compilation.order
    return {
        "name": compilation.spec.name,
        "title": compilation.spec.title,
        "coordinates": list(system.coordinates),
        "parameters": {p.name: float(p.value) for p in system.parameters},
        "structure": str(system.shape),
        "poisson": [readable(row, None) for row in system.poisson],
        "hamiltonian": readable_one(system.hamiltonian, None),
        "casimirs": dict(_named(system.casimirs, None)),
        "invariants": dict(_named(system.invariants, None)),
        "order": plan.order,
        **_described_method(compilation),
        "operations": dict(compilation.program.about.operations),
        "files": {name: len(text.encode()) for name, text in _files(compilation).items()},
    }


def _described_method(compilation: Compilation) -> dict[str, object]:
    from phigen.notation import collocation, flows

    return compilation.by_kind(_described_series, flows.described, collocation.described)


def _described_series(compilation: CompiledSeries) -> dict[str, object]:
    from phigen.notation.generating import series_formulas
    from phigen.symbolic.readable import readable

    realisation, plan = compilation.realisation, compilation.order
    formulas = series_formulas(compilation, None)
    return {
        "scheme": "series",
        "birealisation": {
            "kind": realisation.kind,
            "symmetric": realisation.symmetric,
            "explanation": realisation.explanation,
            "reference": realisation.reference,
            "alpha": readable(realisation.alpha, None),
            "beta": readable(realisation.beta, None),
        },
        "terms": compilation.stage.terms,
        "stages": list(compilation.program.fractions),
        "series": {f"S_{i}": {"formula": str(f), "terms": f.size} for i, f in formulas.listed},
        "series_not_written_from": formulas.beyond,
        "modified_hamiltonian": None
        if formulas.leading is None
        else {"power": plan.order, "coefficient": str(formulas.leading)},
    }
