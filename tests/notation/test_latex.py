"""LaTeX of whole systems, compared with the reviewed files NAME.tex in this folder."""

from pathlib import Path

import pytest
from support import BODY

from phigen import spec
from phigen.compiler import compile_spec
from phigen.notation.latex import document

SPECS = {
    "gauged": f"{BODY}casimirs: {{C: x1**2 + x2**2 + x3**2}}\norder: 4\n",
    "splitting": "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/2 - cos(q)\n"
    "scheme: splitting\norder: 2\n",
    "wide": f"coordinates: [{', '.join(f'x{i}' for i in range(11))}]\norder: 1\n"
    "poisson: {brackets: {x0: {x1: x2**2}, x9: {x10: -x2}}}\nhamiltonian: x0*x1 + x9**2\n",
}


@pytest.mark.parametrize("name", SPECS)
def test_the_page_of_a_system_is_what_was_read(name):
    reviewed_text = Path(__file__).with_name(f"{name}.tex").read_text(encoding="utf-8")
    assert document(compile_spec(spec.loads(f"phigen: 1\nname: {name}\n{SPECS[name]}")), most=4) + "\n" == reviewed_text
