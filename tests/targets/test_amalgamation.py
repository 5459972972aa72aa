"""The generated runtime in C equals the output of a preprocessor, except for blocks without a head."""

import re
from collections import Counter
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from support import run, spec_of, tool, write

from phigen import resources
from phigen.compiler import compile_spec
from phigen.targets.c import phrases, states
from phigen.targets.c.emitter import runtime_of
from phigen.targets.c.files import CALLS, CONDITIONS, calls_left_out, guard
from phigen.targets.c.macros import Macros
from phigen.targets.c.unused import without_unused

RUNTIME = resources.templates() / "c/runtime"
PACKAGE = Path(phrases.__file__).parents[2]


def expanded(lines, *definitions):
    """Return the lines with these macros expanded."""
    macros = Macros()
    for definition in definitions:
        macros.define(f"#define PHI_{definition}")
    return "\n".join(macros.expanded(lines.split("\n")))


def test_heads_that_are_nothing_leave_what_is_below_them():
    text = """\
    PHI_EACH
        phi_prepare(h);
    PHI_EACH {
        PHI_EACH phi_fit(s);
        x[0] = y[0];
    }
    PHI_EACH
        if (good) {
            again();
        }
    done();"""
    left = """\
    phi_prepare(h);
    phi_fit(s);
    x[0] = y[0];
    if (good) {
        again();
    }
    done();"""
    assert expanded(text, "EACH") == left
    assert (
        expanded("    PHI_EACH {", "EACH for (int k = 0; k < PHI_DIM; ++k)")
        == "    for (int k = 0; k < PHI_DIM; ++k) {"
    )


def test_macros_are_expanded_with_their_arguments():
    assert expanded("PHI_OF(s->past[k], (i + 1) % n)[j]", "OF(array, k) array[k]") == "s->past[k][(i + 1) % n][j]"
    assert expanded("f(PHI_OF(PHI_OF(a, 1), 2))", "OF(array, k) array") == "f(a)"
    assert expanded("f(s PHI_AND_K, g(t PHI_AND_K))", "AND_K , k") == "f(s, k, g(t, k))"
    assert expanded("f(s PHI_AND_K, t)", "AND_K") == "f(s, t)"


def test_macros_that_are_given_too_little_are_no_code():
    for line in ("PHI_OF", "PHI_OF(a)", "PHI_OF(a, b, c)", "PHI_OF(a,"):
        with pytest.raises(ValueError, match=r"macro|shorter|longer"):
            expanded(line, "OF(array, k) array[k]")


@cache
def with_derivatives(name, composition):
    """Return the program of a system of the corpus, with the derivatives of its steps."""
    chosen = replace(spec_of(name), composition=composition)
    return compile_spec(chosen, order=4, tangent=True, adjoint=True).program


@pytest.mark.thin(6)
@pytest.mark.parametrize(
    ("name", "composition"),
    [
        ("rigid_body", "auto"),
        ("rigid_body", "suzuki"),
        ("seasonal_predator_prey", "suzuki"),
        ("sir_epidemic", "suzuki"),
        ("kepler", "auto"),
        ("pendulum_euler", "auto"),
        ("toda", "auto"),
        ("klein_gordon", "auto"),
        ("heisenberg_plane", "auto"),
        ("kdv", "suzuki"),
        ("point_vortices", "auto"),
    ],
)
@pytest.mark.parametrize("profile", ["fast", "small"])
def test_code_is_what_a_preprocessor_makes_of_the_runtime(name, composition, profile, tmp_path):
    """Names have the prefix of the solver before macros are expanded, so that macros printed for the model apply to the
    runtime too.
    """
    source, _, code = runtime_of(replace(with_derivatives(name, composition), profile=profile))
    runtime_files = {str(f.relative_to(RUNTIME)): f.read_text(encoding="utf-8") for f in RUNTIME.rglob("*.[ch]")}
    (tmp_path / "none").mkdir()
    write(tmp_path, {f: re.sub(r"\b(phi|PHI)_", f"{source.name}_", text) for f, text in runtime_files.items()})
    printed = {"phrases.h": phrases.header(), **{file: states.header(file) for file in states.PARTS}}
    write(tmp_path, {f: re.sub(r"\b(phi|PHI)_", f"{source.name}_", text) for f, text in printed.items()})
    spelt = {f: re.sub(r"\bPHI_", f"{source.name}_", text) for f, text in source.printed.items()}
    write(tmp_path, {f: f"#ifndef {f[:-2]}_h\n#define {f[:-2]}_h\n{text}\n#endif" for f, text in spelt.items()})
    made_text = source.text(code)
    write(tmp_path, {"made.c": made_text})
    write(tmp_path / "none", dict.fromkeys(re.findall("#include <(.*)>", "".join(runtime_files.values())), ""))
    switches = [f"-D{source.name}_{switch}={int(on)}" for switch, on in source.switches.items()]
    switches += [f"-D{guard.replace('PHI_', source.name + '_')}" for guard in source.left_out.values()]
    left_out = calls_left_out(source.switches)
    switches += [f"-D{function.replace('phi_', source.name + '_')}(...)=" for function in left_out]

    def tokens(file):
        lines = run([tool("gcc"), "-E", "-P", "-nostdinc", "-I", "none", *switches, file], tmp_path).split("\n")
        lines = [line for line in lines if not re.fullmatch(r" *((if|for) \(.*\) )?;", line)]  # statements left out
        text = "\n".join(without_unused(lines, f"{source.name}_"))
        return re.findall(r"\w+|[^\w\s{}]", re.sub("^#.*$", "", text, flags=re.MULTILINE))

    preprocessed = tokens("made.c")
    assert preprocessed == tokens(code)
    assert source.switches["COMPOSED"] or not {"stage", f"{source.name}_STAGES"} & set(preprocessed)
    assert source.switches.get("HALO", True) or f"{source.name}_LEAD" not in preprocessed
    assert not source.switches.get("ONE_ROW") or "r < s->rows" not in made_text


USED = """\
/* A table. */
enum { n_SIZE = 2 }; /* of it */
static int n_never(void) { return n_seldom(); }

/* See n_never. */
static int n_seldom(void)
{
    return n_never();
}

/* Called below. */
static int n_called(void)
{
    return 1;
}

/* Two of one subject. */
int n_defined(void);
int n_elsewhere(void);

/* Of which there is none,
   on two lines. */
/* Nor more. */
int n_nowhere(void);

static int n_ahead(void);
int foreign(void);
int n_defined(void) { return n_called() + n_short(); }
static int n_short(void) { return 1; } /* on one line */

/* Behind it. */
static int n_behind(void)
{
    return n_never();
}

/* Called by a macro of two lines. */
static int n_by_macro(void) { return 1; }
#define N_MACRO(name) \\
    int name(void) { return n_by_macro(); }"""


def test_functions_without_use_are_left_out_with_what_is_said_of_them():
    """Names in comments are not calls, and functions that only call one another are unused."""
    assert [line for line in without_unused(USED.split("\n"), "n_") if line] == [
        "/* A table. */",
        "enum { n_SIZE = 2 }; /* of it */",
        "/* Called below. */",
        "static int n_called(void)",
        "{",
        "    return 1;",
        "}",
        "/* Two of one subject. */",
        "int n_defined(void);",
        "int foreign(void);",
        "int n_defined(void) { return n_called() + n_short(); }",
        "static int n_short(void) { return 1; } /* on one line */",
        "/* Called by a macro of two lines. */",
        "static int n_by_macro(void) { return 1; }",
        "#define N_MACRO(name) \\",
        "    int name(void) { return n_by_macro(); }",
    ]


def test_functions_that_statements_may_not_call_are_of_the_runtime():
    text = "".join(file.read_text(encoding="utf-8") for file in RUNTIME.glob("*.[ch]"))
    printed = {"phi_put_parameters", "phi_put_at_bonds"}
    for function in CALLS.keys() - printed:
        assert re.search(rf"^static [^\n]*\b{function}\(", text, re.M), function
        assert re.search(rf"^ +((if|for) \([^\n]*\) )?{function}\([^\n]*\);$", text, re.M), function


def test_every_phrase_is_used_by_the_runtime_or_printed():
    printing = [PACKAGE / "targets/state.py", *RUNTIME.parent.glob("*.jinja"), *(PACKAGE / "targets/c").glob("*.py")]
    files = [*RUNTIME.glob("*.[ch]"), *(f for f in printing if f.name != "phrases.py")]
    text = "".join(file.read_text(encoding="utf-8") for file in files) + phrases.header()
    words, defined = Counter(re.findall(r"\bPHI_\w+", text)), Counter(re.findall(r"#define (PHI_\w+)", text))
    for choice in phrases.ALL:
        for name in choice.phrases:
            word = f"PHI_{name.split('(')[0]}"
            assert words[word] > defined[word], word


def test_phrases_have_a_text_for_each_condition_and_no_name_of_sizes():
    """A phrase with the name of an enumeration constant would replace the constant in its declaration."""
    names = [name.split("(")[0] for choice in phrases.ALL for name in choice.phrases]
    assert len(names) == len(set(names))
    for choice in phrases.ALL:
        assert {len(texts) for texts in choice.phrases.values()} == {len(choice.conditions) + 1}
    for system in ("rigid_body", "heisenberg_plane"):
        source, header, code = runtime_of(with_derivatives(system, "auto"))
        enumerators = re.findall(rf"\b{system}_([A-Z_]+) =", source.text(header) + source.text(code))
        assert not set(names) & set(enumerators)


def test_files_that_are_left_out_exist_with_their_guards():
    for file in CONDITIONS:
        assert f"#define {guard(file)}\n" in (RUNTIME / file).read_text(encoding="utf-8")
