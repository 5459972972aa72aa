"""The profile certified: C with the parentheses, braces and casts of MISRA C:2012, and otherwise the same."""

import re

import pytest
from support import run, slow_but, spec_of, tool, write

from phigen.compiler import compile_spec, emit
from phigen.targets.c.misra import compliant

WRITTEN = {
    "products in sums": ("x = a * b + c - d / e * f;", "x = (a * b) + c - (d / e * f);"),
    "operators of one precedence": ("x = a + b - c; y = a * b / c;", "x = a + b - c; y = a * b / c;"),
    "comparisons and conditions": (
        "x = a + 1 < b && c ? d * 2 : -e - 1;",
        "x = (((a + 1) < b) && c) ? (d * 2) : (-e - 1);",
    ),
    "signs, casts, calls, members": (
        "x = -a * (double)b + s->c[i + 1] * sin(a * b + 1);",
        "x = (-a * (double)b) + (s->c[i + 1] * sin((a * b) + 1));",
    ),
    "declarations of pointers": ("const double *a = b + 2 * c, *d;", "const double *a = b + (2 * c), *d;"),
    "comments and macros": (
        "#define A a * b + c\nx = /* a * b + c */ a;",
        "#define A a * b + c\nx = /* a * b + c */ a;",
    ),
    "bodies": (
        "for (;;)\n    if (a) b = c; else if (d) return; else e();",
        "for (;;) {\n    if (a) { b = c; } else if (d) { return; } else { e(); } }",
    ),
    "bodies with braces, and none": ("while (a) { b(); } for (;;) ;", "while (a) { b(); } for (;;) ;"),
    "results that are not used": (
        "if (a) memcpy(b, c, d); e = memcmp(f, g, h);",
        "if (a) { (void)memcpy(b, c, d); } e = memcmp(f, g, h);",
    ),
    "open brackets": ('extern "C" {\nint a;', 'extern "C" {\nint a;'),
}


@pytest.mark.parametrize("case", WRITTEN)
def test_what_is_written(case):
    code, expected = WRITTEN[case]
    assert compliant(code) == expected
    assert compliant(expected) == expected


@pytest.mark.parametrize(
    "name",
    slow_but(["pendulum"], of=["pendulum", "rigid_body", "duffing", "kepler_eccentric", "guiding_centre", "toda"]),
)
def test_machine_code_is_that_of_the_profile_small(name, tmp_path):
    """Equal machine code shows that parentheses and braces do not change the meaning."""
    compilers = []
    for profile, without in (("small", ("ensemble", "kicks")), ("certified", ())):
        files = emit(compile_spec(spec_of(name), profile=profile, without=without).program, "c", "x")
        folder = tmp_path / profile
        folder.mkdir()
        write(folder, files)
        run([tool("gcc"), "-std=c99", "-O1", "-S", f"{name}.c", "-o", "code.s"], folder)
        compilers.append(re.sub(r"\.LC?\w+", "", (folder / "code.s").read_text()))
    assert compilers[0] == compilers[1]
    assert "memcmp" not in files[f"{name}.c"]
    assert "NAME_ensemble" not in files[f"{name}.h"]
    assert f"{name}_ensemble" not in files[f"{name}.h"]
